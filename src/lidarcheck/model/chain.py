"""The way of the data through the model: what beams meet, the light, the avalanches, the echoes."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from lidarcheck.effects import Effect
from lidarcheck.effects.shared.ranges import quantised
from lidarcheck.errors import ExternalModelError, UsageError
from lidarcheck.model.fidelity import Device, Fidelity, check_device, check_fidelity
from lidarcheck.model.light import light_of, surface_signal
from lidarcheck.model.sharing import share
from lidarcheck.model.spec import Model
from lidarcheck.model.surfaces import Surfaces
from lidarcheck.rays import Caster
from lidarcheck.scan import IdealScan, Light, Scan
from lidarcheck.sensor import Material, Sensor, beam_directions

if TYPE_CHECKING:
    from lidarcheck.model.exact.echoes import EchoArrays
    from lidarcheck.model.exact.numbers import Numbers

__all__ = [
    "aimed",
    "chain_echoes",
    "check_seed",
    "echoes_of",
    "light_after_effects",
    "of_stage",
    "rounded_ranges",
    "run_and_light",
    "simulate",
]

Progress = Callable[[int, int], object]

_CHUNK = 8192
"""Beams a thread takes at a time: small enough to share the work evenly, large enough to forget the taking."""


def simulate(
    ideal: IdealScan,
    model: Model,
    *,
    seed: int = 0,
    frame: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
    scene: Caster | None = None,
    surfaces: Surfaces | None = None,
    fidelity: Fidelity = "exact",
    device: Device = "cpu",
) -> Scan:
    """One ideal scan through the sensor model: its echoes, in order of (layer, point, echo number).

    The same `seed` and `frame` give the same bytes, for any number of threads and any order of rows. Beams without an
    echo have no row. `threads`: all cores when None. `progress` is told (beams done, beams). `scene`: what the ideal
    scan was cast from; effects that aim beams elsewhere ask it, else the ideal scan's own surfaces. `surfaces`: these,
    if known already; what such effects find without random numbers is kept there for the next seed. `fidelity`: "exact"
    runs the chain for every beam; "fast" draws the echoes of beams with one pulse from a library that the chain has
    filled (docs/performance.md); "reference" follows every detector through every bin, some milliseconds a beam.
    `device`: "cuda" runs the exact chain on an NVIDIA GPU, to the same echoes but for the last digit of its arithmetic.
    Raises `InputError` for a material without an entry, `ExternalModelError` when the model is an external program that
    fails, and `UsageError` for a device that is not there.
    """
    check_seed(seed, frame)
    check_fidelity(fidelity, model)
    check_device(device, fidelity, model)
    if model.external is not None:
        from lidarcheck.model.external import run_external

        try:
            return run_external(ideal, model.external, seed=seed)
        except ExternalModelError as error:
            error.file = error.file or (None if model.file is None else str(model.file))
            raise
    readout = of_stage("readout", model.effects)
    how: dict[str, Any] = {"seed": seed, "frame": frame, "threads": threads, "progress": progress}
    run, scan = _plain_frame(ideal, model, scene, not readout, how) if fidelity == "fast" else (None, None)
    if run is None or scan is None:
        run, light = run_and_light(ideal, model, seed, frame, scene, surfaces, threads)
        scan = echoes_of(light, run.sensor, rounded=not readout, fidelity=fidelity, device=device, **how)
    for effect in readout:
        scan = effect.readout(scan, run.of(effect))
    return rounded_ranges(scan, run.sensor) if readout else scan


def _plain_frame(
    ideal: IdealScan, model: Model, scene: Caster | None, rounded: bool, how: Mapping[str, Any]
) -> tuple[Run | None, Scan | None]:
    """The run and the echoes of a frame that the fast path takes as a whole, None where effects or rows forbid that."""
    from lidarcheck.model.fast.beams import Task
    from lidarcheck.model.fast.run import fast_frame

    if of_stage("aim", model.effects) or of_stage("light", model.effects):
        return None, None
    run = _run_of(ideal, model, how["seed"], how["frame"], scene, None).after_stage("detector", model.effects)
    return run, fast_frame(ideal, model, run.sensor, Task(rounded=rounded, **how))


def light_after_effects(
    ideal: IdealScan, model: Model, *, seed: int = 0, frame: int = 0, scene: Caster | None = None
) -> tuple[Light, Sensor]:
    """The light that reaches the SPADs and the sensor that sees it, behind all effects up to the readout."""
    run, light = run_and_light(ideal, model, seed, frame, scene)
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
    return _run_of(ideal, model, seed, frame, scene, surfaces).after_stage("aim", model.effects).ideal


def _run_of(
    ideal: IdealScan, model: Model, seed: int, frame: int, scene: Caster | None, surfaces: Surfaces | None
) -> Run:
    return Run(seed, frame, model, model.sensor, ideal, scene, surfaces or Surfaces(ideal))


def run_and_light(
    ideal: IdealScan,
    model: Model,
    seed: int,
    frame: int,
    scene: Caster | None,
    surfaces: Surfaces | None = None,
    threads: int | None = 1,
) -> tuple[Run, Light]:
    """What effects may know behind the detector stage, and the light that reaches the SPADs.

    `surfaces`: those of this ideal scan, if known already. `threads`: all cores when None.
    """
    run = _run_of(ideal, model, seed, frame, scene, surfaces).after_stage("aim", model.effects)
    light = light_of(run.ideal, model, functools.partial(share, threads=threads))
    for effect in of_stage("light", model.effects):
        light = effect.light(light, run.of(effect))
    return run.after_stage("detector", model.effects), light


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

    @property
    def materials(self) -> Mapping[int, Material]:
        return self.model.materials

    @property
    def caster(self) -> Caster:
        return self.surfaces.caster if self.scene is None else self.scene

    def signal(self, ideal: IdealScan) -> npt.NDArray[np.float64]:
        return surface_signal(ideal, self.model)

    def of(self, effect: Effect) -> Run:
        return replace(self, purpose=effect.name)

    def after_stage(self, stage: str, effects: tuple[Effect, ...]) -> Run:
        run = self
        for effect in of_stage(stage, effects):
            if stage == "aim":
                run = replace(run, ideal=run.surfaces.aimed(effect, run))
            else:
                run = replace(run, sensor=effect.detector(run.sensor))
        return run

    def uniforms(self, layer: npt.ArrayLike, point: npt.ArrayLike, draws: int = 1) -> npt.NDArray[np.float64]:
        from lidarcheck.model import streams

        return streams.uniforms(self.seed, self.purpose, self.frame, layer, point, draws)


def of_stage(stage: str, effects: tuple[Effect, ...]) -> list[Any]:
    """The effects of a stage, in their order."""
    return [effect for effect in effects if effect.stage == stage]


def check_seed(seed: int, frame: int = 0) -> None:
    """Refuse a seed or a frame that is no unsigned 64-bit whole number."""
    for name, value in (("seed", seed), ("frame", frame)):
        if isinstance(value, bool) or not hasattr(value, "__index__") or not 0 <= value < 2**64:
            fix = "use a whole number from 0 to 18446744073709551615"
            raise UsageError(f"{name} {value} is out of range", fix=fix)


def echoes_of(
    light: Light,
    sensor: Sensor,
    *,
    seed: int = 0,
    frame: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
    rounded: bool = True,
    fidelity: Fidelity = "exact",
    device: Device = "cpu",
) -> Scan:
    """The SPADs' echoes of the light that reaches each beam; see `simulate`. `rounded`: ranges as they are reported."""
    check_fidelity(fidelity)
    check_device(device, fidelity)
    if fidelity == "reference":
        from lidarcheck.model.reference import reference_echoes

        return reference_echoes(light, sensor, seed=seed, frame=frame, progress=progress, rounded=rounded)
    if fidelity == "fast":
        from lidarcheck.model.fast.beams import Task
        from lidarcheck.model.fast.run import fast_echoes

        scan = fast_echoes(light, sensor, Task(seed, frame, threads, rounded, progress))
        if scan is not None:
            return scan
    from lidarcheck.model.exact.listing import scan_of

    echoes = chain_echoes(light, sensor, seed=seed, frame=frame, threads=threads, progress=progress, device=device)
    return scan_of(echoes, light, sensor, rounded, functools.partial(share, threads=threads))


