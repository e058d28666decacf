"""In which unit a file's lengths are, as its ranges tell it; and the units that a user can declare."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray

__all__ = ["BEYOND_GATE_M", "METRES", "UNITS", "UnitFound", "unit_of"]

METRES = {"m": 1.0, "mm": 0.001, "cm": 0.01, "ft": 0.3048, "in": 0.0254, "hm": 100.0, "km": 1000.0}
"""How many metres each unit has. A free factor is no unit: a moved cloud would be one."""
UNITS = tuple(METRES)
BEYOND_GATE_M = 1.0
"""An offset of all ranges may carry them so far beyond the sensor's gate."""
GATE_M = (0.0, 300.0 + BEYOND_GATE_M)
"""Where the reference sensor's ranges lie."""
_IN_GATE, _BEFORE = 0.95, 0.5
"""A unit is named where so many ranges lie in the gate after it, and fewer than the second before."""
_FEWEST_ROWS = 4
"""Fewer ranges tell no unit."""
_SAME = 0.02
"""How far the ratio of two ranges may lie from a unit's."""
_LOOKED_AT = 4000
"""Ranges that tell the unit."""
_ON_STEP, _OFF_STEP, _MOST_OFF = 0.95, 0.01, 0.25
"""A unit goes before others where so many ranges are multiples of the sensor's range step, within so much of it and
what rounding makes of it, if that leaves anything to see."""


@dataclass(frozen=True, slots=True)
class UnitFound:
    """`units`: those that X, Y, Z may be in, the likeliest first; empty where they may well be metres.

    `checked`: whether a RANGE beside X, Y, Z says so.
    """

    units: tuple[str, ...] = ()
    checked: bool = False


def unit_of(
    distance: FloatArray,
    range_m: FloatArray | None,
    error: float = 0.0,
    range_step_m: float = 0.01,
    gate_m: tuple[float, float] = GATE_M,
) -> UnitFound:
    """The unit that distances from the beams' origin, shape (n,), are in.

    `range_m`: ranges of the same rows in metres, where the file has them; else the sensor's gate tells, and among
    several units that fit the one whose ranges are multiples of `range_step_m`. `error`: how far rounding may have
    moved a point, in the distances' unit. `gate_m`: where the sensor's ranges lie.
    """
    rows = slice(None, None, max(1, len(distance) // _LOOKED_AT))
    distance = distance[rows]
    use = distance > 0.0
    if np.count_nonzero(use) < _FEWEST_ROWS:
        return UnitFound()
    if range_m is not None:
        ranges = range_m[rows]
        both = use & (ranges > 0.0)
        ratio = float(np.median(ranges[both] / distance[both])) if both.any() else 0.0
        named = [unit for unit, metres in METRES.items() if abs(ratio / metres - 1.0) <= _SAME]
        if named and _shares(ranges[both], ("m",), gate_m)["m"] >= _IN_GATE:
            return UnitFound(tuple(unit for unit in named if unit != "m"), checked=True)
    shares = _shares(distance[use], UNITS, gate_m)
    if shares["m"] >= _BEFORE:
        return UnitFound()
    fitting = [unit for unit in UNITS if shares[unit] >= _IN_GATE]
    on_step = {unit: _on_step(distance[use], error, range_step_m / METRES[unit]) for unit in fitting}
    return UnitFound(tuple(sorted(fitting, key=lambda unit: not on_step[unit])))


def _shares(distance: FloatArray, units: tuple[str, ...], gate_m: tuple[float, float]) -> dict[str, float]:
    """How many of the distances lie in the gate, were they in each unit."""
    low, high = gate_m
    in_m = {unit: distance * METRES[unit] for unit in units}
    return {unit: float(np.mean((m >= low) & (m <= high))) if len(m) else 0.0 for unit, m in in_m.items()}


def _on_step(distance: FloatArray, error: float, step: float) -> bool:
    """Whether the distances are multiples of a step, all in one unit, as far as their error lets it be seen."""
    if not step:
        return False
    off = _OFF_STEP + error / step
    cells = distance / step
    near = np.abs(cells - np.rint(cells)) <= off + 2.0**-22 * cells
    return off <= _MOST_OFF and bool(np.mean(near) >= _ON_STEP)
