"""How the speed of `simulate` scales: over beams, pulses per beam, frames and cores, as curves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from lidarcheck.cli.bench import scene as bench_scene
from lidarcheck.cli.bench.kit import MEGA, times
from lidarcheck.workers.cores import usable_cores

if TYPE_CHECKING:
    from lidarcheck.figures.data import Course
    from lidarcheck.model.fidelity import Fidelity
    from lidarcheck.scan import IdealScan

__all__ = ["scaling_courses"]

PULSES = (1, 2, 4, 8)
FRAMES = (1, 2, 5, 10)
WAYS: tuple[Fidelity, ...] = ("fast", "exact")
ProgressCallback = Callable[[int, int, str], object]
Timed = Callable[[float, "Fidelity"], float]


def scaling_courses(quick: bool, progress: ProgressCallback) -> list[Course]:
    """Million points a second of the SMART lab frame over each of the four, one curve for each fidelity.

    Several pulses per beam are sub-beams on surfaces half a metre apart; the fast path leaves them to the exact chain.
    `progress` is called with (done, of, name).
    """
    whole = bench_scene.lab_frame()
    if quick:
        whole = whole.take(np.arange(0, len(whole), 20))
    cores = usable_cores()
    beams = [max(len(whole) // part, 1) for part in (256, 64, 16, 4, 1)]
    few = _some(whole, beams[2])
    plan: list[tuple[str, str, Sequence[float], Timed]] = [
        ("Beams", "beams of a frame", beams, lambda n, way: _speed(_some(whole, int(n)), way)),
        ("Pulses per beam", "pulses per beam", PULSES, lambda n, way: _speed(_pulses(few, int(n)), way)),
        ("Frames", "frames, one after another", FRAMES, lambda n, way: _speed(few, way, frames=int(n))),
        ("Cores", "cores", range(1, cores + 1), lambda n, way: _speed(whole, way, threads=int(n))),
    ]
    found = []
    for done, (title, label, at, timed) in enumerate(plan):
        progress(done, len(plan), title.lower())
        found.append(_course(title, label, at, timed))
    return found


def _course(title: str, label: str, at: Sequence[float], timed: Timed) -> Course:
    from lidarcheck.figures.data import Course, Curve

    x = np.array(at, dtype=np.float64)
    curves = tuple(Curve(way, x, np.array([timed(n, way) for n in at])) for way in WAYS)
    return Course(title, label, "Mbeams/s", curves, log_x=len(at) > 2, log_y=True)


def _some(whole: IdealScan, beams: int) -> IdealScan:
    return whole.take(np.linspace(0, len(whole) - 1, beams).astype(np.int64))


def _pulses(frame: IdealScan, pulses: int) -> IdealScan:
    """Each beam split into so many sub-beams, half a metre one behind the other."""
    from dataclasses import replace

    rows = np.repeat(np.arange(len(frame)), pulses)
    behind = np.tile(0.5 * np.arange(pulses), len(frame))
    split = frame.take(rows)
    return replace(split, distance_m=split.distance_m + behind)


def _speed(frame: IdealScan, way: Fidelity, *, frames: int = 1, threads: int | None = None) -> float:
    """Million beams a second, the best of three."""
    from lidarcheck.model import simulate

    model = bench_scene.lab_model("SMART")

    def run() -> None:
        for number in range(frames):
            simulate(frame, model, seed=1, frame=number, threads=threads, fidelity=way)

    beams = len(np.unique(frame.layer.astype(np.int64) << 32 | frame.point))
    return frames * beams / MEGA / min(times(run, 3))
