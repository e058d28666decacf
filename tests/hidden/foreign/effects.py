"""What cases of foreign sensors hide: an effect of the catalogue in a form of its own, or one of no catalogue."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hidden.forms import Draw

from .chain import Aim, Effect, Frame, turn
from .detectors import AIR_STEP_M, Echoes, Shine
from .device import Device
from .places import OFTEN

F = NDArray[np.float64]
Form = Callable[[Draw, Device], Effect]
FORMS: dict[str, Form] = {}


def form(function: Form) -> Form:
    """Registers an effect by its function's name."""
    FORMS[function.__name__] = function
    return function


def _near(device: Device) -> bool:
    """Whether the sensor looks at a bench."""
    return device.gate_m[1] < 5.0


def _scaled(
    name: str, parameters: dict[str, float], factor: Callable[[Shine, Frame], F], same: dict[str, float] | None = None
) -> Effect:
    def light(shine: Shine, frame: Frame) -> None:
        shine.signal = shine.signal * factor(shine, frame)

    return Effect(name, parameters, same or {}, light=light)


def _moved(
    name: str, parameters: dict[str, float], shift: Callable[[Echoes, Frame], F], same: dict[str, float] | None = None
) -> Effect:
    def readout(echoes: Echoes, frame: Frame) -> Echoes:
        echoes.path_m = echoes.path_m + shift(echoes, frame)
        return echoes

    return Effect(name, parameters, same or {}, readout=readout)


@form
def signal_gain(draw: Draw, device: Device) -> Effect:
    gain = draw.factor(0.1, 0.25, 0.5)
    return _scaled("signal_gain", {"gain": gain}, lambda s, f: np.full(len(s.beam), gain), {"signal_gain.gain": gain})


@form
def material_reflectance(draw: Draw, device: Device) -> Effect:
    material = int(draw.rng.choice(OFTEN["bench" if _near(device) else "street"]))
    factor = draw.factor(0.15, 0.3, 0.5)
    values = {"material_id": float(material), "factor": factor}
    return _scaled(
        "material_reflectance", values, lambda s, f: np.where(s.material == material, factor, 1.0),
        {f"material_reflectance.{k}": v for k, v in values.items()},
    )  # fmt: skip


@form
def incidence_falloff(draw: Draw, device: Device) -> Effect:
    exponent = 1.0 + draw.level(0.25, 0.6, 1.2) * (1.0 if draw.rng.random() < 0.6 else -0.8)

    def factor(shine: Shine, frame: Frame) -> F:
        cosine = np.maximum(np.cos(np.deg2rad(shine.incidence_deg)), 1e-3)
        return np.where(frame.of_material(shine.material, 2) > 0, 1.0, cosine ** (exponent - 1.0))

    return _scaled("incidence_falloff", {"exponent": exponent}, factor, {"incidence_falloff.exponent": exponent})


@form
def layer_gain(draw: Draw, device: Device) -> Effect:
    spread = draw.level(0.1, 0.25, 0.5)
    own = np.exp(spread * draw.rng.standard_normal(device.layers))
    return _scaled("layer_gain", {"spread": spread}, lambda s, f: own[f.beams.layer[s.beam]])


@form
def blockage(draw: Draw, device: Device) -> Effect:
    left, low, through = draw.between(0.0, 0.55), draw.between(0.0, 0.55), 1.0 - draw.level(0.3, 0.6, 0.9)

    def factor(shine: Shine, frame: Frame) -> F:
        inside = np.ones(len(frame.beams), bool)
        for begin, at in ((left, frame.beams.point), (low, frame.beams.elevation_deg)):
            place = (at - at.min()) / (at.max() - at.min())
            inside &= (place >= begin) & (place <= begin + 0.4)
        return np.where(inside, through, 1.0)[shine.beam]

    return _scaled("blockage", {"transmission": through}, factor, {"blockage.transmission": through})


@form
def range_offset(draw: Draw, device: Device) -> Effect:
    size = draw.sign() * (draw.level(0.004, 0.012, 0.03) if _near(device) else draw.level(0.015, 0.05, 0.2))
    same = {"range_offset.offset_m": size}
    return _moved("range_offset", {"offset_m": size}, lambda e, f: np.full(len(e.beam), size), same)


