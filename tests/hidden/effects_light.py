"""Forms that change how much light arrives, beam by beam: gains, materials, dirt, background."""

import numpy as np
from numpy.typing import NDArray

from .chain import Effect, Frame
from .forms import AT_RECEIVER, AT_SURFACE, AT_WINDOW, Draw, form
from .rays import normals
from .sensor import LAYERS, Light

F = NDArray[np.float64]


@form("signal_gain", "factor")
def _gain(draw: Draw) -> Effect:
    gain = draw.factor(0.07, 0.2, 0.45)

    def light(light: Light, frame: Frame) -> None:
        light.signal = light.signal * gain

    return Effect("signal_gain", "factor", {"gain": gain}, {"signal_gain.gain": gain}, light=light, place=AT_WINDOW)


@form("signal_gain", "warming")
def _warming(draw: Draw) -> Effect:
    gain, scatter = draw.factor(0.07, 0.2, 0.45), 0.01

    def light(light: Light, frame: Frame) -> None:
        light.signal = light.signal * gain * np.exp(scatter * frame.rng.standard_normal())

    parameters = {"gain": gain, "frame_scatter": scatter}
    return Effect("signal_gain", "warming", parameters, light=light, place=AT_WINDOW)


def _ambient(draw: Draw, sun_side: bool) -> Effect:
    rate = draw.level(0.0006, 0.0018, 0.004) * (1.0 if draw.variant == "SLIM" else 2.0)
    sky = draw.between(0.05, 0.15)

    def light(light: Light, frame: Frame) -> None:
        assert frame.hits is not None
        seen = np.where(frame.hits.rectangle >= 0, frame.reflectance(frame.hits.material), sky)
        lit = 0.5 + np.sin(np.deg2rad(frame.hits.incidence_deg)) ** 2 if sun_side else 1.0  # the sun stands aside
        light.background = light.background + rate * seen * lit

    kind = "sun_aside" if sun_side else "even"
    comparable = {} if sun_side else {"ambient_light.rate_per_ns": rate, "ambient_light.sky": sky}
    return Effect("ambient_light", kind, {"rate_per_ns": rate, "sky": sky}, comparable, light=light, place=AT_RECEIVER)


@form("ambient_light", "even")
def _ambient_even(draw: Draw) -> Effect:
    return _ambient(draw, False)


@form("ambient_light", "sun_aside")
def _ambient_aside(draw: Draw) -> Effect:
    return _ambient(draw, True)


@form("ambient_light", "low_sun")
def _ambient_low_sun(draw: Draw) -> Effect:
    """A sun that stands somewhere, and a sky that is seen the more the more a surface looks up."""
    rate = draw.level(0.001, 0.003, 0.007) * (1.0 if draw.variant == "SLIM" else 2.0)
    azimuth, elevation = np.deg2rad([draw.between(-180.0, 180.0), draw.between(15.0, 60.0)])
    level = np.cos(elevation)
    sun = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    sky, from_sky = draw.between(0.05, 0.15), draw.between(0.15, 0.4)

    def light(light: Light, frame: Frame) -> None:
        assert frame.hits is not None
        assert frame.heading is not None
        met = frame.hits.rectangle >= 0
        rows = np.flatnonzero(met)
        normal = normals(frame.scene, frame.hits.rectangle[rows])
        # A rectangle has two sides: the one that is looked at counts.
        facing = -np.sign(np.sum(normal * frame.heading[rows], axis=1, keepdims=True)) * normal
        lit = np.ones(len(met))
        lit[rows] = from_sky * 0.5 * (1.0 + facing[:, 2]) + (1.0 - from_sky) * np.maximum(facing @ sun, 0.0)
        seen = np.where(met, frame.reflectance(frame.hits.material), sky)
        light.background = light.background + rate * seen * lit

    parameters = {"rate_per_ns": rate, "sky": sky, "azimuth_deg": float(np.rad2deg(azimuth)), "from_sky": from_sky}
    return Effect("ambient_light", "low_sun", parameters, light=light, place=AT_RECEIVER)


