"""Forms that change where beams look, cast again through the true scene: mounting, shaking, motion, footprint."""

import math

import numpy as np
from numpy.typing import NDArray

from .chain import Effect, Frame, View
from .forms import Draw, form
from .places import CAR, FIRST_CAR
from .sensor import POINTS, SWEEP_S

F = NDArray[np.float64]
COLUMN_S = SWEEP_S / (POINTS - 1)


def _angles(draw: Draw) -> tuple[float, float]:
    size, way = draw.level(0.06, 0.15, 0.45), draw.between(0, 2 * math.pi)
    return size * math.cos(way), size * math.sin(way)


@form("boresight", "encoder")
def _encoder(draw: Draw) -> Effect:
    yaw, pitch = _angles(draw)

    def aim(view: View, frame: Frame) -> None:
        view.yaw_deg = view.yaw_deg + yaw
        view.pitch_deg = view.pitch_deg + pitch

    comparable = {"boresight.yaw_deg": yaw, "boresight.pitch_deg": pitch}
    return Effect("boresight", "encoder", {"yaw_deg": yaw, "pitch_deg": pitch}, comparable, aim=aim)


@form("boresight", "body")
def _body(draw: Draw) -> Effect:
    yaw, pitch = _angles(draw)
    c, s = np.cos(np.deg2rad([yaw, pitch])), np.sin(np.deg2rad([yaw, pitch]))
    about_up = np.array([[c[0], -s[0], 0.0], [s[0], c[0], 0.0], [0.0, 0.0, 1.0]])
    about_left = np.array([[c[1], 0.0, -s[1]], [0.0, 1.0, 0.0], [s[1], 0.0, c[1]]])

    def aim(view: View, frame: Frame) -> None:
        view.turn = view.turn @ about_up @ about_left

    comparable = {"boresight.yaw_deg": yaw, "boresight.pitch_deg": pitch}
    return Effect("boresight", "body", {"yaw_deg": yaw, "pitch_deg": pitch}, comparable, aim=aim)


def _footprint(
    kind: str, rays: list[tuple[float, float, float]], parameters: dict[str, float], comparable: dict[str, float]
) -> Effect:
    whole = sum(share for _, _, share in rays)
    shares = tuple((yaw, pitch, share / whole) for yaw, pitch, share in rays)

    def aim(view: View, frame: Frame) -> None:
        view.rays = shares

    return Effect("beam_divergence", kind, parameters, comparable, aim=aim)


@form("beam_divergence", "rectangle")
def _rectangle(draw: Draw) -> Effect:
    wide, high = draw.level(0.03, 0.1, 0.35), draw.level(0.02, 0.07, 0.22)
    steps = (np.arange(7) - 3) / 7
    rays = [(float(u * wide), float(v * high), 1.0) for u in steps for v in steps]
    return _footprint("rectangle", rays, {"wide_deg": wide, "high_deg": high}, {})


@form("beam_divergence", "ellipse")
def _ellipse(draw: Draw) -> Effect:
    wide, high = draw.level(0.035, 0.12, 0.4), draw.level(0.025, 0.08, 0.25)
    steps = (np.arange(9) - 4) / 9
    rays = [(float(u * wide), float(v * high), 1.0) for u in steps for v in steps if u * u + v * v <= 0.25]
    return _footprint("ellipse", rays, {"wide_deg": wide, "high_deg": high}, {})


@form("beam_divergence", "bell")
def _bell(draw: Draw) -> Effect:
    wide, high = draw.level(0.03, 0.09, 0.3), draw.level(0.02, 0.06, 0.2)  # FWHM
    steps = np.linspace(-1.1, 1.1, 9)
    rays = [
        (float(u * wide), float(v * high), float(np.exp(-4 * math.log(2) * (u * u + v * v))))
        for u in steps
        for v in steps
    ]
    comparable = {"beam_divergence.horizontal_deg": wide, "beam_divergence.vertical_deg": high}
    return _footprint("bell", rays, {"wide_deg": wide, "high_deg": high}, comparable)


@form("motion", "ahead")
def _ahead(draw: Draw) -> Effect:
    velocity = np.array([draw.sign() * draw.level(2.5, 8.0, 30.0), draw.between(-1.0, 1.0), 0.0])

    def aim(view: View, frame: Frame) -> None:
        view.origin_m = view.origin_m + frame.beams.time_s[:, None] * velocity

    comparable = {"motion.forward_m_s": float(velocity[0])}
    parameters = {"forward_m_s": float(velocity[0]), "left_m_s": float(velocity[1])}
    return Effect("motion", "ahead", parameters, comparable, aim=aim)


@form("motion", "curve")
def _curve(draw: Draw) -> Effect:
    speed, rate = draw.level(2.5, 8.0, 30.0), draw.sign() * draw.level(4.0, 12.0, 35.0)

    def aim(view: View, frame: Frame) -> None:
        t = frame.beams.time_s
        turned = np.deg2rad(rate * t)
        view.yaw_deg = view.yaw_deg + rate * t
        view.origin_m = view.origin_m + (speed * t)[:, None] * np.stack(
            [np.cos(turned / 2), np.sin(turned / 2), 0 * t], -1
        )

    comparable = {"motion.forward_m_s": speed, "motion.yaw_deg_s": rate}
    return Effect("motion", "curve", {"forward_m_s": speed, "yaw_deg_s": rate}, comparable, aim=aim)


