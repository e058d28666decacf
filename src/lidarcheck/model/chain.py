"""The way of the data through the model: what beams meet, the light, the avalanches, the echoes."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from lidarcheck.effects.base import ReadoutEffect
from lidarcheck.effects.shared.reflectance import reflectance_of
from lidarcheck.errors import UsageError
from lidarcheck.model.estimates import drawn, is_estimate
from lidarcheck.model.fidelity import Device, Fidelity, check_device, check_fidelity
from lidarcheck.model.reported import as_reported
from lidarcheck.model.sharing import Progress, share
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Run, Surfaces, check_seed, of_stage, run_and_light, run_of
from lidarcheck.rays import Caster
from lidarcheck.scan import IdealScan, Light, Scan
from lidarcheck.sensor import Linear, PhotonHistogram, Program, Sensor, SpadArray

__all__ = ["echoes_of", "read_out", "simulate", "simulate_frames"]


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
        from lidarcheck.model.external.around import alone, run_alone

        if alone(model, ideal):
            return run_alone(drawn(ideal, seed), model, seed, frame)
    readout = of_stage("readout", model.effects)
    how: dict[str, Any] = {"seed": seed, "frame": frame, "threads": threads, "progress": progress}
    run, scan = _plain_frame(ideal, model, scene, not readout, how) if fidelity == "fast" else (None, None)
    if run is None or scan is None:
        run, light = run_and_light(ideal, model, seed, frame, scene, surfaces, threads)
        scan = echoes_of(light, run.sensor, run=run, rounded=not readout, fidelity=fidelity, device=device, **how)
    return read_out(scan, run, readout) if readout else scan


def simulate_frames(
    ideals: Sequence[IdealScan],
    model: Model,
    *,
    seed: int,
    frames: Sequence[int],
    surfaces: Sequence[Surfaces] | None = None,
    threads: int | None = 1,
) -> list[Scan]:
    """`simulate` on several ideal scans; somebody else's program gets them all at once. `surfaces`: those of these."""
    how: dict[str, Any] = {"seed": seed, "threads": threads}
    pairs = [*zip([Surfaces(ideal) for ideal in ideals] if surfaces is None else surfaces, frames, strict=True)]
    if not isinstance(model.sensor, Program) or model.sensor.reads is None:
        return [simulate(one.ideal, model, frame=frame, surfaces=one, **how) for one, frame in pairs]
    from lidarcheck.model.external.around import program_echoes

    check_seed(seed)
    found = [run_and_light(one.ideal, model, seed, frame, None, one, threads) for one, frame in pairs]
    scans = program_echoes([(light, run) for run, light in found])
    readout = of_stage("readout", model.effects)
    return [read_out(scan, run, readout) for scan, (run, _) in zip(scans, found, strict=True)]


def read_out(scan: Scan, run: Run, effects: Sequence[ReadoutEffect]) -> Scan:
    """The echoes behind the readout effects, as the sensor reports them."""
    if isinstance(run.sensor, Program):
        from lidarcheck.model.external.readout import read_out_program

        return read_out_program(scan, run, effects)
    for effect in effects:
        scan = effect.readout(scan, run.of(effect))
    return as_reported(scan, run.sensor)


def _plain_frame(
    ideal: IdealScan, model: Model, scene: Caster | None, rounded: bool, how: Mapping[str, Any]
) -> tuple[Run | None, Scan | None]:
    """The run and the echoes of a frame that the fast path takes as a whole, None where effects or rows forbid that."""
    from lidarcheck.model.fast.beams import Task
    from lidarcheck.model.fast.run import fast_frame

    if of_stage("aim", model.effects) or of_stage("light", model.effects) or not isinstance(model.sensor, SpadArray):
        return None, None
    if reflectance_of(ideal) is not None or is_estimate(ideal):
        return None, None
    run = run_of(ideal, model, how["seed"], how["frame"], scene, None).after_stage("detector", model.effects)
    return run, fast_frame(ideal, model, SpadArray.narrow(run.sensor), Task(rounded=rounded, **how))


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
    run: Run | None = None,
) -> Scan:
    """The detector's echoes of the light that reaches each beam; see `simulate`. `rounded`: ranges as they are
    reported. `run`: what the light comes from, which somebody else's program is told where it comes from surfaces."""
    if isinstance(sensor, Program):
        from lidarcheck.model.external.around import bare_run, program_echoes

        return program_echoes([(light, run or bare_run(sensor, light, seed, frame))])[0]
    check_fidelity(fidelity)
    check_device(device, fidelity)
    check_complete(sensor)
    how: dict[str, Any] = {"seed": seed, "frame": frame, "threads": threads, "progress": progress, "rounded": rounded}
    return _DETECTORS[sensor.detector](light, sensor, fidelity, device, how)


def check_complete(sensor: Sensor) -> None:
    """Refuse to simulate a sensor whose file lacks required numbers."""
    if sensor.missing:
        what = f"{sensor.name} cannot be simulated: its file lacks {', '.join(sensor.missing)}"
        raise UsageError(what, fix="add them to the sensor file, or to [sensor] of the model")


def _spad_echoes(light: Light, sensor: Sensor, fidelity: Fidelity, device: Device, how: dict[str, Any]) -> Scan:
    """The echoes of SPADs, counted into PEAK, WIDTH and AREA."""
    spads = SpadArray.narrow(sensor)
    if fidelity == "reference":
        from lidarcheck.model.reference import reference_echoes

        return reference_echoes(light, spads, **{key: value for key, value in how.items() if key != "threads"})
    if fidelity == "fast":
        from lidarcheck.model.fast.beams import Task
        from lidarcheck.model.fast.run import fast_echoes

        scan = fast_echoes(light, spads, Task(**how))
        if scan is not None:
            return scan
    from lidarcheck.model.detection import chain_echoes
    from lidarcheck.model.exact.listing import scan_of

    rounded = how.pop("rounded")
    echoes = chain_echoes(light, spads, device=device, **how)
    return scan_of(echoes, light, spads, rounded, functools.partial(share, threads=how["threads"]))


def _linear_echoes(light: Light, sensor: Sensor, fidelity: Fidelity, device: Device, how: dict[str, Any]) -> Scan:
    """The echoes of amplitudes that pass a threshold."""
    from lidarcheck.model.linear.echoes import linear_echoes
    from lidarcheck.model.reported import scan_of_detector

    return scan_of_detector(linear_echoes(light, Linear.narrow(sensor), **how), light, sensor)


def _histogram_echoes(light: Light, sensor: Sensor, fidelity: Fidelity, device: Device, how: dict[str, Any]) -> Scan:
    """The histograms of zones and the echoes found in them."""
    from lidarcheck.model.histogram.echoes import histogram_echoes
    from lidarcheck.model.reported import scan_of_detector

    return scan_of_detector(histogram_echoes(light, PhotonHistogram.narrow(sensor), **how), light, sensor)


_DETECTORS: dict[str, Callable[[Light, Sensor, Fidelity, Device, dict[str, Any]], Scan]] = {
    SpadArray.detector: _spad_echoes,
    Linear.detector: _linear_echoes,
    PhotonHistogram.detector: _histogram_echoes,
}
"""What finds the echoes of each kind of detector."""
