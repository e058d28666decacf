"""What a search must know of `walk_error`: a curve or a power of AREA, and a table of what these have not quite."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.search.base import FreeParameter, Probe, SearchSpec
from lidarcheck.effects.search.evidence import AREA, RANGE, Evidence, Observations
from lidarcheck.effects.search.parts import ListReader, TakeOver
from lidarcheck.effects.search.residuals import at_knots, medians, range_residuals
from lidarcheck.effects.walk_error import LARGEST_REFERENCE, QUARTERS, WalkError

__all__ = ["walks"]


_POWERS = (-1.0, -0.5, 0.5)
_FREE = (FreeParameter("per_decade_m", 0.01), FreeParameter("bend_m", 0.01))
_REFERENCE = FreeParameter("reference_area", 0.5, log=True)
_KNOTS = 4 * QUARTERS + 1
_BESIDES = 0.3
"""The table is what the curve has not quite: no more than this part of the span of the curve itself."""
_CLIP_M = 1.0
"""Single ranges farther off say no more than this."""


def _starts(evidence: Evidence) -> list[Probe]:
    """A walk as a curve in log AREA and as a power of it, each at its best."""
    found = range_residuals(evidence)
    if found is None:
        return []
    used, residual = found
    area = np.exp(evidence.measured.feature[used, AREA])
    return walks(*medians(np.log10(area), residual)[::-1])


def walks(log_area: FloatArray, shift_m: FloatArray) -> list[Probe]:
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
    far = LARGEST_REFERENCE if power < 0.0 else 1.0
    reference = float(np.clip(1000.0 * ratio ** (1.0 / power), 1.0, LARGEST_REFERENCE)) if ratio > 0.0 else far
    per_decade = factor * (reference / 1000.0) ** power * power * np.log(10.0)
    found.append(_walk(float(per_decade), 0.0, reference, power, "power"))
    return found


def _walk(per_decade_m: float, bend_m: float, reference: float, power: float, variant: str) -> Probe:
    settings = {
        "per_decade_m": float(np.clip(per_decade_m, -2.0, 2.0)),
        "bend_m": float(np.clip(bend_m, -2.0, 2.0)),
        "reference_area": float(np.clip(reference, 1.0, LARGEST_REFERENCE)),
    }
    bends = _FREE if power == 0.0 else _FREE[:1]
    fixed = {"power": power} if power else {}
    return Probe("walk_error", settings, (*bends, _REFERENCE), fixed, variant)


def _shifts(evidence: Evidence, shown: Sequence[Observations], probe: Probe, x: FloatArray) -> tuple[float, ...]:
    """The table of shifts with what the ranges still ask for at each amplitude, within limits.

    Of measured echoes the mean range at an AREA is taken, and of simulated ones that at their own AREA: the photons of
    an echo that is brighter by chance also come earlier.
    """
    means = [_range_by_area(evidence, one) for one in shown]
    more = _range_by_area(evidence, evidence.measured) - np.mean(means, axis=0)
    curve = WalkError(**{**probe.effect(x).settings(), "shifts_m": ()})
    log_area = evidence.measured.feature[evidence.measured.detected, AREA]
    seen = np.quantile(log_area, [0.01, 0.99]) if len(log_area) else np.zeros(2)
    most = _BESIDES * float(np.ptp(curve.shift_m(np.exp(seen))))
    table = np.asarray(probe.settings.get("shifts_m") or np.zeros(_KNOTS)) + more
    return tuple(np.round(np.clip(table, -most, most), 4).tolist())


def _range_by_area(evidence: Evidence, shown: Observations) -> FloatArray:
    """The ranges' residuals [m] at each of the table's amplitudes, by least squares, shape (_KNOTS,)."""
    expected = evidence.expected
    used = np.flatnonzero(shown.detected & expected.known & ~expected.at_edge)
    quarters = np.clip(QUARTERS * shown.feature[used, AREA] / np.log(10.0), 0.0, _KNOTS - 1.0)
    off_m = np.clip(shown.feature[used, RANGE], -_CLIP_M, _CLIP_M)
    return at_knots(quarters, off_m, 1.0 / np.maximum(expected.spread[used, RANGE], 1e-3) ** 2, _KNOTS)


def _shifted(probe: Probe, x: FloatArray, offset: Mapping[str, Any]) -> tuple[Probe, FloatArray]:
    """A walk that shifts all echoes by so much more, where its curve can; else as it is."""
    walk = WalkError(**probe.effect(x).settings())
    values = _about_its_zero(walk, float(offset["offset_m"]))
    if values is None:
        return probe, x
    ranges = {p.name: p for p in walk.parameters()}
    if any(not ranges[name].low <= value <= ranges[name].high for name, value in values.items()):
        return probe, x
    moved = replace(probe, settings={**probe.settings, **values})
    return moved, moved.start()


def _about_its_zero(walk: WalkError, offset_m: float) -> dict[str, float] | None:
    """The numbers of the same curve so much higher, about the AREA where that is zero; None where it is so nowhere."""
    slope, bend, power = walk.per_decade_m, walk.bend_m, walk.power
    if abs(power) >= 1e-6:
        if bend != 0.0 or slope == 0.0:
            return None
        # slope (u - 1) / (q ln 10) + offset, u = (AREA / reference)^q, is zero at this u. Without one the curve ends at
        # a level of its own, and the reference is taken far off: a power with nothing beside it has none.
        zero = max(1.0 - offset_m * power * math.log(10.0) / slope, 1e-6)
        reference = float(np.clip(walk.reference_area * zero ** (1.0 / power), 1.0, LARGEST_REFERENCE))
        return {
            "per_decade_m": slope * (reference / walk.reference_area) ** power,
            "reference_area": reference,
        }
    roots = np.roots([bend, slope, offset_m])
    real = roots[np.abs(roots.imag) < 1e-9].real
    if not len(real):
        return None
    zero = float(real[np.argmin(np.abs(real))])
    moved = {"per_decade_m": slope + 2.0 * bend * zero, "bend_m": bend}
    return moved | {"reference_area": walk.reference_area * 10.0**zero}


SPEC = SearchSpec(
    "walk_error",
    free=_FREE,
    fixed_starts=(
        {"per_decade_m": 0.06, "bend_m": 0.0},
        {"per_decade_m": -0.06, "bend_m": 0.0},
        {"per_decade_m": 0.0, "bend_m": 0.06},
        {"per_decade_m": 0.0, "bend_m": -0.06},
    ),
    starts=_starts,
    order=10,
    amounts=("per_decade_m", "bend_m"),
    groups=frozenset({"ranges"}),
    takes_over=TakeOver("range_offset", _shifted),  # which is a walk about another amplitude
    may_stay={"range": (0.08, 0.15)},
    list_reader=ListReader("shifts_m", _shifts, rounds=2),
    watched_by=("range_residual_per_decade", "range_residual_mean"),
    shown_by=("range", "amplitude"),
)
