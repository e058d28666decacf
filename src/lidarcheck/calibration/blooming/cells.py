"""A measured profile beam by beam: what was seen at the target's range over the offset, and what shone there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.calibration.blooming.response import FEATURES, GATE_M
from lidarcheck.calibration.blooming.target import STEP, BrightTarget, OwnLight, lines_and_places
from lidarcheck.errors import InputError
from lidarcheck.formats.lut import Axis
from lidarcheck.formats.settings import Setting
from lidarcheck.scan import Scan
from lidarcheck.sensor import Beams

__all__ = ["Cells", "Profile", "Sources", "cells_of_scan", "profile_of"]


class Sources(NamedTuple):
    """Bright beams of a line of beams: offsets from the centre [table units] and S, shape (m,)."""

    offset: FloatArray
    signal: FloatArray


@dataclass(frozen=True)
class Cells:
    """Beams about a target that see the same light, a row each. Shapes (n,), (n, 3) for `value`.

    `offset`: from the target's centre [SPAD rows or columns of 0.05 deg]. `beams`: how many were fired, 0 where that is
    not known; `echoes`: how many of them have one at the target's range. `value`: means of PEAK, AREA and WIDTH [ns]
    over those, NaN where not known. `range_m`: their mean range. `target`, `other`: S that a beam has of the target
    and of other surfaces at its range without any bloom. `sources`: the bright beams on each line, `line` which of
    those lines a cell is on. `left_out`: beams near a surface close to the target's range. `setting`: the one that
    said where the target is, None where none did. `within`: where in a bin the target's light comes (`response_of`).
    """

    name: str
    axis: Axis
    distance_m: float
    offset: FloatArray
    beams: IndexArray
    echoes: IndexArray
    value: FloatArray
    range_m: FloatArray
    target: FloatArray
    other: FloatArray
    line: IndexArray
    sources: tuple[Sources, ...]
    left_out: int = 0
    setting: Setting | None = None
    within: tuple[float, ...] = ()

    def __len__(self) -> int:
        return len(self.offset)

    def take(self, rows: BoolArray) -> Cells:
        """The cells picked by a mask."""
        names = ("offset", "beams", "echoes", "value", "range_m", "target", "other", "line")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})

    @property
    def bloom(self) -> BoolArray:
        """Cells beside the target that have echoes."""
        return np.asarray((self.target == 0.0) & (self.echoes > 0))

    @property
    def extent(self) -> tuple[float, float]:
        """Offsets of the target's outermost bright beams."""
        offsets = np.concatenate([source.offset for source in self.sources])
        return float(offsets.min()), float(offsets.max())


@dataclass(frozen=True)
class Profile:
    """Means over the offset from the target; `value` (n, 3) of PEAK, AREA and WIDTH, NaN where there is no echo."""

    offset: FloatArray
    range_m: FloatArray
    value: FloatArray
    echoes: IndexArray
    on_target: BoolArray


def profile_of(cells: Cells) -> Profile:
    """One row for each offset, lines of beams together, weighted by echoes."""
    offset, where = np.unique(np.round(cells.offset, 6), return_inverse=True)
    n = len(offset)
    echoes = np.bincount(where, weights=cells.echoes, minlength=n)
    on_target = np.bincount(where, weights=cells.target > 0.0, minlength=n) > 0.0
    columns = [cells.range_m, *cells.value.T]
    means = [_mean(where, column, cells.echoes, n) for column in columns]
    return Profile(offset, means[0], np.column_stack(means[1:]), echoes.astype(np.int64), on_target)


def _mean(where: IndexArray, value: FloatArray, weight: IndexArray, n: int) -> FloatArray:
    known = np.isfinite(value)
    total = np.bincount(where[known], weights=(weight * value)[known], minlength=n)
    count = np.bincount(where[known], weights=weight[known], minlength=n)
    return np.asarray(np.divide(total, count, out=np.full(n, np.nan), where=count > 0))


