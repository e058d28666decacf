"""What models show of some frames, with the same random numbers for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lidarcheck.cases.frame import Frame
from lidarcheck.effects.base import Effect, ReadoutEffect
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.observed.beam_table import BeamTable
from lidarcheck.inference.observed.observations import Observations, observations_of
from lidarcheck.model.chain import simulate_frames
from lidarcheck.model.incremental import DetectedFrame, program_frames, simulate_detected
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Surfaces, run_and_light
from lidarcheck.scan import Light, Scan
from lidarcheck.sensor import Program, Sensor

__all__ = ["Simulations", "observed"]

_KEPT = 12
"""Simulations that are kept at most: each holds all echoes of the frames."""
_KEPT_POSES = 4
"""Poses whose surfaces are kept at most."""
_ALL = 1000
"""More differences than a model has effects and materials: every beam is another."""
_NONE = np.zeros(0)
_NO_LIGHT = Light(_NONE.astype(np.int32), _NONE.astype(np.int32), _NONE, np.zeros(1, dtype=np.int64), _NONE, _NONE)


def observed(
    frames: Sequence[Frame], surfaces: Sequence[Surfaces], beams: BeamTable, model: Model, seed: int
) -> Observations:
    """What a model shows of each beam of a table; `surfaces`: those of the frames' ideal scans."""
    numbers = [f.number for f in frames]
    scans = simulate_frames([s.ideal for s in surfaces], model, seed=seed, frames=numbers, surfaces=surfaces)
    return observations_of(beams, scans)


class _Simulated(NamedTuple):
    """What was simulated: the effects that act before the detectors, those of them, the sensor, the reflectances, the
    seed, the error of the pose."""

    light: tuple[Effect, ...]
    detector: tuple[Effect, ...]
    sensor: Sensor
    reflectances: tuple[tuple[int, float], ...]
    seed: int
    pose: tuple[float, float, float]

    @classmethod
    def of(cls, model: Model, seed: int, nuisance: Nuisance) -> _Simulated:
        """That of a model."""
        light = tuple(e for e in model.effects if e.stage in ("aim", "light") or _acts_before(e, model.sensor))
        detector = tuple(effect for effect in model.effects if effect.stage == "detector")
        table = tuple((i, m.reflectance) for i, m in model.materials.items())
        return cls(light, detector, model.sensor, table, seed, (nuisance.yaw, nuisance.pitch, nuisance.height))

    def differences(self, other: _Simulated) -> int:
        """In how many effects and reflectances another one differs; `_ALL` where every beam does."""
        if (self.detector, self.sensor, self.seed, self.pose) != (other.detector, other.sensor, other.seed, other.pose):
            return _ALL
        return len({*self.light} ^ {*other.light}) + len({*self.reflectances} ^ {*other.reflectances})


def _acts_before(effect: Effect, sensor: Sensor) -> bool:
    """Whether an effect of the readout acts on the light or the sensor of this detector, as a shift of all ranges does
    on a histogram or on what a program is handed."""
    if not isinstance(effect, ReadoutEffect):
        return False
    light, after = effect.before(_NO_LIGHT, sensor)
    return light is not _NO_LIGHT or after is not sensor


class Simulations:
    """Simulates models on some frames, and keeps echoes for models that differ by little: most of those that a fit asks
    for. What is kept saves time and changes nothing.

    `seed`: what all seeds begin from.
    """

    def __init__(self, frames: Sequence[Frame], seed: int = 0) -> None:
        self.frames = tuple(frames)
        self.seed = seed
        self._own: Model | None = None
        self._unread: dict[_Simulated, list[DetectedFrame]] = {}
        self._plain: dict[int, list[DetectedFrame]] = {}
        self._surfaces = [Surfaces(f.ideal) for f in self.frames]
        self._posed: dict[tuple[float, float, float], list[Surfaces]] = {}

    def __getstate__(self) -> dict[str, object]:
        """Without what is kept of other models than the case's own."""
        return {**self.__dict__, "_unread": {}, "_posed": {}}

    def keep_own(self, model: Model, seeds: int) -> None:
        """Simulate the case's own model with the first seeds and keep that for good."""
        self._own = model
        self._plain = {k: self._simulated(model, k, Nuisance()) for k in range(seeds)}

    def scans(self, model: Model, seed: int, nuisance: Nuisance | None = None) -> list[Scan]:
        """What the model shows of every frame, with random numbers of its own."""
        nuisance = nuisance or Nuisance()
        run = nuisance.model(model)
        echoes = self._echoes(run, seed, nuisance)
        return [one.read_out(run) for one in echoes]

    def _echoes(self, model: Model, seed: int, nuisance: Nuisance) -> list[DetectedFrame]:
        """The echoes before the readout, kept for the next model that differs by its readout alone, or by little."""
        key = _Simulated.of(model, seed, nuisance)
        found = self._unread.get(key)
        if found is None:
            near, like = self._nearest(key)
            found = self._simulated(model, seed, nuisance, like)
            # Replaced, not changed: other threads may look at it. What was of use is kept longer.
            kept = {k: v for k, v in self._unread.items() if k != near}
            kept |= {near: like} if near is not None and like is not None else {}
            self._unread = {**dict([*kept.items()][1 - _KEPT :]), key: found}
        return found

    def _nearest(self, key: _Simulated) -> tuple[_Simulated | None, list[DetectedFrame] | None]:
        """Of what is kept, what has most of its beams in common with a model: the latest, or the case's own model."""
        plain = self._plain.get(key.seed)
        least = _ALL
        if self._own is not None and plain is not None:
            least = key.differences(_Simulated.of(self._own, key.seed, Nuisance()))
        kept = self._unread
        near = min(reversed(kept), key=key.differences, default=None)
        if near is None or key.differences(near) >= least:
            return None, plain
        return near, kept[near]

    def _simulated(
        self, model: Model, seed: int, nuisance: Nuisance, like: Sequence[DetectedFrame] | None = None
    ) -> list[DetectedFrame]:
        model, surfaces = self._posed_of(model, nuisance)
        if isinstance(model.sensor, Program):
            frames = zip(self.frames, surfaces, strict=True)
            lit = [run_and_light(s.ideal, model, (self.seed << 16) + seed, f.number, None, s, 1) for f, s in frames]
            return program_frames([(light, run) for run, light in lit], like or ())
        return [
            simulate_detected(
                one.ideal,
                model,
                seed=(self.seed << 16) + seed,
                frame=f.number,
                threads=1,
                like=None if like is None else like[i],
                surfaces=one,
            )
            for i, (f, one) in enumerate(zip(self.frames, surfaces, strict=True))
        ]

    def _posed_of(self, model: Model, nuisance: Nuisance) -> tuple[Model, list[Surfaces]]:
        """The model and the surfaces with the pose's error; the latter kept for the next model."""
        pose = (nuisance.yaw, nuisance.pitch, nuisance.height)
        kept = self._posed.get(pose)
        if kept is not None and all(effect.stage != "aim" for effect in model.effects):
            return model, kept
        posed, surfaces = nuisance.posed(model, self._surfaces)
        if posed is model:
            self._posed = {**dict([*self._posed.items()][1 - _KEPT_POSES :]), pose: surfaces}
        return posed, surfaces
