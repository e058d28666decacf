"""Whether a measured scan and what it is held against show the same scene, in the same frame, unit and order of beams.

What it is held against is an ideal scan, or else a simulated scan. Beams that were made from X, Y, Z always fit
themselves, so a mirrored file shows only here; so does a wrong unit, or the ideal scan of the frame before.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from os import PathLike

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray, IntArray
from lidarcheck.errors import InputError
from lidarcheck.formats.geometry.unit import METRES
from lidarcheck.kpi.pairing import nearest_on_line
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Beams

__all__ = ["SceneFinding", "Surfaces", "check_scene_of", "compare_scenes"]

CLIP_M = 2.0
"""A residual counts no more than this: how far off a wrong surface is says nothing."""
FEWEST_BEAMS = 30
"""Of fewer common beams a variant is not tried."""
STANDARD_ERRORS = 5.0
"""A variant beats the scan as it is by more than so many standard errors of the paired difference ..."""
RANGE_STEP_M = 0.01
"""... and by more than a step of the range, and is not the worse in the median."""
FITS_M = 0.25
"""Where the median beam fits as well as this, another order of the beams must halve its residual, and always take off
more than a step of the range: a few ghosts of a mirror may lie where that order has a surface."""
SWEEP_PART = 0.25
"""A shift by a frame is tried on beams of the sweep's first quarter: later the next frame often fits as well."""
NEAR_SHARE = 0.1
"""An echo nearer to a surface of its beam than this part of its range, or than `CLIP_M`, may come from it."""
SAME_LEAST, DOUBTFUL = 0.25, 0.5
"""Where fewer beams have an echo near their surface the scene is another, or doubtful. Of 45 scenes, most with an
effect, held against themselves 77 % or more have one; with the sensor turned by 1 deg 60 %, by 3 deg 10 to 20 %."""
ELSEWHERE = 0.1
"""It is another where also so many beams have one behind it, which fog cannot do, or the scene is only doubtful."""
_BEAMS = 5000
"""Beams that are looked at, about."""


@dataclass(frozen=True)
class Surfaces:
    """What beams meet: `layer`, `point`, `distance_m` (n,), 0 where a beam meets nothing.

    `beams`: the sensor's. `simulated`: these are echoes of a simulated scan. `timed`: each says when it is so, as an
    ideal scan with times.
    """

    layer: IntArray
    point: IntArray
    distance_m: FloatArray
    beams: Beams
    simulated: bool = False
    timed: bool = False

    @classmethod
    def of(cls, shown: IdealScan | Scan) -> Surfaces:
        """What an ideal scan says that beams meet, or what the echoes of a simulated scan show."""
        if isinstance(shown, Scan):
            return cls(shown.layer, shown.point, shown.range_m, shown.beams, simulated=True)
        return cls(shown.layer, shown.point, shown.distance_m, shown.beams, timed=shown.time_s is not None)


@dataclass(frozen=True)
class SceneFinding:
    """What was found. `refused`: the two do not belong together; `doubtful`: they may not. `what`, `fix`: in words.

    `tried`: the median clipped |residual| [m] of each variant that could be tried, `as is` among them. `equal`: those
    that cannot be told from as is.
    """

    refused: bool
    doubtful: bool
    what: str
    fix: str
    tried: Mapping[str, float]
    equal: tuple[str, ...] = ()

    def untold(self, measured: Scan) -> tuple[str, ...]:
        """Those that nothing else tells either.

        Of another order of beams the scan's own geometry does, if checked; of another unit a RANGE beside X, Y, Z.
        """
        known = measured.geometry
        told = (*(_NUMBERS if known.verdict != "not checked" else ()), *(METRES if known.unit_checked else ()))
        return tuple(one for one in self.equal if one not in told)


@dataclass(frozen=True)
class _Echoes:
    """Echoes and the beams that they are said to be of."""

    layer: IntArray
    point: IntArray
    range_m: FloatArray
    beams: Beams

    @property
    def beam(self) -> IndexArray:
        return self.beams.index(self.layer, self.point)


