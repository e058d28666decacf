"""What a row of a scan is: an echo, a beam that had none, or a copy; and which echo of its beam."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.beams import Fired
from lidarcheck.formats.table import Table

__all__ = ["Beams", "Numbering", "fired_of", "no_returns", "numbered"]

Column = npt.NDArray[Any]
Mask = npt.NDArray[np.bool_]

RETURN_FLAGS = {"valid": 0, "is_valid": 0, "invalid": 1, "is_invalid": 1, "no_return": 1}
"""Columns that mark rows without a return, in lower case, and the value that does."""

COPY_M = 0.005
"""Copies of an echo lie no farther apart than half of the 1 cm to which the range is rounded."""


def no_returns(table: Table) -> Mask | None:
    """The rows that are no echo but say that their beam had none, shape (n,); None where there is no such row.

    X, Y, Z are all 0 or one of them is not finite, RANGE is 0 or not finite, or a flag says so.
    """
    axes = [column for column in (table.get(name) for name in "XYZ") if column is not None]
    found = [~np.isfinite(axis) for axis in axes if axis.dtype.kind == "f" and not np.isfinite(axis).all()]
    if len(axes) == 3:
        zero = axes[0] == 0
        if zero.any():
            found.append(zero & (axes[1] == 0) & (axes[2] == 0))
    range_m = table.get("RANGE")
    if range_m is not None:
        found.append((range_m == 0) | ~np.isfinite(range_m))
    for name, value in RETURN_FLAGS.items():
        flag = table.get(name)
        if flag is not None and bool(np.isin(flag, (0, 1)).all()):
            found.append(flag == value)
    empty: Mask | None = np.logical_or.reduce(found) if found else None
    return empty if empty is not None and empty.any() else None


@dataclass(frozen=True)
class Beams:
    """The beams of a table's echoes: `layer`, `point`, `frame` (None: one frame); shape (n,).

    `told`: the file says which beams they are. Else they are the cells of a grid that its own beams need not share:
    several beams may fall into one, and -1 is none.
    """

    layer: IntArray
    point: IntArray
    frame: Column | None
    told: bool


@dataclass(frozen=True)
class Numbering:
    """Which echo of its beam each row is, shape (n,), from 1; `kept`: the rows that are no copies, None for all.

    `renumbered`: beams whose numbers were others in the file. `twins` (n,): rows of which there is a copy, None where
    there is none.
    """

    number: IntArray
    kept: Mask | None = None
    renumbered: int = 0
    copies: int = 0
    twins: Mask | None = None


def numbered(
    beams: Beams,
    written: Column | None,
    apart: Sequence[Column],
    xyz: Sequence[Column],
    features: Sequence[Column],
) -> Numbering:
    """Number the echoes of each beam by range, from 1, and find copies.

    `written`: the numbers in the file, None where it has none. `apart`: columns of which a copy differs in one, the
    sensor's own numbers and kinds. It is an echo of the same beam and frame, at the same range, with the same features;
    where the file has no numbers it may also stand beside the first in the order of rows. Where beams are not told,
    numbers stay as they are, raised by 1 where a place's numbers begin at 0, and a copy has exactly the same position.
    """
    n = len(beams.layer)
    key = beams.layer.astype(np.int64) * 2**32 + beams.point
    if _in_order(beams, key, written) or (not beams.told and _no_twins(written, apart, xyz)):
        return Numbering(np.ones(n, dtype=np.int32))
    if beams.told and beams.frame is None and written is not None:
        simple = _already_numbered(key, written, xyz)
        if simple is not None:
            return simple
    if not beams.told:
        key = np.where(beams.layer < 0, -1 - np.arange(n), key)
    return _numbered_anew(beams, key, written, apart, xyz, features)


def _in_order(beams: Beams, key: npt.NDArray[np.int64], written: Column | None) -> bool:
    """Whether it shows at a glance that each beam has one echo, with the number 1 or none."""
    if written is not None and not bool((written == 1).all()):
        return False
    if bool((key[1:] > key[:-1]).all()):
        return True
    across = beams.point.astype(np.int64) * 2**32 + beams.layer
    return bool((across[1:] > across[:-1]).all())


def _no_twins(written: Column | None, apart: Sequence[Column], xyz: Sequence[Column]) -> bool:
    """Whether rows whose beams nobody tells are echoes without number or numbered 1, none twice in a row."""
    if any(bool((column != column[0]).any()) for column in apart if len(column)):
        return False
    if written is not None and not bool((written == 1).all()):
        return False
    twice = np.flatnonzero(xyz[0][1:] == xyz[0][:-1])
    return written is not None or not any(all(axis[i] == axis[i + 1] for axis in xyz) for i in twice)


def _already_numbered(key: npt.NDArray[np.int64], written: Column, xyz: Sequence[Column]) -> Numbering | None:
    """The numbers as written, where each beam's rows follow each other, numbered from 1 in order of range."""
    if not bool((key[1:] >= key[:-1]).all()) or written.min() < 1:
        return None
    same = np.flatnonzero(key[1:] == key[:-1])
    firsts = len(key) - len(same)
    if np.count_nonzero(written == 1) != firsts or not bool((written[same + 1] == written[same] + 1).all()):
        return None
    near, far = (np.sqrt(sum(np.square(axis[at], dtype=np.float64) for axis in xyz)) for at in (same, same + 1))
    return None if bool((far - near <= COPY_M).any()) else Numbering(written.astype(np.int32, copy=False))


