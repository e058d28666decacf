"""Whether measured frames belong to their ideal scans and to the model: said before anything is fitted to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.cases.frame import Frame
from lidarcheck.cases.same_scene import RANGE_STEP_M, SceneFinding, Surfaces, compare_scenes
from lidarcheck.errors import InputError
from lidarcheck.kpi.pairing import beam_keys, nearest_on_line
from lidarcheck.kpi.variant import above_saturation
from lidarcheck.model.chain import simulate_frames
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Scan

__all__ = ["compared_scene", "frame_fault", "swapped"]


NEAR_M, NEAR_SHARE = 2.0, 0.1
"""An echo nearer to a surface of its beam than either of these comes from it, whatever effect moved it."""
FEWEST_NEAR, MOST_BEHIND = 0.25, 0.25
"""Of the beams that meet something and have echoes, where fewer have one near it and more have one behind it, the scene
is another. In dense fog hardly any have one near, but what is there comes from before the surface."""
SAME_M, OTHER_M, OFFSET_M = 0.15, 0.5, 5.0
"""Echoes scatter so little about those of a simulation; surfaces so far apart are different; no offset is larger."""
FEWEST_VOTES, VOTES_SHARE, VOTES_RATIO = 20, 0.4, 2.5
"""Another frame's surfaces fit better where so many echoes lie on them, that share of those that could, and so many
times as many as on their own."""
COMPARED_ECHOES = 2_000_000
"""Echoes that are compared over all pairs of frames, at most."""
CUT_SHARE, CUT_ELSEWHERE = 0.15, 0.05
"""A file is cut off where so large a part of the beams that meet something come after its last row, and in the other
frames no more than that."""


@dataclass(frozen=True)
class _Surfaces:
    """What the beams of an ideal scan meet. `beams`: ascending keys; `line`, `place`: surfaces in (beam, range)."""

    beams: IndexArray
    line: IndexArray
    place: FloatArray

    @classmethod
    def of(cls, ideal: IdealScan, shown: Scan | None = None) -> _Surfaces:
        """The surfaces, or with `shown` the echoes that a simulation shows of them, where it shows some."""
        keys = beam_keys(ideal.layer, ideal.point)
        beams, line = np.unique(keys, return_inverse=True)
        hit = ideal.distance_m > 0.0
        line, place = line[hit], ideal.distance_m[hit]
        if shown is not None:
            echo = np.searchsorted(beams, beam_keys(shown.layer, shown.point))
            unseen = ~np.isin(line, echo)
            line, place = np.append(line[unseen], echo), np.append(place[unseen], shown.range_m)
        order = np.lexsort((place, line))
        return cls(beams, line[order], place[order])

    def index(self, keys: IndexArray) -> IndexArray:
        """The beam of each key, -1 where the scan has none; shape (n,)."""
        at = np.minimum(np.searchsorted(self.beams, keys), max(len(self.beams) - 1, 0))
        return np.where(self.beams[at] == keys, at, -1) if len(self.beams) else np.full(len(keys), -1)

    def residuals(self, keys: IndexArray, range_m: FloatArray) -> FloatArray:
        """Range minus that of the beam's nearest surface; infinite without one, NaN where there is no such beam."""
        beam = self.index(keys)
        near = nearest_on_line(self.line, self.place, beam, range_m)
        residual = np.full(len(keys), np.inf)
        residual[near >= 0] = range_m[near >= 0] - self.place[near[near >= 0]]
        return np.where(beam < 0, np.nan, residual)


def frame_fault(frame: Frame, frames: Sequence[Frame], model: Model, ideal: Path, measured: Path) -> InputError | None:
    """What makes a frame useless that could be read: `ideal` and `measured` name its files in the message."""
    if not len(frame.ideal) or not np.any(frame.ideal.distance_m > 0.0):
        return InputError("no beam meets a surface", file=ideal, fix="name the ideal scan of the frame")
    if not len(frame.measured):
        return InputError("holds no echoes", file=measured, fix="was it measured, and written completely?")
    scan, surfaces = frame.measured, _Surfaces.of(frame.ideal)
    keys = beam_keys(scan.layer, scan.point)
    strange = np.flatnonzero(surfaces.index(keys) < 0)
    if len(strange):
        row = int(strange[0])
        what = f"{_echoes(len(strange), len(scan))} on beams that {ideal.name} does not have, "
        what += f"the first on Layer {scan.layer[row]}, Point {scan.point[row]}"
        return InputError(what, file=measured, fix="name the ideal scan of the same frame: a row for each fired beam")
    near, behind = _near_and_behind(surfaces, keys, scan.range_m)
    if near < FEWEST_NEAR and behind > MOST_BEHIND:
        what = f"only {100.0 * near:.0f} % of the beams with echoes have one from the surface that {ideal.name} has"
        return InputError(what, file=measured, fix="name the ideal scan of the same frame and scene")
    return _cut_fault(frame, frames, measured) or above_saturation(scan, model.sensor, measured)


def compared_scene(frame: Frame, frames: Sequence[Frame], ideal: str) -> SceneFinding | None:
    """Whether the scan is mirrored, in another unit, or of the frame before or after; `ideal` names its ideal scan."""
    before, after = (_neighbour(frame, frames, sign) for sign in (-1.0, 1.0))
    return compare_scenes(frame.measured, Surfaces.of(frame.ideal), before=before, after=after, name=ideal)


def _neighbour(frame: Frame, frames: Sequence[Frame], sign: float) -> Surfaces | None:
    """The surfaces of the frame just before or after; None where there is none, or they are the same."""
    others = [other for other in frames if sign * (other.time_s - frame.time_s) > 0.0]
    if not others or frame.origin.source == "repeats":
        return None
    ideal = min(others, key=lambda other: abs(other.time_s - frame.time_s)).ideal
    own = frame.ideal
    if len(ideal) == len(own) and float(np.max(np.abs(ideal.distance_m - own.distance_m), initial=0.0)) <= RANGE_STEP_M:
        return None
    return Surfaces.of(ideal)


