"""A frame while it is simulated, and its stages up to the light: what beams are aimed at, pulses, the sensor."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.base import AimEffect, Effect, in_detector
from lidarcheck.errors import UsageError
from lidarcheck.model.estimates import drawn, with_row_keys
from lidarcheck.model.kept import KeptLights, Watched, through
from lidarcheck.model.light import light_of, surface_signal
from lidarcheck.model.sharing import Share, serially, share
from lidarcheck.model.spec import Model
from lidarcheck.rays import Caster
from lidarcheck.scan import IdealScan, Light
from lidarcheck.sensor import Material, Sensor

__all__ = [
    "Run",
    "Surfaces",
    "aimed",
    "check_seed",
    "light_after_effects",
    "of_stage",
    "run_and_light",
    "run_of",
]

_KEPT = 4


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
    """The surfaces of an ideal scan, found when an effect asks for them, and what of aim and light no seed changes.

    Several threads may use one: at worst they find the same thing twice.
    """

    def __init__(self, ideal: IdealScan) -> None:
        self.ideal = ideal
        self._aimed: tuple[_Aimed, ...] = ()
        self._lights = KeptLights()

    def __getstate__(self) -> dict[str, Any]:
        """Without what can be found again faster than it is sent."""
        return {"ideal": self.ideal, "_aimed": (), "_lights": KeptLights()}

    @functools.cached_property
    def caster(self) -> Caster:
        """The surfaces themselves."""
        from lidarcheck.effects.geometry.surfaces import LocalSurfaces

        return LocalSurfaces.of(self.ideal)

    @functools.cached_property
    def keyed(self) -> IdealScan:
        """The ideal scan, whose rows keep what their errors are drawn by while effects aim them."""
        return with_row_keys(self.ideal)

    def aimed(self, effect: AimEffect, run: Run) -> IdealScan:
        """What the run's beams meet with the effect; from memory, where it draws no random numbers."""
        for kept in self._aimed:
            if kept.holds(effect, run):
                self._keep(kept)
                return kept.after
        around: Any = Watched(run.of(effect))
        after = effect.aim(run.ideal, around)
        asked = around.depends()
        if asked is not None:
            self._keep(_Aimed(effect, run.ideal, run.scene, asked, after))
        return after

    def light(self, run: Run) -> Light:
        """The run's light behind its light effects; from memory, as far as no random numbers are in it."""
        if run.ideal is self.ideal or run.ideal is self.keyed or any(one.after is run.ideal for one in self._aimed):
            return self._lights.light(run, of_stage("light", run.model.effects))
        return _lit(run)

    def _keep(self, new: _Aimed) -> None:
        """The last used come first; a few are kept."""
        self._aimed = (new, *(kept for kept in self._aimed if kept is not new))[:_KEPT]


def _lit(run: Run) -> Light:
    """The run's light behind its light effects."""
    return through(of_stage("light", run.model.effects), light_of(run.ideal, run.model, run.among), run)


def light_after_effects(
    ideal: IdealScan, model: Model, *, seed: int = 0, frame: int = 0, scene: Caster | None = None
) -> tuple[Light, Sensor]:
    """The light that reaches the SPADs and the sensor that sees it, behind all effects up to the readout; of an ideal
    scan as it is written, whatever errors it has."""
    run, light = run_and_light(ideal, model, seed, frame, scene, as_written=True)
    return light, run.sensor


def aimed(
    ideal: IdealScan,
    model: Model,
    *,
    seed: int = 0,
    frame: int = 0,
    scene: Caster | None = None,
    surfaces: Surfaces | None = None,
) -> IdealScan:
    """What the beams meet behind the model's aim effects. `surfaces`: those of this ideal scan, if known already."""
    return run_of(ideal, model, seed, frame, scene, surfaces).after_stage("aim", model.effects).ideal


