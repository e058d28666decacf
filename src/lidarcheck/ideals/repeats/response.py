"""What a detector makes of a signal: how often an echo, which amplitude, how its range shifts and scatters.

Of a linear detector the law says it; of the others the model itself is run on beams of rising signal.
"""

from __future__ import annotations

import abc
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.ideals.repeats.amplitude import values_of
from lidarcheck.sensor import FWHM_PER_SIGMA, LIGHT_SPEED_M_PER_NS, Feature, Linear, Material, PhotonHistogram, Sensor
from lidarcheck.sensor.grid import Axis, GridBeams

__all__ = ["LinearResponse", "Response", "SimulatedResponse", "response_of"]

_BEAMS = 3000
"""Beams that are simulated for each signal: means are right to a fiftieth of the standard deviation."""
_FINE = 12
"""Signals a decade."""
_PLACE_M = 30.0


class Response(abc.ABC):
    """All functions take and give arrays of one shape; amplitudes in the detector's unit, lengths in m."""

    latent: bool
    """Whether `amplitude` and `amplitude_sd` are those of all shots, the lost ones among them, or of echoes alone."""

    @abc.abstractmethod
    def margin(self, signal: FloatArray) -> FloatArray:
        """By how many standard deviations of a shot the signal lies above the threshold: Phi of it is detected."""

    @abc.abstractmethod
    def amplitude(self, signal: FloatArray) -> FloatArray:
        """Mean amplitude."""

    @abc.abstractmethod
    def amplitude_sd(self, signal: FloatArray) -> FloatArray:
        """Standard deviation of the amplitude from shot to shot."""

    @abc.abstractmethod
    def signal_of(self, amplitude: FloatArray) -> FloatArray:
        """The signal whose mean amplitude this is."""

    @abc.abstractmethod
    def shift_m(self, signal: FloatArray) -> FloatArray:
        """Mean of a reported range beyond the surface's distance."""

    @abc.abstractmethod
    def range_sd_m(self, signal: FloatArray, path_m: FloatArray) -> FloatArray:
        """Standard deviation of a range from shot to shot, before it is rounded."""

    def signal_sd(self, signal: FloatArray) -> FloatArray:
        """Standard deviation of the signal that one shot's amplitude stands for."""
        step = 1e-3 * np.maximum(signal, 1e-12)
        slope = (self.amplitude(signal + step) - self.amplitude(signal - step)) / (2.0 * step)
        return np.asarray(self.amplitude_sd(signal) / np.maximum(slope, 1e-12))


@dataclass(frozen=True)
class LinearResponse(Response):
    """Of a linear detector, by its law."""

    sensor: Linear
    latent = True

    def margin(self, signal: FloatArray) -> FloatArray:
        """(S - T) / sigma(S)."""
        return np.asarray((signal - self.sensor.threshold) / np.maximum(self.amplitude_sd(signal), 1e-12))

    def amplitude(self, signal: FloatArray) -> FloatArray:
        """The signal, up to saturation."""
        top = self.sensor.saturation
        return signal if top is None else np.minimum(signal, top)

    def amplitude_sd(self, signal: FloatArray) -> FloatArray:
        """sigma(S)."""
        own = self.sensor
        positive = np.maximum(signal, 0.0)
        return np.asarray(np.sqrt(own.noise**2 + own.excess * positive + (own.relative * positive) ** 2))

    def signal_of(self, amplitude: FloatArray) -> FloatArray:
        """The amplitude itself."""
        return amplitude

    def shift_m(self, signal: FloatArray) -> FloatArray:
        """What the sensor's own correction of walk leaves."""
        own = self.sensor
        if own.walk_m_per_decade == 0.0:
            return np.zeros_like(signal)
        seen = np.maximum(self.amplitude(signal), max(own.threshold, 1e-12))
        reference = own.walk_reference or 10.0 * own.threshold or 1.0
        return np.asarray(-own.walk_m_per_decade * np.log10(seen / reference))

    def range_sd_m(self, signal: FloatArray, path_m: FloatArray) -> FloatArray:
        """By `range_law`."""
        own, strong = self.sensor, np.maximum(signal, 1e-12)
        if own.range_law == "distance":
            return np.asarray((own.range_base_m or 0.0) + own.range_slope * path_m)
        if own.range_law == "power":
            weak = (own.range_at_threshold_m or 0.0) * (own.threshold / strong) ** own.range_power
        else:
            pulse_m = 0.5 * LIGHT_SPEED_M_PER_NS * own.pulse_fwhm_ns / FWHM_PER_SIGMA
            weak = own.edge_factor * pulse_m * self.amplitude_sd(signal) / strong
        walk = own.walk_m_per_decade * self.amplitude_sd(signal) / (strong * np.log(10.0))
        return np.asarray(np.sqrt(own.range_floor_m**2 + weak**2 + walk**2))

    def signal_sd(self, signal: FloatArray) -> FloatArray:
        """sigma(S)."""
        return self.amplitude_sd(signal)


