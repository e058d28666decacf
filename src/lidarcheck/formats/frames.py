"""Which rows of a file belong to which frame.

A measured scan is one frame, unless a column `Frame` (`frame_id`, `FrameNumber`) or repeats of one beam's echo say
more. Frames are told apart by that column, then by time, then by the places in the order of rows that separate all
repeats. Without echo numbers two whole passes through the columns, in the order of rows, are two frames. An ideal scan
has several frames only by that column: its repeats are parts of one beam's light.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lidarcheck.arrays import BoolArray, IndexArray
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.columns import INT32_MAX, found_columns, missing
from lidarcheck.formats.frame_cuts import Repeats, cuts_of, in_order, repeats_of
from lidarcheck.formats.frame_passes import passes_of, unnumbered_repeats
from lidarcheck.formats.ideals import is_ideal
from lidarcheck.formats.returns import no_returns
from lidarcheck.formats.semantic_ply import is_semantic
from lidarcheck.formats.table import Table
from lidarcheck.formats.times import FRAME_COLUMNS, TIME_COLUMNS

__all__ = ["Frames", "SeveralFrames", "frames_of", "one_frame", "split_command"]

BEAM_COLUMNS = ("Layer", "Point")
RETURN_COLUMNS = ("EchoNumber", "ReturnType", "return_type")
"""What tells rows of one beam apart within a frame."""
WAYS = ("frame", "time", "order")


class SeveralFrames(InputError):
    """A file holds several frames where one is wanted, or frames that nothing tells apart."""


@dataclass(frozen=True, eq=False)
class Frames:
    """The frames of a table. `rows`: of each frame, ascending; None stands for all rows of the only one.

    `way`: one of `WAYS`, or empty of a single frame that nothing divides. `column`: whose values tell the frames apart,
    empty where the order of the rows does. `values`: that column's value of each frame, of times the first.
    """

    rows: tuple[IndexArray | None, ...] = (None,)
    way: str = ""
    column: str = ""
    values: tuple[float, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def how(self) -> str:
        """How they were told apart, in words."""
        return {"frame": f"by the column {self.column}", "time": f"by the times in {self.column}"}.get(
            self.way, "by the order of the rows"
        )

    def take(self, table: Table, number: int) -> Table:
        """A frame's rows, from 0."""
        rows = self.rows[number]
        return table if rows is None else table.take(rows)

    def labels(self) -> list[int]:
        """A whole number for each frame: the column's own, where it holds frames' numbers, else counted from 0."""
        if self.way == "frame" and all(value == int(value) >= 0 for value in self.values):
            return [int(value) for value in self.values]
        return list(range(len(self)))


def frames_of(table: Table, by: str | None = None) -> Frames:
    """The frames of a table's rows. `by`: `frame`, `time`, `order` or a column's name, in the place of the first that
    tells them apart.

    `InputError` where rows repeat and nothing tells the frames apart, or not what `by` names.
    """
    if by is not None and by not in WAYS:
        return _by_column(table, _named(table, by))
    column = next((own for name in FRAME_COLUMNS if (own := table.spelling(name))), None)
    if by == "frame" and column is None:
        raise InputError(f"has no column Frame{found_columns(table)}", file=table.path, fix="name a column with --by")
    if column is not None and by in (None, "frame"):
        found = _by_column(table, column)
        if len(found) > 1 or by == "frame":
            return found
    if is_semantic(table) or is_ideal(table):
        if by in ("time", "order"):
            what = "is an ideal scan, whose frames only a column Frame tells apart"
            raise InputError(what, file=table.path, fix="leave out --by, or name its column")
        return Frames()
    return _by_repeats(table, by)


def one_frame(table: Table) -> Table:
    """The table itself, if it holds one frame; else `InputError` with the command that splits it."""
    found = frames_of(table)
    if len(found) > 1:
        what = f"holds {len(found)} frames, told apart {found.how}, where one is wanted"
        raise SeveralFrames(what, file=table.path, fix=f"split it: {split_command(table.path)}")
    return table


