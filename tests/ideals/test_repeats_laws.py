"""Laws from repeats: numbers that are known from simulated frames, and those of two real captures."""

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.formats import load_scan
from lidarcheck.ideals.repeats.amplitude import amplitude_feature, amplitudes_of
from lidarcheck.ideals.repeats.laws import fit_laws, predicted_sd
from lidarcheck.ideals.repeats.laws.spread import pooled_variance, unrounded
from lidarcheck.ideals.repeats.observations import observed
from lidarcheck.ideals.repeats.response import response_of
from lidarcheck.model.files.sensor_file import load_sensor
from lidarcheck.scan import Scan
from lidarcheck.sensor.document import stated_numbers
from lidarcheck.sensor.laws import EchoNumbers, value
from places import shared_path
from repeats_kit import TRUE, counting, frames, room, shipped


def laws_of(scans, sensor, stated):
    feature = amplitude_feature(sensor, scans)
    seen = observed(scans, sensor, feature)
    return fit_laws(seen, sensor, feature, stated, np.ones(len(scans), dtype=np.bool_))


@pytest.fixture(scope="module")
def counted():
    sensor = counting(**TRUE)
    return frames(sensor, room(sensor), 8)


def test_what_the_file_leaves_open_is_found(counted):
    laws = laws_of(counted, counting(), frozenset({"signal_at_1m", "near_m"}))
    assert set(laws.fitted) == set(TRUE)
    assert not laws.coarse
    for name, share in {
        "noise": 0.15, "excess": 0.05, "relative": 0.1, "threshold": 0.05, "range_floor_m": 0.12, "edge_factor": 0.03
    }.items():  # fmt: skip
        found = laws.fitted[name]
        assert found.value == pytest.approx(TRUE[name], rel=share), name
        assert found.low <= found.value <= found.high
    response = response_of(laws.sensor, laws.sensor.features[0])
    law, _ = predicted_sd(response, laws.bins)
    seen = np.array([one.range_sd_m for one in laws.bins])
    np.testing.assert_allclose(seen, law, rtol=0.12)


def test_known_numbers_stay(counted):
    stated = frozenset({"signal_at_1m", "near_m", "noise", "excess", "relative", "threshold", "range_floor_m"})
    sensor = counting(**{**TRUE, "noise": 7.0, "edge_factor": 1.0})
    laws = laws_of(counted, sensor, stated)
    assert set(laws.fitted) == {"edge_factor"}
    assert laws.sensor.noise == 7.0


@pytest.mark.parametrize("name", ["XT32", "VLP-16", "OS1-128", "SLIM"])
def test_values_are_turned_back_into_amplitudes(name):
    sensor = shipped(name)
    law = "area_counts" if name == "SLIM" else "calibrated_reflectivity"
    feature = next(one for one in sensor.features if one.law == law)
    path = np.array([2.0, 10.0, 40.0])
    if name == "SLIM":
        found = amplitudes_of(feature, np.array([12.0, 100.0, 900.0]), path, sensor)
        np.testing.assert_array_equal(found.value, [12.0, 100.0, 900.0])
        return
    amplitude = sensor.signal_at_1m * np.array([0.3, 0.8, 1.5]) / (path**2 + sensor.near_m**2)
    said = value(feature, EchoNumbers(amplitude, path), sensor)
    found = amplitudes_of(feature, said, path, sensor)
    assert ((found.low <= amplitude) & (amplitude <= found.high)).all()


@pytest.mark.parametrize("sigma", [0.1, 0.25, 0.5, 2.0])
def test_rounding_is_taken_off_a_variance(sigma):
    rng = np.random.default_rng(3)
    rounded = np.rint(rng.random((40_000, 1)) + sigma * rng.standard_normal((40_000, 3)))
    seen = rounded.var(axis=1, ddof=1).mean()
    assert np.sqrt(unrounded(seen, 1.0)) == pytest.approx(sigma, rel=0.03)


def test_a_tenth_of_outliers_does_not_rule_a_pooled_variance():
    rng = np.random.default_rng(4)
    sigma = np.where(rng.random(5000) < 0.1, 30.0, 1.0)[:, None]
    variance = (sigma * rng.standard_normal((5000, 4))).var(axis=1, ddof=1)
    found, kept = pooled_variance(variance, np.full(5000, 3))
    assert found == pytest.approx(1.0, abs=0.12)
    assert kept.sum() > 4300


