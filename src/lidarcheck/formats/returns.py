"""What a row of a scan is: an echo, a beam that had none, or a copy; which echo of its beam, and of which kind.

Sources of the return kinds: `tier4/nebula` (names and numbers), `valgur/velodyne_decoder` (`types.h`), Livox SDK
(`tag`), Hesai user manuals (return mode).
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.formats.table import Table
from lidarcheck.scan import Fired

__all__ = [
    "RETURN_KINDS",
    "Beams",
    "Numbering",
    "fired_of",
    "kinds_by_range",
    "livox_numbers",
    "no_returns",
    "numbered",
    "return_kinds",
]

Column = npt.NDArray[Any]
Mask = npt.NDArray[np.bool_]

RETURN_KINDS = {
    "unknown": 0,
    "last": 1,
    "first": 2,
    "strongest": 3,
    "first weak": 4,
    "last weak": 5,
    "identical": 6,
    "second": 7,
    "second strongest": 8,
    "first strongest": 9,
    "last strongest": 10,
}
"""The numbers that the column `ReturnType` holds."""

RETURN_FLAGS = {"valid": 0, "is_valid": 0, "invalid": 1, "is_invalid": 1, "no_return": 1}
"""Columns that mark rows without a return, in lower case, and the value that does."""

COPY_M = 0.005
"""Copies of an echo lie no farther apart than half of the 1 cm to which the range is rounded."""

_VELODYNE = {1: "strongest", 2: "last", 3: "last strongest"}
_LIVOX_SIGNS = ("line", "offset_time", "slot id", "lidar_id")
_HESAI_ONE = {0x37: "strongest", 0x38: "last"}
_HESAI_TWO = {0x39: ("strongest", "last"), 0x3B: ("first", "last"), 0x3C: ("first", "strongest")}
"""Two returns in order of range. What is strongest and not last lies nearer than the last, and so on."""
_HESAI_STRONGEST_TWO = 0x3E  # and the second strongest: in no order of range


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


def livox_numbers(columns: Mapping[str, Column]) -> Column | None:
    """Return numbers, from 1, out of a Livox `tag`, bits 4 and 5; None where there is none or it says nothing."""
    by_name = {name.casefold(): column for name, column in columns.items()}
    tag = by_name.get("tag")
    if tag is None or tag.dtype.kind not in "iu" or not any(name in by_name for name in _LIVOX_SIGNS):
        return None
    number = tag.astype(np.int64) >> 4 & 3
    return (number + 1).astype(np.int32) if number.any() else None


def return_kinds(columns: Mapping[str, Column]) -> IntArray | None:
    """What the sensor calls each return, as numbers of `RETURN_KINDS`, shape (n,); None where no column says it.

    Of two returns of a Hesai it is unknown; `kinds_by_range` tells them apart.
    """
    by_name = {name.casefold(): column for name, column in columns.items()}
    kind = by_name.get("return_type")
    if "returntype" in by_name:
        return by_name["returntype"].astype(np.int32) if by_name["returntype"].dtype.kind in "iu" else None
    livox = livox_numbers(columns)
    if livox is not None:
        return _coded(livox, {1: "first", 2: "second"})
    if kind is not None and kind.dtype.kind in "iu":
        if "channel" in by_name or "time_stamp" in by_name:  # nebula's own points
            return np.where((kind >= 0) & (kind <= max(RETURN_KINDS.values())), kind, 0).astype(np.int32)
        if "ring" in by_name and "column" in by_name:  # velodyne_decoder's
            return _coded(kind, _VELODYNE)
    mode = _hesai_mode(columns)
    return None if mode is None else _coded(mode, _HESAI_ONE)


def _coded(codes: Column, names: Mapping[int, str]) -> IntArray:
    kinds = np.zeros(len(codes), dtype=np.int32)
    for code, name in names.items():
        kinds[codes == code] = RETURN_KINDS[name]
    return kinds


def _hesai_mode(columns: Mapping[str, Column]) -> Column | None:
    """A Hesai's return mode, where the column holds its modes alone."""
    mode = next((column for name, column in columns.items() if name.casefold() == "return_mode"), None)
    known = (*_HESAI_ONE, *_HESAI_TWO, _HESAI_STRONGEST_TWO)
    return mode if mode is not None and mode.dtype.kind in "iu" and bool(np.isin(mode, known).all()) else None


def kinds_by_range(kinds: IntArray, columns: Mapping[str, Column], beams: Beams, numbering: Numbering) -> IntArray:
    """The kinds, shape (n,); of a Hesai's beam with two echoes by which of them is nearer."""
    mode = _hesai_mode(columns)
    if mode is None or not beams.told:
        return kinds
    kept = np.ones(len(kinds), dtype=np.bool_) if numbering.kept is None else numbering.kept
    keys = [beams.layer, beams.point, *([] if beams.frame is None else [beams.frame])]
    order = np.lexsort((numbering.number, *keys))
    order = order[kept[order]]
    count = np.diff(np.r_[np.flatnonzero(numbering.number[order] == 1), len(order)])
    two = np.zeros(len(kinds), dtype=np.bool_)
    two[order] = np.repeat(count == 2, count)
    kinds = kinds.copy()
    for code, names in _HESAI_TWO.items():
        for place, name in enumerate(names, start=1):
            kinds[two & (mode == code) & (numbering.number == place)] = RETURN_KINDS[name]
    return kinds


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
