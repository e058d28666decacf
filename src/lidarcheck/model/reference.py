"""The slow reference: every detector on its own, every bin on its own, nothing merged and nothing skipped.

Written for reading, not for speed, and independent of the exact chain: its own random numbers, its own echo search, its
own start (a long run of background instead of the steady state's formula). Tests hold the exact chain against it.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.signal import fftconvolve
from scipy.special import ndtr

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.shared.ranges import reported
from lidarcheck.errors import UsageError
from lidarcheck.model.streams import beam_keys, purpose_key
from lidarcheck.scan import Haze, Light, PulseShape, Scan
from lidarcheck.sensor import FWHM_PER_SIGMA, LIGHT_SPEED_M_PER_NS, SpadArray

__all__ = ["detector_trace", "echoes_of_trace", "reference_echoes", "simulate_detectors"]

_SETTLING_DEAD_TIMES = 40


def _rates(light: Light, beam: int, sensor: SpadArray) -> FloatArray:
    """Avalanches per armed SPAD in each bin, shape (bins,)."""
    edges = np.arange(sensor.bins + 1) * sensor.bin_ns
    rates = np.full(sensor.bins, light.background_per_ns[beam] * sensor.bin_ns)
    shape = light.shape or PulseShape(sensor.pulse_fwhm_ns)
    pulses = slice(light.first_pulse[beam], light.first_pulse[beam + 1])
    for range_m, signal in zip(light.pulse_range_m[pulses], light.pulse_signal[pulses], strict=True):
        rates += signal * np.diff(_light_before(edges - 2.0 * range_m / LIGHT_SPEED_M_PER_NS, shape))
    if light.haze is not None:
        for range_m, signal in _air_pulses(light.haze, beam, shape):
            times = edges[:, None] - 2.0 * range_m / LIGHT_SPEED_M_PER_NS
            rates += np.diff(_light_before(times, shape), axis=0) @ signal
    return rates


def _light_before(times: FloatArray, shape: PulseShape) -> FloatArray:
    """Share of a pulse's light before each of the times [ns] behind its centre; same shape."""
    gaussian = np.asarray(ndtr(times * FWHM_PER_SIGMA / shape.fwhm_ns))
    if shape.tail_share == 0.0:
        return gaussian
    late = np.interp(times - shape.tail_delay_ns, *_delayed_light(shape))
    return np.asarray((1.0 - shape.tail_share) * gaussian + shape.tail_share * late)


@functools.cache
def _delayed_light(shape: PulseShape) -> tuple[FloatArray, FloatArray]:
    """The share of a Gaussian with an exponential delay before each of many times: its delays one by one, summed."""
    sigma = shape.fwhm_ns / FWHM_PER_SIGMA
    step = min(sigma, shape.tail_ns) / 50.0
    times = np.arange(-9.0 * sigma, 9.0 * sigma + 35.0 * shape.tail_ns, step)
    chance = -np.diff(np.exp(-np.arange(len(times) + 1) * step / shape.tail_ns))
    half_a_step_late = ndtr((times - 0.5 * step) / sigma)
    return times, fftconvolve(half_a_step_late, chance)[: len(times)]


