"""Splitting the frames before anything looks at them: to fit, to select, to verify."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.cases.frame import FEWEST_FRAMES, Frame
from lidarcheck.errors import UsageError

__all__ = ["Split", "Unseen", "exchanged", "split_frames"]

_ROLES = ("fit", "verify", "fit", "select", "fit", "verify")
"""The roles of frames in order of their distances: of six, three fit, one selects and two verify."""
_FEW, _ROLES_OF_FEW = 5, ("fit", "select", "verify")
"""Of fewer frames, each role has one before any has two."""
_WORTH = 0.1
"""Two frames are swapped where that brings so large a part of the beams to where it is wanted."""
_OF_VERIFY = 0.5
"""What only the frames to verify have in view counts so much: no name is chosen by it."""

Roles = npt.NDArray[np.str_]


class Unseen:
    """Frames that are kept back: they can be looked at once, so that nothing is chosen by what they show."""

    def __init__(self, frames: Sequence[Frame]) -> None:
        self.numbers = tuple(frame.number for frame in frames)
        """The frames' numbers as in the case's file."""
        self._frames: tuple[Frame, ...] | None = tuple(frames)

    def look(self) -> tuple[Frame, ...]:
        """The frames, once; `RuntimeError` the second time, which is a mistake in the program."""
        if self._frames is None:
            raise RuntimeError("the frames of the verification have been looked at already")
        found, self._frames = self._frames, None
        return found


@dataclass(frozen=True)
class Split:
    """Frames by what they are for; those that verify are kept back until all has been decided."""

    fit: tuple[Frame, ...]
    select: tuple[Frame, ...]
    verify: Unseen
    declared: bool = False
    """Whether the case itself says what each frame is for."""

    def numbers(self) -> Mapping[str, tuple[int, ...]]:
        """The frames' numbers as in the case's file."""
        fit, select = (tuple(frame.number for frame in frames) for frames in (self.fit, self.select))
        return {"fit": fit, "select": select, "verify": self.verify.numbers}

    def words(self) -> str:
        """In a sentence."""
        return "; ".join(f"{name}: frames {', '.join(map(str, numbers))}" for name, numbers in self.numbers().items())


def split_frames(frames: Sequence[Frame]) -> Split:
    """Deal frames in order of their median distance to fit, select and verify, so that each spans the distances; then
    swap some, so that the frames of the fit have in view what the others have. Where frames say what they are for, as
    that.

    Of the case's frames only the ideal scans are looked at. `UsageError` for fewer than three, or a part without any.
    """
    if len(frames) < FEWEST_FRAMES:
        raise UsageError(
            f"{len(frames)} {'frame is' if len(frames) == 1 else 'frames are'} too few to split",
            fix=f"give at least {FEWEST_FRAMES} frames: one each to fit, to select and to verify",
        )
    if any(frame.part for frame in frames):
        return _as_declared(frames)
    order = sorted(frames, key=lambda f: (f.median_range_m, f.number))
    roles = _ROLES_OF_FEW if len(frames) < _FEW else _ROLES
    dealt = _swapped(np.array([roles[i % len(roles)] for i in range(len(order))]), _in_view(order))
    by_role = {name: [f for f, role in zip(order, dealt, strict=True) if role == name] for name in _ROLES_OF_FEW}
    fit, select, verify = (tuple(sorted(part, key=lambda f: f.number)) for part in by_role.values())
    return Split(fit, select, Unseen(verify))


def _as_declared(frames: Sequence[Frame]) -> Split:
    by_part = {part: tuple(f for f in frames if f.part == part) for part in _ROLES_OF_FEW}
    for part, those in by_part.items():
        if not those:
            raise UsageError(f"no frame to {part} is left", fix="mend the frames that are left out, or add some")
    fit, select, verify = by_part.values()
    return Split(fit, select, Unseen(verify), declared=True)


def exchanged(split: Split) -> Split:
    """The select frames take part in the fit, and as many of its frames select in their place: those that the fit lacks
    least, by the materials that they have in view."""
    in_view, ways = _in_view((*split.fit, *split.select)), []
    for chosen in itertools.combinations(range(len(split.fit)), len(split.select)):
        roles = np.array(["fit"] * (len(split.fit) + len(split.select)))
        roles[[*chosen]] = "select"
        ways.append((_unlike(roles, in_view), chosen))
    _, chosen = min(ways)
    fit = (*(f for i, f in enumerate(split.fit) if i not in chosen), *split.select)
    return Split(tuple(sorted(fit, key=lambda f: f.number)), tuple(split.fit[i] for i in chosen), split.verify)


def _in_view(frames: Sequence[Frame]) -> FloatArray:
    """What part of each frame's beams meets each material, or nothing, shape (n_frames, 1 + n_materials)."""
    met = [np.where(f.ideal.distance_m > 0.0, f.ideal.material_id, -1) for f in frames]
    materials = np.unique(np.concatenate([[-1], *met]))
    return np.array([np.bincount(np.searchsorted(materials, one), minlength=len(materials)) / len(one) for one in met])


def _swapped(roles: Roles, in_view: FloatArray) -> Roles:
    """The roles of the frames, shape (n_frames,), after those swaps of two that help most, while any helps enough: an
    effect that shows on one material alone cannot be fitted where that is nowhere in view."""
    unlike = _unlike(roles, in_view)
    for _ in range(len(roles)):
        swaps = [pair for pair in itertools.combinations(range(len(roles)), 2) if roles[pair[0]] != roles[pair[1]]]
        found = [(_unlike(_swap(roles, pair), in_view), pair) for pair in swaps]
        best, pair = min(found)
        if best > unlike - _WORTH:
            break
        roles, unlike = _swap(roles, pair), best
    return roles


def _swap(roles: Roles, pair: tuple[int, int]) -> Roles:
    other = roles.copy()
    other[[*pair]] = roles[[*pair[::-1]]]
    return other


def _unlike(roles: Roles, in_view: FloatArray) -> float:
    """What part of the beams of the other frames, and half of that of those to verify, meets what those of the fit do
    not."""
    fit = in_view[roles == "fit"].mean(axis=0)
    lacking = [
        np.maximum(in_view[of].mean(axis=0) - fit, 0.0).sum() for of in (roles != "fit", roles == "verify") if of.any()
    ]
    return float(np.dot(lacking, (1.0, _OF_VERIFY)[: len(lacking)]))