def chain_echoes(
    light: Light,
    sensor: Sensor,
    *,
    seed: int = 0,
    frame: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
    device: Device = "cpu",
) -> EchoArrays:
    """The echoes of each beam as the exact chain finds them, before they are put into a table."""
    from lidarcheck.model import streams
    from lidarcheck.model.exact import kernel
    from lidarcheck.model.exact.echoes import new_echoes
    from lidarcheck.model.exact.numbers import numbers_of
    from lidarcheck.model.exact.pulses import pulses_of

    n, among = len(light), functools.partial(share, threads=threads)
    numbers = numbers_of(sensor)
    echoes = new_echoes(n, sensor.max_echoes)
    beams = streams.beam_keys(light.layer, light.point)
    per_bin = light.background_per_ns * sensor.bin_ns
    pulses = pulses_of(light, sensor, numbers, among)
    one_background = n == 0 or per_bin.min() == per_bin.max()
    order = np.arange(n) if one_background else np.argsort(per_bin, kind="stable")
    if device == "cuda":
        _refuse_disturbed(sensor)
        from lidarcheck.model.cuda.simulate import simulate_on_cuda

        simulate_on_cuda(numbers, streams.new_stream(seed, "spads", frame), beams, per_bin, pulses, order, echoes)
        return echoes

    follow = _follower(sensor, numbers) if sensor.nonideal.any else None
    chunks = _chunks(sensor, light, order, seed, frame)
    beams_done = np.cumsum([len(rows) for _, rows in chunks])
    idle: dict[int, list[kernel.Scratch]] = {threshold: [] for threshold, _ in chunks}

    def run(chunk: int) -> None:
        threshold, rows = chunks[chunk]
        asked, stream = numbers._replace(threshold=threshold), streams.new_stream(seed, "spads", frame)
        if follow is not None:
            follow(asked, stream, beams, per_bin, pulses, rows, echoes)
            return
        try:
            scratch = idle[threshold].pop()
        except IndexError:
            scratch = kernel.new_scratch(asked)
        kernel.simulate_beams(asked, stream, beams, per_bin, pulses, rows, scratch, echoes)
        idle[threshold].append(scratch)

    share(run, range(len(chunks)), threads, lambda done: progress and progress(int(beams_done[done - 1]), n))
    return echoes