@form("dark_counts", "constant")
def _dark(draw: Draw) -> Effect:
    rate = draw.level(0.00014, 0.0003, 0.0007) * (1.0 if draw.variant == "SLIM" else 2.0)

    def light(light: Light, frame: Frame) -> None:
        light.background = light.background + rate

    return Effect(
        "dark_counts",
        "constant",
        {"rate_per_ns": rate},
        {"dark_counts.rate_per_ns": rate},
        light=light,
        place=AT_RECEIVER,
    )


@form("dark_counts", "heating")
def _heating(draw: Draw) -> Effect:
    rate = draw.level(0.00014, 0.0003, 0.0007) * (1.0 if draw.variant == "SLIM" else 2.0)

    def light(light: Light, frame: Frame) -> None:
        light.background = light.background + rate * frame.rng.uniform(0.85, 1.15)

    return Effect("dark_counts", "heating", {"rate_per_ns": rate}, {}, light=light, place=AT_RECEIVER)


@form("incidence_falloff", "power")
def _power(draw: Draw) -> Effect:
    exponent = 1.0 + draw.level(0.06, 0.2, 0.6)

    def light(light: Light, frame: Frame) -> None:
        lambertian = light.direct & ~frame.retro(light.material)
        cosine = np.cos(np.deg2rad(np.minimum(light.incidence_deg, 89.9)))
        light.signal = light.signal * np.where(lambertian, cosine ** (exponent - 1.0), 1.0)

    comparable = {"incidence_falloff.exponent": exponent}
    return Effect("incidence_falloff", "power", {"exponent": exponent}, comparable, light=light, place=AT_SURFACE)


@form("incidence_falloff", "sheen")
def _sheen(draw: Draw) -> Effect:
    share, width = draw.level(0.08, 0.25, 0.55), draw.between(2.0, 5.0)

    def light(light: Light, frame: Frame) -> None:
        lambertian = light.direct & ~frame.retro(light.material)
        cosine = np.cos(np.deg2rad(light.incidence_deg))
        light.signal = light.signal * np.where(lambertian, 1.0 - share + share * cosine**width, 1.0)

    return Effect("incidence_falloff", "sheen", {"share": share, "power": width}, {}, light=light, place=AT_SURFACE)


@form("incidence_falloff", "rough")
def _rough(draw: Draw) -> Effect:
    power = draw.level(0.05, 0.15, 0.35)

    def light(light: Light, frame: Frame) -> None:
        lambertian = light.direct & ~frame.retro(light.material)
        cosine = np.maximum(np.cos(np.deg2rad(light.incidence_deg)), 0.003)
        light.signal = light.signal * np.where(lambertian, cosine**-power, 1.0)

    comparable = {"incidence_falloff.exponent": 1.0 - power}
    return Effect("incidence_falloff", "rough", {"power": power}, comparable, light=light, place=AT_SURFACE)


def _material(draw: Draw, spread: float) -> Effect:
    material, factor = int(draw.rng.choice(draw.materials)), draw.factor(0.15, 0.3, 0.5)

    def light(light: Light, frame: Frame) -> None:
        assert frame.hits is not None
        each = np.exp(spread * frame.rng.standard_normal(200))  # by object
        thing = each[np.clip(frame.hits.object_id, 0, 199)][light.beam]
        light.signal = light.signal * np.where(light.material == material, factor * thing, 1.0)

    parameters = {"material_id": float(material), "factor": factor, "object_spread": spread}
    comparable = {"material_reflectance.material_id": float(material)}
    if not spread:
        comparable["material_reflectance.factor"] = factor
    kind = "each_object" if spread else "factor"
    return Effect("material_reflectance", kind, parameters, comparable, light=light, place=AT_SURFACE)


@form("material_reflectance", "factor")
def _material_factor(draw: Draw) -> Effect:
    return _material(draw, 0.0)


@form("material_reflectance", "each_object")
def _material_objects(draw: Draw) -> Effect:
    return _material(draw, 0.02)


def _layers(kind: str, gain: F, parameters: dict[str, float], comparable: dict[str, float] | None = None) -> Effect:
    def light(light: Light, frame: Frame) -> None:
        light.scale_beams(gain[frame.beams.layer], gain[frame.beams.layer])

    return Effect("layer_gain", kind, parameters, comparable or {}, light=light, place=AT_RECEIVER)


