"""The linear detector's numbers, and the light of beams, as its kernel sees them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.model import streams
from lidarcheck.model.detector_echoes import fixed
from lidarcheck.model.linear.air import air_echoes
from lidarcheck.scan import Light
from lidarcheck.sensor import FWHM_PER_SIGMA, LIGHT_SPEED_M_PER_NS, Linear

__all__ = ["LinearLight", "LinearNumbers", "linear_light", "linear_numbers"]

_BANDWIDTH = 0.44
"""Of a Gaussian pulse: this over its FWHM."""
_PHYSICAL, _POWER, _DISTANCE = 0, 1, 2
_RANGE_LAWS = {"physical": _PHYSICAL, "power": _POWER, "distance": _DISTANCE}


class LinearNumbers(NamedTuple):
    """The detector as its kernel sees it; amplitudes in the sensor's unit, lengths in m.

    `noise2`, `relative2`: squares. `false_per_ns`: Rice's rate without its exponential, or, `from_dark`, the sensor's
    own rate in the dark; `gate_ns`: how long a shot listens. `edge`: range noise a unit of sigma(S)/S; `floor2`: its
    floor's square. `saturation`: infinite without one.
    """

    threshold: float
    noise2: float
    excess: float
    relative2: float
    separation: float
    false_per_ns: float
    from_dark: bool
    gate_ns: float
    gate_low: float
    gate_high: float
    law: int
    floor2: float
    edge: float
    at_threshold: float
    power: float
    base: float
    slope: float
    walk: float
    walk_reference: float
    saturation: float
    recovery_ns: float


class LinearLight(NamedTuple):
    """What reaches the beams: beam i has the pulses `first[i]` ... `first[i + 1] - 1`.

    `beams` (n,): numbers that streams know them by; `ambient` (n,): variance of the amplitude that light from elsewhere
    adds; `offset` (n,): of the reported range [m]. Of the air, beam i has the rows `air_first[i]` ... , each with the
    cell `air_end` (in cells of the profile) that ends it and its factor; `air_signal`, `air_range` (cells + 1,): see
    `air.air_echoes`.
    """

    beams: npt.NDArray[np.uint64]
    ambient: FloatArray
    offset: FloatArray
    first: IndexArray
    range_m: FloatArray
    signal: FloatArray
    air_first: IndexArray
    air_end: FloatArray
    air_share: FloatArray
    air_signal: FloatArray
    air_range: FloatArray


def linear_numbers(sensor: Linear, light: Light) -> LinearNumbers:
    """The sensor's numbers; those of the pulse from the light's, where an effect has changed it.

    A light's own `shape` counts by its FWHM alone: a longer pulse merges surfaces farther apart and blurs the edge.
    """
    fwhm_ns = sensor.pulse_fwhm_ns if light.shape is None else light.shape.fwhm_ns
    noise, threshold, own_hz = sensor.noise, sensor.threshold, sensor.false_rate_hz
    return LinearNumbers(
        threshold=threshold,
        noise2=noise * noise,
        excess=sensor.excess,
        relative2=sensor.relative * sensor.relative,
        separation=sensor.separation_m * (fwhm_ns / sensor.pulse_fwhm_ns),
        false_per_ns=_BANDWIDTH / fwhm_ns / math.sqrt(3.0) if own_hz is None else 1e-9 * own_hz,
        from_dark=own_hz is not None,
        gate_ns=2.0 * (sensor.max_range_m - sensor.min_range_m) / LIGHT_SPEED_M_PER_NS,
        gate_low=sensor.min_range_m,
        gate_high=sensor.max_range_m,
        law=_RANGE_LAWS[sensor.range_law],
        floor2=sensor.range_floor_m**2,
        edge=0.5 * LIGHT_SPEED_M_PER_NS * sensor.edge_factor * fwhm_ns / FWHM_PER_SIGMA,
        at_threshold=sensor.range_at_threshold_m or 0.0,
        power=sensor.range_power,
        base=sensor.range_base_m or 0.0,
        slope=sensor.range_slope,
        walk=sensor.walk_m_per_decade,
        walk_reference=sensor.walk_reference or 10.0 * threshold or 1.0,
        saturation=sensor.saturation or math.inf,
        recovery_ns=sensor.recovery_ns,
    )


def linear_light(light: Light, sensor: Linear) -> LinearLight:
    """The light as the kernel sees it; the air's profile made into one echo for each place where it may end."""
    n, none = len(light), fixed(np.zeros(0))
    offset = np.empty(n)
    offset[:] = sensor.beams.range_offset_m(light.layer)
    air = (fixed(np.zeros(n + 1, dtype=np.int64)), none, none, none, none)
    if light.haze is not None and np.any(light.haze.density_per_m > 0.0):
        haze = light.haze
        fwhm_ns = sensor.pulse_fwhm_ns if light.shape is None else light.shape.fwhm_ns
        tables = air_echoes(haze, 0.5 * LIGHT_SPEED_M_PER_NS * fwhm_ns / FWHM_PER_SIGMA)
        air = (haze.first_row, fixed(haze.row_end_m / haze.step_m), haze.row_share, *map(fixed, tables))
    return LinearLight(
        streams.beam_keys(light.layer, light.point),
        light.background_per_ns,
        offset,
        light.first_pulse,
        light.pulse_range_m,
        light.pulse_signal,
        *air,
    )
