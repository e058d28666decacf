"""Measured signs with ghosts whose truth is known, made by the independent simulator: no code of the package in it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hidden import effects_light_paths  # noqa: F401  (registers blooming)
from hidden.chain import Effect, Frame, Nuisance, measure
from hidden.files import echoes_text, ideal_text, model_text
from hidden.forms import AT_SURFACE, Draw, draw_effect
from hidden.places import ASPHALT, CONCRETE, SIGN, TABLE, Builder
from hidden.rays import Beams, Hits, Scene, cast, directions
from hidden.sensor import Echoes, Light
from lidarcheck.scan import Scan

F = NDArray[np.float64]
OTHER_LABEL, SIGN_LABEL, GHOST_LABEL = 0, 1, 2
LAYERS, POINTS = range(232, 296), range(448, 512)


@dataclass(frozen=True)
class Recipe:
    """What one frame is made of."""

    variant: str = "SLIM"
    range_m: float = 25.0
    seed: int = 0
    ratio: float = 8e-5  # the ghost's S over the sign's, at 25 m
    power: float = 0.25
    extra_m: float = 0.3
    size_m: tuple[float, float] = (0.8, 0.8)
    turn_deg: float = 0.0
    gain: float = 900.0
    ghost_share: float = 1.0  # of the sign's beams that make a ghost at all
    wall_at_ghost: bool = False  # a wall beside the sign, at the ghost's range
    noise_share: float = 0.0  # of the sign's beams on which something glimmers behind the sign
    false_echoes: float = 0.01  # of all beams that have a stray echo
    blooming: str = ""
    second_sign: bool = False  # further away, without a ghost
    azimuth_deg: float = 0.3
    layers: range = LAYERS
    points: range = POINTS
    table: dict[int, tuple[str, float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Made:
    """A frame: its beams, what they would meet, the echoes and the true label of each."""

    recipe: Recipe
    beams: Beams
    hits: Hits
    echoes: Echoes
    label: NDArray[np.int64]
    table: dict[int, tuple[str, float, float]]

    @property
    def scan_text(self) -> str:
        return echoes_text(self.beams, self.echoes)

    @property
    def ideal_text(self) -> str:
        return ideal_text(self.beams, self.hits, False, None)

    @property
    def model_text(self) -> str:
        return model_text(self.recipe.variant, self.table, {})


def _scene(r: Recipe, rng: np.random.Generator) -> Scene:
    b = Builder(rng)
    b.ground(ASPHALT)
    b.plate(r.range_m, (r.azimuth_deg, 0.4), r.size_m, SIGN, r.turn_deg)
    b.wall(float(rng.uniform(190.0, 230.0)), CONCRETE, (-7.0, 7.0), 3.0)
    if r.wall_at_ghost:
        b.wall(2.0 * r.range_m + r.extra_m + float(rng.uniform(-0.2, 0.2)), CONCRETE, (-7.0, 7.0), 2.5)
    if r.second_sign:
        b.plate(1.35 * r.range_m, (r.azimuth_deg + 2.2, 0.5), (0.9, 0.9), SIGN)
    return Scene(tuple(b.rectangles), "sign")


def _sign_beams(light: Light, frame: Frame, range_m: float) -> NDArray[np.int64]:
    return np.flatnonzero(light.direct & (light.material == SIGN) & (np.abs(light.range_m - range_m) < 3.0))


def _effects(r: Recipe, added: dict[str, tuple[NDArray[np.int64], F]]) -> tuple[Effect, ...]:
    """The ghost, noise behind the sign, strays, blooming; `added` takes beams and ranges of the ghosts' pulses."""

    def ghost(light: Light, frame: Frame) -> None:
        rows = _sign_beams(light, frame, r.range_m)
        rows = rows[frame.rng.random(len(rows)) < r.ghost_share]
        strength = light.signal[rows] * r.ratio * (25.0 / light.range_m[rows]) ** r.power
        at = 2.0 * light.range_m[rows] + r.extra_m
        added["ghost"] = (light.beam[rows], at)
        light.added(light.beam[rows], at, strength, light.material[rows])

    def noise(light: Light, frame: Frame) -> None:
        rows = _sign_beams(light, frame, r.range_m)
        rows = rows[frame.rng.random(len(rows)) < r.noise_share]
        behind = light.range_m[rows] + frame.rng.uniform(0.5, 4.5, len(rows))
        added["noise"] = (light.beam[rows], behind)
        light.added(light.beam[rows], behind, frame.rng.uniform(0.05, 3.0, len(rows)))

    def false_echoes(light: Light, frame: Frame) -> None:
        beams = np.flatnonzero(frame.rng.random(len(frame.beams)) < r.false_echoes)
        light.added(beams, frame.rng.uniform(4.0, 200.0, len(beams)), frame.rng.uniform(0.05, 0.5, len(beams)))

    parts = [Effect("retro_ghost", "test", {}, light=ghost, place=AT_SURFACE)]
    parts += [Effect("noise", "test", {}, light=noise, place=AT_SURFACE + 1)] if r.noise_share else []
    parts += [Effect("strays", "test", {}, light=false_echoes, place=AT_SURFACE + 1)] if r.false_echoes else []
    if r.blooming:
        draw = Draw(np.random.default_rng([r.seed, 5]), r.blooming, r.variant, (SIGN,))
        parts += [draw_effect(f"blooming_{way}", draw) for way in ("vertical", "horizontal")]
    return tuple(parts)


