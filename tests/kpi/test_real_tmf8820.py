"""A real SPAD sensor facing a plane: its late background follows from the early one and the first-photon dead time.

The sensor counts one photon a laser cycle at most, so the background behind a strong return is lower than before it.
Early are bins 0 ... 7, before anything returns; late are bins 108 ... 127, 6 ns and more behind the farthest return's
peak. Usable is a histogram of a distance from 30 mm on (nearer there are near-field effects) with at least 150 counts
expected late, so that the errors are Gaussian. The choice of windows does not matter, as the tests show.
"""

import json

import numpy as np
import pytest

from lidarcheck.kpi.deadtime import expected_counts, late_background
from places import shared_path

CYCLES = 4000 * 1024
EARLY, LATE = slice(0, 8), slice(108, 128)


@pytest.fixture(scope="module")
def capture():
    frames = json.loads(shared_path("data/tmf8820_spad/distance_data.json").read_text())
    counts = np.array([frame["hists"] for frame in frames], dtype=np.float64)
    distance_m = np.array([frame["dist_to_plane"] for frame in frames])
    assert counts.shape == (159, 9, 128)
    return counts, np.repeat(distance_m[:, None], 9, axis=1)


def usable(counts, distance_m):
    expected = late_background(counts, CYCLES, early=EARLY, late=LATE).expected
    return (distance_m > 0.0299) & (expected >= 150.0)


def reduced_chi_square(background, mask):
    z = (background.observed[mask] - background.expected[mask]) / background.sigma[mask]
    return float(np.mean(z**2))


def test_dead_time_explains_the_late_background(capture):
    counts, distance_m = capture
    mask = usable(counts, distance_m)
    assert mask.sum() == 1325
    with_dead_time = late_background(counts, CYCLES, early=EARLY, late=LATE)
    without = late_background(counts, CYCLES, early=EARLY, late=LATE, dead_bins=1)
    assert reduced_chi_square(with_dead_time, mask) == pytest.approx(1.19, abs=0.01)
    assert reduced_chi_square(without, mask) > 10.0


@pytest.mark.parametrize("early", [slice(0, 6), slice(0, 8), slice(2, 10), slice(0, 10)])
@pytest.mark.parametrize("late", [slice(96, 128), slice(108, 128), slice(118, 128)])
def test_whatever_the_windows(capture, early, late):
    counts, distance_m = capture
    mask = usable(counts, distance_m)
    with_dead_time = late_background(counts, CYCLES, early=early, late=late)
    without = late_background(counts, CYCLES, early=early, late=late, dead_bins=1)
    assert reduced_chi_square(with_dead_time, mask) < 2.0
    assert reduced_chi_square(without, mask) > 10.0


def test_another_number_of_cycles_does_not(capture):
    counts, distance_m = capture
    mask = usable(counts, distance_m)
    for cycles in (CYCLES / 1.4, CYCLES * 1.4):
        background = late_background(counts[mask], cycles, early=EARLY, late=LATE)
        assert reduced_chi_square(background, np.ones(1325, dtype=bool)) > 2.0


def test_the_chain_reproduces_the_whole_record(capture):
    from lidarcheck.kpi.deadtime import coates_rate

    counts, distance_m = capture
    some = counts[usable(counts, distance_m)][::50]
    np.testing.assert_allclose(expected_counts(coates_rate(some, CYCLES), CYCLES), some, rtol=1e-9, atol=1e-6)