def _echoes(count: int, of: int) -> str:
    return "all echoes are" if count == of else f"{count} of {of} echoes {'is' if count == 1 else 'are'}"


def _near_and_behind(surfaces: _Surfaces, keys: IndexArray, range_m: FloatArray) -> tuple[float, float]:
    """Of the beams that meet a surface and have echoes, the shares with one near it, and behind it; 1, 0 without."""
    residual = surfaces.residuals(keys, range_m)
    meets = np.isfinite(residual)
    tolerance = np.maximum(NEAR_M, NEAR_SHARE * range_m)
    beams, near, behind = (
        len(np.unique(keys[meets & which])) for which in (meets, np.abs(residual) <= tolerance, residual > tolerance)
    )
    return (near / beams, behind / beams) if beams else (1.0, 0.0)


def _cut_fault(frame: Frame, frames: Sequence[Frame], measured: Path) -> InputError | None:
    """A file that ends too early: nothing from its last row's beam on, where the other frames have echoes."""
    for order in (("layer", "point"), ("point", "layer")):
        last = _last_place(frame.measured, order)
        if last is None:
            continue
        own = _beyond(frame, last, order)
        others = [_beyond(f, _last_place(f.measured, order), order) for f in frames if f is not frame]
        if own > CUT_SHARE and others and float(np.median(others)) < CUT_ELSEWHERE:
            what = f"ends at Layer {frame.measured.layer[-1]}, Point {frame.measured.point[-1]}: "
            what += f"{100.0 * own:.0f} % of the beams that meet something come later"
            return InputError(what, file=measured, fix="was the file cut off? export it again")
    return None


def _last_place(scan: Scan, order: tuple[str, str]) -> int | None:
    """The last row's place where the rows are sorted so; None where they are not, or there are none."""
    key = getattr(scan, order[0]).astype(np.int64) * 2**20 + getattr(scan, order[1])
    return int(key[-1]) if len(key) and bool(np.all(np.diff(key) >= 0)) else None


def _beyond(frame: Frame, last: int | None, order: tuple[str, str]) -> float:
    ideal = frame.ideal
    hit = ideal.distance_m > 0.0
    if last is None or not hit.any():
        return 0.0
    key = getattr(ideal, order[0]).astype(np.int64) * 2**20 + getattr(ideal, order[1])
    return float(np.mean(key[hit] > last))


def swapped(frames: Sequence[Frame], model: Model) -> tuple[int, int] | None:
    """Numbers (i, j) of the first frame whose echoes lie where the model shows frame j rather than it; or None.

    The model stands between, since pile-up alone brings strong echoes nearer by half a metre and more. Only beams count
    whose echoes differ between the two frames. Files that are mixed up are so in a ring: the surfaces of frame i must
    be those of another frame's echoes, too.
    """
    numbers = [frame.number for frame in frames]
    shown = simulate_frames([frame.ideal for frame in frames], model, seed=0, frames=numbers, threads=None)
    surfaces = [_Surfaces.of(frame.ideal, scan) for frame, scan in zip(frames, shown, strict=True)]
    most = int(np.clip(COMPARED_ECHOES // max(len(frames), 1) ** 2, 500, 20_000))
    better: list[tuple[int, int]] = []
    for i, frame in enumerate(frames):
        scan = frame.measured
        rows = np.unique(np.linspace(0, len(scan) - 1, min(most, len(scan))).astype(np.int64))
        keys, range_m = beam_keys(scan.layer, scan.point)[rows], scan.range_m[rows]
        own = surfaces[i].residuals(keys, range_m)
        fits = [0 if j == i else _fits_better(own, other.residuals(keys, range_m)) for j, other in enumerate(surfaces)]
        if any(fits):
            better.append((i, int(np.argmax(fits))))
    wanted = {j for _, j in better}
    pair = next(((i, j) for i, j in better if i in wanted), None)
    return None if pair is None else (frames[pair[0]].number, frames[pair[1]].number)


def _fits_better(own: FloatArray, other: FloatArray) -> int:
    """How many echoes lie on the other's surfaces, where far more do than on their own; else 0.

    Of beams whose surfaces differ; an offset of all ranges, whatever it is, is taken off before.
    """
    on_own, on_other = _on_surfaces(own), _on_surfaces(other)
    with np.errstate(invalid="ignore"):
        differ = ~np.isnan(other) & ~np.isnan(own) & ~(np.abs(own - other) < OTHER_M)
    for_own, for_other = (int(np.count_nonzero(on[differ])) for on in (on_own, on_other))
    meet_other = int(np.count_nonzero(np.abs(other[differ]) < OFFSET_M))
    enough = for_other >= max(FEWEST_VOTES, VOTES_SHARE * meet_other)
    return int(np.count_nonzero(on_other)) if enough and for_other > VOTES_RATIO * for_own else 0


def _on_surfaces(residual: FloatArray) -> npt.NDArray[np.bool_]:
    """Which echoes lie within `SAME_M` of where most do; shape (n,)."""
    near = np.sort(residual[np.abs(residual) < OFFSET_M])
    if not len(near):
        return np.zeros(len(residual), dtype=np.bool_)
    most = int(np.argmax(np.searchsorted(near, near + 2.0 * SAME_M, side="right") - np.arange(len(near))))
    with np.errstate(invalid="ignore"):
        return np.asarray((residual >= near[most]) & (residual <= near[most] + 2.0 * SAME_M))