def _numbered_anew(
    beams: Beams,
    key: npt.NDArray[np.int64],
    written: Column | None,
    apart: Sequence[Column],
    xyz: Sequence[Column],
    features: Sequence[Column],
) -> Numbering:
    range_m = np.sqrt(sum(np.square(axis, dtype=np.float64) for axis in xyz))
    as_written = np.zeros(len(key)) if written is None else np.nan_to_num(written, nan=0.0)
    frame = np.zeros(len(key)) if beams.frame is None else beams.frame
    order = np.lexsort((as_written, range_m, key, frame))
    same = (np.diff(key[order]) == 0) & (np.diff(frame[order]) == 0)
    equal = features if beams.told else [*features, *xyz]
    copy = _copies(order, same, range_m, equal, apart, beside=written is None)
    kept = np.ones(len(key), dtype=np.bool_)
    kept[order[1:][copy]] = False
    twins = np.zeros(len(key), dtype=np.bool_)
    twins[order[:-1][copy]] = True
    number = _ranks(order, same, kept) if beams.told else _raised(order, same, as_written, written is None)
    beam = np.empty(len(key), dtype=np.int64)
    beam[order] = np.cumsum(np.r_[True, ~same])[: len(key)]
    odd = kept & (number != as_written)
    return Numbering(
        number=number,
        kept=None if kept.all() else kept,
        renumbered=0 if written is None else len(np.unique(beam[odd])),
        copies=int(np.count_nonzero(~kept)),
        twins=twins if twins.any() else None,
    )


def _copies(
    order: npt.NDArray[np.intp],
    same: Mask,
    range_m: FloatArray,
    equal: Sequence[Column],
    apart: Sequence[Column],
    *,
    beside: bool,
) -> Mask:
    """Which rows, in that order and without its first, are copies of the one before them.

    `beside`: rows that stand beside each other may be copies, too.
    """
    at = np.flatnonzero(same)
    one, other = order[at], order[at + 1]
    copy = range_m[other] - range_m[one] <= COPY_M
    for column in equal:
        copy &= (column[one] == column[other]) | ((column[one] != column[one]) & (column[other] != column[other]))
    other_one = (np.abs(other - one) == 1) & beside
    for column in apart:
        other_one |= column[one] != column[other]
    copy &= other_one
    found = np.zeros(len(same), dtype=np.bool_)
    found[at[copy]] = True
    return found


def _ranks(order: npt.NDArray[np.intp], same: Mask, kept: Mask) -> IntArray:
    """Place of each kept row within its beam, from 1, in that order."""
    count = np.cumsum(kept[order])
    first = np.r_[True, ~same][: len(order)]
    before = np.maximum.accumulate(np.where(first, count - kept[order], 0))
    number = np.empty(len(order), dtype=np.int32)
    number[order] = count - before
    return number


def _raised(order: npt.NDArray[np.intp], same: Mask, written: FloatArray, none: bool) -> IntArray:
    """The numbers as written, raised by 1 at places where the least is 0; 1 where there are none."""
    if none or not len(order):
        return np.ones(len(order), dtype=np.int32)
    starts = np.flatnonzero(np.r_[True, ~same])
    least = np.minimum.reduceat(written[order], starts)
    raised = np.empty(len(order), dtype=np.int32)
    raised[order] = written[order] + np.repeat(least == 0, np.diff(np.r_[starts, len(order)]))
    return raised


def fired_of(echoes: Beams, empty: Beams) -> Fired | None:
    """The beams that were fired, where a file has a row for each of them, with an echo or without; else None.

    It has, where each column of a frame has a row for every layer; only the first and the last column may be cut off. A
    hole anywhere else is a beam that the file leaves out: a few rows without a return tell nothing of the others then.
    Both of one file, so that both have frames or none has.
    """
    layer = np.concatenate([echoes.layer, empty.layer])
    point = np.concatenate([echoes.point, empty.point])
    frames = [part.frame for part in (echoes, empty) if part.frame is not None]
    frame = np.concatenate(frames) if len(frames) == 2 else np.zeros(len(layer), dtype=np.int64)
    order = np.lexsort((layer, point, frame))
    layer, point, frame = layer[order], point[order], frame[order]
    once = np.r_[True, (np.diff(layer) != 0) | (np.diff(point) != 0) | (np.diff(frame) != 0)][: len(order)]
    layer, point, frame = layer[once], point[once], frame[once]
    ends = [*np.flatnonzero(np.diff(frame)) + 1, len(frame)]
    if not all(_has_all(layer[a:b], point[a:b]) for a, b in itertools.pairwise([0, *ends])):
        return None
    return Fired(layer, point, frame if len(frames) == 2 else None)


def _has_all(layer: IntArray, point: IntArray) -> bool:
    """Whether these beams of one frame, ascending in (point, layer), have no hole but at the first and last column."""
    _, beams = np.unique(point, return_counts=True)
    within = beams[1:-1] if len(beams) > 2 else beams
    return bool((within == len(np.unique(layer))).all())
