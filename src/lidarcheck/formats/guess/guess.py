"""The beams that a sensor's scans show: elevations, columns, sense of turning, fire times, range step, origins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.errors import UsageError
from lidarcheck.formats.assign.cloud import Cloud
from lidarcheck.formats.assign.columns import circular_median
from lidarcheck.formats.guess.columns import Steps, column_step, sense_of_rows
from lidarcheck.formats.guess.elevations import MOST_SPREAD, Rings, rings_of, sound
from lidarcheck.formats.guess.heads import Beside, beside_columns
from lidarcheck.formats.guess.origin import fitted_origin
from lidarcheck.formats.guess.ranges import range_step_m
from lidarcheck.formats.guess.rows import Labelled, labelled
from lidarcheck.formats.guess.turning import Turning, turning_of
from lidarcheck.formats.table import counted

__all__ = ["Guess", "guess_beams"]

_FEWEST_RINGS = 1
_ROUNDS = 3
"""Where a beam starts depends on what it looks beside its column, and that on where it starts."""
_SAME_PHASE = 0.1
"""Frames whose columns lie so near to each other, as a part of the step, have the same."""
_AROUND_DEG = 20.0
"""A gap in the azimuths that leaves so much out is said."""


@dataclass(frozen=True)
class Guess:
    """What scans show of their sensor's beams; arrays of shape (rings,), by ascending ring number.

    `rings`: those that are sound; `others`: those that are not. `told`: what said which ring a row is of. `columns`:
    the step of the azimuth, None where none is common. `beside`: each ring's azimuth beside the column's and its fire
    time. `sense`: 1 to the left, -1 to the right, 0 unknown. `repeats`: whether columns repeat, None unknown.
    `forward_m`, `up_m`: where beams start; `range_offset_m`: of a RANGE; `range_step_m`. `turning`: what the times say.
    """

    rings: Rings
    others: Rings
    told: str
    rows: int
    frames: int
    columns: Steps | None
    beside: Beside
    sense: int
    repeats: bool | None
    forward_m: float = 0.0
    up_m: float = 0.0
    range_offset_m: float = 0.0
    range_step_m: float | None = None
    turning: Turning | None = None
    notes: tuple[str, ...] = field(default=())

    @property
    def numbered(self) -> bool:
        """Whether the file itself numbers the rings."""
        return self.told in ("ring", "Layer")


def guess_beams(clouds: Sequence[Cloud]) -> Guess:
    """What frames of one sensor show of its beams. `UsageError` where they show no rings."""
    rows = labelled(clouds)
    forward, up = _origin(rows)
    elevation = np.rad2deg(np.arctan2(rows.position[:, 2] - up, rows.level_m - forward))
    every = rings_of(elevation, rows.ring)
    good = sound(every)
    if np.count_nonzero(good) < _FEWEST_RINGS:
        raise UsageError(_no_rings(every, rows), fix="give whole scans, or more of them, or the column of the rings")
    rows = rows.of_rings(every.number[good])
    rings = every.take(good)
    turning = turning_of(clouds, rows)
    for _ in range(_ROUNDS if forward else 1):
        step = _step(rows)
        sense = _sense(rows, turning)
        beside = beside_columns(rows, step, sense, turning)
        rows = rows.starting(forward, beside.offset_deg) if forward and beside.whole_turns else rows
    if step is not None and forward and not beside.whole_turns:
        # Rows lie beside their columns by what nobody knows: their scatter is no chance.
        step = Steps(step.step_deg, step.error_deg * float(np.sqrt(len(rows))))
    repeats = _repeats(step, beside, rows)
    notes = _notes(every.take(~good), rows, step, sense, beside)
    if rows.told == "Layer" and not np.array_equal(rings.number, np.arange(len(rings.number))):
        lost = np.setdiff1d(np.arange(int(rings.number[-1]) + 1), rings.number)
        notes = (
            *notes,
            f"{counted(len(lost), 'layer')} without rows supposed to lie in line with those that have some",
        )
    offset, range_step = _ranges(rows, forward, up)
    return Guess(
        rings, every.take(~good), rows.told, len(rows), rows.frames, step, beside, sense, repeats, forward, up, offset,
        range_step, turning, notes,
    )  # fmt: skip


def _origin(rows: Labelled) -> tuple[float, float]:
    names, place = np.unique(rows.ring, return_inverse=True)
    return fitted_origin(rows.level_m, rows.position[:, 2], place.astype(np.int32), len(names))


def _no_rings(every: Rings, rows: Labelled) -> str:
    enough = every.rows >= 50
    if not enough.any():
        return f"{len(rows)} rows in {len(every.number)} rings: no ring has the 50 rows that a guess takes"
    near = every.take(enough)
    spread = float(np.median(near.spread_deg / near.spacing_deg))
    what = (
        f"the rows of a ring spread by {spread:.2g} of the spacing of the rings, {MOST_SPREAD:g} at most are a beam's"
    )
    return f"{what}: a moved or deskewed cloud, or no rings"


def _step(rows: Labelled) -> Steps | None:
    """From a column to the next: by the file's columns where it numbers them, else by the differences within rings."""
    if rows.point is not None:
        return _numbered_step(rows, rows.point)
    # Rings of different frames are different rings: their columns need not be the same.
    return column_step(rows.azimuth_deg, rows.ring.astype(np.int64) + rows.frame.astype(np.int64) * 100_000)