def run_of(
    ideal: IdealScan, model: Model, seed: int, frame: int, scene: Caster | None, surfaces: Surfaces | None
) -> Run:
    """A frame before any effect; `UsageError` for an effect that means nothing for the model's sensor."""
    if model.external is not None:
        from lidarcheck.model.external.reads import readied

        model = readied(model, [ideal])
    for effect in model.effects:
        effect.check(model.sensor)
    surfaces = surfaces or Surfaces(ideal)
    return Run(seed, frame, model, model.sensor, surfaces.keyed, scene, surfaces)


def run_and_light(
    ideal: IdealScan,
    model: Model,
    seed: int,
    frame: int,
    scene: Caster | None,
    surfaces: Surfaces | None = None,
    threads: int | None = 1,
    *,
    as_written: bool = False,
) -> tuple[Run, Light]:
    """What effects may know behind the detector stage, and the light that reaches the SPADs.

    `surfaces`: those of this ideal scan, if known already: they keep the light for the next seed or model. `threads`:
    all cores when None. `as_written`: without drawing what the ideal scan may be off by (`estimates`).
    """
    among = functools.partial(share, threads=threads)
    run = replace(run_of(ideal, model, seed, frame, scene, surfaces), among=among).after_stage("aim", model.effects)
    run = run if as_written else replace(run, ideal=drawn(run.ideal, seed))
    light = _lit(run) if surfaces is None else surfaces.light(run)
    run = run.after_stage("detector", model.effects)
    sensor = run.sensor
    for effect in of_stage("readout", model.effects):
        light, sensor = effect.before(light, sensor)
    return replace(run, sensor=sensor), light


@dataclass(frozen=True, slots=True)
class Run:
    """What effects may know while a frame is simulated; random numbers are keyed by the asking effect's name."""

    seed: int
    frame: int
    model: Model
    sensor: Sensor
    ideal: IdealScan
    scene: Caster | None
    surfaces: Surfaces
    purpose: str = ""
    among: Share = serially

    @property
    def materials(self) -> Mapping[int, Material]:
        """The model's table."""
        return self.model.materials

    @property
    def caster(self) -> Caster:
        """Who is asked what a ray meets: the scene, else the ideal scan's own surfaces."""
        return self.surfaces.caster if self.scene is None else self.scene

    def signal(self, ideal: IdealScan) -> npt.NDArray[np.float64]:
        """S of each row, shape (n,)."""
        return surface_signal(ideal, self.model)

    def of(self, effect: Effect) -> Run:
        """The same for this effect, whose random numbers are its own."""
        return replace(self, purpose=effect.name)

    def after_stage(self, stage: str, effects: tuple[Effect, ...]) -> Run:
        """Behind the effects of the stage "aim" or "detector"."""
        run = self
        if stage == "aim":
            for effect in of_stage(stage, effects):
                run = replace(run, ideal=run.surfaces.aimed(effect, run))
            return run
        for effect in effects:
            run = replace(run, sensor=in_detector(effect, run.sensor))
        return run

    def uniforms(self, layer: npt.ArrayLike, point: npt.ArrayLike, draws: int = 1) -> npt.NDArray[np.float64]:
        """Uniform random numbers of these beams, shape (n, draws)."""
        from lidarcheck.model import streams

        return streams.uniforms(self.seed, self.purpose, self.frame, layer, point, draws, self.among)


def of_stage(stage: str, effects: tuple[Effect, ...]) -> list[Any]:
    """The effects of a stage, in their order."""
    return [effect for effect in effects if effect.stage == stage]


def check_seed(seed: int, frame: int = 0) -> None:
    """Refuse a seed or a frame that is no unsigned 64-bit whole number."""
    for name, value in (("seed", seed), ("frame", frame)):
        if isinstance(value, bool) or not hasattr(value, "__index__") or not 0 <= value < 2**64:
            fix = "use a whole number from 0 to 18446744073709551615"
            raise UsageError(f"{name} {value} is out of range", fix=fix)