def cells_of_scan(
    scan: Scan, target: BrightTarget, axis: Axis, *, own: OwnLight | None = None, name: str = "the scan"
) -> Cells:
    """The cells on the target's lines. Beams are those of `own`, the ideal scan's; else all within the scan's bounds.

    Beams that see the same light go together. `InputError`: the target reaches the end of the field of view or of the
    scan, so that a part of its light is not known; or the scan has no echo where the ideal scan has the target.
    """
    lines = np.unique(target.line)
    fired = own or _fired(scan, target, axis, lines)
    _check_field(target, fired, scan.beams, axis, name, from_ideal=own is not None)
    own = fired
    keep = ~own.left_out
    echo = _echo_of_beam(scan, target, axis, own)
    if not np.any((echo >= 0) & (own.target > 0.0)):
        what = f"no echo on the target that the ideal scan shows at {target.distance_m:.1f} m"
        raise InputError(what, file=name, fix="do the scan and the ideal scan belong together?")
    sources, which = _sources(target, lines, axis)
    line = which[np.searchsorted(lines, own.line)]
    faint = np.round(np.log10(np.maximum(own.other, 1e-6)), 1)
    edge = np.round(np.log10(np.maximum(own.target, 1e-6)), 1)
    key = np.column_stack([line, own.place, faint, edge])[keep]
    first, cell = np.unique(key, axis=0, return_index=True, return_inverse=True)[1:]
    n, cell = len(first), cell.ravel()
    found = echo[keep] >= 0
    beams = np.bincount(cell, minlength=n)
    echoes = np.bincount(cell[found], minlength=n)
    row = echo[keep][found]

    def mean(values: FloatArray) -> FloatArray:
        total = np.bincount(cell[found], weights=values[row], minlength=n)
        return np.asarray(np.divide(total, echoes, out=np.full(n, np.nan), where=echoes > 0))

    def of_beams(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(cell, weights=values[keep], minlength=n) / np.maximum(beams, 1))

    return Cells(
        name, axis, target.distance_m,
        offset=np.asarray(STEP[axis] * (own.place[keep][first] - target.center), dtype=np.float64),
        beams=beams, echoes=echoes,
        value=np.column_stack([mean(scan.peak), mean(scan.area), mean(scan.width_ns)]).reshape(n, len(FEATURES)),
        range_m=mean(scan.range_m),
        target=of_beams(own.target), other=of_beams(own.other), line=line[keep][first].astype(np.int64),
        sources=sources, left_out=int(own.left_out.sum()), setting=target.setting, within=target.within,
    )  # fmt: skip


def _fired(scan: Scan, target: BrightTarget, axis: Axis, lines: npt.NDArray[np.int32]) -> OwnLight:
    """All beams of the lines within the scan's bounds, with the target's light where it saturates."""
    _, places = lines_and_places(scan, axis)
    low, high = int(places.min()), int(places.max())
    line = np.repeat(lines, high - low + 1)
    place = np.tile(np.arange(low, high + 1, dtype=np.int32), len(lines))
    light = np.zeros(len(line))
    light[np.searchsorted(lines, target.line) * (high - low + 1) + target.place - low] = target.signal
    return OwnLight(line, place, light, np.zeros(len(line)), np.zeros(len(line), dtype=bool))


def _check_field(target: BrightTarget, own: OwnLight, beams: Beams, axis: Axis, name: str, *, from_ideal: bool) -> None:
    """Refuse a target at the first or last beam that was fired; `from_ideal`: found by an ideal scan."""
    low, high = int(own.place.min()), int(own.place.max())
    at_end = (target.place <= low) | (target.place >= high)
    if np.any(at_end):
        unit = "layers" if axis == "vertical" else "points"
        most = (beams.layers if axis == "vertical" else beams.points) - 1
        end = "the field of view" if (low, high) == (0, most) else "the scan"
        what = (
            f"the target is cut by the end of {end}: it covers {unit} {target.place.min()} to {target.place.max()} "
            f"of {low} to {high}"
        )
        fix = "use a frame in which all of it is seen; the light of the rest would be missing"
        if not from_ideal:
            fix += "; where nothing beside it echoes, --ideal says which beams were fired"
        raise InputError(what, file=name, fix=fix)


def _echo_of_beam(scan: Scan, target: BrightTarget, axis: Axis, own: OwnLight) -> IndexArray:
    """The row of the strongest echo of each beam at the target's range, -1 for none."""
    lines, places = lines_and_places(scan, axis)
    near = np.flatnonzero((np.abs(scan.range_m - target.distance_m) <= GATE_M) & np.isin(lines, own.line))
    near = near[np.argsort(scan.area[near], kind="stable")]
    span = int(max(own.place.max(), places[near].max(initial=0))) + 1
    table = np.full((int(own.line.max()) + 1) * span, -1, dtype=np.int64)
    table[lines[near].astype(np.int64) * span + places[near]] = near
    return np.asarray(table[own.line.astype(np.int64) * span + own.place])


def _sources(target: BrightTarget, lines: npt.NDArray[np.int32], axis: Axis) -> tuple[tuple[Sources, ...], IndexArray]:
    """The distinct patterns of bright beams, and which of them each line has, shape (lines,)."""
    patterns: dict[tuple[bytes, bytes], int] = {}
    found: list[list[Sources]] = []
    which = np.empty(len(lines), dtype=np.int64)
    for i, line in enumerate(lines):
        on = target.line == line
        offset = STEP[axis] * (target.place[on] - target.center)
        signal = target.signal[on]
        key = (offset.tobytes(), np.round(np.log10(signal), 2).tobytes())
        which[i] = patterns.setdefault(key, len(patterns))
        if which[i] == len(found):
            found.append([])
        found[which[i]].append(Sources(offset, signal))
    merged = (Sources(alike[0].offset, np.mean([s.signal for s in alike], axis=0)) for alike in found)
    return tuple(merged), which
