"""Light for a library of echoes, and the areas that a library gives for it."""

import numpy as np

from lidarcheck.model import echoes_of
from lidarcheck.model.fast.grid import Grid
from lidarcheck.scan import Light
from lidarcheck.sensor import Sensor
from reference_grid import POINTS

TINY = Grid(sample_bits=3)
SENSOR = Sensor.of("SMART")


def light(signals: tuple[float, ...]) -> Light:
    n = 2000
    layer, point = np.divmod(np.arange(n), POINTS)
    signal = np.resize(np.array(signals), n)
    ranges = np.random.default_rng(0).uniform(20.0, 80.0, n)
    return Light(layer, point, np.full(n, 3e-4), np.arange(n + 1), ranges, signal)


def areas(signals: tuple[float, ...] = (0.3, 40.0)) -> list[float]:
    return echoes_of(light(signals), SENSOR, seed=1, fidelity="fast").area.tolist()
