"""The pulse of a histogram chip in bins: a Gaussian, or what its reference channel has counted."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.model.exact.pulse_form import PulseForm, form_of
from lidarcheck.scan import PulseShape
from lidarcheck.sensor import PhotonHistogram

__all__ = ["CountedPulse", "Pulse", "fwhm_bins", "pulse_of", "template"]

_TEMPLATE_SIGMAS = 4.0
"""Standard deviations of a Gaussian pulse that the search for echoes weighs: all but 6e-5 of its light."""


@dataclass(frozen=True)
class CountedPulse:
    """A pulse given by the counts of consecutive bins, even within each; its centroid is its zero."""

    counts: tuple[float, ...]

    def _edges(self) -> FloatArray:
        weights = np.asarray(self.counts, dtype=np.float64)
        centroid = float(np.sum(weights * (np.arange(len(weights)) + 0.5)) / np.sum(weights))
        return np.asarray(np.arange(len(weights) + 1) - centroid, dtype=np.float64)

    def _up_to(self) -> FloatArray:
        weights = np.asarray(self.counts, dtype=np.float64)
        return np.concatenate([[0.0], np.cumsum(weights) / np.sum(weights)])

    def before(self, at: npt.ArrayLike) -> FloatArray:
        """Share of the light before `at` bins behind the centroid; same shape."""
        return np.asarray(np.interp(np.asarray(at, dtype=np.float64), self._edges(), self._up_to()))

    def integral(self, at: npt.ArrayLike) -> FloatArray:
        """Integral of `before` from minus infinity to `at` [bins]; same shape."""
        edges, up_to = self._edges(), self._up_to()
        whole = np.concatenate([[0.0], np.cumsum(0.5 * (up_to[1:] + up_to[:-1]))])
        x = np.asarray(at, dtype=np.float64)
        cell = np.clip(np.floor(x - edges[0]).astype(np.int64), 0, len(up_to) - 2)
        inside = np.clip(x - edges[cell], 0.0, 1.0)
        found = whole[cell] + inside * (up_to[cell] + 0.5 * inside * (up_to[cell + 1] - up_to[cell]))
        return np.asarray(found + np.maximum(x - edges[-1], 0.0))

    def reach(self, expected: npt.ArrayLike) -> tuple[IndexArray, IndexArray]:
        """Bins before and behind the centroid that the pulse lies within, whatever its light."""
        edges = self._edges()
        both = (math.ceil(-edges[0]), math.ceil(edges[-1]))
        before, behind = (np.full(np.shape(expected), bins, dtype=np.int64) for bins in both)
        return before, behind


Pulse = PulseForm | CountedPulse


def pulse_of(sensor: PhotonHistogram, shape: PulseShape | None = None) -> Pulse:
    """The sensor's pulse, times in bins; that of `shape` where an effect has given the light one."""
    if shape is None and sensor.pulse:
        return CountedPulse(tuple(sensor.pulse))
    return form_of(shape, sensor, sensor.bin_ns)


def fwhm_bins(sensor: PhotonHistogram) -> float:
    """Full width at half maximum of the sensor's own pulse [bins]; of counts, between bins on straight lines."""
    if not sensor.pulse:
        return float(sensor.pulse_fwhm_ns / sensor.bin_ns)
    counts = np.concatenate([[0.0], np.asarray(sensor.pulse, dtype=np.float64), [0.0]])
    half = 0.5 * counts.max()
    above = np.flatnonzero(counts >= half)
    first, last = int(above[0]), int(above[-1])
    rise = (half - counts[first - 1]) / (counts[first] - counts[first - 1])
    fall = (half - counts[last + 1]) / (counts[last] - counts[last + 1])
    return float(last + 1 - fall - (first - 1 + rise))


def template(pulse: Pulse) -> FloatArray:
    """Share of the pulse's light in each bin around one at whose middle it is centred, normalised; an odd length."""
    if isinstance(pulse, PulseForm):
        half = math.ceil(_TEMPLATE_SIGMAS * pulse.sigma)
    else:
        half = max(int(bins) for bins in pulse.reach(0.0))
    shares = np.diff(pulse.before(np.arange(-half, half + 2) - 0.5))
    return np.asarray(shares / np.sum(shares))
