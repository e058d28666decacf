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

_FEW_BEAMS = 5
"""Fewer show nothing of a material."""


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

    Frames are swapped then where the fit would lack a material that others have: what it does not see, a sign's
    blooming or a pane's reflections, it could not find. Of the case's frames only the ideal scans are looked at.
    `UsageError` for fewer than three.
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
    _show_all_materials(dealt)
    return Split(*(tuple(sorted(dealt[name], key=lambda f: f.number)) for name in ("fit", "select", "verify")))


def _show_all_materials(dealt: dict[str, list[Frame]]) -> None:
    """Swap frames into the fit while that shows it more materials."""
    materials = {frame.number: _materials(frame) for frames in dealt.values() for frame in frames}
    fit = dealt["fit"]

    def shown(frames: Sequence[Frame]) -> set[int]:
        return set().union(*(materials[frame.number] for frame in frames))

    others = [(role, i) for role in ("select", "verify") for i in range(len(dealt[role]))]
    while True:
        now = shown(fit)
        role, i = max(others, key=lambda at: len(materials[dealt[at[0]][at[1]].number] - now))
        new = dealt[role][i]
        out = max(range(len(fit)), key=lambda j: len(shown([*fit[:j], new, *fit[j + 1 :]])))
        if len(shown([*fit[:out], new, *fit[out + 1 :]])) <= len(now):
            return
        fit[out], dealt[role][i] = new, fit[out]


def _materials(frame: Frame) -> set[int]:
    """The materials that more than a few beams meet."""
    found, beams = np.unique(frame.ideal.material_id[frame.ideal.distance_m > 0.0], return_counts=True)
    return {int(i) for i in found[beams >= _FEW_BEAMS]}


def _distance(frame: Frame) -> float:
    met = frame.ideal.distance_m[frame.ideal.distance_m > 0.0]
    return float(np.median(met)) if len(met) else 0.0
