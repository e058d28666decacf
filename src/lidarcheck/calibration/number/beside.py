"""The beams beside bright targets, on any sensor: at what range their bloom would be seen, and how far they stand off.

An ideal scan and the model tell the light of every beam. The beams of every line with a bright beam are looked at, each
once for each target on its line; those that see the target itself, or another surface near its range, are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.calibration.number.frames import Frames
from lidarcheck.calibration.number.light import Keys, keys_of
from lidarcheck.effects.shared.blooming import Direction
from lidarcheck.errors import NotThereError
from lidarcheck.formats.lut import Axis
from lidarcheck.kpi.pairing import nearest_on_line
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import run_and_light
from lidarcheck.scan import IdealScan

__all__ = ["Beside", "beside_targets"]

_APART_M = 3.0
"""Bright beams farther apart than this in range are two targets, and a target may stand so far from its distance."""
_CLEAR = 2.0
"""A surface nearer than so many reaches to the target's range may take the bloom's echo."""


@dataclass(frozen=True)
class Beside:
    """Beams beside targets, a row each, shape (n,): frame, number of the beam, and of the target, by range.

    `at_m`: where the bloom is seen, as the line has it; `line`: a number for each line of each frame; `offset`: from
    the target's nearest beam in the table's units, upward or to the left.
    """

    frame: IndexArray
    key: Keys
    target: IndexArray
    at_m: FloatArray
    line: IndexArray
    offset: FloatArray

    def __len__(self) -> int:
        return len(self.key)

    def beams(self, frame: int) -> Keys:
        """The beams of a frame, ascending, each once."""
        return np.unique(self.key[self.frame == frame])


def beside_targets(
    data: Frames, bare: Model, axis: Axis, bright_signal: float, reach_m: float, *,
    distance_m: float | None = None, material: int | None = None,
) -> Beside:  # fmt: skip
    """Those of all frames. `bare`: the model without blooming; `reach_m`: how near to a surface an echo is its own.

    `NotThereError` where no target is bright, or none stands at `distance_m` or has the `material`.
    """
    bright = [_bright(data, i, bare, axis, bright_signal, material) for i in range(len(data.frames))]
    ranges = np.concatenate([one.at_m for one in bright])
    if not len(ranges):
        what = f"no beam of its ideal scan has S of {bright_signal:g} or more, from which light blooms"
        raise NotThereError(what, file=data.name, fix="is the target's material a retro-reflector in the model?")
    edges = _targets(ranges, distance_m, data.name)
    parts = [_beside(data, i, one, edges, reach_m) for i, one in enumerate(bright)]
    joined = {f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Beside)}
    if not len(joined["key"]):
        raise NotThereError("has no beam beside its target", file=data.name, fix="is the ideal scan cut to the target?")
    number = np.unique(np.column_stack([joined["frame"], joined["line"]]), axis=0, return_inverse=True)[1]
    return Beside(**{**joined, "line": number.ravel()})


@dataclass(frozen=True)
class _Bright:
    """The bright beams of a frame, (m,), in order of line and place, and all beams, (n,) with their rows."""

    line: IndexArray
    place: IndexArray
    at_m: FloatArray
    key: Keys
    along: Direction
    ideal: IdealScan


def _bright(data: Frames, i: int, bare: Model, axis: Axis, bright_signal: float, material: int | None) -> _Bright:
    ideal = data.frames[i].ideal
    if not ideal.beams.lattice:
        what = "is of a sensor whose beams have no neighbours by their numbers, so that no line blooms"
        raise NotThereError(what, file=data.name, fix="set blooming by hand in the model")
    run, light = run_and_light(ideal, bare, 0, data.frames[i].number, None, data.surfaces[i], 1, as_written=True)
    along = Direction.of(run.sensor, light.beams, vertical=axis == "vertical")
    row, beam = light.rows(), light.pulse_beam
    rows = np.maximum(row, 0)
    own = (run.ideal.layer[rows] == light.layer[beam]) & (run.ideal.point[rows] == light.point[beam])
    mine = (light.pulse_signal >= bright_signal) & (row >= 0) & own
    if material is not None:
        mine &= run.ideal.material_id[rows] == material
    beam, at_m = beam[mine], light.pulse_range_m[mine]
    line, place, inside = along.place(light.layer[beam], light.point[beam])
    order = np.flatnonzero(inside)[np.lexsort((place[inside], line[inside]))]
    key = keys_of(light.layer[beam], light.point[beam])
    return _Bright(line[order], place[order], at_m[order], key[order], along, run.ideal)


def _targets(ranges: FloatArray, distance_m: float | None, name: str) -> FloatArray:
    """The ends of the ranges of each target, shape (targets, 2): of all, or of the one at a distance."""
    ordered = np.sort(ranges)
    parts = np.split(ordered, np.flatnonzero(np.diff(ordered) > _APART_M) + 1)
    middles = [float(np.median(part)) for part in parts]
    kept = [p for p, at in zip(parts, middles, strict=True) if distance_m is None or abs(at - distance_m) <= _APART_M]
    if not kept:
        listed = ", ".join(f"{at:.1f}" for at in middles[:8])
        what = f"no bright target within {_APART_M:g} m of {distance_m:g} m; there are some at {listed} m"
        raise NotThereError(what, file=name, fix="name the distance of one of them")
    return np.array([(part[0], part[-1]) for part in kept])


def _beside(data: Frames, i: int, bright: _Bright, edges: FloatArray, reach_m: float) -> Beside:
    """The beams of one frame beside all targets."""
    fired = np.unique(keys_of(data.frames[i].ideal.layer, data.frames[i].ideal.point))
    line, place, inside = bright.along.place(fired >> 32, fired & 0xFFFFFFFF)
    fired, line, place = fired[inside], line[inside], place[inside]
    found: list[tuple[npt.NDArray[Any], ...]] = []
    for number, (low, high) in enumerate(edges):
        mine = np.flatnonzero((bright.at_m >= low) & (bright.at_m <= high))
        lines, which = np.unique(bright.line[mine], return_inverse=True)
        at_m = np.array([np.median(bright.at_m[mine][which == k]) for k in range(len(lines))])
        rows = np.flatnonzero(np.isin(line, lines))
        of_line = np.searchsorted(lines, line[rows])
        near = nearest_on_line(
            bright.line[mine], bright.place[mine].astype(np.float64), line[rows], place[rows].astype(np.float64)
        )
        offset = (place[rows] - bright.place[mine][near]) * bright.along.step
        clear = ~np.isin(fired[rows], bright.key[mine]) & ~_near(bright.ideal, fired[rows], at_m[of_line], reach_m)
        found.append((fired[rows][clear], np.full(int(clear.sum()), number), at_m[of_line][clear],
                      line[rows][clear], offset[clear]))  # fmt: skip
    key, target, at, of, off = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return Beside(np.full(len(key), i), key, target, at, of, off)


def _near(ideal: IdealScan, key: Keys, at_m: FloatArray, reach_m: float) -> BoolArray:
    """Whether a beam `key`, each once and ascending, meets a surface near a range, shape (n,)."""
    rows = keys_of(ideal.layer, ideal.point)
    at = np.minimum(np.searchsorted(key, rows), len(key) - 1)
    close = (key[at] == rows) & (ideal.distance_m > 0.0) & (np.abs(ideal.distance_m - at_m[at]) <= _CLEAR * reach_m)
    return np.isin(np.arange(len(key)), at[close])


def middles_m(beside: Beside) -> Sequence[float]:
    """The range of each target."""
    return [float(np.median(beside.at_m[beside.target == k])) for k in np.unique(beside.target)]
