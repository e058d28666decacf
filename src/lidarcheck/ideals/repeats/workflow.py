"""Ideal scans from repeats of a scene at rest: each frame's own, made of the others, and the laws of the sensor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.ideals.repeats.amplitude import Amplitudes, amplitude_feature
from lidarcheck.ideals.repeats.checks import check_at_rest, check_scans, check_sensor
from lidarcheck.ideals.repeats.estimate import Estimate, estimated, ideal_of
from lidarcheck.ideals.repeats.groups import gap_m, grouped
from lidarcheck.ideals.repeats.laws import Laws, fit_laws
from lidarcheck.ideals.repeats.neighbours import hidden_rays
from lidarcheck.ideals.repeats.observations import Observations, observed, turned
from lidarcheck.ideals.repeats.response import Response, response_of
from lidarcheck.ideals.repeats.split import FEWEST_FOR_VERDICT, Parts, parts_of
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Feature, Sensor

__all__ = ["Counts", "FrameIdeal", "Repeats", "repeats_of"]

Tell = Callable[[int, int, str], object]


@dataclass(frozen=True)
class Counts:
    """What became of the rays of one ideal scan; `repeats`: how many frames it was made of.

    `known`: with a surface; `several`: with two or more; `edges`: marked as such; `unknown`: fired, without a surface;
    `free`: fired so often without an echo that they meet nothing; `occluded`: behind a person in this frame.
    """

    repeats: int
    rays: int
    known: int
    several: int
    edges: int
    unknown: int
    free: int
    occluded: int


@dataclass(frozen=True)
class FrameIdeal:
    """The ideal scan of a frame; `shared`: the number of an earlier frame whose ideal scan is the same, else None."""

    frame: int
    part: str
    ideal: IdealScan
    counts: Counts
    shared: int | None = None


@dataclass(frozen=True)
class Repeats:
    """What repeats gave. `ideals`: empty where there are too few frames for a verdict. `whole`: made of all frames.

    `moved`: share of the rays without a range that comes again. `outside`: echoes on no beam of the sensor.
    """

    parts: Parts
    laws: Laws
    feature: str
    moved: float
    outside: int
    ideals: Sequence[FrameIdeal] = ()
    whole: FrameIdeal | None = None
    notes: Sequence[str] = field(default_factory=tuple)


def repeats_of(
    names: Sequence[str],
    scans: Sequence[Scan],
    sensor: Sensor,
    stated: frozenset[str],
    *,
    material: int = 0,
    whole: bool = False,
    tell: Tell | None = None,
) -> Repeats:
    """The laws, and each frame's ideal scan by the others, or with `whole` one of all frames.

    `names`: of the frames, in order of time, for messages. `stated`: the detector's numbers that are known. `material`:
    whose number rows get. `UsageError` and `InputError` where the recording is no repeats of a scene at rest.
    """
    check_sensor(sensor)
    check_scans(names, scans, sensor)
    parts = parts_of(len(scans))
    feature = amplitude_feature(sensor, scans)
    seen = observed(scans, sensor, feature, of=scans[0].beams if not sensor.beams.repeats else None)
    moved = _checked(names, seen, sensor, feature)
    seen = _turned(seen, sensor, feature, range(len(scans)))
    fitting = _mask(len(scans), parts.fitting if not whole else range(len(scans)))
    laws = fit_laws(seen, sensor, feature, stated, fitting)
    work = _Work(scans, seen, laws, feature, response_of(laws.sensor, feature), parts, material)
    ideals = () if whole or len(scans) < FEWEST_FOR_VERDICT else tuple(work.each(tell))
    return Repeats(
        parts, laws, feature.name if feature is not None else "", moved, seen.outside, ideals,
        work.of_all() if whole else None, tuple(laws.notes),
    )  # fmt: skip


def _checked(names: Sequence[str], seen: Observations, sensor: Sensor, feature: Feature | None) -> float:
    every = np.ones(seen.frames, dtype=np.bool_)
    # Before any law is known, what makes two echoes is two surfaces.
    amplitudes = seen.amplitudes(feature, sensor)
    gaps = np.full(len(seen.ray), min(0.5, 0.5 * sensor.separation_m))
    groups = grouped(seen, amplitudes, gaps, every)
    return check_at_rest(names, seen, groups, gaps)


def _turned(seen: Observations, sensor: Sensor, feature: Feature | None, some: Sequence[int] | range) -> Observations:
    """The observations as if every frame had fired the same rays, by what the frames of `some` show beside them."""
    if not seen.aside.any():
        return seen
    amplitudes = seen.amplitudes(feature, sensor)
    gaps = np.full(len(seen.ray), min(0.5, 0.5 * sensor.separation_m))
    groups = grouped(seen, amplitudes, gaps, _mask(seen.frames, some))
    about = np.full(len(seen.rays), np.nan)
    about[groups.ray[groups.main]] = groups.path_m[groups.main]
    return turned(seen, about)


@dataclass
class _Work:
    """Estimating one frame after another; where columns repeat all share one table of observations."""

    scans: Sequence[Scan]
    seen: Observations
    laws: Laws
    feature: Feature | None
    response: Response
    parts: Parts
    material: int
    kept: tuple[Observations, Amplitudes, FloatArray] | None = None
    hidden: BoolArray | None = None

    def each(self, tell: Tell | None) -> list[FrameIdeal]:
        """The ideal scan of every frame, by others."""
        found: list[FrameIdeal] = []
        made: dict[tuple[int, ...], tuple[int, Estimate, Observations, BoolArray]] = {}
        repeat = self.laws.sensor.beams.repeats
        for frame, part in enumerate(self.parts.names):
            others = self.parts.others(frame)
            if repeat and others in made:
                first, estimate, seen, hidden = made[others]
            else:
                seen, hidden = self._seen(frame)
                estimate = self._estimate(seen, others, hidden)
                first = frame
                if repeat:
                    made[others] = frame, estimate, seen, hidden
            same = first != frame and _alike(seen, hidden, first, frame)
            ideal = self._ideal(estimate, seen, hidden, frame)
            counts = _counts(estimate, seen, hidden, frame, len(others))
            found.append(FrameIdeal(frame, part, ideal, counts, first if same else None))
            if tell is not None:
                tell(frame + 1, len(self.scans), part)
        return found

    def of_all(self) -> FrameIdeal:
        """One ideal scan of all frames."""
        seen, hidden = self._seen(0)
        every = tuple(range(len(self.scans)))
        estimate = self._estimate(seen, every, hidden)
        ideal = ideal_of(estimate, seen, self.laws.sensor, self.material)
        return FrameIdeal(0, "fit", ideal, _counts(estimate, seen, hidden, None, len(every)))

    def _seen(self, frame: int) -> tuple[Observations, BoolArray]:
        """The observations by the rays of a frame, and the rays behind persons."""
        sensor = self.laws.sensor
        seen = self.seen
        if not sensor.beams.repeats:
            seen = observed(self.scans, sensor, self.feature, of=self.scans[frame].beams)
            seen = _turned(seen, sensor, self.feature, self.parts.others(frame))
        elif self.hidden is not None:
            return seen, self.hidden
        every = _mask(len(self.scans), self.parts.estimating)
        amplitudes, gaps = self._told(seen)
        groups = grouped(seen, amplitudes, gaps, every)
        self.hidden = hidden_rays(seen, groups, gaps)
        return seen, self.hidden

    def _told(self, seen: Observations) -> tuple[Amplitudes, FloatArray]:
        """The amplitudes of all echoes, and how far apart two ranges of one ray must lie."""
        if self.kept is None or self.kept[0] is not seen:
            amplitudes = seen.amplitudes(self.feature, self.laws.sensor)
            gaps = gap_m(self.response, self.laws.sensor, amplitudes.value, seen.path_m)
            self.kept = seen, amplitudes, gaps
        return self.kept[1:]

    def _estimate(self, seen: Observations, others: Sequence[int], hidden: BoolArray) -> Estimate:
        sensor = self.laws.sensor
        amplitudes, gaps = self._told(seen)
        use = _mask(len(self.scans), others)
        return estimated(seen, amplitudes, gaps, use, hidden, self.response, sensor, untold_m=self.laws.untold_m)

    def _ideal(self, estimate: Estimate, seen: Observations, hidden: BoolArray, frame: int) -> IdealScan:
        return ideal_of(estimate, seen, self.laws.sensor, self.material, frame=frame, hidden=hidden[frame])


def _alike(seen: Observations, hidden: BoolArray, first: int, frame: int) -> bool:
    """Whether two frames have fired the same rays and hide the same ones."""
    return bool(np.array_equal(hidden[first], hidden[frame]) and np.array_equal(seen.fired[first], seen.fired[frame]))


def _mask(frames: int, some: Sequence[int] | range) -> BoolArray:
    found = np.zeros(frames, dtype=np.bool_)
    found[list(some)] = True
    return found


def _counts(estimate: Estimate, seen: Observations, hidden: BoolArray, frame: int | None, repeats: int) -> Counts:
    groups = estimate.groups
    fired = seen.fired.any(axis=0) if frame is None else seen.fired[frame]
    behind = fired & hidden[frame] if frame is not None else np.zeros_like(fired)
    known = fired & ~behind & (groups.row >= 0)
    several = np.bincount(groups.ray, minlength=len(seen.rays)) > 1
    free = fired & ~behind & (groups.row < 0) & estimate.free
    return Counts(
        repeats=repeats,
        rays=int(fired.sum()),
        known=int(known.sum()),
        several=int((known & several).sum()),
        edges=int((known & estimate.edge).sum()),
        unknown=int((fired & ~known & ~behind & ~free).sum()),
        free=int(free.sum()),
        occluded=int(behind.sum()),
    )
