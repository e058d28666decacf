"""The chip's numbers and the light of its zones, as its kernels see them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.model import streams
from lidarcheck.model.detector_echoes import fixed
from lidarcheck.model.exact.pulse_form import PHASES
from lidarcheck.model.histogram.pulse import Pulse, fwhm_bins, pulse_of, template
from lidarcheck.scan import Haze, Light
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, PhotonHistogram

__all__ = ["HistogramNumbers", "ZoneLight", "expected", "histogram_numbers", "zone_light"]

_HALF_LIGHT_SPEED = 0.5 * LIGHT_SPEED_M_PER_NS
_MOST_COUNTS = 2.0**32 - 1.0
_FAR = 1e9
"""Bins: as good as any pulse behind the end of the histogram, and a whole number that fits."""


class HistogramNumbers(NamedTuple):
    """The chip as its kernels see it; times in bins.

    `trials`: N, SPADs times shots; `dead`: 0 where only the first photon counts; `most_counts`: where counts clip;
    `first`: the beginning of bin 0, that many times `metres_per_bin` away. `glass`, (bins,): counts of the cover glass
    alone near zero range, 0 elsewhere; its scale is found in the bins `glass_first` ... `glass_last` - 1. `template`:
    the pulse in bins.
    """

    trials: int
    bins: int
    dead: int
    most_counts: float
    coates: bool
    threshold: float
    fwhm: float
    metres_per_bin: float
    first: float
    glass: FloatArray
    glass_first: int
    glass_last: int
    template: FloatArray


class ZoneLight(NamedTuple):
    """What reaches the zones: zone i has the pulses `first_pulse[i]` ... `first_pulse[i + 1] - 1`.

    `beams` (n,): numbers that streams know them by; `background` (n,): avalanches a bin; `offset` (n,): of the reported
    range [m]. `centre` [bins] and `signal` of the pulses; `shares`, (PHASES + 1, bins around a pulse): see `PulseForm`,
    `middle` its column of the bin that a pulse lies in. `glass` (bins,): avalanches that the cover glass sets off.
    `air_first`, `air_end` [cells], `air_share`: the rows that see the air; `air` (cells + 1, bins): avalanches of a
    profile that ends at each cell's edge; `air_density` (cells,): S per bin of range; `air_step` [bins]: a cell's
    length; `ramps`: see `PulseForm`, `ramp_middle` its column of the bin in which a row of pulses ends. `first`: where
    bin 0 begins.
    """

    beams: npt.NDArray[np.uint64]
    background: FloatArray
    offset: FloatArray
    first_pulse: IndexArray
    centre: FloatArray
    signal: FloatArray
    shares: FloatArray
    middle: int
    glass: FloatArray
    air_first: IndexArray
    air_end: FloatArray
    air_share: FloatArray
    air: FloatArray
    air_density: FloatArray
    air_step: float
    first: float
    ramps: FloatArray
    ramp_middle: int


def expected(rates: FloatArray, dead: int) -> FloatArray:
    """Chance q_k of a count in each bin for these rates: of the first photon where `dead` is 0, else outside dead time.

    Shape (bins,). A SPAD is armed when bin 0 begins.
    """
    fires = -elementary.expm1(-rates)
    if dead == 0:
        before = np.concatenate([[0.0], np.cumsum(rates)[:-1]])
        return np.asarray(fires * elementary.exp(-before))
    chance = np.zeros(len(rates))
    for k in range(len(rates)):
        chance[k] = fires[k] * max(1.0 - float(np.sum(chance[max(k - dead + 1, 0) : k])), 0.0)
    return chance


def histogram_numbers(sensor: PhotonHistogram) -> HistogramNumbers:
    """The sensor's numbers; what the search expects is the sensor's own pulse, whatever an effect has made of it."""
    pulse, fwhm = pulse_of(sensor), fwhm_bins(sensor)
    trials, dead = sensor.spads * sensor.shots, 0 if sensor.readout == "first" else sensor.dead_bins
    rates = _glass_rates(sensor, pulse)
    # Corrected counts are those of rates: what the glass is expected to give is corrected as well.
    counts = trials * (rates if sensor.coates and dead == 0 else expected(rates, dead))
    away = np.abs(np.arange(sensor.bins) + 0.5 + sensor.first_bin_ns / sensor.bin_ns)
    near = np.flatnonzero(away <= 0.5 * fwhm)
    limits = [feature.most for feature in sensor.features if feature.law == "histogram" and feature.most is not None]
    return HistogramNumbers(
        trials=trials,
        bins=sensor.bins,
        dead=dead,
        most_counts=min([*limits, _MOST_COUNTS]),
        coates=bool(sensor.coates and dead == 0),
        threshold=sensor.threshold_sigma,
        fwhm=fwhm,
        metres_per_bin=_HALF_LIGHT_SPEED * sensor.bin_ns,
        first=sensor.first_bin_ns / sensor.bin_ns,
        glass=np.where(away <= 2.0 * fwhm, counts, 0.0),
        glass_first=int(near[0]) if len(near) else 0,
        glass_last=int(near[-1]) + 1 if len(near) else 0,
        template=template(pulse),
    )


def _glass_rates(sensor: PhotonHistogram, pulse: Pulse) -> FloatArray:
    """Avalanches in each bin that the cover glass sets off, per SPAD and shot."""
    edges = np.arange(sensor.bins + 1) + sensor.first_bin_ns / sensor.bin_ns
    return np.asarray(sensor.cover_glass * np.maximum(np.diff(pulse.before(edges)), 0.0))


def zone_light(light: Light, sensor: PhotonHistogram) -> ZoneLight:
    """The light as the kernels see it."""
    pulse, offset = pulse_of(sensor, light.shape), np.empty(len(light))
    offset[:] = sensor.beams.range_offset_m(light.layer)
    first = sensor.first_bin_ns / sensor.bin_ns
    brightest = float(light.pulse_signal.max(initial=0.0))
    before, behind = (int(bins) + 1 for bins in pulse.reach(sensor.spads * sensor.shots * brightest))
    before, behind = min(before, sensor.bins), min(behind, sensor.bins)
    phases: Any = np.arange(PHASES + 1) / PHASES
    shares = np.diff(pulse.before(np.arange(-before, behind + 2) - phases[:, None]), axis=1)
    return ZoneLight(
        streams.beam_keys(light.layer, light.point),
        light.background_per_ns * sensor.bin_ns,
        offset,
        light.first_pulse,
        np.clip(light.pulse_range_m / (_HALF_LIGHT_SPEED * sensor.bin_ns) - first, -_FAR, _FAR),
        light.pulse_signal,
        np.ascontiguousarray(np.maximum(shares, 0.0)),
        before,
        _glass_rates(sensor, pulse),
        *_air(light, pulse, sensor),
    )


def _air(light: Light, pulse: Pulse, sensor: PhotonHistogram) -> tuple[Any, ...]:
    """Of `ZoneLight`, all fields from `air_first` on."""
    haze, first = light.haze, sensor.first_bin_ns / sensor.bin_ns
    if haze is None or not np.any(haze.density_per_m > 0.0):
        none, table = fixed(np.zeros(0)), np.zeros((0, 0))
        return fixed(np.zeros(len(light) + 1, dtype=np.int64)), none, none, table, np.zeros(0), 1.0, first, table, 0
    rates, bin_m = _air_rates(haze, pulse, sensor), _HALF_LIGHT_SPEED * sensor.bin_ns
    density = haze.density_per_m[: len(rates) - 1] * bin_m
    most = sensor.spads * sensor.shots * float(haze.row_share.max(initial=0.0) * density.sum())
    before, behind = (min(int(bins) + 1, sensor.bins) for bins in pulse.reach(most))
    phases: Any = np.arange(PHASES + 1) / PHASES
    ramps = 1.0 - np.diff(pulse.integral(np.arange(-before, behind + 2) - phases[:, None]), axis=1)
    rows = (haze.first_row, fixed(haze.row_end_m / haze.step_m), haze.row_share)
    return *rows, rates, density, haze.step_m / bin_m, first, np.clip(ramps, 0.0, 1.0), before


def _air_rates(haze: Haze, pulse: Pulse, sensor: PhotonHistogram) -> FloatArray:
    """Avalanches in each bin of the profile that ends at each cell's edge, shape (cells + 1, bins).

    Even light from b to e reaches what the pulse's integral says: light before t of a pulse at x, summed over x.
    """
    bin_m = _HALF_LIGHT_SPEED * sensor.bin_ns
    ends = np.arange(sensor.bins + 1) + sensor.first_bin_ns / sensor.bin_ns
    last_m = (ends[-1] + pulse.reach(1e6)[0]) * bin_m
    cells = min(len(haze.density_per_m), max(int(last_m / haze.step_m) + 1, 1))
    rates = np.zeros((cells + 1, sensor.bins))
    earlier = pulse.integral(ends)
    for cell in range(cells):
        later = pulse.integral(ends - (cell + 1) * haze.step_m / bin_m)
        seen = haze.density_per_m[cell] * bin_m * np.diff(earlier - later)
        rates[cell + 1] = rates[cell] + np.maximum(seen, 0.0)
        earlier = later
    return rates