@form("motion", "traffic")
def _traffic(draw: Draw) -> Effect:
    speed = draw.level(4.0, 12.0, 35.0)

    def aim(view: View, frame: Frame) -> None:  # cars move towards or away from the sensor, each as fast
        for car in sorted({r.object_id for r in frame.scene.rectangles if r.material == CAR}):
            way = -1.0 if (car - FIRST_CAR) % 2 == 0 else 1.0
            view.velocity[car] = view.velocity.get(car, np.zeros(3)) + np.array([way * speed, 0.0, 0.0])

    return Effect("motion", "traffic", {"speed_m_s": speed}, {}, aim=aim)


def _shaken(
    kind: str, shake: "Shake", parameters: dict[str, float], comparable: dict[str, float] | None = None
) -> Effect:
    def aim(view: View, frame: Frame) -> None:
        pitch, yaw = shake(frame.rng)
        view.pitch_deg = view.pitch_deg + pitch[frame.beams.point]
        view.yaw_deg = view.yaw_deg + yaw[frame.beams.point]

    return Effect("vibration", kind, parameters, comparable or {}, aim=aim)


class Shake:
    """Pitch and yaw (960,) [deg] of each point column of a frame."""

    def __call__(self, rng: np.random.Generator) -> tuple[F, F]:
        raise TypeError("a shake needs a form")


class Wave(Shake):
    """A wave, of the same phase in every frame or of another in each."""

    def __init__(self, pitch_deg: float, yaw_deg: float, hertz: float, phase: float | None) -> None:
        self.size, self.hertz, self.phase = (pitch_deg, yaw_deg), hertz, phase

    def __call__(self, rng: np.random.Generator) -> tuple[F, F]:
        phase = rng.uniform(0, 2 * math.pi) if self.phase is None else self.phase
        wave = np.sin(2 * math.pi * self.hertz * COLUMN_S * np.arange(POINTS) + phase)
        return self.size[0] * wave, self.size[1] * wave


class Wander(Shake):
    """A first-order autoregressive wander, from column to column."""

    def __init__(self, pitch_deg: float, yaw_deg: float, memory: float) -> None:
        self.size, self.memory = (pitch_deg, yaw_deg), memory

    def __call__(self, rng: np.random.Generator) -> tuple[F, F]:
        kicks = rng.standard_normal((POINTS, 2)) * math.sqrt(1 - self.memory**2)
        state = np.zeros((POINTS, 2))
        state[0] = rng.standard_normal(2)
        for k in range(1, POINTS):
            state[k] = self.memory * state[k - 1] + kicks[k]
        return self.size[0] * state[:, 0], self.size[1] * state[:, 1]


class Knocks(Shake):
    """Knocks at random columns that ring and fade."""

    def __init__(self, size_deg: float, hertz: float) -> None:
        self.size, self.hertz = size_deg, hertz

    def __call__(self, rng: np.random.Generator) -> tuple[F, F]:
        t = COLUMN_S * np.arange(POINTS)
        both = np.zeros((2, POINTS))
        for start in rng.uniform(0, t[-1], 20):
            age = np.maximum(t - start, 0.0)
            both += rng.standard_normal((2, 1)) * np.exp(-age / 1.5e-3) * np.sin(2 * math.pi * self.hertz * age)
        return self.size * both[0], 0.5 * self.size * both[1]


@form("vibration", "wave")
def _wave(draw: Draw) -> Effect:
    pitch, yaw, hertz, phase = (
        draw.level(0.025, 0.07, 0.2),
        draw.level(0.015, 0.04, 0.1),
        draw.between(300, 900),
        draw.between(0, 6),
    )
    parameters = {"pitch_deg": pitch, "yaw_deg": yaw, "hertz": hertz}
    comparable = {"vibration.pitch_deg": pitch, "vibration.yaw_deg": yaw, "vibration.frequency_hz": hertz}
    comparable["vibration.phase_deg"] = math.degrees(phase)
    return _shaken("wave", Wave(pitch, yaw, hertz, phase), parameters, comparable)


@form("vibration", "free_wave")
def _free_wave(draw: Draw) -> Effect:
    pitch, yaw, hertz = draw.level(0.03, 0.07, 0.2), draw.level(0.015, 0.04, 0.1), draw.between(300, 900)
    parameters = {"pitch_deg": pitch, "yaw_deg": yaw, "hertz": hertz}
    return _shaken("free_wave", Wave(pitch, yaw, hertz, None), parameters)


@form("vibration", "wander")
def _wander(draw: Draw) -> Effect:
    pitch, yaw, memory = draw.level(0.02, 0.06, 0.16), draw.level(0.015, 0.04, 0.1), draw.between(0.6, 0.9)
    return _shaken("wander", Wander(pitch, yaw, memory), {"pitch_deg": pitch, "yaw_deg": yaw, "memory": memory})


@form("vibration", "knocks")
def _knocks(draw: Draw) -> Effect:
    size, hertz = draw.level(0.05, 0.13, 0.35), draw.between(300, 700)
    return _shaken("knocks", Knocks(size, hertz), {"size_deg": size, "hertz": hertz})