def split_command(path: str | os.PathLike[str] | None, by: str = "") -> str:
    """The command that writes a file's frames into files of their own."""
    file = Path(path or "FILE")
    words = ["lidarcheck", "split", str(file), "--out", str(file.with_name(f"{file.stem}_frames"))]
    return " ".join(shlex.quote(word) for word in words) + (f" --by {by}" if by else "")


def _named(table: Table, name: str) -> str:
    own = table.spelling(name)
    if own is None:
        raise UsageError(
            f"{table.path}: --by {name} is no column{found_columns(table)}", fix="use frame, time, order or a column"
        )
    return own


def _by_column(table: Table, name: str) -> Frames:
    """Frames by a column's values, ascending."""
    column = table.columns[name]
    if not len(column) or bool((column == column[0]).all()):
        return Frames(way="frame", column=name, values=tuple(column[:1].tolist()))
    if column.dtype.kind == "f" and not np.isfinite(column).all():
        row = int(np.flatnonzero(~np.isfinite(column))[0])
        raise table.fault(f"{name} is {column[row]}", row=row, fix="every row belongs to a frame: give its number")
    values, frame = np.unique(column, return_inverse=True)
    order = np.argsort(frame, kind="stable")
    starts = np.searchsorted(frame[order], np.arange(1, len(values)))
    return Frames(tuple(np.split(order, starts)), "frame", name, tuple(values.tolist()))


def _by_repeats(table: Table, by: str | None) -> Frames:
    """Frames by time or by the order of the rows, where beams stand in the table more than once."""
    named = [table.columns[own] for own in _spelled(table, (*BEAM_COLUMNS, *RETURN_COLUMNS))]
    if not missing(table, BEAM_COLUMNS) and in_order(*named):
        return Frames()
    beams = _whole(table, BEAM_COLUMNS)
    if beams is None or len(beams) < len(BEAM_COLUMNS):
        if by is not None:
            what = f"has no Layer and Point, by whose repeats frames are told apart{found_columns(table)}"
            raise InputError(what, file=table.path, fix="name a column that tells them apart with --by")
        return Frames()
    returns = _whole(table, RETURN_COLUMNS, unknown=0) or []
    key = _key([*beams, *returns])
    if not _repeats(key):
        return Frames()
    if not returns:
        return _unnumbered(table, beams, key, by)
    repeats, copies = repeats_of(key), _copies(table, key)
    empty = no_returns(table)
    if empty is not None:  # of a beam without any return, each of its rows says so
        copies = copies | empty
    repeats.previous[copies] = -1
    if not (repeats.previous >= 0).any():
        return Frames()
    found = None if by == "order" else _by_time(table, key, beams, copies)
    if found is None and by != "time":
        found = _cut(np.arange(len(key)), cuts_of(repeats, [key, *beams[::-1]]))
    if found is None:
        raise _not_told_apart(table, repeats, by)
    return found


def _unnumbered(table: Table, beams: Sequence[IndexArray], key: IndexArray, by: str | None) -> Frames:
    """Frames of rows without echo numbers, in which one beam's echoes may stand beside each other."""
    found = None if by == "order" else _by_time(table, key, beams)
    if found is None and by != "time":
        found = _cut(np.arange(len(key)), passes_of(*beams))
    if found is not None:
        return found
    repeats = unnumbered_repeats(table, key)
    if by is None and repeats is None:
        return Frames()
    raise _not_told_apart(table, repeats or repeats_of(key), by)


