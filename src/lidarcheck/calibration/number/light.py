"""The light of some beams of a frame, once for all seeds where no effect draws it, and the echoes that it makes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.calibration.number.frames import Frames
from lidarcheck.calibration.number.models import said_of
from lidarcheck.cases.frame import Frame
from lidarcheck.model.chain import echoes_of, read_out, simulate_frames
from lidarcheck.model.estimates import drawn, is_estimate
from lidarcheck.model.light import light_of
from lidarcheck.model.sharing import serially
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Run, Surfaces, of_stage, run_of
from lidarcheck.scan import Haze, Light, Scan, light_of_beams
from lidarcheck.sensor import Program

__all__ = ["Keys", "Lights", "Lit", "keys_of", "lights_of", "lit"]

Keys = npt.NDArray[np.int64]


def keys_of(layer: npt.ArrayLike, point: npt.ArrayLike) -> Keys:
    """One number a beam, ascending in (layer, point), same shape."""
    return np.asarray(np.asarray(layer, dtype=np.int64) << 32 | np.asarray(point, dtype=np.int64))


@dataclass(frozen=True)
class Lit:
    """What some beams of a frame get with a model: their light and the run that it comes from, one for all seeds, or
    one for each where effects draw. `alike`: a hash of it and of all that sees it."""

    of_seed: tuple[tuple[Light, Run], ...]
    seeds: tuple[int, ...]

    @property
    def alike(self) -> str:
        """A hash of the light and of what sees it: what agrees in it shows the same echoes."""
        digest = hashlib.sha256(repr(self.seeds).encode())
        for light, run in self.of_seed:
            for column in _columns(light):
                digest.update(np.ascontiguousarray(column).tobytes())
            readout = of_stage("readout", run.model.effects)
            digest.update(repr((run.sensor, readout, light.shape, run.model.external)).encode())
        return digest.hexdigest()

    def scan(self, k: int) -> Scan:
        """The echoes with the k-th seed, as `simulate` gives them for these beams."""
        light, run = self.of_seed[min(k, len(self.of_seed) - 1)]
        run = replace(run, seed=self.seeds[k])
        effects = of_stage("readout", run.model.effects)
        how: dict[str, Any] = {"seed": run.seed, "frame": run.frame, "threads": 1, "run": run}
        scan = echoes_of(light, run.sensor, rounded=not effects, **how)
        return read_out(scan, run, effects) if effects else scan


def lit(frame: Frame, surfaces: Surfaces, model: Model, seeds: Sequence[int], keys: Keys) -> Lit:
    """The light of the beams `keys`, ascending, of a frame.

    Light of other beams may reach these, so that the whole frame's is found first and then cut.
    """
    drew: list[str] = []
    found = [_light(frame, surfaces, model, seeds[0], drew)]
    if drew:
        found += [_light(frame, surfaces, model, seed, drew) for seed in seeds[1:]]
    return Lit(tuple((_cut(light, keys), run) for light, run in found), tuple(seeds))


@dataclass(frozen=True)
class Lights:
    """What some beams of several frames get. `scans`: the echoes of all frames with the k-th seed; `first`: the light
    with the first seed and the run that it comes from, of each frame, empty for somebody else's program."""

    alike: str
    scans: Callable[[int], Sequence[Scan]]
    first: tuple[tuple[Light, Run], ...] = ()


def lights_of(data: Frames, model: Model, seeds: Sequence[int], keys: Sequence[Keys]) -> Lights:
    """The light of the beams `keys` of each frame, and their echoes; somebody else's program gets whole frames."""
    if isinstance(model.sensor, Program):
        return _around(data, model, seeds, keys)
    pairs = zip(data.frames, data.surfaces, keys, strict=True)
    found = [lit(frame, surfaces, model, seeds, some) for frame, surfaces, some in pairs]
    first = tuple(one.of_seed[0] for one in found)
    return Lights(_hash([one.alike for one in found]), lambda k: [one.scan(k) for one in found], first)


def _around(data: Frames, model: Model, seeds: Sequence[int], keys: Sequence[Keys]) -> Lights:
    """Of somebody else's program, whose echoes may depend on all that the model says."""
    numbers, ideals = [f.number for f in data.frames], [s.ideal for s in data.surfaces]

    def scans(k: int) -> list[Scan]:
        whole = simulate_frames(ideals, model, seed=seeds[k], frames=numbers, surfaces=data.surfaces)
        pairs = zip(whole, keys, strict=True)
        return [scan.take(np.isin(keys_of(scan.layer, scan.point), some)) for scan, some in pairs]

    return Lights(_hash([said_of(model), *map(str, seeds)]), scans)


def _hash(words: Sequence[str]) -> str:
    return hashlib.sha256("\n".join(words).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class _Watched(Run):
    """A run that notes who draws random numbers."""

    drew: list[str] = field(default_factory=list)

    def uniforms(self, layer: npt.ArrayLike, point: npt.ArrayLike, draws: int = 1) -> FloatArray:
        """As the run's own."""
        self.drew.append(self.purpose)
        return Run.uniforms(self, layer, point, draws)


def _light(frame: Frame, surfaces: Surfaces, model: Model, seed: int, drew: list[str]) -> tuple[Light, Run]:
    """As `run_and_light`; `drew` gets the names of those that draw."""
    plain = run_of(surfaces.ideal, model, seed, frame.number, None, surfaces)
    run: Run = _Watched(**{f.name: getattr(plain, f.name) for f in fields(Run)}, drew=drew)
    run = run.after_stage("aim", model.effects)
    if is_estimate(run.ideal):
        drew.append("estimate")
        run = replace(run, ideal=drawn(run.ideal, seed))
    light = light_of(run.ideal, model, serially)
    for effect in of_stage("light", model.effects):
        light = effect.light(light, run.of(effect))
    run = run.after_stage("detector", model.effects)
    sensor = run.sensor
    for effect in of_stage("readout", model.effects):
        light, sensor = effect.before(light, sensor)
    return light, replace(run, sensor=sensor)


def _cut(light: Light, keys: Keys) -> Light:
    """The light of some beams, with what the air scatters into them."""
    mask = np.isin(keys_of(light.layer, light.point), keys)
    part = light_of_beams(light, mask)
    return part if light.haze is None else replace(part, haze=_cut_haze(light.haze, mask))


def _cut_haze(haze: Haze, mask: BoolArray) -> Haze:
    counts = np.diff(haze.first_row)
    rows = np.repeat(mask, counts)
    first = np.concatenate([[0], np.cumsum(counts[mask])])
    return replace(haze, first_row=first, row_end_m=haze.row_end_m[rows], row_share=haze.row_share[rows])


def _columns(light: Light) -> list[npt.NDArray[Any]]:
    columns: list[npt.NDArray[Any]] = [light.layer, light.point, light.background_per_ns, light.first_pulse]
    columns += [light.pulse_range_m, light.pulse_signal]
    haze = light.haze
    if haze is not None:
        columns += [haze.density_per_m, haze.first_row, haze.row_end_m, haze.row_share]
    return columns