@form
def range_scale(draw: Draw, device: Device) -> Effect:
    size = draw.sign() * (draw.level(0.006, 0.015, 0.04) if _near(device) else draw.level(0.0006, 0.002, 0.006))
    return _moved("range_scale", {"fraction": size}, lambda e, f: size * e.path_m, {"range_scale.fraction": size})


@form
def walk_error(draw: Draw, device: Device) -> Effect:
    per_decade = draw.sign() * (draw.level(0.005, 0.012, 0.03) if _near(device) else draw.level(0.02, 0.05, 0.12))
    reference = {"linear": 60.0, "photon_histogram": 1e4, "spad_array": 1000.0}[device.detector]

    def shift(echoes: Echoes, frame: Frame) -> F:
        return per_decade * np.log10(np.maximum(echoes.amplitude, 1.0) / reference)

    return _moved("walk_error", {"per_decade_m": per_decade}, shift, {"walk_error.per_decade_m": per_decade})


@form
def timing_jitter(draw: Draw, device: Device) -> Effect:
    sigma = draw.level(0.15, 0.35, 0.8) * (0.6 if _near(device) else 1.0)

    def light(shine: Shine, frame: Frame) -> None:
        shine.jitter_ns = sigma

    return Effect("timing_jitter", {"sigma_ns": sigma}, {"timing_jitter.sigma_ns": sigma}, light=light)


@form
def dropout(draw: Draw, device: Device) -> Effect:
    """Packets of twelve columns, half of the channels each, or single beams."""
    share, packets = draw.level(0.015, 0.04, 0.1), draw.rng.random() < 0.4

    def readout(echoes: Echoes, frame: Frame) -> Echoes:
        half = 2 * frame.beams.layer // frame.device.layers
        of_beam = frame.beams.point // 12 * 2 + half if packets else np.arange(len(frame.beams))
        lost = frame.rng.random(int(of_beam.max()) + 1) < share
        return echoes.kept(~lost[of_beam][echoes.beam])

    return Effect("dropout", {"share": share, "packets": float(packets)}, {"dropout.share": share}, readout=readout)


@form
def boresight(draw: Draw, device: Device) -> Effect:
    size, way = draw.level(0.1, 0.25, 0.6), draw.between(0, 2 * math.pi)
    yaw, pitch = size * math.cos(way), size * math.sin(way)

    def aim(aim: Aim, frame: Frame) -> None:
        aim.turn = aim.turn @ turn(yaw, pitch)

    same = {"boresight.yaw_deg": yaw, "boresight.pitch_deg": pitch}
    return Effect("boresight", {"yaw_deg": yaw, "pitch_deg": pitch}, same, aim=aim)


@form
def motion(draw: Draw, device: Device) -> Effect:
    speed = draw.sign() * draw.level(3.0, 10.0, 30.0)

    def aim(aim: Aim, frame: Frame) -> None:
        aim.at_m = aim.at_m + frame.beams.time_s[:, None] * np.array([speed, 0.0, 0.0])

    return Effect("motion", {"forward_m_s": speed}, {"motion.forward_m_s": speed}, aim=aim)


@form
def threshold(draw: Draw, device: Device) -> Effect:
    factor = 1.0 + draw.level(0.15, 0.4, 1.0) if draw.rng.random() < 0.6 else 1.0 - draw.level(0.08, 0.2, 0.3)

    def light(shine: Shine, frame: Frame) -> None:
        changed = shine.threshold * factor
        shine.threshold = np.round(changed) if device.detector == "spad_array" else changed

    return Effect("threshold", {"factor": factor}, light=light)


@form
def ambient_light(draw: Draw, device: Device) -> Effect:
    own = device.numbers
    base = float(own.get("noise", 1.0)) ** 2 if device.detector == "linear" else float(own["background_per_ns"])
    level = base * draw.level(1.5, 4.0, 10.0) * (3.0 if device.detector == "spad_array" else 1.0)
    sky = draw.between(0.1, 0.4)

    def light(shine: Shine, frame: Frame) -> None:
        assert frame.hits is not None
        met = frame.hits.rectangle >= 0
        shine.background = shine.background + level * np.where(met, frame.of_material(frame.hits.material, 1), sky)

    return Effect("ambient_light", {"level": level, "sky": sky}, {"ambient_light.sky": sky}, light=light)


