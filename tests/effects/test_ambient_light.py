"""Sunlight from one direction: surfaces that face the sun are brighter, by Lambert's cosine law."""

import dataclasses
import math

import numpy as np
import pytest

from effect_kit import MATERIALS, Around, lit, wall
from lidarcheck import effects
from lidarcheck.effects.geometry.surfaces import LocalSurfaces
from lidarcheck.model import Model, simulate
from lidarcheck.rays import Caster
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Sensor
from reference_grid import beam_directions


@dataclasses.dataclass(frozen=True)
class Cast(Around):
    """Surroundings whose surfaces can be asked for, as those of a model can."""

    @property
    def caster(self) -> Caster:
        return LocalSurfaces.of(self.ideal)


def plane(normal: tuple[float, float, float], offset_m: float, first_layer: int) -> IdealScan:
    """Beams of 20 layers and 30 points on the plane n . x = offset, of material 1."""
    layer, point = (axis.ravel() for axis in np.mgrid[first_layer : first_layer + 20, 465:495])
    distance = offset_m / (beam_directions(layer, point) @ np.asarray(normal))
    incidence = np.rad2deg(np.arccos(abs(offset_m) / distance))
    return IdealScan(layer, point, distance, np.full(600, 1), incidence)


@pytest.mark.parametrize(
    ("normal", "offset_m", "first_layer", "cosine"),
    [
        ((0.0, 0.0, 1.0), -2.0, 100, math.sin(math.radians(30.0))),
        ((-1.0, 0.0, 0.0), -20.0, 250, math.cos(math.radians(30.0)) * math.cos(math.radians(60.0))),
        ((-math.sqrt(0.5), -math.sqrt(0.5), 0.0), -20.0, 250, 0.0),
    ],
    ids=["road", "wall ahead", "wall that faces away from the sun"],
)
def test_the_suns_light_falls_by_lamberts_law(
    normal: tuple[float, float, float], offset_m: float, first_layer: int, cosine: float
) -> None:
    ideal = plane(normal, offset_m, first_layer)
    settings = {"rate_per_ns": 0.01, "direct": 0.8, "sun_azimuth_deg": 120.0, "sun_elevation_deg": 30.0}
    light = lit(effects.make("ambient_light", settings), Cast(ideal))
    expected = 0.0003 + 0.01 * 0.4 * (0.2 + 0.8 * cosine)
    assert light.background_per_ns == pytest.approx(np.full(600, expected), abs=0.01 * 0.4 * 0.0051)
    assert len(np.unique(light.background_per_ns)) == 1


def test_open_sky_is_as_bright_wherever_the_sun_stands() -> None:
    settings = {"rate_per_ns": 0.01, "sky": 0.25, "direct": 0.9}
    light = lit(effects.make("ambient_light", settings), Cast(wall(30, 0.0)))
    assert light.background_per_ns == pytest.approx(np.full(30, 0.0003 + 0.0025))


def test_the_sun_lights_surfaces_as_an_effect_has_aimed_the_beams_at_them() -> None:
    model = Model(Sensor.of("SMART"), MATERIALS).with_(effects.make("boresight", {"yaw_deg": 5.0, "pitch_deg": 0.0}))
    sun = {"rate_per_ns": 0.02, "direct": 1.0, "sun_azimuth_deg": 180.0, "sun_elevation_deg": 0.0}
    sunny = model.with_(effects.make("ambient_light", sun))
    ideal = plane((-1.0, 0.0, 0.0), -150.0, 250)
    dark, bright = simulate(ideal, model, seed=1), simulate(ideal, sunny, seed=1)
    assert len(bright) > len(dark) + 100
