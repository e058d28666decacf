"""Forms in which light comes by another way: blooming, ghosts, mirrors."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .chain import Effect, Frame
from .forms import AT_MIRROR, AT_SURFACE, IN_OPTICS, Draw, form
from .places import ASPHALT, CONCRETE, GLASS
from .rays import cast, normals
from .sensor import Light

F = NDArray[np.float64]
N = NDArray[np.int64]
BRIGHT = 30.0  # avalanches per SPAD and shot: only what is this bright blooms visibly
FAINTEST = 1e-3
Profile = Callable[[F], F]
# Heights of the three forms at each strength. The view is wider than high, so horizontal blooming meets more beams.
LEVELS = {
    "blooming_vertical": ((2e-5, 8e-5, 4e-4), (5e-5, 2e-4, 1e-3), (6e-6, 2.5e-5, 1.2e-4)),
    "blooming_horizontal": ((8e-6, 4e-5, 2e-4), (1.5e-5, 8e-5, 4e-4), (2e-6, 1e-5, 6e-5)),
}


def _bloomed(light: Light, frame: Frame, along: N, across: N, step: float, profile: Profile) -> None:
    """Scatters each bright pulse over the beams of its line, by the offset in the profile's unit."""
    bright = np.flatnonzero(light.direct & (light.signal > BRIGHT))
    beams, ranges, signals, materials = [], [], [], []
    lines = {line: np.flatnonzero(across == line) for line in np.unique(across[light.beam[bright]])}
    for row in bright:
        own = light.beam[row]
        others = lines[across[own]]
        others = others[others != own]
        scattered = light.signal[row] * profile(step * (along[others] - along[own]).astype(float))
        keep = scattered > FAINTEST
        beams.append(others[keep])
        ranges.append(np.full(keep.sum(), light.range_m[row]))
        signals.append(scattered[keep])
        materials.append(np.full(keep.sum(), light.material[row]))
    if beams:
        light.added(*(np.concatenate(part) for part in (beams, ranges, signals, materials)))


def _blooming(name: str, kind: str, profile: Profile, parameters: dict[str, float]) -> Effect:
    def light(light: Light, frame: Frame) -> None:
        if name == "blooming_vertical":
            _bloomed(light, frame, frame.beams.layer, frame.beams.point, 3.0, profile)
        else:
            _bloomed(light, frame, frame.beams.point, frame.beams.layer, 2.5, profile)

    return Effect(name, kind, parameters, light=light, place=IN_OPTICS)


def _power_law(name: str) -> Callable[[Draw], Effect]:
    def drawn(draw: Draw) -> Effect:
        height, width = draw.level(*LEVELS[name][0]), draw.between(5, 10)
        return _blooming(
            name, "power_law", lambda x: height / (1 + (x / width) ** 2), {"height": height, "width": width}
        )

    return drawn


def _decay(name: str) -> Callable[[Draw], Effect]:
    def drawn(draw: Draw) -> Effect:
        height, width = draw.level(*LEVELS[name][1]), draw.between(6, 14)
        return _blooming(
            name, "decay", lambda x: height * np.exp(-np.abs(x) / width), {"height": height, "width": width}
        )

    return drawn


def _plateau(name: str) -> Callable[[Draw], Effect]:
    def drawn(draw: Draw) -> Effect:
        height, reach, side = draw.level(*LEVELS[name][2]), draw.between(60, 120), draw.sign()
        core = 5 * height

        def profile(x: F) -> F:
            one_sided = height * np.clip((reach - side * x) / (reach / 2), 0, 1) * (side * x > 0)
            return core * np.exp(-np.abs(x) / 6) + one_sided

        return _blooming(name, "plateau", profile, {"height": height, "reach": reach, "side": side})

    return drawn


for _name in ("blooming_vertical", "blooming_horizontal"):
    form(_name, "power_law")(_power_law(_name))
    form(_name, "decay")(_decay(_name))
    form(_name, "plateau")(_plateau(_name))


def _ghost(kind: str, ratio: float, power: float, shape: float, extra_m: float, comparable: dict[str, float]) -> Effect:
    """`shape` is that of a gamma-distributed scatter of the strength, 0 for none."""

    def light(light: Light, frame: Frame) -> None:
        rows = np.flatnonzero(light.direct & frame.retro(light.material))
        strength = light.signal[rows] * ratio * (25.0 / light.range_m[rows]) ** power
        if shape:
            strength = strength * frame.rng.gamma(shape, 1.0 / shape, len(rows))
        light.added(light.beam[rows], 2.0 * light.range_m[rows] + extra_m, strength, light.material[rows])

    parameters = {"ratio_at_25m": ratio, "power": power, "gamma_shape": shape, "extra_m": extra_m}
    return Effect("retro_ghost", kind, parameters, comparable, light=light, place=AT_SURFACE)


