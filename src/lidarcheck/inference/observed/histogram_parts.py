"""What a histogram of photons says of each echo in it: its counts, the background, and how long its pulse is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.kpi.histogram import histograms_of
from lidarcheck.kpi.pairing import beam_keys
from lidarcheck.scan import Scan
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, PhotonHistogram

__all__ = ["PARTS", "HistogramParts", "Part"]

Part = Literal["counts", "background", "pulse"]
PARTS: tuple[Part, ...] = ("counts", "background", "pulse")
_LAST = 4
"""The background is the median of the last bins, one in so many."""


@dataclass(frozen=True, slots=True)
class HistogramParts:
    """Where a sensor's bins lie: the start of bin 0 against zero range, a bin's length, the pulse's FWHM [ns]."""

    first_ns: float
    bin_ns: float
    fwhm_ns: float

    @classmethod
    def of(cls, sensor: PhotonHistogram) -> HistogramParts:
        """Those of a sensor."""
        return cls(sensor.first_bin_ns, sensor.bin_ns, sensor.pulse_fwhm_ns)

    def each(self, scan: Scan, part: Part) -> FloatArray:
        """One part of each echo's histogram, shape (n,); 0 where its beam has none.

        `counts`: above the background, within a FWHM of the echo's range; `background`: counts a bin; `pulse`: the
        standard deviation [ns] of what `counts` counts.
        """
        keys, counts = histograms_of(scan)
        found = np.zeros(len(scan))
        if not len(keys) or not len(scan):
            return found
        own = beam_keys(scan.layer, scan.point)
        at = np.minimum(np.searchsorted(keys, own), len(keys) - 1)
        rows = np.flatnonzero(keys[at] == own)
        bins = counts[at[rows]]
        floor = np.median(bins[:, -max(bins.shape[1] // _LAST, 1) :], axis=1)
        if part == "background":
            found[rows] = floor
            return found
        time_ns = 2.0 * scan.range_m[rows] / LIGHT_SPEED_M_PER_NS
        centre = self.first_ns + self.bin_ns * (np.arange(bins.shape[1]) + 0.5)
        inside = np.abs(centre - time_ns[:, None]) <= self.fwhm_ns
        left = np.where(inside, np.maximum(bins - floor[:, None], 0.0), 0.0)
        total = left.sum(axis=1)
        if part == "counts":
            found[rows] = total
            return found
        share = left / np.maximum(total, 1.0)[:, None]
        mean = (share * centre).sum(axis=1)
        found[rows] = np.sqrt(np.maximum((share * (centre - mean[:, None]) ** 2).sum(axis=1), 0.0))
        return found
