"""What of a frame's aim and light no seed changes, kept for the next seed, frame or model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lidarcheck.effects.base import LightEffect
from lidarcheck.model.light import light_of
from lidarcheck.rays import Caster
from lidarcheck.scan import IdealScan, Light

if TYPE_CHECKING:
    from lidarcheck.model.stages import Run

__all__ = ["KeptLights", "Watched", "through"]

_KEPT = 2
"""Chains that are kept at most: that of the model asked for last, and of the one before, which differs by little."""
_DEPENDS = {
    "ideal": (),
    "scene": (),
    "caster": (),
    "sensor": ("sensor",),
    "materials": ("materials",),
    "signal": ("sensor", "materials"),
}
"""On what of a run an effect depends, besides the scan and the scene, that has asked for this and for nothing else."""


class Watched:
    """A run that notes what is asked of it."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self.asked: set[str] = set()

    def __getattr__(self, name: str) -> Any:
        self.asked.add(name)
        return getattr(self._run, name)

    def depends(self) -> dict[str, Any] | None:
        """What of the run that goes by, with its values; None where the next seed may change it."""
        if not self.asked <= _DEPENDS.keys():
            return None
        return {name: getattr(self._run, name) for asked in self.asked for name in _DEPENDS[asked]}


@dataclass(frozen=True)
class _Step:
    """What an effect has made of the light before it, and what else that went by; None where a seed changes it.

    Without an effect it is the light of the ideal scan itself.
    """

    effect: LightEffect | None
    ideal: IdealScan
    scene: Caster | None
    asked: dict[str, Any] | None
    after: Light

    @classmethod
    def first(cls, run: Run) -> _Step:
        """The light of the run's ideal scan."""
        asked = {"sensor": run.sensor, "materials": run.materials}
        return cls(None, run.ideal, run.scene, asked, light_of(run.ideal, run.model, run.among))

    @classmethod
    def next(cls, effect: LightEffect, light: Light, run: Run) -> _Step:
        """The light with one more effect."""
        around: Any = Watched(run.of(effect))
        after = effect.light(light, around)
        return cls(effect, run.ideal, run.scene, around.depends(), after)

    def holds(self, effect: LightEffect | None, run: Run) -> bool:
        """Whether the same would come of the same light again."""
        if self.asked is None or self.ideal is not run.ideal or self.scene is not run.scene or self.effect != effect:
            return False
        return all(getattr(run, name) == value for name, value in self.asked.items())


class KeptLights:
    """The light of an ideal scan behind the effects of some models, step by step, for runs whose ideal scan no seed
    changes: a model takes the steps that it has in common with one of them, and makes the others.

    Several threads may use one: at worst they find the same thing twice.
    """

    def __init__(self) -> None:
        self._chains: tuple[tuple[_Step, ...], ...] = ()

    def light(self, run: Run, effects: Sequence[LightEffect]) -> Light:
        """The run's light behind these effects."""
        chain: list[_Step] = []
        alike = [one for one in self._chains if one[0].holds(None, run)]
        step = alike[0][0] if alike else _Step.first(run)
        for place, effect in enumerate(effects, start=1):
            alike = [one for one in alike if one[place - 1] is step]
            chain.append(step)
            alike = [one for one in alike if len(one) > place and one[place].holds(effect, run)]
            step = alike[0][place] if alike else _Step.next(effect, step.after, run)
            if step.asked is None:
                self._keep(chain)
                return through(effects[place:], step.after, run)
        self._keep([*chain, step])
        return step.after

    def _keep(self, chain: Sequence[_Step]) -> None:
        """The last used come first; what is the beginning of another is not kept besides it."""
        others = [one for one in self._chains if len(one) > len(chain) or chain[len(one) - 1] is not one[-1]]
        self._chains = (tuple(chain), *others)[:_KEPT]


def through(effects: Sequence[LightEffect], light: Light, run: Run) -> Light:
    """The light behind some effects, one after the other."""
    for effect in effects:
        light = effect.light(light, run.of(effect))
    return light
