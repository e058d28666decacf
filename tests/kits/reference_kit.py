"""The slow reference, from a start that has settled for as long as the background needs and not much longer."""

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


def simulate_detectors(light: Light, sensor: Sensor, rng: np.random.Generator) -> Scan:
    """`reference.simulate_detectors`, with most of its run of background before the first bin left out."""
    brightest = float(light.background_per_ns.max()) * sensor.bin_ns
    with mock.patch.object(reference, "_SETTLING_DEAD_TIMES", settling_dead_times(brightest, sensor)):
        return reference.simulate_detectors(light, sensor, rng)