def made(r: Recipe) -> Made:
    """The frame of a recipe."""
    rng = np.random.default_rng([r.seed, 11])
    scene, beams = _scene(r, rng), Beams.block(r.layers, r.points)
    name, reflectance, _ = TABLE[SIGN]
    table = {m: TABLE[m] for m in (ASPHALT, CONCRETE)} | {SIGN: (name, reflectance, r.gain)}
    added: dict[str, tuple[NDArray[np.int64], F]] = {}
    echoes = measure(scene, beams, r.variant, table, _effects(r, added), Nuisance(), r.seed, 0)
    zero = np.zeros((len(beams), 3))
    hits = cast(scene, zero, directions(beams.azimuth_deg, beams.elevation_deg), beams.time_s)
    return Made(r, beams, hits, echoes, _truth(r, hits, echoes, added), table)


def _truth(r: Recipe, hits: Hits, echoes: Echoes, pulses: dict[str, tuple[NDArray[np.int64], F]]) -> NDArray[np.int64]:
    """What made each echo: the nearest of the pulses on its beam, or the sign's light once its SPADs have recovered."""
    label = np.zeros(len(echoes.beam), np.int64)
    own = np.where(hits.material == SIGN, hits.range_m, np.nan)[echoes.beam]
    to_sign = np.fmin(np.abs(echoes.range_m - own + 0.3), np.abs(echoes.range_m - own - 1.0))
    distance = {SIGN_LABEL: np.where(np.isnan(own), np.inf, to_sign)}
    for name, kind in (("ghost", GHOST_LABEL), ("noise", OTHER_LABEL)):
        at = np.full(len(hits.range_m), np.inf)
        beam, range_m = pulses.get(name, (np.zeros(0, np.int64), np.zeros(0)))
        at[beam] = range_m
        distance[kind] = np.abs(echoes.range_m - at[echoes.beam])
    # A weak echo of noise may lie near the sign's own; the sign's are strong.
    strong = echoes.area > 0.3 * 9.0 * {"SMART": 135, "SLIM": 315}[r.variant]
    sign = (distance[SIGN_LABEL] < 1.3) & (strong | (distance[SIGN_LABEL] <= distance[OTHER_LABEL]))
    label[sign] = SIGN_LABEL
    label[distance[GHOST_LABEL] < 0.8] = GHOST_LABEL
    return label


def scan_of(frame) -> Scan:
    """The frame's echoes, in the package's table."""
    echoes = frame.echoes
    first = np.concatenate([[True], np.diff(echoes.beam) > 0])
    row = np.arange(len(echoes.beam))
    number = row - np.maximum.accumulate(np.where(first, row, 0)) + 1
    return Scan.from_beams(
        frame.beams.layer[echoes.beam], frame.beams.point[echoes.beam], echoes.range_m, echo_number=number,
        width_ns=echoes.width_ns, area=echoes.area, peak=echoes.peak,
    )  # fmt: skip