_MIRRORED = "Y mirrored, or points from the other end"
_LAYERS = "layers from the other end, or Z mirrored"
_BOTH = "Y and Z mirrored, or layers and points from the other end"
_BEFORE, _AFTER = "the frame before", "the frame after"
_OTHER_FRAME = "name the ideal scan of the same frame"
_FIXES = {
    _MIRRORED: 'give --mirror y (in a case, the frame\'s mirror = "y"), or renumber: Point = {point} - Point',
    _LAYERS: 'renumber: Layer = {layer} - Layer, or give --mirror z (in a case, the frame\'s mirror = "z")',
    _BOTH: 'give --pose "0,0,0,180,0,0", or renumber Layer and Point from the other end',
    _BEFORE: _OTHER_FRAME,
    _AFTER: _OTHER_FRAME,
}
"""Each variant, and what the user does where it fits."""
_NUMBERS = (_MIRRORED, _LAYERS, _BOTH)


def compare_scenes(
    measured: Scan,
    shown: Surfaces,
    *,
    before: Surfaces | None = None,
    after: Surfaces | None = None,
    name: str = "the ideal scan",
) -> SceneFinding | None:
    """What the measured echoes say of the surfaces that they are held against; None with fewer than 30 common beams.

    `before`, `after`: the surfaces of the neighbouring frames, where these differ from `shown`. `name`: what `shown`
    is called in words.
    """
    if not measured.beams.alike(shown.beams):
        what = f"it is read with the beams of one sensor, {name} with those of another"
        return SceneFinding(True, False, what, "name the sensor that measured, for both", {})
    echoes = _chosen(measured)
    own = _residuals(shown, echoes)
    if np.count_nonzero(~np.isnan(own)) < FEWEST_BEAMS:
        return None
    pairs = [(variant, own, other) for variant, other in _variants(shown, echoes)]
    pairs += _frame_pairs(measured, shown, {_BEFORE: before, _AFTER: after})
    tried = {"as is": _median(own)}
    beats: list[tuple[float, float, str]] = []
    equal = []
    for variant, as_is, other in pairs:
        common = ~np.isnan(as_is) & ~np.isnan(other)
        if np.count_nonzero(common) < FEWEST_BEAMS:
            continue
        tried[variant] = _median(other[common])
        verdict = _compared(as_is[common], other[common], few_tell=variant not in _NUMBERS)
        if verdict > 0:
            beats.append((tried[variant], _median(as_is[common]), variant))
        elif verdict == 0:
            equal.append(variant)
    if beats:
        median, as_it_is, variant = min(beats)
        what = f"{name} fits with {_said(variant)}: median residual {median:.2f} m, {as_it_is:.2f} m as it is"
        # Whose beams agree with its X, Y, Z is not the one that is wrong.
        sound = variant in _NUMBERS and measured.geometry.verdict in ("ok", "warning")
        fix = f"its X, Y, Z agree with its beams: number {name} as they are" if sound else _fix(variant, shown.beams)
        return SceneFinding(True, False, what, fix, tried)
    return _same(echoes, own, shown, name, tried, tuple(equal))


def check_scene_of(measured: Scan, shown: IdealScan | Scan, file: str | PathLike[str], name: str) -> str:
    """What is to be said of a measured scan and what it is held against, `name` in words; empty where they fit.

    `InputError` with the measured scan's `file` where they do not belong together.
    """
    found = compare_scenes(measured, Surfaces.of(shown), name=name)
    if found is None:
        return ""
    if found.refused:
        raise InputError(found.what, file=file, fix=found.fix)
    if found.doubtful:
        return f"{file}: {found.what}"
    untold = found.untold(measured)
    return f"{file}: against {name} not told apart from {'; '.join(untold)}" if untold else ""


