"""The slow reference, all beams at a time, from a start that has settled for as long as the background needs."""

from collections.abc import Callable

import numpy as np

from lidarcheck.model import reference
from lidarcheck.scan import Light, Scan
from lidarcheck.sensor import Sensor


def settling_dead_times(background: float, sensor: Sensor) -> int:
    """Dead times after which a detector that starts armed avalanches as often as in the steady state, to 1e-6.

    `background`: avalanches per armed detector and bin.
    """
    chance, dead = -np.expm1(-background), sensor.dead_bins
    steady = chance / (1.0 + (dead - 1) * chance)
    avalanche = [0.0] * dead
    for _ in range(reference._SETTLING_DEAD_TIMES * dead):
        avalanche.append((1.0 - sum(avalanche[len(avalanche) - dead + 1 :] if dead > 1 else ())) * chance)
    off = np.flatnonzero(np.abs(np.array(avalanche[dead:]) - steady) > 1e-6 * steady)
    return int(off[-1] + 1) // dead + 1 if len(off) else 1


RatesOf = Callable[[Light, int, Sensor], np.ndarray]


def once_each(rates_of: RatesOf) -> RatesOf:
    """The same rates, worked out once for all beams of a light that get the same."""
    kept: dict[bytes, np.ndarray] = {}

    def rates(light: Light, beam: int, sensor: Sensor) -> np.ndarray:
        pulses = slice(light.first_pulse[beam], light.first_pulse[beam + 1])
        columns = [light.background_per_ns[beam : beam + 1], light.pulse_range_m[pulses], light.pulse_signal[pulses]]
        if light.haze is not None:
            rows = slice(light.haze.first_row[beam], light.haze.first_row[beam + 1])
            columns += [light.haze.row_end_m[rows], light.haze.row_share[rows]]
        # With the lengths before them, columns that differ cannot run together to the same bytes.
        key = bytes(str([len(column) for column in columns]), "ascii") + np.concatenate(columns).tobytes()
        if key not in kept:
            kept[key] = rates_of(light, beam, sensor)
        return kept[key]

    return rates


def detector_traces(
    rates: np.ndarray, background: np.ndarray, sensor: Sensor, rng: np.random.Generator, settling: int
) -> np.ndarray:
    """`reference.detector_trace` of many beams at a time, shape (beams, bins); of a single one it has the same draws.

    `rates` (beams, bins), `background` (beams,): avalanches per armed SPAD and bin, the latter in the `settling` bins
    before bin 0.
    """
    chance = -np.expm1(-np.concatenate([np.repeat(background[:, None], settling, axis=1), rates], axis=1))
    beams, bins = chance.shape
    armed_from = np.zeros((beams, sensor.detectors), dtype=np.int64)
    on = np.zeros((beams, bins + sensor.on_bins), dtype=np.int64)
    for k in range(bins):
        fires = (armed_from <= k) & (rng.random(armed_from.shape) < chance[:, k, None])
        armed_from[fires] = k + sensor.dead_bins
        on[:, k : k + sensor.on_bins] += np.count_nonzero(fires, axis=1)[:, None]
    return on[:, settling : settling + sensor.bins]


def simulate_detectors(light: Light, sensor: Sensor, rng: np.random.Generator) -> Scan:
    """`reference.simulate_detectors`, all beams at a time and without most of their run of background before bin 0."""
    assert not sensor.nonideal.any
    background, rates_of = light.background_per_ns * sensor.bin_ns, once_each(reference._rates)
    settling = settling_dead_times(float(background.max()), sensor) * sensor.dead_bins
    rates = np.array([rates_of(light, beam, sensor) for beam in range(len(light))])
    traces = detector_traces(rates, background, sensor, rng, settling)
    return reference._scan(light, [reference.echoes_of_trace(trace, sensor) for trace in traces])
