"""The surfaces of an ideal scan, and what effects have aimed its beams at: found once, and kept for the next seed."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lidarcheck.effects.base import AimEffect
from lidarcheck.rays import Caster
from lidarcheck.scan import IdealScan

if TYPE_CHECKING:
    from lidarcheck.model.chain import Run

__all__ = ["Surfaces"]

_KEPT = 4
_DEPENDS = {
    "ideal": (),
    "scene": (),
    "caster": (),
    "sensor": ("sensor",),
    "materials": ("materials",),
    "signal": ("sensor", "materials"),
}
"""On what of a run an effect depends, besides the scan and the scene, that has asked for this and for nothing else."""


@dataclass(frozen=True)
class _Aimed:
    """What an effect has made of an ideal scan, and what else it depended on."""

    effect: AimEffect
    before: IdealScan
    scene: Caster | None
    asked: dict[str, Any]
    after: IdealScan

    def holds(self, effect: AimEffect, run: Run) -> bool:
        """Whether the effect would do the same again."""
        same = self.before is run.ideal and self.scene is run.scene and self.effect == effect
        return same and all(getattr(run, name) == value for name, value in self.asked.items())


class Surfaces:
    """The surfaces of an ideal scan, found when an effect asks for them.

    Several threads may use one: at worst they find the same thing twice.
    """

    def __init__(self, ideal: IdealScan) -> None:
        self.ideal = ideal
        self._aimed: tuple[_Aimed, ...] = ()

    def __getstate__(self) -> dict[str, Any]:
        """Without what can be found again faster than it is sent."""
        return {"ideal": self.ideal, "_aimed": ()}

    @functools.cached_property
    def caster(self) -> Caster:
        """The surfaces themselves."""
        from lidarcheck.effects.geometry.surfaces import LocalSurfaces

        return LocalSurfaces.of(self.ideal)

    def aimed(self, effect: AimEffect, run: Run) -> IdealScan:
        """What the run's beams meet with the effect; from memory, where it draws no random numbers."""
        for kept in self._aimed:
            if kept.holds(effect, run):
                self._keep(kept)
                return kept.after
        around = _Watched(run.of(effect))
        after = effect.aim(run.ideal, around)
        if around.asked <= _DEPENDS.keys():
            names = {name for asked in around.asked for name in _DEPENDS[asked]}
            self._keep(_Aimed(effect, run.ideal, run.scene, {name: getattr(run, name) for name in names}, after))
        return after

    def _keep(self, new: _Aimed) -> None:
        """The last used come first; a few are kept."""
        self._aimed = (new, *(kept for kept in self._aimed if kept is not new))[:_KEPT]


class _Watched:
    """A run that notes what is asked of it."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self.asked: set[str] = set()

    def __getattr__(self, name: str) -> Any:
        self.asked.add(name)
        return getattr(self._run, name)
