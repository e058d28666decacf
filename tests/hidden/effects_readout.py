"""Forms that change echoes after the trace is read: ranges that are off, losses."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .chain import Effect, Frame
from .forms import AT_RECEIVER, Draw, form
from .sensor import LIGHT_M_NS, PEAK_SATURATION, Echoes, Light

F = NDArray[np.float64]


def _moved(
    name: str,
    kind: str,
    parameters: dict[str, float],
    comparable: dict[str, float],
    shift: Callable[[Echoes, Frame], F],
) -> Effect:
    def readout(echoes: Echoes, frame: Frame) -> Echoes:
        echoes.range_m = echoes.range_m + shift(echoes, frame)
        return echoes

    return Effect(name, kind, parameters, comparable, readout=readout)


@form("range_offset", "readout")
def _offset(draw: Draw) -> Effect:
    offset = draw.sign() * draw.level(0.015, 0.05, 0.2)
    return _moved(
        "range_offset",
        "readout",
        {"offset_m": offset},
        {"range_offset.offset_m": offset},
        lambda e, f: np.full(len(e.beam), offset),
    )


@form("range_offset", "late_light")
def _late(draw: Draw) -> Effect:
    offset = draw.sign() * draw.level(0.015, 0.05, 0.2)

    def light(light: Light, frame: Frame) -> None:
        light.range_m = light.range_m + offset

    return Effect(
        "range_offset",
        "late_light",
        {"offset_m": offset},
        {"range_offset.offset_m": offset},
        light=light,
        place=AT_RECEIVER + 1,
    )


@form("range_scale", "readout")
def _scale(draw: Draw) -> Effect:
    fraction = draw.sign() * draw.level(0.0003, 0.0012, 0.005)
    return _moved(
        "range_scale",
        "readout",
        {"fraction": fraction},
        {"range_scale.fraction": fraction},
        lambda e, f: fraction * e.range_m,
    )


@form("range_scale", "clock")
def _clock(draw: Draw) -> Effect:
    fraction = draw.sign() * draw.level(0.0003, 0.0012, 0.005)

    def light(light: Light, frame: Frame) -> None:  # the light's times as a fast clock counts them
        light.range_m = light.range_m * (1.0 + fraction)

    return Effect(
        "range_scale",
        "clock",
        {"fraction": fraction},
        {"range_scale.fraction": fraction},
        light=light,
        place=AT_RECEIVER + 1,
    )


@form("walk_error", "root")
def _walk_root(draw: Draw) -> Effect:
    slope = draw.sign() * draw.level(0.35, 1.2, 4.5)
    return _moved("walk_error", "root", {"slope_m": slope}, {}, lambda e, f: slope / np.sqrt(e.area))


@form("walk_error", "by_peak")
def _walk_peak(draw: Draw) -> Effect:
    slope = draw.sign() * draw.level(0.025, 0.08, 0.35)
    saturation = PEAK_SATURATION[draw.variant]
    return _moved("walk_error", "by_peak", {"slope_m": slope}, {}, lambda e, f: slope * (1.0 - e.peak / saturation))


@form("walk_error", "saturating")
def _walk_saturating(draw: Draw) -> Effect:
    most, scale = draw.sign() * draw.level(0.035, 0.12, 0.45), draw.between(200, 700)
    return _moved(
        "walk_error", "saturating", {"most_m": most, "area": scale}, {}, lambda e, f: most * np.exp(-e.area / scale)
    )


@form("walk_error", "decades")
def _walk_decades(draw: Draw) -> Effect:
    slope = draw.sign() * draw.level(0.02, 0.06, 0.22)
    comparable = {"walk_error.per_decade_m": slope}
    return _moved(
        "walk_error", "decades", {"per_decade_m": slope}, comparable, lambda e, f: slope * np.log10(e.area / 1000.0)
    )


@form("timing_jitter", "normal")
def _jitter_normal(draw: Draw) -> Effect:
    sigma = draw.level(0.13, 0.4, 1.2)
    comparable = {"timing_jitter.sigma_ns": sigma}
    return _moved(
        "timing_jitter", "normal", {"sigma_ns": sigma}, comparable,
        lambda e, f: LIGHT_M_NS / 2 * sigma * f.rng.standard_normal(len(e.beam)),
    )  # fmt: skip


@form("timing_jitter", "uniform")
def _jitter_uniform(draw: Draw) -> Effect:
    half = draw.level(0.22, 0.7, 2.0)
    comparable = {"timing_jitter.uniform_ns": half}
    return _moved(
        "timing_jitter", "uniform", {"half_width_ns": half}, comparable,
        lambda e, f: LIGHT_M_NS / 2 * half * f.rng.uniform(-1, 1, len(e.beam)),
    )  # fmt: skip


@form("timing_jitter", "laplace")
def _jitter_laplace(draw: Draw) -> Effect:
    scale = draw.level(0.1, 0.3, 0.9)
    return _moved(
        "timing_jitter", "laplace", {"scale_ns": scale}, {},
        lambda e, f: LIGHT_M_NS / 2 * scale * f.rng.laplace(size=len(e.beam)),
    )  # fmt: skip


@form("timing_jitter", "each_beam")
def _jitter_beam(draw: Draw) -> Effect:
    sigma = draw.level(0.13, 0.4, 1.2)
    return _moved(
        "timing_jitter", "each_beam", {"sigma_ns": sigma}, {},
        lambda e, f: LIGHT_M_NS / 2 * sigma * f.rng.standard_normal(len(f.beams))[e.beam],
    )  # fmt: skip


def _lost(
    kind: str, share: float, lost: Callable[[Frame], NDArray[np.bool_]], extra: dict[str, float] | None = None
) -> Effect:
    def readout(echoes: Echoes, frame: Frame) -> Echoes:
        return echoes.kept(~lost(frame)[echoes.beam])

    return Effect("dropout", kind, {"share": share, **(extra or {})}, {"dropout.share": share}, readout=readout)


@form("dropout", "beams")
def _drop_beams(draw: Draw) -> Effect:
    share = draw.level(0.008, 0.025, 0.08)
    return _lost("beams", share, lambda f: f.rng.random(len(f.beams)) < share)


@form("dropout", "packets")
def _drop_packets(draw: Draw) -> Effect:
    share, points, layers = draw.level(0.015, 0.04, 0.1), int(draw.rng.choice([4, 8])), int(draw.rng.choice([4, 8]))

    def lost(frame: Frame) -> NDArray[np.bool_]:
        packet = (frame.rng.random((960 // points + 1, 520 // layers + 1))) < share
        return packet[frame.beams.point // points, frame.beams.layer // layers]

    return _lost("packets", share, lost, {"points": float(points), "layers": float(layers)})


@form("dropout", "column_parts")
def _drop_columns(draw: Draw) -> Effect:
    share, layers = draw.level(0.015, 0.04, 0.1), 12

    def lost(frame: Frame) -> NDArray[np.bool_]:
        part = frame.rng.random((960, 520 // layers + 1)) < share
        return part[frame.beams.point, frame.beams.layer // layers]

    return _lost("column_parts", share, lost, {"layers": float(layers)})
