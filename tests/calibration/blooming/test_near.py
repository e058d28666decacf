"""A target at 20 m, so bright that its detectors may fire twice: where in a bin it stands decides what is seen."""

import numpy as np
import pytest

from lidarcheck.calibration.blooming.fit import FreeLight
from lidarcheck.calibration.blooming.response import bin_length_m, response_of, strongest_echoes
from lidarcheck.calibration.blooming.workflow import BloomingMeasurement, calibrate, gather, model_side_of
from lidarcheck.effects.finding import make
from lidarcheck.formats import save_ideal, save_scan
from lidarcheck.formats.lut import parse_lut
from lidarcheck.model import Model, simulate
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Material, Sensor

X = (0, 2.5, 5, 7.5, 10, 15, 20, 30, 40, 60, 80, 100)
GIVEN = f"PostPro.LUT_bloomingH_X = {','.join(map(str, X))}\nPostPro.LUT_bloomingH_Y = 1{',0.00005' * (len(X) - 1)}\n"
TRUE = {x: 1e-4 * np.exp(-x / 2.5) + 1.5e-6 * np.exp(-((x / 30.0) ** 2)) for x in X}
"""The effect's own profile."""


def model_of(variant, *effects):
    sign = Material("sign", 0.5, "retro", 1000.0)
    return Model(Sensor.of(variant), {1: Material("wall", 0.1), 2: sign}, effects=effects)


def sign_at(distance_m, layers=range(240, 280), points=range(400, 560)):
    """A sign of 0.9 m, and nothing else."""
    layer, point = (a.ravel().astype(np.int32) for a in np.meshgrid(np.array(layers), np.array(points), indexing="ij"))
    azimuth, elevation = np.deg2rad((point - 479.5) * 0.125), np.deg2rad((layer - 259.5) * 0.05)
    y, z = distance_m * np.tan(azimuth), distance_m * np.tan(elevation) / np.cos(azimuth)
    on = (abs(y) < 0.45) & (abs(z) < 0.45)
    path = distance_m / np.cos(azimuth) / np.cos(elevation)
    return IdealScan(layer, point, np.where(on, path, 0.0), np.where(on, 2, 1), np.zeros(len(layer)))


@pytest.mark.parametrize(("variant", "distance_m"), [("SLIM", 20.05), ("SLIM", 20.1), ("SMART", 20.1)])
def test_the_response_is_that_of_the_detectors_one_by_one(variant, distance_m):
    """Against the slow reference: within 3 %, where the mean over all places of a bin is off by up to a quarter."""
    n = 60
    layer, point = np.full(n, 260, dtype=np.int32), np.arange(n, dtype=np.int32)
    ideal = IdealScan(layer, point, np.full(n, distance_m), np.full(n, 2), np.zeros(n))
    model = model_of(variant)
    scan = simulate(ideal, model, seed=4, fidelity="reference")
    area = strongest_echoes(scan.take(abs(scan.range_m - distance_m) < 1.5)).area
    z = np.log10([model.sensor.signal_at_1m * 500.0 / distance_m**2])
    place = distance_m / bin_length_m(model.sensor) % 1.0
    expected = response_of(model.sensor, within=(place,)).features(z)[0][0, 1]
    assert expected == pytest.approx(area.mean(), abs=3.0 * area.std() / np.sqrt(n) + 0.03 * area.mean())
    everywhere = response_of(model.sensor).features(z)[0][0, 1]
    assert abs(everywhere / area.mean() - 1.0) > (0.15 if variant == "SLIM" else 0.04)


@pytest.mark.parametrize(
    ("variant", "distance_m"),
    [
        *(("SMART", 19.95), ("SMART", 20.05), ("SLIM", 20.0), ("SLIM", 20.1)),
        *(pytest.param(*other, marks=pytest.mark.long) for other in (("SMART", 20.0), ("SMART", 20.1))),
        *(pytest.param(*other, marks=pytest.mark.long) for other in (("SLIM", 19.95), ("SLIM", 20.05))),
    ],
)
def test_a_horizontal_table_is_found_at_20_m(variant, distance_m, tmp_path):
    """With the ideal scan and without it; a fit that starts far off, and a target whose beams fire once or twice."""
    model = model_of(variant, make("blooming_horizontal", {}))
    ideal = sign_at(distance_m)
    save_ideal(ideal, tmp_path / "ideal.parquet")
    save_scan(simulate(ideal, model, seed=3), tmp_path / "scan.parquet")
    bench, lut = model_side_of(model, "horizontal"), parse_lut(GIVEN.encode())
    for known in (tmp_path / "ideal.parquet", None):
        cells = gather([BloomingMeasurement(tmp_path / "scan.parquet", None, known)], bench)
        # 20 beams, each of them one source, though some show two echoes.
        assert {len(source.offset) for source in cells[0].sources} <= ({20, 21} if known else {20, 21, 22})
        result = calibrate(cells, bench, lut)
        assert result.fit.misfit < 1.5
        rows = {row.x: row for row in result.rows}
        for x in (2.5, 5, 7.5):
            assert rows[x].status in ("fitted", "smooth")
            assert abs(np.log10(rows[x].y / TRUE[x])) < (0.06 if known else 0.3)


def test_the_targets_own_echoes_tell_its_brightness(tmp_path):
    """At 19.95 m SMART's AREA still rises with the light; the mean over a bin would say 0.44."""
    model = model_of("SMART", make("blooming_horizontal", {}))
    ideal = sign_at(19.95)
    save_ideal(ideal, tmp_path / "ideal.parquet")
    save_scan(simulate(ideal, model, seed=3), tmp_path / "scan.parquet")
    bench = model_side_of(model, "horizontal")
    cells = gather([BloomingMeasurement(tmp_path / "scan.parquet", None, tmp_path / "ideal.parquet")], bench)
    result = calibrate(cells, bench, parse_lut(GIVEN.encode()), free=FreeLight(brightness=True))
    assert result.fit.brightness == pytest.approx(1.0, abs=0.1)
    (brightness,) = result.fit.parameters
    # The interval holds 1 in 95 of 100 scans; in 3 of 1000 it is off by half of its half-width more.
    spare = 0.25 * (brightness.high - brightness.low)
    assert brightness.high - brightness.low < 0.15
    assert brightness.low - spare < 1.0 < brightness.high + spare
