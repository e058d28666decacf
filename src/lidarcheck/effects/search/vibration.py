"""What a search must know of `vibration`: the frequency at which ranges swing along the slope of surfaces, or a view
that turns at random."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.effects.base import Effect
from lidarcheck.effects.search.base import LOG_STEP, FreeParameter, Probe, SearchSpec, Variant
from lidarcheck.effects.search.evidence import RANGE, Evidence

_FREE = (FreeParameter("pitch_deg", 0.3, log=True), FreeParameter("yaw_deg", 0.3, log=True))
_TREMBLE = (FreeParameter("random_deg", LOG_STEP, log=True),)
_WANDER = (*_TREMBLE, FreeParameter("memory_columns", 0.4, log=True))
_NO_SWING = {"pitch_deg": 0.0, "yaw_deg": 0.0}

_LEAST_COLUMNS = 12
_LEAST_SPREAD_M, _MOST_M = 0.02, 1.0
_CURVED_DEG = 0.03
"""A slope holds for an angle to this much: at grazing incidence a beam's parts meet the ground metres apart."""
_PER_RESOLVED, _FINE = 4, 10
"""Frequencies tried within the reciprocal of the sweep's time, below which two cannot be told apart; and so many times
as many about the best of them."""
_HIGHEST = 0.45
"""The highest frequency, in columns' own."""
_NEARLY_ALL = 0.9
"""Phases of their own fit a little of anything: only where they explain so much of what columns do together are they
taken, and else the rhythm that all frames share."""
_LEAST_DEG, _MOST_DEG = 0.003, 0.5
_MOST_UNLIKE = 3.0
"""What is larger than so many times what the leading axis has is of few beams, and of what these see besides."""
_KNOWN = 30.0
"""What a swing of an axis must explain, in variances of single beams, before anything is known of it; and what a phase
of its own must explain besides."""


def _starts(evidence: Evidence) -> list[Probe]:
    """The strongest swing of pitch and yaw, of the same phase in every frame, and of another in each."""
    points, column = np.unique(evidence.beams.point, return_inverse=True)
    if len(points) < _LEAST_COLUMNS:
        return []
    time = _times(evidence, points)
    curvature, slope = _by_column(evidence, column, len(points))
    found = []
    same = _strongest(time, curvature.sum(axis=0)[None], slope.sum(axis=0)[None])
    anew = _strongest(time, curvature, slope)
    if anew is None or anew.drop < _NEARLY_ALL * _together(curvature, slope):
        anew = same
    length = float(time[-1] - time[0])
    for swing, place, variant in ((same, {}, ""), (anew, {"new_phase": 1}, "free phase")):
        if swing is None:
            continue
        # A step that shifts the swing by a twentieth of a cycle at the sweep's end.
        step = float(np.clip(0.05 / (swing.frequency_hz * length), 1e-4, 0.05))
        free = [*_FREE, FreeParameter("frequency_hz", step, log=True)]
        if not place:
            free.append(FreeParameter("phase_deg", 15.0))
        found.append(Probe("vibration", swing.settings(), tuple(free), place, variant))
    return found


def _times(evidence: Evidence, points: IndexArray) -> FloatArray:
    """When columns are fired, shape (n,): the mean of their beams, which a head fires one after the other."""
    beams = evidence.sensor.beams
    layers = np.unique(evidence.beams.layer).astype(np.int32)
    if beams.grid:
        return beams.fire_time_s(layers[0], points.astype(np.int32))
    layer, point = np.repeat(layers, len(points)), np.tile(points.astype(np.int32), len(layers))
    there = beams.has(layer, point)
    fired = np.where(there, beams.fire_time_s(np.where(there, layer, 0), np.where(there, point, 0)), 0.0)
    count = np.maximum(there.reshape(len(layers), -1).sum(axis=0), 1)
    return np.asarray(fired.reshape(len(layers), -1).sum(axis=0) / count)