def _chunks(
    sensor: Sensor, light: Light, order: npt.NDArray[np.int64], seed: int, frame: int
) -> list[tuple[int, npt.NDArray[np.int64]]]:
    """What threads take at a time: a threshold and beams of `order` that have it."""
    parts = [(sensor.threshold, order)]
    if sensor.nonideal.threshold_dither > 0.0:
        from lidarcheck.model import streams

        drawn = streams.uniforms(seed, "threshold", frame, light.layer, light.point)[order, 0]
        higher = drawn < sensor.nonideal.threshold_dither
        parts = [(sensor.threshold, order[~higher]), (sensor.threshold + 1, order[higher])]
    return [(threshold, rows[at : at + _CHUNK]) for threshold, rows in parts for at in range(0, len(rows), _CHUNK)]


def _refuse_disturbed(sensor: Sensor) -> None:
    if sensor.nonideal.any:
        what = "crosstalk, afterpulsing and a dead time that varies are followed detector by detector, not on a GPU"
        raise UsageError(what, fix="use the device cpu")
    if sensor.nonideal.threshold_dither > 0.0:
        raise UsageError("a threshold between two whole numbers is not simulated on a GPU", fix="use the device cpu")


def _follower(sensor: Sensor, numbers: Numbers) -> Callable[..., None]:
    """`simulate_chunk` for SPADs that disturb each other and are followed one by one."""
    from lidarcheck.model.detectors import simulate as detectors
    from lidarcheck.model.detectors.array import detectors_of

    return functools.partial(detectors.simulate_chunk, detectors_of(sensor, numbers))


def rounded_ranges(scan: Scan, sensor: Sensor) -> Scan:
    """The same echoes at ranges as the sensor reports them."""
    xyz = beam_directions(scan.layer, scan.point) * quantised(scan.range_m, sensor)[:, None]
    return replace(scan, x_m=xyz[:, 0], y_m=xyz[:, 1], z_m=xyz[:, 2])
