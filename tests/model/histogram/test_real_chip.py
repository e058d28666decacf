"""A real TMF8820 before a plane at 159 known distances: background, the first photon's dead time, ranges."""

import json

import numpy as np
import pytest

from lidarcheck.model.histogram.search import coates
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, shipped
from places import shared_path

EARLY, LATE = slice(0, 9), slice(112, 128)
"""Bins before any light comes back, and behind the pulse's tail."""
CENTRE = 4


@pytest.fixture(scope="module")
def capture():
    """Distances to the plane [m], (n,), and the counts of nine zones, (n, 9, 128)."""
    rows = json.loads(shared_path("data/tmf8820_spad/distance_data.json").read_text(encoding="utf-8"))
    return np.array([row["dist_to_plane"] for row in rows]), np.array([row["hists"] for row in rows], dtype=float)


def off(counts, trials):
    """Chi-squared a degree of freedom of the late background against the early one, pile-up of first photons undone."""
    early, late, corrected = counts[..., EARLY].sum(-1), counts[..., LATE].sum(-1), counts.copy()
    for histogram in corrected.reshape(-1, corrected.shape[-1]):
        coates(trials, histogram)
    lost = late / np.maximum(corrected[..., LATE].sum(-1), 1e-9)
    expected = early / 9 * 16 * lost
    variance = expected + early * (16 / 9 * lost) ** 2
    enough = early >= 20
    return float(((late - expected)[enough] ** 2 / variance[enough]).mean()), int(enough.sum())


def test_the_late_background_follows_from_the_early_one_by_first_photons(capture):
    """With one converter a zone: as many trials as shots. Nine of them, or no dead time, are off by a factor of 30."""
    counts, chip = capture[1], shipped("TMF8820-short")
    found, histograms = off(counts, chip.shots)
    assert histograms > 1300
    assert found == pytest.approx(1.24, abs=0.1)
    assert off(counts, chip.trials)[0] > 30.0
    assert off(counts, 1 << 50)[0] > 30.0


def test_ranges_follow_the_distance_by_the_description_s_bins(capture):
    """From 0.1 m on, the centre's zone; below, the cover glass's light lies in the echo. Bin 0 is the chip's own."""
    distance, counts = capture
    bins, far = np.arange(128), capture[0] > 0.1
    centre = []
    for histogram in counts[far, CENTRE]:
        net = histogram - np.median(histogram[-32:])
        near = slice(14 + int(np.argmax(net[14:])) - 4, 14 + int(np.argmax(net[14:])) + 5)
        centre.append((bins[near] + 0.5) @ net[near] / net[near].sum())
    range_m = 0.5 * LIGHT_SPEED_M_PER_NS * shipped("TMF8820-short").bin_ns * np.array(centre)
    slope, start = np.polyfit(distance[far], range_m, 1)
    assert slope == pytest.approx(1.0, abs=0.005)
    assert start == pytest.approx(0.190, abs=0.005)
    assert np.std(range_m - slope * distance[far] - start) < 0.001