def _chosen(measured: Scan) -> _Echoes:
    """All echoes of some beams, picked by a hash of their number so that no column or layer is left out."""
    beams = measured.beams
    keys, inside = _keys(measured.layer, measured.point, beams)
    every = max(1, len(measured) // _BEAMS)
    picked = np.zeros(beams.size, dtype=np.bool_)
    picked[((np.arange(beams.size) * 2654435761) >> 12) % every == 0] = True
    rows = np.flatnonzero(picked[keys] & inside)
    layer, point = measured.layer[rows], measured.point[rows]
    xyz = np.stack([measured.x_m[rows], measured.y_m[rows], measured.z_m[rows]], axis=-1)
    range_m = beams.ranges_m(layer, point, xyz) - beams.range_offset_m(layer)
    return _Echoes(layer, point, range_m, beams)


def _keys(layer: IntArray, point: IntArray, beams: Beams) -> tuple[IntArray, BoolArray]:
    """A number for each beam, and whether the sensor has it; 0 for those that it has not."""
    inside = (layer >= 0) & (layer < beams.layers) & (point >= 0) & (point < beams.points)
    return np.where(inside, layer * np.int32(beams.points) + point, np.int32(0)), inside


def _variants(shown: Surfaces, echoes: _Echoes) -> Iterator[tuple[str, FloatArray]]:
    """Each variant's name and its residuals, one a beam of the echoes as they are."""
    layer, point = echoes.beams.layers - 1 - echoes.layer, echoes.beams.points - 1 - echoes.point
    images = [replace(echoes, point=point), replace(echoes, layer=layer), replace(echoes, layer=layer, point=point)]
    shown = _of_beams(shown, np.concatenate([echoes.beam, *(image.beam for image in images)]))
    for name, image in zip(_NUMBERS, images, strict=True):
        yield name, _residuals(shown, image, echoes.beam)
    for unit, metres in METRES.items():
        if unit != "m":
            yield unit, _residuals(shown, replace(echoes, range_m=echoes.range_m * metres))


def _frame_pairs(
    measured: Scan, shown: Surfaces, neighbours: Mapping[str, Surfaces | None]
) -> list[tuple[str, FloatArray, FloatArray]]:
    """The residuals of early beams as it is and against each neighbour, where the two frames differ."""
    if all(neighbour is None for neighbour in neighbours.values()):
        return []
    early = measured.beams.fire_time_s(measured.layer, measured.point) < SWEEP_PART * measured.beams.sweep.duration_s
    echoes = _chosen(measured if shown.timed or measured.beams.sweep.order == "flash" else measured.take(early))
    own = _residuals(shown, echoes)
    pairs = []
    for variant, neighbour in neighbours.items():
        if neighbour is None:
            continue
        other = _residuals(neighbour, echoes)
        # What stands still between the frames, as flat ground, tells nothing of them.
        met = np.isfinite(own) | np.isfinite(other)
        with np.errstate(invalid="ignore"):
            differ = met & ~(np.abs(own - other) <= RANGE_STEP_M)
        pairs.append((variant, own[differ], other[differ]))
    return pairs


def _residuals(shown: Surfaces, echoes: _Echoes, beam: IndexArray | None = None) -> FloatArray:
    """The residual of each beam's echo that lies nearest to a surface, in ascending order of `beam`, shape (n_beams,).

    `beam`: what the result is ordered by, the echoes' own beams by default. Infinite where the beam meets nothing, NaN
    where `shown` does not have it.
    """
    shown = _of_beams(shown, echoes.beam)
    keys = _keys(shown.layer, shown.point, shown.beams)[0].astype(np.int64)
    fired = np.zeros(shown.beams.size, dtype=np.bool_)
    fired[keys] = True
    rows = np.flatnonzero(shown.distance_m > 0.0)
    order = rows[np.lexsort((shown.distance_m[rows], keys[rows]))]
    near = nearest_on_line(keys[order], shown.distance_m[order], echoes.beam, echoes.range_m)
    residual = np.full(len(near), np.inf)
    residual[near >= 0] = echoes.range_m[near >= 0] - shown.distance_m[order[near[near >= 0]]]
    residual[~fired[echoes.beam]] = np.nan
    group = echoes.beam if beam is None else beam
    by = np.lexsort((np.abs(residual), group))
    _, first = np.unique(group[by], return_index=True)
    return residual[by[first]]


def _of_beams(shown: Surfaces, beams: IndexArray) -> Surfaces:
    """The surfaces of those beams alone."""
    wanted = np.zeros(shown.beams.size, dtype=np.bool_)
    wanted[beams] = True
    keys, inside = _keys(shown.layer, shown.point, shown.beams)
    rows = np.flatnonzero(wanted[keys] & inside)
    if len(rows) == len(keys):
        return shown
    return replace(shown, layer=shown.layer[rows], point=shown.point[rows], distance_m=shown.distance_m[rows])


def _median(residual: FloatArray) -> float:
    return float(np.median(np.minimum(np.abs(residual[~np.isnan(residual)]), CLIP_M)))


def _compared(own: FloatArray, other: FloatArray, *, few_tell: bool) -> int:
    """1 where the other residuals are smaller beyond chance, 0 where the two cannot be told apart, else -1. `few_tell`:
    a few beams do, though the median beam fits as it is.

    With an offset of all ranges left in and taken out, which must agree: an offset alone must not make another frame
    fit better.
    """
    pairs = (own, other), (_centred(own), _centred(other))
    plain, centred = (_better(*pair, few_tell=few_tell) for pair in pairs)
    return plain if plain == centred else 0


def _centred(residual: FloatArray) -> FloatArray:
    finite = residual[np.isfinite(residual)]
    middle = float(np.clip(np.median(finite), -CLIP_M, CLIP_M)) if len(finite) else 0.0
    return residual - middle


def _better(own: FloatArray, other: FloatArray, *, few_tell: bool) -> int:
    """1 where the other clipped residuals are smaller beyond chance and a step of the range, -1 if larger, else 0."""
    a, b = (np.minimum(np.abs(residual), CLIP_M) for residual in (own, other))
    gain = float(np.mean(a - b))
    if abs(gain) <= max(STANDARD_ERRORS * float(np.std(a - b)) / np.sqrt(len(a)), RANGE_STEP_M):
        return 0
    step = float(np.median(a) - np.median(b))
    contrary = gain * step < 0.0 and abs(step) > RANGE_STEP_M
    few = not few_tell and gain > 0.0 and (step <= RANGE_STEP_M or step < 0.5 * np.median(a) <= 0.5 * FITS_M)
    return 0 if contrary or few else int(np.sign(gain))


def _said(variant: str) -> str:
    """A variant in words."""
    return variant if variant in _FIXES else f"the measured ranges in {variant}"


def _fix(variant: str, beams: Beams) -> str:
    fix = _FIXES.get(variant, f'give --unit {variant} (in a case, the frame\'s unit = "{variant}")')
    return fix.replace("{point}", str(beams.points - 1)).replace("{layer}", str(beams.layers - 1))


def _same(
    echoes: _Echoes, own: FloatArray, shown: Surfaces, name: str, tried: Mapping[str, float], equal: tuple[str, ...]
) -> SceneFinding:
    """Whether the beams' echoes lie near what the beams meet at all."""
    meets = np.isfinite(own)
    range_m = echoes.range_m[np.unique(echoes.beam, return_index=True)[1]]
    tolerance = np.maximum(CLIP_M, NEAR_SHARE * range_m)
    count = max(int(np.count_nonzero(meets)), 1)
    near = np.count_nonzero(meets & (np.abs(own) <= tolerance)) / count
    behind, ahead = (np.count_nonzero(meets & (sign * own > tolerance)) / count for sign in (1.0, -1.0))
    what = f"only {100.0 * near:.0f} % of the beams with echoes have one near what {name} shows there"
    fix = "name the scan of the same frame and scene"
    elsewhere = behind > ELSEWHERE and (not shown.simulated or ahead > ELSEWHERE)
    if count < FEWEST_BEAMS or near >= DOUBTFUL:
        return SceneFinding(False, False, "", "", tried, equal)
    if near < SAME_LEAST and elsewhere:
        return SceneFinding(True, False, f"this is not the same scene: {what}", fix, tried, equal)
    return SceneFinding(False, True, f"this may not be the same scene: {what}", fix, tried, equal)
