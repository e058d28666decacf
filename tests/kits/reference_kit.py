"""The slow reference, from a start that has settled for as long as the background needs and not much longer."""

from collections.abc import Callable
from unittest import mock

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


def simulate_detectors(light: Light, sensor: Sensor, rng: np.random.Generator) -> Scan:
    """`reference.simulate_detectors`, without most of its run of background before the first bin, and `once_each`."""
    brightest = float(light.background_per_ns.max()) * sensor.bin_ns
    with (
        mock.patch.object(reference, "_SETTLING_DEAD_TIMES", settling_dead_times(brightest, sensor)),
        mock.patch.object(reference, "_rates", once_each(reference._rates)),
    ):
        return reference.simulate_detectors(light, sensor, rng)
