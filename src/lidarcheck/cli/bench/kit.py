"""What the figures of `lidarcheck bench` are made of, and how their times are taken."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

__all__ = ["MEGA", "Alternative", "Figure", "duration", "rate", "times", "times_in_turn"]

MEGA = 1e6


@dataclass(frozen=True, slots=True)
class Alternative:
    """Another way to the same: what it reached, in the figure's unit, and how many times better the figure is."""

    name: str
    best: float
    ratio: float


@dataclass(frozen=True, slots=True)
class Figure:
    """A speed, or a time where the unit is s: best and median of the repeats."""

    name: str
    unit: str
    best: float
    median: float
    repeats: int
    against: tuple[Alternative, ...] = ()


def times(work: Callable[[], object], repeats: int, *, warm: bool = True) -> list[float]:
    """Seconds of each repeat; with `warm` one more before them warms compilers and caches."""
    if warm:
        work()
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return seconds


def times_in_turn(
    works: Sequence[Callable[[], object]], other: Callable[[], object], repeats: int
) -> tuple[list[float], list[float]]:
    """Seconds of `works` and of `other`, one after the other in each repeat, so that both meet the same machine."""
    ours: list[float] = []
    others: list[float] = []
    for work in (*works, other):
        work()
    for _ in range(repeats):
        for work, seconds in (*((work, ours) for work in works), (other, others)):
            start = time.perf_counter()
            work()
            seconds.append(time.perf_counter() - start)
    return ours, others


def rate(name: str, unit: str, amount: float, seconds: list[float], against: tuple[Alternative, ...] = ()) -> Figure:
    """A figure where more is better."""
    return Figure(name, unit, amount / min(seconds), amount / statistics.median(seconds), len(seconds), against)


def duration(name: str, seconds: list[float], against: tuple[Alternative, ...] = ()) -> Figure:
    """A figure where less is better."""
    return Figure(name, "s", min(seconds), statistics.median(seconds), len(seconds), against)