@dataclass(frozen=True)
class _Swing:
    """A frequency and, for each frame, the sine's and the cosine's part of pitch and yaw, shape (n_frames, 2, 2) [deg],
    and how much less these leave, in variances of single beams; `weight` (2,): what is known of either axis."""

    frequency_hz: float
    part_deg: FloatArray
    drop: float
    weight: FloatArray

    def settings(self) -> dict[str, float]:
        """The effect's settings; the phases are those of the first frame."""
        size = np.sqrt((self.part_deg**2).sum(axis=2).mean(axis=0))
        phase = np.arctan2(self.part_deg[0, :, 1], self.part_deg[0, :, 0])
        lead = int(np.argmax(self.weight * size**2))
        other = 1 - lead
        along = size[other] * np.cos(phase[other] - phase[lead])
        own_phase = float(self.weight[other] * (size[other] ** 2 - max(along, 0.0) ** 2)) > _KNOWN
        if not own_phase:
            size[other] = max(along, 0.0)
        # Along an axis in which hardly any surface slopes, the other one's size is as good a start as any.
        if self.weight[other] * size[lead] ** 2 < _KNOWN:
            size[other] = size[lead]
        size[other] = min(size[other], _MOST_UNLIKE * size[lead])
        pitch, yaw = np.clip(size, _LEAST_DEG, _MOST_DEG).tolist()
        apart = float(np.rad2deg((phase[1] - phase[0] + np.pi) % (2.0 * np.pi) - np.pi)) if own_phase else 0.0
        at = phase[0] if own_phase else phase[lead]
        return {
            "pitch_deg": pitch, "yaw_deg": yaw, "frequency_hz": self.frequency_hz,
            "phase_deg": float(np.rad2deg(at)), "yaw_phase_deg": apart, "random_deg": 0.0,
        }  # fmt: skip


def _by_column(evidence: Evidence, column: npt.NDArray[np.intp], columns: int) -> tuple[FloatArray, FloatArray]:
    """The normal equations of the two angles of each column of each frame: (n_frames, columns, 2, 2) and (..., 2)."""
    expected, measured, beams = evidence.expected, evidence.measured, evidence.beams
    used = measured.detected & expected.known & ~beams.crease
    off = np.clip(measured.feature[:, RANGE] - expected.mean[:, RANGE], -_MOST_M, _MOST_M)[used]
    along = beams.slope_m_per_deg[used]
    spread = np.maximum(expected.spread[used, RANGE], _LEAST_SPREAD_M)
    weight = 1.0 / (spread**2 + (_CURVED_DEG**2 * along**2).sum(axis=1))
    frames = int(beams.frame.max()) + 1
    place = (beams.frame * columns + column)[used]

    def summed(value: FloatArray) -> FloatArray:
        return np.bincount(place, value, frames * columns).reshape(frames, columns).astype(np.float64)

    slope = np.stack([summed(weight * off * along[:, a]) for a in (0, 1)], axis=-1)
    pairs = [[summed(weight * along[:, a] * along[:, b]) for b in (0, 1)] for a in (0, 1)]
    return np.moveaxis(np.array(pairs), (0, 1), (2, 3)), slope


def _together(curvature: FloatArray, slope: FloatArray) -> float:
    """What the beams of a column have in common beyond their frame's mean and chance, in variances of single beams."""

    def explained(left: FloatArray, right: FloatArray) -> float:
        scale = np.trace(left, axis1=-2, axis2=-1)[..., None, None]
        found = np.linalg.solve(left + (1e-6 * scale + 1e-9) * np.eye(2), right[..., None])[..., 0]
        return float((found * right).sum())

    chance = 2.0 * np.count_nonzero(np.trace(curvature, axis1=-2, axis2=-1))
    return explained(curvature, slope) - explained(curvature.sum(axis=1), slope.sum(axis=1)) - chance


