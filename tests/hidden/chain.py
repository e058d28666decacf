"""From a scene to a frame of echoes: aim, light, detectors, readout, with the effects in their places."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .rays import Beams, Hits, Scene, cast, directions
from .sensor import ALL_SHOTS, BACKGROUND_PER_NS, SIGNAL_AT_1M, THRESHOLD, Detectors, Echoes, Light, detect

F = NDArray[np.float64]
N = NDArray[np.int64]


@dataclass
class View:
    """Where the beams look, and from where: offsets of the angles [deg], origins [m], a turn of the body, sub-rays."""

    yaw_deg: F
    pitch_deg: F
    origin_m: F
    turn: F = field(default_factory=lambda: np.eye(3))
    velocity: dict[int, F] = field(default_factory=dict)
    rays: tuple[tuple[float, float, float], ...] = ((0.0, 0.0, 1.0),)  # yaw, pitch [deg], share of the light


@dataclass(frozen=True)
class Nuisance:
    """Small errors that every real comparison has; none of them is an effect."""

    gain: float = 1.0
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    height_m: float = 0.0
    reflectance: dict[int, float] = field(default_factory=dict)  # material -> factor


@dataclass
class Frame:
    """What an effect may look at when it acts on a frame."""

    scene: Scene
    beams: Beams
    variant: str
    index: int
    rng: np.random.Generator
    table: dict[int, tuple[str, float, float]]
    hits: Hits | None = None
    heading: F | None = None  # (beams, 3) where the middle of each beam looks, after the aim effects
    origin_m: F | None = None

    def reflectance(self, material: N) -> F:
        """Lambertian part of materials, retro gain left out; 0 for none."""
        return np.array([self.table[m][1] if m in self.table else 0.0 for m in range(100)])[material]

    def retro(self, material: N) -> NDArray[np.bool_]:
        return np.array([m in self.table and self.table[m][2] > 0 for m in range(100)])[material]

    def signal(self, material: N, range_m: F, incidence_deg: F) -> F:
        """Primary avalanches per SPAD and shot that a surface gives."""
        gain = np.array([max(self.table[m][2], 1.0) if m in self.table else 1.0 for m in range(100)])[material]
        cosine = np.where(self.retro(material), 1.0, np.cos(np.deg2rad(incidence_deg)))
        return np.asarray(SIGNAL_AT_1M * self.reflectance(material) * gain * cosine / np.maximum(range_m, 0.05) ** 2)


@dataclass(frozen=True)
class Effect:
    """One hidden effect in one form: what it does at each place of the chain.

    `parameters` are those of this form; `comparable` holds those that mean the same as a parameter of the public
    catalogue, by "effect.parameter".
    """

    name: str
    form: str
    parameters: dict[str, float]
    comparable: dict[str, float] = field(default_factory=dict)
    aim: Callable[[View, Frame], None] | None = None
    light: Callable[[Light, Frame], None] | None = None
    detectors: Callable[[Detectors, Frame], None] | None = None
    readout: Callable[[Echoes, Frame], Echoes] | None = None
    place: int = 0  # order among the effects on the light


def _look(view: View, frame: Frame) -> tuple[Light, Hits]:
    """Casts every sub-ray; each that meets something is a pulse."""
    beams = frame.beams
    first: Hits | None = None
    parts: list[tuple[N, Hits, float]] = []
    for yaw, pitch, share in view.rays:
        heading = (
            directions(beams.azimuth_deg + view.yaw_deg + yaw, beams.elevation_deg + view.pitch_deg + pitch)
            @ view.turn.T
        )
        hits = cast(frame.scene, view.origin_m, heading, beams.time_s, view.velocity)
        parts.append((np.flatnonzero(hits.rectangle >= 0), hits, share))
        if first is None or (yaw == 0.0 and pitch == 0.0):
            first = hits
            frame.heading, frame.origin_m, frame.hits = heading, view.origin_m, hits
    assert first is not None
    beam = np.concatenate([rows for rows, _, _ in parts])
    range_m, incidence = (
        np.concatenate([getattr(h, n)[rows] for rows, h, _ in parts]) for n in ("range_m", "incidence_deg")
    )
    material = np.concatenate([h.material[rows] for rows, h, _ in parts])
    share_of = np.concatenate([np.full(len(rows), share) for rows, _, share in parts])
    signal = frame.signal(material, range_m, incidence) * share_of
    light = Light(
        beam, range_m, signal, material, incidence, np.ones(len(beam), bool), np.full(len(beam), ALL_SHOTS, np.int64),
        np.full(len(beams), BACKGROUND_PER_NS), first.range_m.copy(),
    )  # fmt: skip
    return light, first


def _streams(seed: int, index: int, effects: tuple[Effect, ...]) -> list[np.random.Generator]:
    return [np.random.default_rng([seed, index, 101, *e.name.encode()]) for e in effects]


def measure(
    scene: Scene, beams: Beams, variant: str, table: dict[int, tuple[str, float, float]], effects: tuple[Effect, ...],
    nuisance: Nuisance, seed: int, index: int,
) -> Echoes:  # fmt: skip
    """One frame of echoes, ranges quantised to 1 cm; effects act in the order of the light's way."""
    true_table = {m: (n, rho * nuisance.reflectance.get(m, 1.0), gain) for m, (n, rho, gain) in table.items()}
    frame = Frame(scene.raised(-nuisance.height_m), beams, variant, index, np.random.default_rng(seed), true_table)
    streams = _streams(seed, index, effects)
    zero = np.zeros(len(beams))
    view = View(zero + nuisance.yaw_deg, zero + nuisance.pitch_deg, np.zeros((len(beams), 3)))
    for effect, frame.rng in zip(effects, streams, strict=True):
        if effect.aim is not None:
            effect.aim(view, frame)
    light, _ = _look(view, frame)
    light.signal = light.signal * nuisance.gain
    for effect, frame.rng in sorted(zip(effects, streams, strict=True), key=lambda pair: pair[0].place):
        if effect.light is not None:
            effect.light(light, frame)
    detectors = Detectors(np.full(len(beams), float(THRESHOLD)))
    for effect, frame.rng in zip(effects, streams, strict=True):
        if effect.detectors is not None:
            effect.detectors(detectors, frame)
    echoes = detect(light, detectors, variant, int(np.random.default_rng([seed, index, 7]).integers(2**31)))
    for effect, frame.rng in zip(effects, streams, strict=True):
        if effect.readout is not None:
            echoes = effect.readout(echoes, frame)
    echoes.range_m = np.asarray(np.round(np.maximum(echoes.range_m, 0.0), 2), np.float64)
    return echoes.kept(echoes.range_m > 0)