def _by_time(
    table: Table, key: IndexArray, beams: Sequence[IndexArray], copies: BoolArray | None = None
) -> Frames | None:
    """Frames by the first column of times that separates all repeats.

    `copies` (n,): rows that are no repeats; without it no row is that repeats a beam at the same time.
    """
    for name in TIME_COLUMNS:
        time = table.get(name)
        if time is None or not np.isfinite(time).all() or bool((time == time[0]).all()):
            continue
        order = np.argsort(time, kind="stable")
        sorted_time = time[order]
        later = np.concatenate([[False], sorted_time[1:] != sorted_time[:-1]])
        repeats = repeats_of(key[order])
        same_time = (repeats.previous >= 0) & (sorted_time[repeats.previous] == sorted_time)
        repeats.previous[same_time if copies is None else copies[order]] = -1
        if not (repeats.previous >= 0).any():
            continue
        cuts = cuts_of(repeats, [beam[order] for beam in beams[::-1]], later)
        if (found := _cut(order, cuts)) is not None:
            first = tuple(time[rows].min().item() for rows in found.rows if rows is not None)
            return Frames(found.rows, "time", table.spelling(name) or name, first)
    return None


def _cut(order: IndexArray, cuts: IndexArray | None) -> Frames | None:
    if cuts is None or not len(cuts):
        return None
    return Frames(tuple(np.sort(part) for part in np.split(order, cuts)), "order")


def _whole(table: Table, names: Sequence[str], unknown: float = np.nan) -> list[IndexArray] | None:
    """Those of the columns that are there, as 64-bit whole numbers from 0; None where one holds others, which is for
    the reader to say. `unknown`: what stands for NaN.
    """
    found = []
    for name in names:
        column = table.get(name)
        if column is None:
            continue
        if column.dtype.kind == "f" and np.isnan(column).any():
            column = np.where(np.isnan(column), unknown, column)
        # NaN compares false, too.
        if len(column) and not (column.min() >= 0 and column.max() <= INT32_MAX):
            return None
        if column.dtype.kind == "f" and not (column == np.rint(column)).all():
            return None
        found.append(column.astype(np.int64, copy=False))
    return found


def _key(columns: Sequence[IndexArray]) -> IndexArray:
    """A number for each row, ascending with the columns, the first one slowest; equal where all of them are."""
    key, *others = columns
    for column in others:
        low = int(column.min(initial=0))
        key = key * (int(column.max(initial=0)) - low + 1)
        key += column
    return key


def _repeats(key: IndexArray) -> bool:
    """Whether any key stands there twice."""
    low, high = int(key.min()), int(key.max())
    if high - low > 64 * len(key) + 1_000_000:
        return len(np.unique(key)) < len(key)
    seen = np.zeros(high - low + 1, dtype=np.bool_)
    seen[key - low] = True
    return int(np.count_nonzero(seen)) < len(key)


def _copies(table: Table, key: IndexArray) -> BoolArray:
    """Rows that stand beside a twin that they equal in every column, shape (n,): no two measurements do."""
    rows = np.flatnonzero(key[1:] == key[:-1]) + 1
    for column in table.columns.values():
        rows = rows[column[rows] == column[rows - 1]]
    copies = np.zeros(len(key), dtype=np.bool_)
    copies[rows] = True
    return copies


def _not_told_apart(table: Table, repeats: Repeats, by: str | None) -> SeveralFrames:
    row = int(np.flatnonzero(repeats.previous >= 0)[0])
    first = int(repeats.previous[row])
    words: list[Any] = [f"{name.lower()} {table.columns[name][row]:g}" for name in _spelled(table, BEAM_COLUMNS)]
    words += [f"{name} {table.columns[name][row]:g}" for name in _spelled(table, RETURN_COLUMNS)]
    before = table.line_of(first)
    where = f"row {first + 1}" if before is None else f"line {before}"
    told = {None: "neither a column Frame, nor a time, nor the order of the rows tells", "time": "no time tells"}
    what = f"{', '.join(words)} stands here again after {where}: these are several frames, and "
    what += f"{told.get(by, 'the order of the rows does not tell')} them apart"
    fix = f"name a column that does: {split_command(table.path, 'COLUMN')}"
    fault = table.fault(what, row=row, fix=fix)
    return SeveralFrames(fault.what, file=fault.file, line=fault.line, fix=fix)


def _spelled(table: Table, names: Sequence[str]) -> list[str]:
    return [own for name in names if (own := table.spelling(name))]
