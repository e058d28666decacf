"""The light of some beams of a frame, once for all seeds where no effect draws it, and the echoes that it makes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.calibration.number.frames import Frames
from lidarcheck.calibration.number.memo import Memo
from lidarcheck.calibration.number.models import said_of
from lidarcheck.cases.frame import Frame
from lidarcheck.model.chain import simulate_frames
from lidarcheck.model.incremental import DetectedFrame, detected
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Run, Surfaces, of_stage, run_and_light
from lidarcheck.scan import Light, Scan, light_of_beams
from lidarcheck.sensor import Program

__all__ = ["Keys", "Lights", "Lit", "keys_of", "lights_of", "lit"]

Keys = npt.NDArray[np.int64]

_KEPT_BEAMS = 1_000_000
"""Beams of a frame, times seeds, up to which echoes are kept for the next model: some 100 MB."""
_LAST: Memo[Sequence[Lit]] = Memo(4)
"""What was simulated last, by the measurement, the beams and the seeds."""


def keys_of(layer: npt.ArrayLike, point: npt.ArrayLike) -> Keys:
    """One number a beam, ascending in (layer, point), same shape."""
    return np.asarray(np.asarray(layer, dtype=np.int64) << 32 | np.asarray(point, dtype=np.int64))


@dataclass(frozen=True)
class Lit:
    """What some beams of a frame get with a model: their light and the run that it comes from, one for all seeds, or
    one for each where effects draw. `alike`: a hash of it and of all that sees it. `before`: the echoes that another
    model made with the k-th seed, which are taken for beams that get the same light; `shown`: those of this one."""

    of_seed: tuple[tuple[Light, Run], ...]
    seeds: tuple[int, ...]
    before: Mapping[int, DetectedFrame] = field(default_factory=dict)
    shown: dict[int, DetectedFrame] = field(default_factory=dict)

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
        found = detected(light, replace(run, seed=self.seeds[k]), self.before.get(k), threads=1)
        if len(light) * len(self.seeds) <= _KEPT_BEAMS:
            self.shown[k] = found
        return found.read_out(run.model)


def lit(
    frame: Frame, surfaces: Surfaces, model: Model, seeds: Sequence[int], keys: Keys, before: Lit | None = None
) -> Lit:
    """The light of the beams `keys`, ascending, of a frame. `before`: with the same seeds and another model.

    Light of other beams may reach these, so that the whole frame's is found first and then cut.
    """
    found: list[tuple[Run, Light]] = []
    for seed in seeds:
        found.append(run_and_light(surfaces.ideal, model, seed, frame.number, None, surfaces, 1))
        if len(found) == 2 and found[0][1] is found[1][1]:  # kept, so that no seed changes it
            del found[1]
            break
    of_seed = tuple(
        (light_of_beams(light, np.isin(keys_of(light.layer, light.point), keys)), run) for run, light in found
    )
    return Lit(of_seed, tuple(seeds), {**before.before, **before.shown} if before else {})


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
    about = (data.key, tuple(seeds), *(hashlib.sha256(some.tobytes()).hexdigest() for some in keys))
    before: Sequence[Lit | None] = _LAST.held(about) or [None] * len(keys)
    pairs = zip(data.frames, data.surfaces, keys, before, strict=True)
    found = [lit(frame, surfaces, model, seeds, some, last) for frame, surfaces, some, last in pairs]
    _LAST.put(about, found)
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


def _columns(light: Light) -> list[npt.NDArray[Any]]:
    columns: list[npt.NDArray[Any]] = [light.layer, light.point, light.background_per_ns, light.first_pulse]
    columns += [light.pulse_range_m, light.pulse_signal]
    haze = light.haze
    if haze is not None:
        columns += [haze.density_per_m, haze.first_row, haze.row_end_m, haze.row_share]
    return columns