@form("retro_ghost", "even")
def _ghost_even(draw: Draw) -> Effect:
    ratio, power, extra = draw.level(4e-5, 8e-5, 3e-4), 0.25, draw.between(0.1, 0.4)
    comparable = {"retro_ghost.strength": ratio, "retro_ghost.extra_m": extra}
    return _ghost("even", ratio, power, 0.0, extra, comparable)


@form("retro_ghost", "fourth_power")
def _ghost_fourth(draw: Draw) -> Effect:
    return _ghost("fourth_power", draw.level(1.5e-4, 3e-4, 1e-3), 2.0, 0.0, 0.0, {})


@form("retro_ghost", "scattered")
def _ghost_scattered(draw: Draw) -> Effect:
    return _ghost("scattered", draw.level(5e-5, 1e-4, 3e-4), 0.0, 4.0, draw.between(0.0, 0.5), {})


def _fresnel(incidence_deg: F, index: float) -> F:
    """Unpolarised reflection from air into a dielectric."""
    cosine = np.cos(np.deg2rad(incidence_deg))
    inside = np.sqrt(1.0 - (np.sin(np.deg2rad(incidence_deg)) / index) ** 2)
    across, along = (
        (cosine - index * inside) / (cosine + index * inside),
        (inside - index * cosine) / (inside + index * cosine),
    )
    return 0.5 * (across**2 + along**2)


def _mirror(
    kind: str,
    materials: tuple[int, ...],
    reflected: Callable[[F], F],
    parameters: dict[str, float],
    comparable: dict[str, float],
) -> Effect:
    """Casts on from the mirror, to where its own frame of rectangles leads; there and back over the mirror."""

    def light(light: Light, frame: Frame) -> None:
        hits, heading, origin = frame.hits, frame.heading, frame.origin_m
        assert hits is not None
        assert heading is not None
        assert origin is not None
        ground = np.array(
            [abs(r.along[2]) + abs(r.across[2]) == 0.0 and r.half_m[0] > 100 for r in frame.scene.rectangles] + [False]
        )
        mirrors = np.isin(hits.material, materials) & (hits.rectangle >= 0)
        if GLASS not in materials:
            mirrors &= ground[hits.rectangle]
        rows = np.flatnonzero(mirrors)
        normal = normals(frame.scene, hits.rectangle[rows])
        towards = heading[rows]
        onward = towards - 2.0 * np.sum(towards * normal, axis=1, keepdims=True) * normal
        at = origin[rows] + hits.range_m[rows, None] * towards
        met = cast(frame.scene, at, onward, frame.beams.time_s[rows])
        seen = met.rectangle >= 0
        way = hits.range_m[rows] + met.range_m
        strength = frame.signal(met.material, way, met.incidence_deg) * reflected(hits.incidence_deg[rows]) ** 2
        light.added(rows[seen], way[seen], strength[seen], met.material[seen])

    return Effect("mirror_multipath", kind, parameters, comparable, light=light, place=AT_MIRROR)


@form("mirror_multipath", "even_glass")
def _even_glass(draw: Draw) -> Effect:
    part = min(draw.level(0.2, 0.4, 0.85), 0.95)
    comparable = {"mirror_multipath.reflectivity": part, "mirror_multipath.material_id": float(GLASS)}
    return _mirror("even_glass", (GLASS,), lambda i: np.full(len(i), part), {"reflectivity": part}, comparable)


@form("mirror_multipath", "pane")
def _pane(draw: Draw) -> Effect:
    index = draw.level(1.4, 1.7, 2.4)
    return _mirror("pane", (GLASS,), lambda i: 2 * (r := _fresnel(i, index)) / (1 + r), {"index": index}, {})


@form("mirror_multipath", "wet_road")
def _wet_road(draw: Draw) -> Effect:
    index, film = 1.33, min(draw.level(0.35, 0.6, 0.95), 1.0)
    return _mirror(
        "wet_road", (ASPHALT, CONCRETE), lambda i: film * _fresnel(i, index), {"index": index, "film": film}, {}
    )
