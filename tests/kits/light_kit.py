"""Ideal scans of a few beams, and the pulses that an effect adds to their light."""

from types import SimpleNamespace

import numpy as np

from lidarcheck.effects import Effect
from lidarcheck.model import Model, light_of
from lidarcheck.model.stages import light_after_effects
from lidarcheck.scan import IdealScan, Light
from lidarcheck.sensor import Material, Sensor

MATERIALS = {1: Material("wall", 0.4), 2: Material("sign", 0.8, "retro", 1000.0), 3: Material("road", 0.1)}


def scan_of(*rows: tuple[int, int, float, int]) -> IdealScan:
    """An ideal scan of (layer, point, distance, material)."""
    layer, point, distance, material = np.array(rows, dtype=np.float64).reshape(-1, 4).T
    return IdealScan(layer, point, distance, material, np.zeros(len(rows)))


def cross(*bright: tuple[int, int, float], layers: range = range(520), points: range = range(960)) -> IdealScan:
    """Every beam of the columns and layers through the bright beams; all others meet nothing."""
    at = {(layer, point): (0.0, 1) for _, point, _ in bright for layer in layers}
    at |= {(layer, point): (0.0, 1) for layer, _, _ in bright for point in points}
    at |= {(layer, point): (distance, 2) for layer, point, distance in bright}
    return scan_of(*((*beam, *what) for beam, what in at.items()))


def model(*effects: Effect, variant: str = "SLIM") -> Model:
    return Model(Sensor.of(variant), MATERIALS, effects)


def lit(ideal: IdealScan, *effects: Effect, variant: str = "SLIM") -> Light:
    return light_after_effects(ideal, model(*effects, variant=variant))[0]


def own(ideal: IdealScan, variant: str = "SLIM") -> Light:
    return light_of(ideal, model(variant=variant))


def alone(effect: Effect, light: Light, ideal: IdealScan) -> Light:
    return effect.light(light, SimpleNamespace(sensor=Sensor.of("SLIM"), ideal=ideal, materials=MATERIALS))


def added(light: Light, before: Light) -> dict[tuple[int, int], list[tuple[float, float, int]]]:
    """(range, S, row) of the pulses that are new, by beam, in order of range."""
    new = {}
    for i in range(len(light)):
        count = before.first_pulse[i + 1] - before.first_pulse[i]
        part = slice(light.first_pulse[i] + count, light.first_pulse[i + 1])
        pulses = zip(
            light.pulse_range_m[part].tolist(),
            light.pulse_signal[part].tolist(),
            light.rows()[part].tolist(),
            strict=True,
        )
        if part.stop > part.start:
            new[int(light.layer[i]), int(light.point[i])] = sorted(pulses)
    return new


def signal(distance_m: float) -> float:
    return 6000.0 * 0.8 * 1000.0 / distance_m**2
