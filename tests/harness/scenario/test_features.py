"""Scenarios of sensors that report other features than a SPAD array's, or further columns of an ideal scan."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.beams import BeamHistograms
from lidarcheck.errors import ConfigError
from lidarcheck.formats import save_ideal
from lidarcheck.harness.kpis.features import FEATURE_KINDS
from lidarcheck.harness.kpis.fired import FiredBeams
from lidarcheck.harness.kpis.selection import KpiSelection, SelectedEchoes
from lidarcheck.harness.scenario.measure import measure
from lidarcheck.harness.scenario.scenario import Scenario, load_scenario
from lidarcheck.kpi.pairing import beam_keys, pair_with_ideal
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor, shipped

HEAD = """description = "a wall"
[model]
variant = "XT32"
[model.materials.1]
reflectance = 0.5
[[beams]]
shape = "surface"
layers = [4, 11]
points = [100, 139]
material = 1
range_m = [20.0, 20.0]
"""


def kpis(*kinds: str, feature: str = "INTENSITY") -> str:
    asked = f'feature = "{feature}"\n' if feature else ""
    return "".join(f'[[kpis]]\nkpi = "{kind}"\n{asked}tolerance = 1.0\n' for kind in kinds)


def load(folder: Path, text: str) -> Scenario:
    (folder / "one.toml").write_text(text, encoding="utf-8")
    return load_scenario(folder / "one.toml")


def test_a_feature_is_asked_for_by_its_name_and_has_its_own_unit(tmp_path: Path) -> None:
    scenario = load(
        tmp_path, HEAD + kpis("feature_mean", "feature_spread", "feature_distance", "feature_percentile_50")
    )
    names = [kpi.name for kpi in scenario.kpis]
    assert names == [f"feature_{kind}.INTENSITY" for kind in ("mean", "spread", "distance", "percentile_50")]
    assert {kpi.unit for kpi in scenario.kpis} == {scenario.model.sensor.feature("INTENSITY").unit}
    seen = measure(scenario, scenario.model, 1)
    assert seen.values["feature_mean.INTENSITY"] == pytest.approx(50.0, abs=1.0)  # percent, one count each
    assert seen.values["feature_percentile_50.INTENSITY"] == pytest.approx(50.0, abs=1.0)
    assert 0.0 < seen.values["feature_spread.INTENSITY"] < 20.0
    assert len(seen.samples["feature_distance.INTENSITY"]) > 300
    assert measure(scenario, scenario.model.with_sensor(signal_at_1m=600_000.0), 1).digest != seen.digest


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (kpis("area_mean", feature=""), "area_mean is of AREA, which PandarXT-32 does not report"),
        (kpis("feature_mean", feature="AREA"), "reports no AREA"),
        (kpis("feature_mean", feature=""), 'add feature = "NAME"'),
        (kpis("detection_probability"), "remove feature"),
    ],
)
def test_a_feature_that_there_is_none_of_is_refused_with_its_line(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, HEAD + text)
    (fault,) = caught.value.faults
    assert fault.line == 12
    assert says in f"{fault.what} {fault.fix}"


def test_a_standard_feature_may_be_asked_for_by_its_name_too(tmp_path: Path) -> None:
    both = kpis("area_mean", feature="") + kpis("feature_mean", feature="AREA")
    scenario = load(tmp_path, HEAD.replace("XT32", "SMART") + both)
    seen = measure(scenario, scenario.model, 3).values
    assert seen["area_mean"] == seen["feature_mean.AREA"] > 0.0


def test_the_hash_covers_every_column_that_the_ideal_scan_has(tmp_path: Path) -> None:
    def hashed(**more: float) -> str:
        table = (np.full(3, 9), np.arange(100, 103), np.full(3, 10.0), np.ones(3), np.zeros(3))
        extra = {name: np.full(3, value) for name, value in more.items()}
        save_ideal(IdealScan(*table, extra=extra), tmp_path / "ideal.parquet")
        head = HEAD.split("[[beams]]")[0].replace("XT32", "SMART")
        return load(tmp_path, 'ideal = "ideal.parquet"\n' + head + kpis("area_mean", feature="")).content_hash

    assert len({hashed(), hashed(Reflectance=0.3), hashed(Reflectance=0.4), hashed(Edge=0.0)}) == 4
    assert hashed(Reflectance=0.3) == hashed(Reflectance=0.3)


def test_a_histogram_is_one_feature() -> None:
    sensor = shipped("TMF8820")
    rng, frames = np.random.default_rng(0), 40
    layer, point = sensor.beams.every()
    n = len(layer)
    ideal = IdealScan(layer, point, np.full(n, 1.0), np.ones(n), np.zeros(n), beams=sensor.beams)
    mean = 20.0 + 5.0 * np.arange(12)
    parts = []
    for frame in range(frames):
        counts = rng.poisson(mean, (n, 12)).astype(float)
        scan = Scan.from_beams(layer[:5], point[:5], np.full(5, 1.0), beams=sensor.beams)  # the others see nothing
        scan = replace(scan, histograms=BeamHistograms(layer, point, counts))
        parts.append(SelectedEchoes.of(scan, pair_with_ideal(ideal, scan, sensor), frame, sensor))
    rows = np.ones(n, dtype=bool)
    seen = KpiSelection(FiredBeams.of(ideal), rows, 0.1, feature="HISTOGRAM", sensor=sensor).seen(
        SelectedEchoes.joined(parts), frames
    )
    assert FEATURE_KINDS["feature_mean"].value(seen) == pytest.approx(mean.mean(), rel=0.01)
    assert FEATURE_KINDS["feature_spread"].value(seen) == pytest.approx(1.0, abs=0.04)
    places = FEATURE_KINDS["feature_distance"].sample(seen)
    assert places.mean() == pytest.approx(float(((np.arange(12) + 0.5) * mean).sum() / mean.sum()), rel=0.01)


def test_neighbours_are_those_of_an_image_of_the_beams() -> None:
    sensor: Sensor = shipped("OS1-128")
    layer, point = (grid.ravel() for grid in np.meshgrid([40, 41], [0, 1, 8, 15, 16, 1023], indexing="ij"))
    n = len(layer)
    fired = FiredBeams.of(IdealScan(layer, point, np.full(n, 9.0), np.ones(n), np.zeros(n), beams=sensor.beams))
    at = {key: i for i, key in enumerate(beam_keys(fired.layer, fired.point).tolist())}
    shift = [sensor.beams.image_column(layer, 0) for layer in (40, 41)]
    around = fired.around[at[(40 << 32) + 0]].tolist()
    below = (int(shift[0]) - int(shift[1])) % 1024  # the column of the lower layer that stands beneath column 0
    assert around[4] == at[(40 << 32) + 0]
    assert around[5] == at[(40 << 32) + 1]
    assert around[3] == at[(40 << 32) + 1023]  # once around
    assert around[1] == at.get((41 << 32) + below, -1)  # layers count from above
    assert around[7] == -1
