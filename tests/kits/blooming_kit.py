"""Measurements of a sign that blooms by a known table, made by the independent generator."""

from functools import cache

import numpy as np

from hidden.chain import Nuisance, measure
from hidden.effects_light_paths import _blooming
from hidden.places import SIGN, TABLE, VEGETATION, Builder
from hidden.rays import Beams, Scene, cast, directions
from lidarcheck.model import Model
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Material, Sensor

X = (-160, -120, -80, -50, -33, -20, -10.4, -5.87, -4.4, -3.37, -2.5, 0)
X += (2.5, 3.37, 4.4, 5.87, 10.4, 20, 33, 40, 60, 80, 100, 120, 140, 200)


def true_y(x):
    """Neither symmetric nor monotone: a core, a wide part below, a hump above."""
    x = np.asarray(x, dtype=float)
    core = np.where(x > 0, 4e-3, 8e-3) * np.exp(-np.abs(x) / 6)
    above = (1.2e-3 * np.exp(-(((x - 55) / 40) ** 2)) + 2e-4 * np.exp(-x / 60)) * (x > 0)
    return np.where(x == 0, 1.0, core + above + 2.5e-4 * np.exp(x / 45) * (x < 0))


def lut_text(y=None, x=X, key="LUT_blooming"):
    y = [1.0 if at == 0 else 1e-4 for at in x] if y is None else y
    return f"PostPro.{key}_X = {', '.join(map(str, x))}\nPostPro.{key}_Y = {', '.join(f'{v:.7f}' for v in y)}\n"


@cache
def sign_frame(distance_m, variant, seed, at=(0.1, 0.0), axis="vertical"):
    """A scan of a sign of 0.9 m before a far hedge, and its ideal scan."""
    layers, points = (range(180, 350), range(474, 488)) if axis == "vertical" else (range(254, 266), range(380, 580))
    b = Builder(np.random.default_rng(seed))
    b.plate(distance_m, at, (0.9, 0.9), SIGN)
    b.wall(260.0, VEGETATION, (-15, 15), 6.0)
    scene, beams = Scene(tuple(b.rectangles), "sign"), Beams.block(layers, points)
    bloom = _blooming(f"blooming_{axis}", "known", lambda x: np.interp(x, X, true_y(X), left=0, right=0), {})
    echoes = measure(scene, beams, variant, TABLE, (bloom,), Nuisance(), seed, 0)
    heading = directions(beams.azimuth_deg, beams.elevation_deg)
    hits = cast(scene, np.zeros((len(beams), 3)), heading, beams.time_s, {})
    met = hits.rectangle >= 0
    layer, point = beams.layer.astype(np.int32), beams.point.astype(np.int32)
    ideal = IdealScan(
        layer, point, np.where(met, hits.range_m, 0.0), hits.material.astype(np.int32),
        np.where(met, hits.incidence_deg, 0.0),
    )  # fmt: skip
    features = {"width_ns": echoes.width_ns, "area": echoes.area, "peak": echoes.peak}
    return Scan.from_beams(layer[echoes.beam], point[echoes.beam], echoes.range_m, **features), ideal


def sign_model(variant):
    materials = {
        number: Material(name, rho, "retro" if gain else "lambertian", gain or 1.0)
        for number, (name, rho, gain) in TABLE.items()
    }
    return Model(Sensor.of(variant), materials)
