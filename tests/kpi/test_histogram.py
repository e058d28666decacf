"""Histograms against closed forms; echoes of a zone against what its rows send back together."""

from dataclasses import replace

import numpy as np
import pytest

from lidarcheck.beams import BeamHistograms
from lidarcheck.errors import UsageError
from lidarcheck.kpi.compare import compare
from lidarcheck.kpi.distances import wasserstein
from lidarcheck.kpi.histogram import (
    bin_residuals,
    earth_movers_distance,
    histogram_gap,
    histogram_quantiles,
)
from lidarcheck.kpi.pairing import pair_with_ideal
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Material, Sensor, sensor_of

BINS = 24
CHIP: Sensor = sensor_of(
    {
        "name": "chip",
        "detector": "photon_histogram",
        "frame_rate_hz": 15,
        "returns": 2,
        "keep": "strongest_second",
        "sweep": {"order": "flash"},
        "range": {"min_m": 0.01, "max_m": 4.0, "step_m": 0.001},
        "photon_histogram": {
            "spads": 9, "shots": 1000, "bins": BINS, "bin_ns": 0.5, "pulse_fwhm_ns": 1.0, "signal_at_1m": 1e-3,
        },
        "features": {"BINS": {"law": "histogram"}},
        "beams": {
            "kind": "grid",
            "layers": 3,
            "points": 3,
            "elevation_deg": {"first": -9.0, "step": 9.0},
            "azimuth_deg": {"first": -9.0, "step": 9.0},
        },
    }
)  # fmt: skip


def scan_of(counts: np.ndarray, range_m: float = 1.0) -> Scan:
    layer, point = CHIP.beams.every()
    number = np.ones(len(layer), dtype=np.int32)
    scan = Scan.from_beams(layer, point, np.full(9, range_m), echo_number=number, beams=CHIP.beams)
    return replace(scan, histograms=BeamHistograms(layer, point, counts))


def test_counts_of_one_mean_are_a_standard_normal_apart() -> None:
    rng = np.random.default_rng(0)
    m, s = (rng.poisson(400.0, (9, 400)) for _ in range(2))
    assert np.std(bin_residuals(m, s)) == pytest.approx(1.0, abs=0.05)
    assert bin_residuals([0.0, 9.0], [0.0, 16.0]).tolist() == [0.0, -1.4]
    with pytest.raises(UsageError, match="of shapes"):
        bin_residuals(np.zeros(3), np.zeros(4))


def test_what_must_be_moved_how_far() -> None:
    h = np.array([[0.0, 4.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 0.0]])
    moved = np.array([[0.0, 0.0, 0.0, 8.0], [1.0, 1.0, 1.0, 1.0], [1.0, 0.0, 0.0, 0.0]])
    assert earth_movers_distance(h, moved).tolist()[:2] == [2.0, 0.0]
    assert np.isnan(earth_movers_distance(h, moved)[2])


def test_evenly_cut_places_are_as_far_apart_as_the_histograms() -> None:
    rng = np.random.default_rng(1)
    one, other = rng.poisson(50.0, 30), rng.poisson(np.linspace(20.0, 90.0, 30))
    apart = wasserstein(histogram_quantiles(one, 4096), histogram_quantiles(other, 4096))
    assert apart == pytest.approx(earth_movers_distance(one, other), rel=0.02)
    assert not histogram_quantiles(np.zeros(5)).size


def test_histograms_of_two_scans_are_compared_as_one_feature() -> None:
    rng = np.random.default_rng(2)
    mean = 50.0 + 300.0 * np.exp(-0.5 * (np.arange(BINS) - 8.0) ** 2 / 2.0)
    m, s, later = (scan_of(rng.poisson(np.roll(mean, by), (9, BINS)).astype(float)) for by in (0, 0, 1))
    columns = {f"H{k}": m.histograms.counts[:, k] for k in range(BINS)}
    assert histogram_gap(replace(m, histograms=None, extra=columns), s) == histogram_gap(m, s)  # read without a sensor
    same, moved = histogram_gap(m, s), histogram_gap(later, s)
    assert (same.zones, same.bins) == (9, BINS)
    assert same.residual == pytest.approx(1.0, abs=0.15)
    assert moved.residual > 2.0
    assert moved.distance_bins == pytest.approx(float(earth_movers_distance(mean, np.roll(mean, 1))), rel=0.2)
    found = compare(later, s, sensor=CHIP)
    assert list(found.features) == []  # bins are no features of their own
    values = {row.kpi: row.value for row in found.rows()}
    assert values["histogram_residual"] == moved.residual
    assert found.to_dict()["histogram"]["zones"] == 9
    assert histogram_gap(m, scan_of(np.ones((9, 3)))) is None


def test_an_echo_of_a_zone_is_held_against_the_mean_of_what_sends_it() -> None:
    # Nearer 0.9 m of reflectance 0.5, farther 1.0 m of 0.1, and a wall far behind that is not in the echo.
    zeros = np.zeros(3, dtype=np.int32)
    near_m, far_m = 0.9, 1.0
    ideal = IdealScan(zeros, zeros, np.array([near_m, far_m, 3.0]), np.array([1, 2, 1]), np.zeros(3), beams=CHIP.beams)
    model = Model(CHIP, {1: Material("white", 0.5), 2: Material("grey", 0.1)})
    scan = Scan.from_beams(zeros[:1], zeros[:1], np.array([0.93]), beams=CHIP.beams)
    weight = np.array([0.5 / near_m**2, 0.1 / far_m**2])
    expected = 0.93 - float(weight @ [near_m, far_m] / weight.sum())
    assert pair_with_ideal(ideal, scan, model=model).residual_m[0] == pytest.approx(expected, abs=1e-4)
    equal = np.array([1 / near_m**2, 1 / far_m**2])
    assert pair_with_ideal(ideal, scan, CHIP).residual_m[0] == pytest.approx(
        0.93 - float(equal @ [near_m, far_m] / equal.sum()), abs=1e-4
    )
    assert pair_with_ideal(ideal, scan).residual_m[0] == pytest.approx(0.03, abs=1e-4)  # of others, the nearest row
