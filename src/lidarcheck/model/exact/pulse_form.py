"""The laser pulse over time: which share of its light comes when, and how far from its centre any of it matters."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.scan import PulseShape
from lidarcheck.sensor import FWHM_PER_SIGMA, Sensor

__all__ = ["PHASES", "PulseForm", "form_of"]

PHASES = 512
"""Pulse positions within a bin that are tabulated; linear between them, the share of a bin is exact to 2e-8."""
_TAIL = 1e-6
"""Avalanches a beam may lose, on average, where a pulse is cut off."""
_SQRT_HALF = math.sqrt(0.5)


@dataclass(frozen=True)
class PulseForm:
    """The pulse: a Gaussian of `sigma`, of which the share `tail_share` comes behind an exponential delay.

    Times are in bins, or in any other unit, which they have in common; the delay is `delay` at least, and `tail` more
    in the mean. The delayed share is an exponentially modified Gaussian (Grushka, "Characterization of exponentially
    modified Gaussian peaks in chromatography", Anal. Chem. 44, 1972).
    """

    sigma: float
    tail_share: float
    tail: float
    delay: float = 0.0

    def before(self, at: npt.ArrayLike) -> FloatArray:
        """Share of the light before `at` bins behind the Gaussian's centre; same shape."""
        from scipy.special import ndtr

        z = np.asarray(at, dtype=np.float64) / self.sigma
        gaussian = np.asarray(ndtr(z))
        if self.tail_share == 0.0:
            return gaussian
        later = z - self.delay / self.sigma
        return np.asarray(gaussian - self.tail_share * (gaussian - ndtr(later) + self._late(later)))

    def integral(self, at: npt.ArrayLike) -> FloatArray:
        """Integral of `before` from minus infinity to `at` [bins]; same shape."""
        from scipy.special import ndtr

        z = np.asarray(at, dtype=np.float64) / self.sigma
        gaussian = self._gaussian_integral(z)
        if self.tail_share == 0.0:
            return gaussian
        later = z - self.delay / self.sigma
        # The delayed share E of a Gaussian G solves tail dE/dt = G - E.
        behind = gaussian - self._gaussian_integral(later) + self.tail * (ndtr(later) - self._late(later))
        return np.asarray(gaussian - self.tail_share * behind)

    def _gaussian_integral(self, z: FloatArray) -> FloatArray:
        from scipy.special import ndtr

        return np.asarray(self.sigma * (z * ndtr(z) + elementary.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)))

    def _late(self, z: FloatArray) -> FloatArray:
        """What is already there of the Gaussian, but not yet of its delayed twin: exp(r^2 / 2 - r z) Phi(z - r).

        r = sigma / tail. Where z < r the exponential may overflow while Phi underflows: there, their product is
        written as a scaled error function times a Gaussian, which can do neither.
        """
        from scipy.special import erfcx, ndtr

        r = self.sigma / self.tail
        left = 0.5 * erfcx(np.maximum(r - z, 0.0) * _SQRT_HALF) * elementary.exp(-0.5 * z * z)
        right = elementary.exp(np.minimum(r * (0.5 * r - z), 0.0)) * ndtr(z - r)
        return np.asarray(np.where(z < r, left, right))

    def reach(self, expected: npt.ArrayLike) -> tuple[IndexArray, IndexArray]:
        """Bins before and behind its centre beyond which less than `_TAIL` avalanches of a pulse are lost.

        `expected`: avalanches of the pulse in the beam, of all detectors. Whole, so that a slightly changed signal
        meets the same draws in the same bins. A delayed share comes late only if its Gaussian or its delay is late.
        """
        lost = np.asarray(expected, dtype=np.float64) / _TAIL
        near = self._gaussian_reach(lost)
        if self.tail_share == 0.0:
            return near, near
        delay = self.delay + self.tail * elementary.log(np.maximum(2.0 * self.tail_share * lost, 1.0))
        behind = self._gaussian_reach(2.0 * lost) + np.ceil(delay).astype(np.int64)
        return near, behind

    def _gaussian_reach(self, lost: FloatArray) -> IndexArray:
        return np.asarray(np.ceil(self.sigma * np.sqrt(2.0 * elementary.log(np.maximum(lost, 1.0)))).astype(np.int64))

    def shares(self, before: int, behind: int) -> FloatArray:
        """The share of a pulse's light in each bin around it, shape (PHASES + 1, before + 1 + behind).

        Row p: a pulse p / PHASES of a bin behind the beginning of the bin in column `before`.
        """
        shares = np.diff(self.before(_edges(before, behind)), axis=1)
        return np.ascontiguousarray(np.maximum(shares, 0.0))

    def ramps(self, before: int, behind: int) -> FloatArray:
        """Light in each bin of a row of unit pulses a bin that ends here: integrals of `shares` over the position."""
        ramps = 1.0 - np.diff(self.integral(_edges(before, behind)), axis=1)
        return np.ascontiguousarray(np.clip(ramps, 0.0, 1.0))


def _edges(before: int, behind: int) -> FloatArray:
    """Bin edges as seen from a pulse, shape (PHASES + 1, before + behind + 2)."""
    phases: Any = np.arange(PHASES + 1) / PHASES
    return np.asarray(np.arange(-before, behind + 2) - phases[:, None])


def form_of(shape: PulseShape | None, sensor: Sensor, unit_ns: float) -> PulseForm:
    """The pulse of that shape, the sensor's own where there is none; its times in units of `unit_ns`."""
    if shape is None:
        return PulseForm(sensor.sigma_ns / unit_ns, 0.0, 1.0)
    tail_share = shape.tail_share if shape.tail_ns > 0.0 else 0.0
    tail = max(shape.tail_ns, 1e-9) / unit_ns
    return PulseForm(shape.fwhm_ns / FWHM_PER_SIGMA / unit_ns, tail_share, tail, shape.tail_delay_ns / unit_ns)
