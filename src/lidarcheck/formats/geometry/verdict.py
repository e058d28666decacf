"""The verdict on a scan's X, Y, Z beside its beams: fit to use, with a warning, not checked, or refused."""

from __future__ import annotations

import re
from dataclasses import dataclass

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.beams import ANOTHER_SENSOR, Geometry
from lidarcheck.formats.geometry.changes import Change, Echoes
from lidarcheck.formats.geometry.check import FEWEST_JUDGED, FEWEST_ROWS, Agreement, agreement, outside, refuses
from lidarcheck.formats.geometry.drift import drift_of
from lidarcheck.formats.geometry.lattice import REFERENCE, Lattice
from lidarcheck.formats.geometry.mismatch import MOST_ROWS, Mismatch, search
from lidarcheck.formats.geometry.placement import POSE_NAMES
from lidarcheck.formats.geometry.sensor_changes import column_step_deg
from lidarcheck.formats.geometry.unit import METRES, UnitFound

__all__ = ["geometry_of", "refusal", "unit_fault"]

_OTHER_STEP = 0.05
"""Columns whose step differs by more than this part from the sensor's are another sensor's."""
_MOST_OTHERS = 2
"""Sets of changes that fit as well and are named."""


@dataclass(frozen=True)
class Refusal:
    """X, Y, Z and the beams disagree: `what` and `fix` as an error says them, and the changes that would help."""

    what: str
    fix: str
    mismatch: Mismatch | None = None


def geometry_of(
    position: FloatArray,
    layer: IntArray,
    point: IntArray,
    error_m: float,
    unit: UnitFound,
    lattice: Lattice = REFERENCE,
) -> Geometry | Refusal:
    """How points, shape (n, 3) [m], agree with the beams that they are said to be of; `layer`, `point`: shape (n,).

    `error_m`: how far rounding may have moved a point. `unit`: what the ranges tell. A `Refusal` where they disagree.
    """
    relative, beams = Echoes(position, layer, point, error_m, lattice).placed()
    found = agreement(relative[:, 0], relative[:, 1], relative[:, 2], beams, error_m)
    if refuses(found) or unit.units:
        refused = _refused(position, layer, point, error_m, unit, lattice, found)
        if isinstance(refused, Refusal):
            return refused
        return _geometry(found, "not checked", refused, unit, lattice)
    if found.judged < FEWEST_JUDGED:
        return _geometry(found, "not checked", _too_few(found), unit, lattice)
    some = slice(None, None, max(1, -(-found.rows // MOST_ROWS)))
    few, their = relative[some], beams.take(some)
    wide, clear = outside(few, their, error_m)
    drift = drift_of(few, their, layer[some], clear & ~wide, error_m)
    return _geometry(found, "warning" if drift else "ok", drift.words if drift else "", unit, lattice)


def _geometry(found: Agreement, verdict: str, note: str, unit: UnitFound, lattice: Lattice) -> Geometry:
    numbers = (found.rows, found.judged, found.passed, found.outside)
    return Geometry(verdict, *numbers, note, unit.checked, lattice.repeats)


def _too_few(found: Agreement) -> str:
    return f"{found.judged} of {found.rows} rows can be judged, {FEWEST_JUDGED} are needed"


def _refused(
    position: FloatArray,
    layer: IntArray,
    point: IntArray,
    error_m: float,
    unit: UnitFound,
    lattice: Lattice,
    found: Agreement,
) -> Refusal | str:
    """The refusal; or why it is none: the beams are another sensor's."""
    if unit.units and not refuses(found):
        return unit_fault(unit)
    metres = METRES[unit.units[0]] if unit.units else 1.0
    mismatch = search(Echoes(position * metres, layer, point, error_m * metres, lattice))
    if not mismatch.sets:
        other = _other_sensor(position, layer, point, lattice)
        if other:
            return other
    return refusal(mismatch, unit, found)


def unit_fault(unit: UnitFound) -> Refusal:
    """X, Y, Z in another unit than metres."""
    what = f"X, Y, Z are not in m: the ranges fit in {' or '.join(unit.units)}"
    return Refusal(what, _declared(f"give --unit {unit.units[0]}"))


def refusal(mismatch: Mismatch, unit: UnitFound, found: Agreement) -> Refusal:
    """What is said of points and beams that disagree."""
    if not mismatch.sets:
        return _unexplained(mismatch, found)
    first, *others = mismatch.sets
    median, most = (f"{was:.3g} to {now:.3g}" for was, now in zip(mismatch.before, mismatch.after, strict=True))
    what = f"{_said(first)}: {100.0 * mismatch.share:.1f} % fit with {' and '.join(change.how for change in first)}, "
    what += f"{100.0 * mismatch.share_before:.1f} % as it is (median {median} deg, 99 % {most} deg)"
    if others:
        what += f"; these rows cannot tell it from: {', or '.join(_said(changes) for changes in others[:_MOST_OTHERS])}"
    fix = " and ".join(change.fix for change in first)
    if unit.units:
        what = f"X, Y, Z are in {unit.units[0]}, and {what}"
        fix = f"give --unit {unit.units[0]} {fix.removeprefix('give ') if fix.startswith('give ') else f'and {fix}'}"
    return Refusal(what, _declared(fix), mismatch)


def _said(changes: tuple[Change, ...]) -> str:
    return " and ".join(change.said for change in changes)


def _unexplained(mismatch: Mismatch, found: Agreement) -> Refusal:
    off = f"median {mismatch.before[0]:.3g}, 99 % {mismatch.before[1]:.3g} deg off"
    what = f"X, Y, Z do not lie where Layer and Point point: {_mixed(found)} fit, {off}, and no change makes them fit"
    if mismatch.nearest:
        what += f"; the nearest: {mismatch.nearest}, {100.0 * mismatch.share:.1f} %"
    return Refusal(what, "give each echo its own Layer and Point, and X, Y, Z in the sensor's frame", mismatch)


def _mixed(found: Agreement) -> str:
    if found.judged >= FEWEST_JUDGED:
        return f"{100.0 * found.passed / found.judged:.0f} % of {found.judged} judged rows"
    return f"{found.rows - found.outside} of {found.rows} rows"


def _declared(fix: str) -> str:
    """The options of a fix, and the keys of a case's frame that say the same."""
    options = re.findall(r"--(mirror|unit) (\w+)", fix)
    keys = [f'{name} = "{value}"' for name, value in options]
    pose = re.search(r'--pose "([^"]*)"', fix)
    if pose:
        numbers = zip(POSE_NAMES, pose[1].split(","), strict=True)
        keys.append(f"pose = {{{', '.join(f'{name} = {number}' for name, number in numbers)}}}")
    return f"{fix} (in a case, the frame's {', '.join(keys)})" if keys else fix


def _other_sensor(position: FloatArray, layer: IntArray, point: IntArray, lattice: Lattice) -> str:
    """That the columns are another sensor's, in words; empty where they are this one's, or no columns at all."""
    if len(layer) < FEWEST_ROWS:
        return ""
    step = column_step_deg(position, layer, point)
    own = abs(lattice.column_deg)
    beyond = int(layer.max()) > lattice.layers or int(point.max()) > lattice.points
    if step is None or (abs(abs(step) / own - 1.0) <= _OTHER_STEP and not beyond):
        return ""
    return f"{ANOTHER_SENSOR}: columns of {abs(step):.3g} deg, {own:g} deg here"
