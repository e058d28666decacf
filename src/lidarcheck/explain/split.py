"""Splitting the frames before anything looks at them: to fit, to select, to verify."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.errors import UsageError
from lidarcheck.explain.lab import Frame

__all__ = ["Split", "split_frames"]

FEWEST = 3
_ROLES = ("fit", "verify", "fit", "select", "fit", "verify")
"""The roles of frames in order of their distances: of six, three fit, one selects and two verify."""


@dataclass(frozen=True)
class Split:
    """Frames by what they are for."""

    fit: tuple[Frame, ...]
    select: tuple[Frame, ...]
    verify: tuple[Frame, ...]

    def numbers(self) -> Mapping[str, tuple[int, ...]]:
        """The frames' numbers as in the case's file."""
        return {name: tuple(f.number for f in getattr(self, name)) for name in ("fit", "select", "verify")}

    def words(self) -> str:
        """In a sentence."""
        return "; ".join(f"{name}: frames {', '.join(map(str, numbers))}" for name, numbers in self.numbers().items())


def split_frames(frames: Sequence[Frame]) -> Split:
    """Deal frames in order of their median distance to fit, select and verify, so that each spans the distances.

    Of the case's frames only the ideal scans are looked at. `UsageError` for fewer than three.
    """
    if len(frames) < FEWEST:
        raise UsageError(
            f"{len(frames)} {'frame is' if len(frames) == 1 else 'frames are'} too few to split",
            fix=f"give at least {FEWEST} frames: one each to fit, to select and to verify",
        )
    order = sorted(frames, key=lambda f: (_distance(f), f.number))
    roles = ("fit", "select", "verify") if len(frames) < 5 else _ROLES
    dealt: dict[str, list[Frame]] = {name: [] for name in ("fit", "select", "verify")}
    for i, frame in enumerate(order):
        dealt[roles[i % len(roles)]].append(frame)
    return Split(*(tuple(sorted(dealt[name], key=lambda f: f.number)) for name in ("fit", "select", "verify")))


def _distance(frame: Frame) -> float:
    met = frame.ideal.distance_m[frame.ideal.distance_m > 0.0]
    return float(np.median(met)) if len(met) else 0.0
