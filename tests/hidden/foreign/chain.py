"""A frame: beams cast into a scene, light, detector, readout, with the hidden effects in their places."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hidden.chain import Nuisance
from hidden.rays import Hits, Scene, cast, directions

from .detectors import Echoes, Shine, detect
from .device import Beams, Device
from .readout import reported

F = NDArray[np.float64]
N = NDArray[np.int64]
Table = dict[int, tuple[str, float, float]]


@dataclass
class Aim:
    """A turn of the head (3, 3), and where the head stands when each beam fires (n, 3) [m]."""

    turn: F
    at_m: F


@dataclass
class Frame:
    """What an effect may look at."""

    device: Device
    beams: Beams
    table: Table
    rng: np.random.Generator
    hits: Hits | None = None
    light: Shine | None = None

    def of_material(self, material: N, column: int, none: float = 0.0) -> F:
        """A column of the table of materials for each row."""
        return np.array([self.table[m][column] if m in self.table else none for m in range(100)])[material]


@dataclass(frozen=True)
class Effect:
    """One hidden effect: what it does at each place of the chain, and the true values that mean the same elsewhere."""

    name: str
    parameters: dict[str, float]
    comparable: dict[str, float] = field(default_factory=dict)
    aim: Callable[[Aim, Frame], None] | None = None
    light: Callable[[Shine, Frame], None] | None = None
    readout: Callable[[Echoes, Frame], Echoes] | None = None


def headings(beams: Beams) -> F:
    """Nominal unit vectors (n, 3)."""
    return directions(beams.azimuth_deg, beams.elevation_deg)


def turn(yaw_deg: float, pitch_deg: float) -> F:
    """To the left, then upwards."""
    c, s = np.cos(np.deg2rad([yaw_deg, pitch_deg])), np.sin(np.deg2rad([yaw_deg, pitch_deg]))
    about_up = np.array([[c[0], -s[0], 0.0], [s[0], c[0], 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_up @ np.array([[c[1], 0.0, -s[1]], [0.0, 1.0, 0.0], [s[1], 0.0, c[1]]]))


def look(scene: Scene, device: Device, beams: Beams, aim: Aim) -> list[Hits]:
    """What each part of every beam meets, from where its beam begins."""
    origin = device.origins_m(beams) @ aim.turn.T + aim.at_m
    return [
        cast(scene, origin, directions(beams.azimuth_deg + a, beams.elevation_deg + e) @ aim.turn.T, beams.time_s)
        for a, e in device.parts_deg()
    ]


def nominal(scene: Scene, device: Device, beams: Beams) -> list[Hits]:
    """The same, with nothing off."""
    return look(scene, device, beams, Aim(np.eye(3), np.zeros((len(beams), 3))))


def light_of(frame: Frame, parts: list[Hits]) -> Shine:
    """The light of what each part of every beam meets."""
    own = frame.device.numbers
    met = [np.flatnonzero(h.rectangle >= 0) for h in parts]
    range_m, incidence, material = (
        np.concatenate([getattr(h, name)[rows] for h, rows in zip(parts, met, strict=True)])
        for name in ("range_m", "incidence_deg", "material")
    )
    gain = frame.of_material(material, 2)
    lit = np.where(gain > 0, gain, np.cos(np.deg2rad(incidence))) * frame.of_material(material, 1)
    signal = float(own["signal_at_1m"]) * lit / (range_m**2 + float(own.get("near_m", 0.0)) ** 2) / len(parts)
    n = len(frame.beams)
    dark = 0.0 if frame.device.detector == "linear" else float(own.get("background_per_ns", 0.0))
    threshold = float(own.get("threshold", own.get("threshold_sigma", 5.5)))
    return Shine(
        np.concatenate(met), range_m, signal, material, incidence, np.full(n, dark), np.full(n, threshold),
        parts[len(parts) // 2].range_m.copy(),
    )  # fmt: skip


def measure(
    scene: Scene, device: Device, beams: Beams, table: Table, effects: tuple[Effect, ...], nuisance: Nuisance,
    seed: list[int],
) -> Echoes:  # fmt: skip
    """One frame of what the sensor reports."""
    true = {m: (n, rho * nuisance.reflectance.get(m, 1.0), gain) for m, (n, rho, gain) in table.items()}
    frame = Frame(device, beams, true, np.random.default_rng(seed))
    streams = [np.random.default_rng([*seed, *e.name.encode()]) for e in effects]
    aim = Aim(turn(nuisance.yaw_deg, nuisance.pitch_deg), np.zeros((len(beams), 3)))
    for effect, frame.rng in zip(effects, streams, strict=True):
        if effect.aim is not None:
            effect.aim(aim, frame)
    parts = look(scene.raised(-nuisance.height_m), device, beams, aim)
    frame.hits = parts[len(parts) // 2]
    shine = frame.light = light_of(frame, parts)
    shine.signal = shine.signal * nuisance.gain
    for effect, frame.rng in zip(effects, streams, strict=True):
        if effect.light is not None:
            effect.light(shine, frame)
    echoes = detect(shine, device, np.random.default_rng([*seed, 7]))
    for effect, frame.rng in zip(effects, streams, strict=True):
        if effect.readout is not None:
            echoes = effect.readout(echoes, frame)
    return reported(echoes, beams, device)
