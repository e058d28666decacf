"""Traces: what the SPADs of a beam are expected to show, noise-free, and draws of what they do show."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.scan import Light
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, SpadArray

__all__ = ["bin_rates", "draw_traces", "expected_trace", "on_probability"]


def bin_rates(light: Light, sensor: SpadArray) -> FloatArray:
    """Avalanches per armed SPAD in each bin, shape (n_beams, bins): background plus the shares of pulses and haze."""
    from lidarcheck.model.exact.pulse_form import form_of

    edges_ns = np.arange(sensor.bins + 1) * sensor.bin_ns
    rates = np.repeat((light.background_per_ns * sensor.bin_ns)[:, None], sensor.bins, axis=1)
    beam = np.repeat(np.arange(len(light)), np.diff(light.first_pulse))
    form = form_of(light.shape, sensor, 1.0)
    for i, range_m, signal in zip(beam, light.pulse_range_m, light.pulse_signal, strict=True):
        time_ns = 2.0 * range_m / LIGHT_SPEED_M_PER_NS
        rates[i] += signal * np.diff(form.before(edges_ns - time_ns))
    if light.haze is not None:
        _add_haze(light, sensor, rates)
    return rates


def _add_haze(light: Light, sensor: SpadArray, rates: FloatArray) -> None:
    from lidarcheck.model.exact.haze_rates import add_haze
    from lidarcheck.model.exact.numbers import numbers_of
    from lidarcheck.model.exact.pulses import pulses_of

    haze = pulses_of(light, sensor, numbers_of(sensor)).haze
    if haze.last > 0:
        for i in range(len(light)):
            add_haze(haze, i, 0, sensor.bins, rates[i])


def on_probability(rates: npt.ArrayLike, background: npt.ArrayLike, sensor: SpadArray) -> FloatArray:
    """q_k: the probability that a detector is ON in bin k, shape (n_beams, bins).

    `rates` (n_beams, bins): avalanches per armed SPAD in each bin; `background` (n_beams,): the same before bin 0.
    With m_k the probability of an avalanche in bin k: armed_k = 1 - sum of the last `dead - 1` m, m_k = armed_k (1 -
    exp(-rate_k)), q_k = sum of the last `on` m. Detectors being independent, A_k is Binomial(N, q_k) exactly.
    """
    chance = -np.expm1(-np.asarray(rates, dtype=np.float64))
    before = -np.expm1(-np.asarray(background, dtype=np.float64))
    dead, on = sensor.dead_bins, sensor.on_bins
    avalanche = np.empty((chance.shape[0], dead + chance.shape[1]))
    avalanche[:, :dead] = (before / (1.0 + (dead - 1) * before))[:, None]
    for k in range(chance.shape[1]):
        armed = 1.0 - avalanche[:, k + 1 : k + dead].sum(axis=1)
        avalanche[:, dead + k] = armed * chance[:, k]
    total = np.cumsum(np.pad(avalanche, ((0, 0), (1, 0))), axis=1)
    return np.asarray(total[:, dead + 1 :] - total[:, dead + 1 - on : -on])


def expected_trace(light: Light, sensor: SpadArray) -> FloatArray:
    """Expected number of detectors ON in each bin, shape (n_beams, bins): the mean of A_k, noise-free."""
    q = on_probability(bin_rates(light, sensor), light.background_per_ns * sensor.bin_ns, sensor)
    return sensor.detectors * q


def draw_traces(light: Light, sensor: SpadArray, *, seed: int = 0, frame: int = 0) -> npt.NDArray[np.int32]:
    """A_k, the detectors ON in each bin, shape (n_beams, bins): the exact chain, run through every bin.

    For looking at waveforms and for tests: a few ten microseconds a beam. Echoes come from `simulate`, which visits
    only the bins that matter and therefore draws other numbers of the same distribution.
    """
    from lidarcheck.model import streams
    from lidarcheck.model.exact import kernel
    from lidarcheck.model.exact.numbers import numbers_of
    from lidarcheck.model.exact.pulses import pulses_of

    numbers = numbers_of(sensor)
    traces = np.empty((len(light), sensor.bins), dtype=np.int32)
    kernel.trace_beams(
        numbers,
        streams.new_stream(seed, "traces", frame),
        streams.beam_keys(light.layer, light.point),
        light.background_per_ns * sensor.bin_ns,
        pulses_of(light, sensor, numbers),
        kernel.new_scratch(numbers),
        traces,
    )
    return traces
