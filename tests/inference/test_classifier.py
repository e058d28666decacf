"""A classifier that is shown measured and simulated echoes: what it can tell apart, what it must not, and its floor."""

import dataclasses

import numpy as np
import pytest

from explain_core_kit import at_ranges, frames, model
from lidarcheck.effects import Effect, make
from lidarcheck.inference.classifier import COLUMNS, Chance, Classifier, classifier_gaps
from lidarcheck.inference.observed.beam_table import beams_of, key_of
from lidarcheck.inference.observed.observations import observations_of
from lidarcheck.inference.observed.summaries import expectation
from lidarcheck.inference.usual_ranges import farther_by_height_m, usual_range_errors_m
from lidarcheck.scan import IdealScan

FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 8)}
CHANCE = 0.08
"""More than 2.6 standard deviations of the figure on two frames of so many beams."""


def asked(measured, **how) -> Classifier:
    return Classifier.of(measured, model(), 3, **how)


def test_the_sensor_itself_is_not_told_from_its_model() -> None:
    assert abs(asked(frames(model(), 2, **FINE)).gap(model())) < CHANCE


@pytest.mark.parametrize(
    "effect",
    [
        make("range_offset", {"offset_m": 0.1}),
        make("signal_gain", {"gain": 0.7}),
        make("dropout", {"share": 0.2}),
        make("dark_counts", {"rate_per_ns": 2e-3}),
    ],
    ids=lambda effect: effect.name,
)
def test_a_missing_effect_is_seen_until_the_model_has_it(effect: Effect) -> None:
    classifier = asked(frames(model(effect), 2, **FINE))
    chance = Chance(model(effect), CHANCE / 2.6 * np.sqrt(classifier.drawn.sum()))
    found = classifier_gaps(classifier, model(), model(effect), chance)
    assert found.before > found.floor == pytest.approx(CHANCE)
    assert not found.tells
    assert dataclasses.replace(found, after=found.before).tells


def test_digits_of_a_file_are_no_artefact_and_decimetres_are() -> None:
    """Ranges that come from X, Y and Z of six decimals are not those of a model by less than a micrometre."""
    measured = frames(model(), 2, **FINE)
    rng = np.random.default_rng(1)

    def changed(how):
        return [dataclasses.replace(f, measured=at_ranges(f.measured, how(f.measured.range_m))) for f in measured]

    written = changed(lambda r: r + rng.uniform(-5e-7, 5e-7, len(r)))
    plain, digits = (asked(one).gap(model()) for one in (measured, written))
    assert abs(digits - plain) < 0.5 * CHANCE
    assert asked(changed(lambda r: np.round(r, 1))).gap(model()) > CHANCE


def test_a_row_for_each_echo_and_each_beam_without_one() -> None:
    [frame] = frames(model(make("range_offset", {"offset_m": 0.1})), 1, sign=True, **FINE)
    classifier, scan = asked([frame]), frame.measured
    beams = classifier.beams
    table, of_beam = classifier.rows([scan], 0.01, [0, 0])
    rows = dict(zip(COLUMNS, table.T, strict=True))
    lost = np.isnan(rows["range_off_m"])
    assert (~lost).sum() == len(scan)
    assert lost.sum() == len(beams) - len({*zip(scan.layer, scan.point, strict=True)})
    np.testing.assert_array_equal(
        of_beam[~lost], np.searchsorted(beams.key, key_of(0 * scan.layer, scan.layer, scan.point))
    )
    off = scan.range_m - beams.distance_m[of_beam[~lost]]
    np.testing.assert_allclose(rows["range_off_m"][~lost], off, atol=0.0051)
    np.testing.assert_array_equal(rows["layer"][~lost], scan.layer)
    np.testing.assert_allclose(np.exp(rows["log_area"][~lost]), scan.area)
    beside = beams_of([frame.ideal], model()).signal.reshape(30, 40)
    place = np.ravel_multi_index((15, 30), (30, 40))
    near = max(beside[14, 30], beside[16, 30], beside[15, 29], beside[15, 31])
    assert rows["log_strength_beside"][of_beam == place][0] == pytest.approx(np.log1p(near))


def test_beams_are_drawn_by_whole_columns_and_those_at_marked_edges_are_left_out() -> None:
    measured = frames(model(), 2, **FINE)
    some = asked(measured, most=500)
    assert 440 <= some.drawn.sum() <= 500
    column = some.beams.column
    assert all(len({*some.drawn[column == c]}) == 1 for c in np.unique(column))
    marked = [dataclasses.replace(f, ideal=with_edge(f.ideal, f.ideal.layer == 250)) for f in measured]
    assert (asked(marked).drawn == (asked(marked).beams.layer != 250)).all()


def with_edge(ideal: IdealScan, rows: np.ndarray) -> IdealScan:
    return dataclasses.replace(ideal, extra={**ideal.extra, "Edge": rows.astype(float)})


def test_too_few_blocks_of_beams_have_no_figure() -> None:
    classifier = asked(frames(model(), 2))
    assert classifier.gap(model()) is None
    found = classifier_gaps(classifier, model(), model())
    assert found.to_dict() == {"before": None, "after": None, "floor": None}
    assert not found.tells


def test_ranges_that_usual_errors_make_longer_are_put_right_and_no_others() -> None:
    dense = {**FINE, "layers": range(230, 290)}
    beams = beams_of([f.ideal for f in frames(model(), 2, **dense)], model())
    shown = [observations_of(beams, [f.measured for f in frames(model(), 2, seed=s, **dense)]) for s in range(6)]
    spread = expectation(beams, shown).spread[:, 0]
    higher_m = 1.5 * farther_by_height_m(beams)
    one = dataclasses.replace(shown[0], feature=shown[0].feature + np.pad(higher_m[:, None], ((0, 0), (0, 3))))
    found = usual_range_errors_m(beams, spread, one, shown[1])
    sloped = np.abs(higher_m) > 0.01
    assert sloped.sum() > 50
    assert np.abs(found - higher_m)[sloped].mean() < 0.4 * np.abs(higher_m)[sloped].mean()
    off = dataclasses.replace(shown[0], feature=shown[0].feature + np.array([0.1, 0.0, 0.0, 0.0]))
    assert np.abs(usual_range_errors_m(beams, spread, off, shown[1])).mean() < 0.03


@pytest.mark.parametrize(("further", "most"), [(8, 1), pytest.param(100, 8, marks=pytest.mark.long)])
def test_few_further_pairs_of_seeds_lie_above_the_floor(further: int, most: int) -> None:
    """At 1 % each, and a floor of 20 pairs that is itself known to a sixth."""
    classifier = asked(frames(model(), 2, sign=True, **FINE))
    floor = classifier.floor(classifier.chance(model()))
    found = [classifier.pair(model(), 20 + k) for k in range(further)]
    assert sum(one > floor for one in found) <= most
    assert floor < 5.0 * np.std(found)
