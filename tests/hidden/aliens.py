"""Effects that no catalogue has: what a workflow must call unknown."""

import math

import numpy as np

from .chain import Effect, Frame
from .forms import AT_RECEIVER, AT_SURFACE, AT_WINDOW, Draw, alien
from .sensor import PEAK_SATURATION, Echoes, Light


@alien("range_ripple")
def _ripple(draw: Draw) -> Effect:
    """A converter that is not linear: the range errs periodically with the range."""
    size, period, phase = draw.level(0.03, 0.06, 0.15), draw.between(6, 25), draw.between(0, 2 * math.pi)

    def readout(echoes: Echoes, frame: Frame) -> Echoes:
        echoes.range_m = echoes.range_m + size * np.sin(2 * math.pi * echoes.range_m / period + phase)
        return echoes

    return Effect("range_ripple", "sine", {"size_m": size, "period_m": period, "phase": phase}, readout=readout)


@alien("stuck_columns")
def _stuck(draw: Draw) -> Effect:
    """A stripe of point columns whose echoes all report one range."""
    first, columns, at = int(draw.rng.integers(432, 505)), round(draw.level(2, 4, 10)), draw.between(3, 60)

    def readout(echoes: Echoes, frame: Frame) -> Echoes:
        point = frame.beams.point[echoes.beam]
        stuck = (point >= first) & (point < first + columns)
        echoes.range_m = np.where(stuck, at, echoes.range_m)
        return echoes

    return Effect(
        "stuck_columns", "stripe", {"first": float(first), "columns": float(columns), "range_m": at}, readout=readout
    )


@alien("peak_compression")
def _compressed(draw: Draw) -> Effect:
    """A readout whose PEAK is not linear in the detectors that are ON."""
    power = 1.0 - draw.level(0.05, 0.12, 0.3)

    def readout(echoes: Echoes, frame: Frame) -> Echoes:
        top = PEAK_SATURATION[frame.variant]
        echoes.peak = np.minimum(np.maximum(np.round(top * (echoes.peak / top) ** power), 1.0), top)
        return echoes

    return Effect("peak_compression", "power", {"power": power}, readout=readout)


@alien("area_gain")
def _area(draw: Draw) -> Effect:
    """AREA reported with a factor, PEAK and WIDTH right."""
    factor = draw.factor(0.05, 0.12, 0.3)

    def readout(echoes: Echoes, frame: Frame) -> Echoes:
        echoes.area = np.maximum(np.round(echoes.area * factor), 1.0)
        return echoes

    return Effect("area_gain", "factor", {"factor": factor}, readout=readout)


@alien("width_clock")
def _width(draw: Draw) -> Effect:
    """WIDTH counted by a clock that runs fast."""
    factor = 1.0 + draw.level(0.1, 0.2, 0.45)

    def readout(echoes: Echoes, frame: Frame) -> Echoes:
        echoes.width_ns = np.maximum(np.floor(echoes.width_ns * factor + frame.rng.random(len(echoes.beam))), 1.0)
        return echoes

    return Effect("width_clock", "factor", {"factor": factor}, readout=readout)


@alien("gated_gain")
def _gated(draw: Draw) -> Effect:
    """A bias that ripples after the shot: sensitivity goes up and down with range."""
    depth, period, phase = draw.level(0.12, 0.3, 0.6), draw.between(25, 60), draw.between(0, 2 * math.pi)

    def light(light: Light, frame: Frame) -> None:
        light.signal = light.signal * (1.0 + depth * np.sin(2 * math.pi * light.range_m / period + phase))

    return Effect("gated_gain", "sine", {"depth": depth, "period_m": period}, light=light, place=AT_RECEIVER)


@alien("polarised_gain")
def _polarised(draw: Draw) -> Effect:
    """A gain that follows azimuth and incidence together, as of a polarised receiver."""
    depth = draw.level(0.3, 0.6, 0.88)

    def light(light: Light, frame: Frame) -> None:
        azimuth = np.deg2rad(frame.beams.azimuth_deg[light.beam] * 30.0)
        tilt = np.sin(np.deg2rad(light.incidence_deg))
        light.signal = light.signal * (1.0 + depth * tilt * np.sin(azimuth))

    return Effect("polarised_gain", "sine", {"depth": depth}, light=light, place=AT_SURFACE)


@alien("column_gain")
def _columns(draw: Draw) -> Effect:
    """The laser's power ripples from column to column within a frame."""
    depth, period = draw.level(0.08, 0.2, 0.45), draw.between(5, 20)

    def light(light: Light, frame: Frame) -> None:
        light.signal = light.signal * (1.0 + depth * np.sin(2 * math.pi * frame.beams.point[light.beam] / period))

    return Effect("column_gain", "sine", {"depth": depth, "period_points": period}, light=light, place=AT_WINDOW)


@alien("coarse_range")
def _coarse(draw: Draw) -> Effect:
    """Ranges rounded to coarse steps."""
    step = draw.level(0.3, 0.6, 1.5)

    def readout(echoes: Echoes, frame: Frame) -> Echoes:
        echoes.range_m = np.maximum(step * np.round(echoes.range_m / step), 0.01)
        return echoes

    return Effect("coarse_range", "round", {"step_m": step}, readout=readout)


@alien("layer_offset")
def _layer_offset(draw: Draw) -> Effect:
    """Every layer has a delay of its own."""
    spread = draw.level(0.02, 0.05, 0.15)
    delay = spread * draw.rng.standard_normal(520)

    def readout(echoes: Echoes, frame: Frame) -> Echoes:
        echoes.range_m = echoes.range_m + delay[frame.beams.layer[echoes.beam]]
        return echoes

    return Effect("layer_offset", "each_layer", {"spread_m": spread}, readout=readout)


@alien("amplitude_noise")
def _amplitude_noise(draw: Draw) -> Effect:
    """The laser's energy scatters from beam to beam."""
    spread = draw.level(0.15, 0.35, 0.7)

    def light(light: Light, frame: Frame) -> None:
        light.signal = light.signal * np.exp(spread * frame.rng.standard_normal(len(frame.beams)))[light.beam]

    return Effect("amplitude_noise", "log_normal", {"spread": spread}, light=light, place=AT_WINDOW)
