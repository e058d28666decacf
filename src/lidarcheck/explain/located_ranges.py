"""Starts for what shifts ranges, read off the paired range residuals: over the amplitude, over the range, all alike."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.aiming import rays_of
from lidarcheck.explain.beams import key_of
from lidarcheck.explain.candidates import Free, Probe, free_of
from lidarcheck.explain.lab import Lab
from lidarcheck.rays import sweep_time_s

__all__ = ["range_probes"]

FloatArray = npt.NDArray[np.float64]

_BINS = 24
_FEWEST = 200
"""Fewer beams than this do not show a curve."""
_POWERS = (-1.0, -0.5, 0.5)
_LARGEST_REFERENCE = 1e6
_REFERENCE = Free("reference_area", 0.5, log=True)


def range_probes(lab: Lab, names: Collection[str]) -> list[Probe]:
    """A walk error as a curve in log AREA and as a power of it, a scale, an offset: each at its best."""
    residual, area, range_m = _residuals(lab)
    if len(residual) < _FEWEST:
        return []
    found: list[Probe] = []
    if "range_offset" in names:
        found.append(Probe("range_offset", {"offset_m": float(np.median(residual))}, free_of("range_offset")))
    if "range_scale" in names:
        y, x = _medians(range_m, residual)
        fraction = float(np.clip(np.sum(x * y) / np.sum(x * x), -0.05, 0.05))
        found.append(Probe("range_scale", {"fraction": fraction}, free_of("range_scale")))
    if "motion" in names:
        found += _ahead(lab)
    if "walk_error" in names:
        found += _walks(*_medians(np.log10(area), residual)[::-1])
    return found


def _ahead(lab: Lab) -> list[Probe]:
    """A sensor that drives: the velocity along X by which ranges have shortened when each column is fired."""
    measured, expected = lab.measured_sights, lab.summaries.expected
    used = measured.detected & expected.known & ~expected.at_edge & (expected.spread[:, 0] < 0.5)
    way_s = _driving_s(lab)[used]
    if not np.any(way_s > 0.0):
        return []
    residual = measured.feature[used, 0] - expected.mean[used, 0]
    velocity = -float(np.median(residual[way_s > 0.0] / way_s[way_s > 0.0]))
    settings = {"forward_m_s": float(np.clip(velocity, -60.0, 60.0)), "left_m_s": 0.0, "up_m_s": 0.0, "yaw_deg_s": 0.0}
    return [Probe("motion", settings, free_of("motion"))] if velocity else []


def _driving_s(lab: Lab) -> FloatArray:
    """How much shorter each beam's range gets per 1 m/s along X, from the ideal scan's time to the beam's; (n,)."""
    found = np.zeros(len(lab.beams))
    for number, frame in enumerate(lab.frames):
        ideal = frame.ideal
        passed_s = sweep_time_s(ideal.point) - (0.0 if ideal.time_s is None else ideal.time_s)
        place = np.searchsorted(lab.beams.key, key_of(number, ideal.layer, ideal.point))
        found[place] = passed_s * rays_of(ideal).direction[:, 0]
    return found


def _residuals(lab: Lab) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Range residuals [m], AREA and range [m] of beams whose range the model knows well."""
    expected, measured = lab.summaries.expected, lab.measured_sights
    used = measured.detected & expected.known & ~expected.at_edge & (expected.spread[:, 0] < 0.5)
    residual = measured.feature[used, 0] - expected.mean[used, 0]
    return residual, np.exp(measured.feature[used, 1]), lab.beams.distance_m[used]


def _medians(over: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Medians of the residuals and of what they are looked at over, in bins of as many beams; shapes (n_bins,)."""
    parts = np.array_split(np.argsort(over, kind="stable"), _BINS)
    return np.array([np.median(residual[p]) for p in parts]), np.array([np.median(over[p]) for p in parts])


def _walks(log_area: FloatArray, shift_m: FloatArray) -> list[Probe]:
    """The parabola and the power of AREA that go best through the shifts."""
    bend, slope, level = np.polyfit(log_area - 3.0, shift_m, 2)
    roots = np.roots([bend, slope, level])
    real = roots[np.abs(roots.imag) < 1e-9].real
    # Where the shift is zero nowhere, the nearest thing to a zero, its vertex, stands for it.
    zero = real[np.argmin(np.abs(real))] if len(real) else -slope / (2.0 * bend)
    zero = float(np.clip(zero, -3.0, 3.0))
    found = [_walk(float(slope + 2.0 * bend * zero), float(bend), 10.0 ** (3.0 + zero), 0.0, "curve")]
    best = (np.inf, 0.0, 0.0, 0.0)
    for power in _POWERS:
        basis = np.column_stack([10.0 ** (power * (log_area - 3.0)), np.ones(len(log_area))])
        (factor, constant), *_ = np.linalg.lstsq(basis, shift_m, rcond=None)
        left = float(np.sum((basis @ [factor, constant] - shift_m) ** 2))
        if left < best[0]:
            best = (left, power, float(factor), float(constant))
    _, power, factor, constant = best
    ratio = -constant / factor if factor else 0.0
    # factor (A / 1000)^q + constant is zero at A = 1000 ratio^(1 / q); without such an A it is taken far off.
    far = _LARGEST_REFERENCE if power < 0.0 else 1.0
    reference = float(np.clip(1000.0 * ratio ** (1.0 / power), 1.0, _LARGEST_REFERENCE)) if ratio > 0.0 else far
    per_decade = factor * (reference / 1000.0) ** power * power * np.log(10.0)
    found.append(_walk(float(per_decade), 0.0, reference, power, "power"))
    return found


def _walk(per_decade_m: float, bend_m: float, reference: float, power: float, variant: str) -> Probe:
    settings = {
        "per_decade_m": float(np.clip(per_decade_m, -2.0, 2.0)),
        "bend_m": float(np.clip(bend_m, -2.0, 2.0)),
        "reference_area": float(np.clip(reference, 1.0, _LARGEST_REFERENCE)),
    }
    bends = free_of("walk_error") if power == 0.0 else free_of("walk_error")[:1]
    fixed = {"power": power} if power else {}
    return Probe("walk_error", settings, (*bends, _REFERENCE), fixed, variant)
