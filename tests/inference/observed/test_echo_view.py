"""What is looked at of the echoes of sensors that are not the reference: names, steps, lengths."""

import numpy as np
import pytest

from lidarcheck.cases.frame import Frame
from lidarcheck.effects.finding import catalogue, find
from lidarcheck.explain.report.wording import depends_on, place_words
from lidarcheck.explain.steps import Workflow
from lidarcheck.figures.gap.measure import pictures_of
from lidarcheck.inference.observed.beam_table import beams_of
from lidarcheck.inference.observed.echo_view import EchoView
from lidarcheck.inference.observed.strata import divisions
from lidarcheck.inference.observed.summary import Summary
from lidarcheck.model import simulate
from lidarcheck.model.spec import Material, Model
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Sensor
from lidarcheck.workers import WorkerPool

MATERIALS = {1: Material("board", 0.5)}


def chip() -> tuple[Model, IdealScan]:
    model = Model(Sensor.of("TMF8820-short"), MATERIALS)
    layer, point = model.sensor.beams.every()
    distance = np.linspace(0.3, 1.5, len(layer))
    return model, IdealScan(
        layer, point, distance, np.ones(len(layer), np.int64), np.zeros(len(layer)), beams=model.sensor.beams
    )


def test_a_chip_of_short_range_has_bins_of_range_and_edges_of_its_own() -> None:
    model, ideal = chip()
    beams = beams_of([ideal], model)
    assert beams.view.length_scale < 0.2
    found = {one.covariate: one for one in divisions(beams, np.full(len(beams), np.nan), {})}
    assert len(found["range"].names) >= 3
    assert beams.apart_m(np.array([0.5])) == pytest.approx(beams.view.length_scale)


@pytest.mark.parametrize("name", ["SLIM", "SMART", "XT32", "OS1-128"])
def test_lengths_are_those_of_a_pulse_of_5_ns_where_it_is_no_shorter(name: str) -> None:
    assert EchoView.of(Sensor.of(name)).length_scale == 1.0


def test_words_are_the_sensors_own() -> None:
    own, reference = (EchoView.of(Sensor.of(name)) for name in ("XT32", "SLIM"))
    one = Summary("area", "range", "20-30 m")
    assert place_words(one, -12.3, own) == "echoes are weaker (INTENSITY) at range 20-30 m (-12.3 sd)"
    assert place_words(one, -12.3, reference) == "echoes are weaker (AREA) at range 20-30 m (-12.3 sd)"
    assert depends_on([one], np.array([9.0]), own) == "INTENSITY depends on range"


def test_pages_show_the_sensors_features_alone() -> None:
    model, ideal = chip()
    frame = Frame(0, ideal, simulate(ideal, model, seed=1), 0.0)
    found = pictures_of([frame], model, model, seed=1)
    assert [one.words for one in found.histograms][1:-1] == [slot.name for slot in EchoView.of(model.sensor).slots]
    assert {one.feature for one in found.curves} == {"range", "area", "peak", "width"}
    assert np.diff(found.histograms[0].edges).min() == pytest.approx(0.001, rel=1.0)


def test_what_means_nothing_for_a_sensor_is_not_searched_and_not_testable_with_the_reason() -> None:
    model, _ = chip()
    run = Workflow(model, 0, (), WorkerPool(), lambda *_: None)
    nothing = {name for name in catalogue() if find(name).why_not(model.sensor)}
    assert {"crosstalk", "dropout"} & nothing
    assert not nothing & set(run.searched())


def test_histograms_tell_counts_background_and_pulse() -> None:
    model, ideal = chip()
    view = EchoView.of(model.sensor)
    assert [slot.name for slot in view.slots] == [f"{part} of HISTOGRAM" for part in ("counts", "background", "pulse")]

    def means(**changes: float) -> np.ndarray:
        shown = Model(Sensor.of("TMF8820-short", **changes), MATERIALS)
        scans = [simulate(ideal, shown, seed=k) for k in range(4)]
        return np.array([column.mean() for column in view.columns(scans)])

    plain = means()
    brighter, noisier, longer = (
        means(signal_at_1m=2.6e-4), means(background_per_ns=4e-6), means(pulse_fwhm_ns=0.9)
    )  # fmt: skip
    assert brighter[0] - plain[0] == pytest.approx(np.log(2.0), abs=0.03)
    assert noisier[1] - plain[1] == pytest.approx(np.log(2.0), abs=0.2)
    assert longer[2] / plain[2] > 1.15


def test_a_sensor_that_reports_its_background_is_looked_at_for_it() -> None:
    assert [slot.name for slot in EchoView.of(Sensor.of("OS1-128")).slots] == ["REFLECTIVITY", "AMBIENT", ""]