@form
def dark_counts(draw: Draw, device: Device) -> Effect:
    rate = float(device.numbers["background_per_ns"]) * draw.level(0.7, 2.0, 5.0)

    def light(shine: Shine, frame: Frame) -> None:
        shine.background = shine.background + rate

    return Effect("dark_counts", {"rate_per_ns": rate}, {"dark_counts.rate_per_ns": rate}, light=light)


@form
def pulse_shape(draw: Draw, device: Device) -> Effect:
    stretch = 1.0 + draw.level(0.15, 0.3, 0.6)

    def light(shine: Shine, frame: Frame) -> None:
        shine.stretch = stretch

    return Effect("pulse_shape", {"stretch": stretch}, {"pulse_shape.stretch": stretch}, light=light)


@form
def fog(draw: Draw, device: Device) -> Effect:
    """Even fog; the receiver sees the air fully only some metres away."""
    mor_m = 1.0 / draw.level(1 / 1000, 1 / 350, 1 / 120)
    start, scale, backscatter = draw.between(0.5, 2.0), draw.between(2.0, 5.0), draw.between(0.03, 0.06)

    def light(shine: Shine, frame: Frame) -> None:
        alpha = math.log(20.0) / mor_m
        shine.signal = shine.signal * np.exp(-2.0 * alpha * shine.range_m)
        at = AIR_STEP_M * (np.arange(4000) + 0.5)
        seen = np.where(at > start, 1.0 - np.exp(-(((at - start) / scale) ** 2)), 0.0)
        k = float(frame.device.numbers["signal_at_1m"])
        shine.haze_per_m = k * math.pi * backscatter / mor_m * np.exp(-2.0 * alpha * at) * seen / at**2

    return Effect("fog", {"mor_m": mor_m, "backscatter": backscatter}, {"fog.mor_m": mor_m}, light=light)


@form
def interference(draw: Draw, device: Device) -> Effect:
    share = draw.level(0.006, 0.02, 0.06)

    def light(shine: Shine, frame: Frame) -> None:
        beam = np.flatnonzero(frame.rng.random(len(frame.beams)) < share)
        strength = 0.4 if frame.device.detector == "spad_array" else 1.5 * float(shine.threshold.mean())
        at = frame.rng.uniform(*frame.device.gate_m, len(beam))
        shine.added(beam, at, strength * (0.5 + frame.rng.exponential(size=len(beam))))

    return Effect("interference", {"share": share}, {"interference.share": share}, light=light)


@form
def retro_ghost(draw: Draw, device: Device) -> Effect:
    """Light that goes between sign and sensor twice."""
    level = 10.0 ** -draw.between(1.6, 2.2)

    def light(shine: Shine, frame: Frame) -> None:
        retro = np.flatnonzero(frame.of_material(shine.material, 2) > 0)
        shine.added(shine.beam[retro], 2.0 * shine.range_m[retro], level * shine.signal[retro])

    return Effect("retro_ghost", {"level": level}, light=light)


@form
def range_ripple(draw: Draw, device: Device) -> Effect:
    """Of no catalogue: a converter that is not linear."""
    size, period = (0.02, 0.35) if _near(device) else (draw.level(0.03, 0.07, 0.15), draw.between(6, 20))
    phase = draw.between(0, 2 * math.pi)
    values = {"size_m": size, "period_m": period}
    return _moved("range_ripple", values, lambda e, f: size * np.sin(2 * math.pi * e.path_m / period + phase))


@form
def column_gain(draw: Draw, device: Device) -> Effect:
    """Of no catalogue: the laser's power ripples from column to column."""
    depth, period = draw.level(0.1, 0.3, 0.5), draw.between(6, 16)
    values = {"depth": depth, "period_columns": period}
    return _scaled(
        "column_gain", values, lambda s, f: 1.0 + depth * np.sin(2 * math.pi * f.beams.point[s.beam] / period)
    )