def test_rays_of_one_amplitude_that_scatter_more_than_others_count():
    rng = np.random.default_rng(5)
    sigma = np.where(rng.random(20_000) < 0.15, 1.8, 1.0)[:, None]
    variance = (sigma * rng.standard_normal((20_000, 4))).var(axis=1, ddof=1)
    found, _ = pooled_variance(variance, np.full(20_000, 3))
    assert found == pytest.approx(np.mean(sigma**2), rel=0.06)


def test_a_real_ouster_scatters_as_photons_do(tmp_path):
    # The angles are another unit's, so ranges are taken by beam: what lies beside what is the same.
    file = tmp_path / "os0.toml"
    assert (
        main(["sensor", "from", str(shared_path("data/calibrations/ouster_os0_128_fw301.json")), "--out", str(file)])
        == 0
    )
    sensor = load_sensor(file)
    scans = []
    for k in (0, 1):
        scan = load_scan(shared_path(f"data/ouster_os0_128/scan_{k}.parquet"))
        columns = {name: np.asarray(scan.extra[name], dtype=float) for name in ("RANGE", "SIGNAL")}
        scans.append(
            Scan.from_beams(
                scan.layer, scan.point, columns["RANGE"], features={"SIGNAL": columns["SIGNAL"]}, beams=sensor.beams
            )
        )
    laws = laws_of(scans, sensor, stated_numbers(sensor))
    signal = np.array([one.amplitude for one in laws.bins])
    seen = np.array([one.range_sd_m for one in laws.bins])
    rays = np.array([one.rays for one in laws.bins])
    # 175 mm/sqrt(SIGNAL), no floor, slope -0.57: as the pairs of the two scans have it by another way.
    law, _ = predicted_sd(response_of(laws.sensor, sensor.feature("SIGNAL")), laws.bins)
    assert not laws.coarse
    assert np.exp(np.average(np.log(law * np.sqrt(signal)), weights=rays)) == pytest.approx(0.175, rel=0.1)
    assert np.exp(np.average(np.log(seen * np.sqrt(signal)), weights=rays)) == pytest.approx(0.175, rel=0.15)
    assert np.polyfit(np.log(signal), np.log(seen), 1, w=np.sqrt(rays))[0] == pytest.approx(-0.57, abs=0.05)
    assert laws.fitted["range_floor_m"].value < 0.001


def test_a_real_hesai_scatters_by_its_reflectivity(tmp_path):
    file = tmp_path / "xt32.toml"
    calibration = shared_path("data/calibrations/hesai_PandarXT32.csv")
    wanted = ["sensor", "from", str(calibration), "--rate", "10", "--azimuth-step", "0.18", "--out", str(file)]
    assert main(wanted) == 0
    text = file.read_text().replace("# returns = 2", "returns = 2").replace('# keep = "', 'keep = "')
    file.write_text(
        text.replace("# step_m", "step_m").replace("# min_m = 0.5", "min_m = 0.05").replace("# max_m", "max_m")
    )
    sensor = load_sensor(file)
    scans = [load_scan(shared_path(f"data/hesai_xt32/rotation_{k}.parquet"), sensor=sensor) for k in range(4)]
    laws = laws_of(scans, sensor, stated_numbers(sensor))
    assert laws.coarse
    assert laws.sensor.range_law == "power"
    assert laws.fitted["near_m"].value > 10.0  # indoors the scatter goes with the value, not with the range
    unit = laws.sensor.signal_at_1m / 100.0 / laws.sensor.near_m**2
    reflectivity = np.array([one.amplitude for one in laws.bins]) / unit
    seen = np.array([one.range_sd_m for one in laws.bins])
    law, _ = predicted_sd(response_of(laws.sensor, sensor.features[0]), laws.bins)
    hits, rays = (np.array([getattr(one, name) for one in laws.bins]) for name in ("hit_share", "rays"))
    for (low, high), sigma_m in {(0, 0.5): 0.0109, (0.9, 2.2): 0.0060, (5.5, 11.5): 0.0037, (50, 89): 0.0028}.items():
        rows = (reflectivity >= low) & (reflectivity <= high)
        assert rows.any()
        # What was read off the pairs has the rounding to 4 mm in it, and rays beside edges.
        for found, share in ((seen, 0.10), (law, 0.11)):
            rounded = np.hypot(found[rows], 0.004 / np.sqrt(12.0))
            assert np.average(rounded, weights=rays[rows]) == pytest.approx(sigma_m, rel=share)
    assert (hits[reflectivity > 0.9] >= 0.995).all()