def _air_pulses(haze: Haze, beam: int, shape: PulseShape) -> Iterator[tuple[FloatArray, FloatArray]]:
    """The air that each row of a beam sees as many small pulses, a tenth of a pulse's sigma apart: range and S."""
    slice_m = 0.05 * LIGHT_SPEED_M_PER_NS * shape.fwhm_ns / FWHM_PER_SIGMA
    slices = int(np.ceil(haze.step_m / slice_m))
    slice_m = haze.step_m / slices
    near_m = np.arange(len(haze.density_per_m) * slices) * slice_m
    density_per_m = np.repeat(haze.density_per_m, slices)
    for row in range(haze.first_row[beam], haze.first_row[beam + 1]):
        length_m = np.clip(haze.row_end_m[row] - near_m, 0.0, slice_m)
        seen = length_m * density_per_m > 0.0
        signal = haze.row_share[row] * density_per_m * length_m
        for part in np.array_split(np.flatnonzero(seen), np.count_nonzero(seen) // 1000 + 1):
            yield (near_m + 0.5 * length_m)[part], signal[part]


def detector_trace(
    rates: npt.NDArray[np.float64], background: float, sensor: SpadArray, rng: np.random.Generator
) -> npt.NDArray[np.int64]:
    """A_k of one beam, shape (bins,): detectors ON in each bin, each detector followed through all bins.

    `rates`: avalanches per armed SPAD in each bin; `background`: the same before bin 0.
    """
    n, settling = sensor.detectors, _SETTLING_DEAD_TIMES * sensor.dead_bins
    chance = -np.expm1(-np.concatenate([np.full(settling, background), rates]))
    armed_from = np.zeros(n, dtype=np.int64)
    on = np.zeros(len(chance) + sensor.on_bins, dtype=np.int64)
    for k in range(len(chance)):
        fires = (armed_from <= k) & (rng.random(n) < chance[k])
        armed_from[fires] = k + sensor.dead_bins
        on[k : k + sensor.on_bins] += np.count_nonzero(fires)
    return on[settling : settling + sensor.bins]


def echoes_of_trace(trace: npt.NDArray[np.int64], sensor: SpadArray) -> list[tuple[float, float, int, int]]:
    """Echoes of one trace, by range: (range [m], width [ns], area, peak)."""
    echoes: list[tuple[float, float, int, int]] = []
    above = np.flatnonzero(trace > sensor.threshold)
    for run in np.split(above, np.flatnonzero(np.diff(above) > 1) + 1):
        if len(run) == 0:
            continue
        height = trace[run]
        area = int(height.sum())
        time_ns = float((height * (run + 0.5)).sum()) / area * sensor.bin_ns - sensor.time_offset_ns
        range_m = LIGHT_SPEED_M_PER_NS * time_ns / 2.0
        if sensor.range_resolution_m > 0.0:
            range_m = round(range_m / sensor.range_resolution_m) * sensor.range_resolution_m
        echoes.append((range_m, len(run) * sensor.bin_ns, area, min(int(height.max()), sensor.peak_saturation)))
    largest = sorted(echoes, key=lambda echo: -echo[2])[: sensor.max_echoes]
    return sorted(largest)


def simulate_detectors(light: Light, sensor: SpadArray, rng: np.random.Generator) -> Scan:
    """Echoes of each beam, from `detector_trace`: about a millisecond per thousand bins and beam."""
    return _scan(light, [_echoes_of_beam(light, beam, sensor, rng) for beam in range(len(light))])


def reference_echoes(
    light: Light,
    sensor: SpadArray,
    *,
    seed: int = 0,
    frame: int = 0,
    progress: Callable[[int, int], object] | None = None,
    rounded: bool = True,
) -> Scan:
    """The same with draws of its own for every beam, in whichever order beams stand; `rounded`: ranges as reported.

    `UsageError` where detectors are to disturb each other: the exact chain follows them one by one itself.
    """
    if sensor.nonideal.any:
        what = "the reference knows no crosstalk, no afterpulsing and no varying dead time"
        raise UsageError(what, fix="use the fidelity exact, which follows such detectors one by one")
    unrounded = replace(sensor, range_resolution_m=0.0)
    key = np.array([seed, purpose_key("reference")], dtype=np.uint64)
    echoes = []
    for beam, number in enumerate(beam_keys(light.layer, light.point)):
        counter = np.array([0, number, frame, 0], dtype=np.uint64)
        rng = np.random.Generator(np.random.Philox(counter=counter, key=key))
        echoes.append(_echoes_of_beam(light, beam, unrounded, rng))
        if progress is not None:
            progress(beam + 1, len(light))
    return _scan(light, echoes, sensor if rounded else unrounded)


def _echoes_of_beam(light: Light, beam: int, sensor: SpadArray, rng: np.random.Generator) -> list[Any]:
    background = float(light.background_per_ns[beam]) * sensor.bin_ns
    if sensor.nonideal.threshold_dither > 0.0:
        sensor = replace(sensor, threshold=sensor.threshold + int(rng.random() < sensor.nonideal.threshold_dither))
    return echoes_of_trace(detector_trace(_rates(light, beam, sensor), background, sensor, rng), sensor)


def _scan(light: Light, echoes: list[list[Any]], sensor: SpadArray | None = None) -> Scan:
    """The table of the echoes of each beam; `sensor`: ranges as it reports them, none behind it."""
    rows = [
        (light.layer[beam], light.point[beam], number, *echo)
        for beam, found in enumerate(echoes)
        for number, echo in enumerate(found, start=1)
    ]
    layer, point, number_, range_m, width, area, peak = np.array(rows, dtype=np.float64).reshape(-1, 7).T
    scan = Scan.from_beams(
        layer.astype(np.int32),
        point.astype(np.int32),
        np.maximum(range_m, 0.0) + light.beams.range_offset_m(layer.astype(np.int32)),
        echo_number=number_.astype(np.int32),
        width_ns=width,
        area=area,
        peak=peak,
        beams=light.beams,
    )
    return scan if sensor is None else reported(scan, sensor)