def _numbered_step(rows: Labelled, point: IntArray) -> Steps | None:
    order = np.lexsort((point, rows.ring, rows.frame))
    columns = np.diff(point[order])
    same = (np.diff(rows.ring[order]) == 0) & (np.diff(rows.frame[order]) == 0) & (columns > 0)
    if np.count_nonzero(same) < 3:
        return None
    near = same & (columns <= np.median(columns[same]))
    turned = (np.diff(rows.azimuth_deg[order]) + 180.0) % 360.0 - 180.0
    step = float(np.median(turned[near] / columns[near]))
    if not step:
        return None
    error = abs(step)
    for _ in range(3):
        beyond = (rows.azimuth_deg - step * point + 180.0) % 360.0 - 180.0
        key = rows.ring.astype(np.int64) + rows.frame.astype(np.int64) * 100_000
        names, place = np.unique(key, return_inverse=True)
        middle = np.array([circular_median(part, 360.0) for part in _parts(beyond, place, len(names))])
        off = (beyond - middle[place] + 180.0) % 360.0 - 180.0
        use = np.abs(off) <= 10.0 * np.median(np.abs(off)) + 1e-9
        since = (point - point.mean())[use]
        square = float(np.sum(since**2))
        step += float(np.sum(since * off[use])) / square
        error = float(np.sqrt(np.mean(off[use] ** 2) / square))
    return Steps(abs(step), error)


def _parts(values: FloatArray, place: np.ndarray, count: int) -> list[FloatArray]:
    order = np.argsort(place, kind="stable")
    return np.split(values[order], np.cumsum(np.bincount(place, minlength=count))[:-1])


def _sense(rows: Labelled, turning: Turning | None) -> int:
    if rows.point is not None:
        order = np.lexsort((rows.point, rows.ring, rows.frame))
        same = (np.diff(rows.ring[order]) == 0) & (np.diff(rows.point[order]) > 0)
        turned = (np.diff(rows.azimuth_deg[order]) + 180.0) % 360.0 - 180.0
        return int(np.sign(np.median(turned[same]))) if same.any() else 0
    if turning is not None:
        return int(np.sign(turning.deg_per_s))
    return sense_of_rows(rows.azimuth_deg, rows.ring)


def _repeats(step: Steps | None, beside: Beside, rows: Labelled) -> bool | None:
    """Whether every frame has the same columns: by the frames' own, else by whether a turn has a whole number."""
    if step is None:
        return None
    if not step.whole:
        return False
    if rows.frames > 1:
        off = (beside.phase_deg - beside.phase_deg[0] + 0.5 * step.step_deg) % step.step_deg - 0.5 * step.step_deg
        return bool(np.max(np.abs(off)) <= _SAME_PHASE * step.step_deg)
    return True


def _ranges(rows: Labelled, forward: float, up: float) -> tuple[float, float | None]:
    """What RANGE is longer than the way from the beam's origin [m], and the step of the ranges."""
    away = np.hypot(rows.level_m - forward, rows.position[:, 2] - up)
    if rows.range_m is None:
        return 0.0, range_step_m(away, rows.error_m)
    offset = float(np.median(rows.range_m - away))
    return (offset if abs(offset) > 0.002 else 0.0), range_step_m(rows.range_m)


def _notes(others: Rings, rows: Labelled, step: Steps | None, sense: int, beside: Beside) -> tuple[str, ...]:
    notes = list(rows.notes)
    if len(others.number):
        names = ", ".join(str(number) for number in others.number[:12]) + (" ..." if len(others.number) > 12 else "")
        notes.append(f"no guess of ring {names}: fewer than 50 rows, or a spread above a tenth of the spacing")
    if step is None:
        notes.append("no step of the azimuth is common: the columns are not guessed")
    if not sense:
        notes.append("neither times nor the order of rows tell the sense of turning")
    if step is not None and not beside.whole_turns:
        notes.append("azimuths of rings beside their columns are known only but for whole steps: no time, no columns")
    azimuth = np.sort(rows.azimuth_deg)
    gap = float(np.max(np.diff(np.r_[azimuth, azimuth[0] + 360.0])))
    if gap > _AROUND_DEG:
        notes.append(f"the rows leave {gap:.0f} deg of the azimuth out: the turn beyond them is supposed")
    return tuple(notes)