def _strongest(time: FloatArray, curvature: FloatArray, slope: FloatArray) -> _Swing | None:
    """The swing that explains most, with parts of its own for each of the frames; None where nothing has weight."""
    length = float(time[-1] - time[0])
    if length <= 0.0 or not np.any(curvature):
        return None
    coarse = 1.0 / (_PER_RESOLVED * length)
    highest = _HIGHEST / float(np.median(np.diff(time)))
    best = max(
        (_swing(time, curvature, slope, f) for f in np.arange(0.7 / length, highest, coarse)), key=lambda s: s.drop
    )
    near = best.frequency_hz + coarse * np.linspace(-1.0, 1.0, 2 * _FINE + 1)
    return max((_swing(time, curvature, slope, f) for f in near if f > 0.0), key=lambda s: s.drop)


def _swing(time: FloatArray, curvature: FloatArray, slope: FloatArray, frequency_hz: float) -> _Swing:
    """The least squares of a sine, a cosine and a constant of either angle."""
    turn = 2.0 * np.pi * frequency_hz * time
    basis = np.column_stack([np.sin(turn), np.cos(turn), np.ones_like(time)])
    left = np.einsum("ci,cj,fcab->faibj", basis, basis, curvature, optimize=True)
    right = np.einsum("ci,fca->fai", basis, slope, optimize=True)
    frames = len(left)
    whole = left.reshape(frames, 6, 6) + 1e-6 * np.trace(left.reshape(frames, 6, 6), axis1=1, axis2=2)[
        :, None, None
    ] * np.eye(6)
    flat = left[:, :, 2, :, 2] + 1e-6 * np.trace(left[:, :, 2, :, 2], axis1=1, axis2=2)[:, None, None] * np.eye(2)
    whole, flat = whole + 1e-9 * np.eye(6), flat + 1e-9 * np.eye(2)
    found = np.linalg.solve(whole, right.reshape(frames, 6, 1))[:, :, 0]
    level = np.linalg.solve(flat, right[:, :, 2, None])[:, :, 0]
    drop = float((right.reshape(frames, 6) * found).sum() - (right[:, :, 2] * level).sum())
    weight = np.array([left[:, a, :2, a, :2].trace(axis1=1, axis2=2).sum() / 2.0 for a in (0, 1)])
    return _Swing(float(frequency_hz), found.reshape(frames, 2, 3)[:, :, :2], drop, weight)


def _turns_anew(effect: Effect) -> bool:
    """Whether the view is turned otherwise in each frame, so that a few frames have a mean pose by chance."""
    values = effect.settings()
    return bool(values["new_phase"]) or float(values["random_deg"]) > 0.0


SPEC = SearchSpec(
    "vibration",
    free=_FREE,
    fixed_starts=(
        {"pitch_deg": 0.05, "yaw_deg": 0.05, "frequency_hz": 150.0, "random_deg": 0.0},
        {"pitch_deg": 0.05, "yaw_deg": 0.05, "frequency_hz": 60.0, "random_deg": 0.0},
    ),
    variants=(
        Variant("random", _NO_SWING | {"random_deg": 0.03}, _TREMBLE),
        Variant("random", _NO_SWING | {"random_deg": 0.12}, _TREMBLE),
        Variant("wander", _NO_SWING | {"random_deg": 0.05, "memory_columns": 5.0}, _WANDER),
        Variant("wander", _NO_SWING | {"random_deg": 0.08, "memory_columns": 25.0}, _WANDER),
    ),
    starts=_starts,
    order=4,
    amounts=("pitch_deg", "yaw_deg", "random_deg"),
    groups=frozenset({"aim"}),
    confused_with={"timing_jitter": "a wall at right angles: jitter stays, vibration vanishes"},
    at_edges=True,
    at_random="turns the view",
    variants_anew=("random", "wander", "free phase"),
    acts_anew=_turns_anew,
    in_repeats=True,
    watched_by=("range_residual_point_spread", "range_noise"),
    shown_by=("range", "point"),
)