@form("layer_gain", "wave")
def _wave(draw: Draw) -> Effect:
    depth, period, phase = draw.level(0.09, 0.18, 0.4), draw.between(8, 40), draw.between(0, 2 * np.pi)
    gain = 1.0 + depth * np.sin(2 * np.pi * np.arange(LAYERS) / period + phase)
    return _layers("wave", gain, {"depth": depth, "period_layers": period, "phase": phase})


@form("layer_gain", "each_layer")
def _each_layer(draw: Draw) -> Effect:
    spread = draw.level(0.09, 0.18, 0.4)
    gain = np.exp(spread * draw.rng.standard_normal(LAYERS))
    return _layers("each_layer", gain, {"spread": spread})


@form("layer_gain", "band")
def _band(draw: Draw) -> Effect:
    factor, first, rows = draw.factor(0.16, 0.3, 0.5), int(draw.rng.integers(215, 270)), int(draw.rng.integers(10, 30))
    gain = np.where((np.arange(LAYERS) >= first) & (np.arange(LAYERS) < first + rows), factor, 1.0)
    parameters = {"gain": factor, "first_layer": float(first), "layers": float(rows)}
    comparable = {
        "layer_gain.gain": factor,
        "layer_gain.first_layer": float(first),
        "layer_gain.last_layer": first + rows - 1.0,
    }
    return _layers("band", gain, parameters, comparable)


@form("layer_gain", "slope")
def _slope(draw: Draw) -> Effect:
    depth = draw.level(0.12, 0.3, 0.6)
    gain = 1.0 - depth * np.clip(np.abs(np.arange(LAYERS) - 259.5) / 50.0, 0, 1)
    return _layers("slope", gain, {"depth": depth})


def _spots(draw: Draw, soft: bool) -> Effect:
    """Specks of dirt: Gaussian, or discs with a soft rim."""
    spots = int(draw.rng.integers(1, 4)) if soft else 1
    loss = min(draw.level(0.25, 0.5, 0.85), 0.95)
    where = draw.rng.uniform([-5.0, -1.8, 0.8], [5.0, 1.8, 1.6], (spots, 3))  # azimuth, elevation, size [deg]
    both_ways = draw.rng.random() < 0.5

    def light(light: Light, frame: Frame) -> None:
        transmission = np.ones(len(frame.beams))
        for azimuth, elevation, size in where:
            off = np.hypot(frame.beams.azimuth_deg - azimuth, frame.beams.elevation_deg - elevation)
            shade = np.exp(-0.5 * (off / size) ** 2) if soft else np.clip((1.2 * size - off) / 0.15, 0, 1)
            transmission *= 1.0 - loss * shade
        light.scale_beams(transmission, np.sqrt(transmission) if both_ways else np.ones(len(transmission)))

    parameters = {
        "loss": loss,
        "spots": float(spots),
        "azimuth_deg": where[0, 0],
        "elevation_deg": where[0, 1],
        "size_deg": where[0, 2],
    }
    comparable = {} if soft else {"blockage.transmission": 1.0 - loss}
    return Effect("blockage", "spots" if soft else "disc", parameters, comparable, light=light, place=AT_WINDOW)


@form("blockage", "spots")
def _soft_spots(draw: Draw) -> Effect:
    return _spots(draw, True)


@form("blockage", "disc")
def _disc(draw: Draw) -> Effect:
    return _spots(draw, False)


@form("blockage", "patch")
def _patch(draw: Draw) -> Effect:
    kept = 1.0 - min(draw.level(0.25, 0.5, 0.85), 0.97)
    layer, point = int(draw.rng.integers(215, 275)), int(draw.rng.integers(435, 495))
    layers, points = int(draw.rng.integers(15, 40)), int(draw.rng.integers(15, 40))

    def light(light: Light, frame: Frame) -> None:
        b = frame.beams
        inside = (b.layer >= layer) & (b.layer < layer + layers) & (b.point >= point) & (b.point < point + points)
        transmission = np.where(inside, kept, 1.0)
        light.scale_beams(transmission, np.sqrt(transmission))

    parameters = {
        "transmission": kept,
        "layer": float(layer),
        "point": float(point),
        "layers": float(layers),
        "points": float(points),
    }
    return Effect("blockage", "patch", parameters, {"blockage.transmission": kept}, light=light, place=AT_WINDOW)