@dataclass(frozen=True, eq=False)
class SimulatedResponse(Response):
    """Of any detector, read off what the model made of beams of rising signal; columns of shape (k,).

    `shots`: of each signal, amplitude and range beyond the surface of what was detected, shape (m, 2); for draws.
    """

    log_signal: FloatArray
    margins: FloatArray
    amplitudes: FloatArray
    amplitude_sds: FloatArray
    shifts_m: FloatArray
    range_sds_m: FloatArray
    shots: tuple[FloatArray, ...] = ()
    latent = False

    def _at(self, signal: FloatArray, column: FloatArray) -> FloatArray:
        return np.asarray(np.interp(np.log(np.maximum(signal, 1e-300)), self.log_signal, column))

    def margin(self, signal: FloatArray) -> FloatArray:
        """Of the share that was detected."""
        return self._at(signal, self.margins)

    def amplitude(self, signal: FloatArray) -> FloatArray:
        """Mean of the echoes'."""
        return self._at(signal, self.amplitudes)

    def amplitude_sd(self, signal: FloatArray) -> FloatArray:
        """Of the echoes'."""
        return self._at(signal, self.amplitude_sds)

    def signal_of(self, amplitude: FloatArray) -> FloatArray:
        """Where the mean passes the amplitude."""
        rising = np.maximum.accumulate(self.amplitudes)
        rising = rising + np.arange(len(rising)) * 1e-9 * max(float(rising[-1]), 1.0)
        return np.asarray(np.exp(np.interp(amplitude, rising, self.log_signal)))

    def shift_m(self, signal: FloatArray) -> FloatArray:
        """Mean of the echoes'."""
        return self._at(signal, self.shifts_m)

    def range_sd_m(self, signal: FloatArray, path_m: FloatArray) -> FloatArray:
        """Of the echoes'."""
        return self._at(signal, self.range_sds_m)


def response_of(sensor: Sensor, feature: Feature | None) -> Response:
    """What the sensor's detector makes of a signal; `feature`: what it reports of an amplitude."""
    if isinstance(sensor, Linear):
        return LinearResponse(sensor)
    return _simulated(sensor, feature)


def _simulated(sensor: Sensor, feature: Feature | None) -> SimulatedResponse:
    """The model run on a fan of beams, each line of them a signal."""
    from lidarcheck.effects.shared.reflectance import with_reflectance
    from lidarcheck.model import Model, simulate
    from lidarcheck.scan import IdealScan

    weakest, strongest = sensor.signal_of(0.02 * sensor.threshold_counts), sensor.signal_of(1e5)
    signals = np.geomspace(weakest, strongest, max(int(_FINE * np.log10(strongest / weakest)), 8) + 1)
    place = min(_PLACE_M, 0.5 * sensor.max_range_m)
    count = _BEAMS // 8 if isinstance(sensor, PhotonHistogram) else _BEAMS
    beams = GridBeams(sensor.sweep, Axis(len(signals), 0.0, 1e-3), Axis(count, 0.0, 1e-3))
    layer, point = beams.every()
    # From the first place to the last lie many bins: no place within one is preferred.
    distance = place + (np.arange(count) / count)[point] * min(3.0, 0.3 * place)
    signal_at_1m = 1.0
    ideal = IdealScan(layer, point, distance, np.zeros(len(layer), np.int32), np.zeros(len(layer)), beams=beams)
    ideal = with_reflectance(ideal, signals[layer] * (distance**2 + sensor.near_m**2) / signal_at_1m)
    plain = replace(sensor, beams=beams, signal_at_1m=signal_at_1m, missing=(), range_resolution_m=0.0)
    scan = simulate(ideal, Model(plain, {0: Material("white", 1.0)}), threads=None)
    off = scan.range_m - distance.reshape(len(signals), -1)[scan.layer, scan.point]
    own = np.flatnonzero(np.abs(off) < 4.0 * sensor.window_m)
    own = own[np.lexsort((np.abs(off[own]), scan.point[own], scan.layer[own]))]
    key = scan.layer[own].astype(np.int64) * count + scan.point[own]
    own = own[np.concatenate(([True], key[1:] > key[:-1]))] if len(own) else own
    values = (scan.strength if feature is None else values_of(feature, scan, plain))[own]
    return _described(signals, count, scan.layer[own].astype(np.int64), values, off[own])


def _described(
    signals: FloatArray, beams: int, line: IndexArray, values: FloatArray, off_m: FloatArray
) -> SimulatedResponse:
    """Moments of the echoes of each line; those of lines with few echoes are the next line's."""
    count = np.bincount(line, minlength=len(signals)).astype(np.float64)
    enough = count >= 50
    some = np.maximum(count, 1.0)

    def moments(column: FloatArray) -> tuple[FloatArray, FloatArray]:
        mean = np.bincount(line, column, len(signals)) / some
        variance = np.bincount(line, (column - mean[line]) ** 2, len(signals)) / np.maximum(some - 1.0, 1.0)
        at = np.flatnonzero(enough)
        near = at[np.clip(np.searchsorted(at, np.arange(len(signals))), 0, len(at) - 1)]
        return mean[near], np.sqrt(variance[near])

    amplitude, amplitude_sd = moments(values)
    shift_m, range_sd_m = moments(off_m)
    margin = np.maximum.accumulate(ndtri(np.clip(count / beams, 1e-6, 1.0 - 1e-9)))
    shots = np.split(np.column_stack([values, off_m]), np.cumsum(count).astype(np.int64)[:-1])
    return SimulatedResponse(
        np.log(signals), margin, amplitude, np.maximum(amplitude_sd, 1e-9), shift_m, np.maximum(range_sd_m, 1e-6),
        tuple(shots),
    )  # fmt: skip
