"""Forms of weather and of foreign light: fog, rain, interference."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from . import kernel
from .chain import Effect, Frame
from .forms import IN_AIR, IN_OPTICS, Draw, form
from .sensor import ALL_SHOTS, FWHM_NS, LIGHT_M_NS, SHOTS, SIGNAL_AT_1M, Light

F = NDArray[np.float64]
AIR_STEP_M = 0.03
AIR_M = AIR_STEP_M * (np.arange(10000) + 0.5)


def _backscatter(alpha: F, beta: F, overlap: F) -> F:
    """Rate (bins,) that the air over AIR_M gives, from extinction and backscatter per metre."""
    way = np.exp(-2.0 * AIR_STEP_M * (np.cumsum(alpha) - alpha / 2))
    per_step = SIGNAL_AT_1M * math.pi * beta * way * overlap / AIR_M**2 * AIR_STEP_M
    bins = 2.0 * AIR_M / LIGHT_M_NS
    fine = np.histogram(bins, bins=np.arange(0, kernel.BINS, 0.2), weights=per_step)[0]
    offset = 0.2 * np.arange(-60, 61)
    pulse = np.exp(-0.5 * (offset / (FWHM_NS / 2.3548)) ** 2)
    smooth = np.convolve(fine, pulse / pulse.sum(), mode="same")
    rate = np.zeros(kernel.BINS)
    rate[: len(smooth) // 5] = smooth[: len(smooth) // 5 * 5].reshape(-1, 5).sum(axis=1)
    return rate


def _fog(
    kind: str, mor_m: float, density: Callable[[F, F, Frame], tuple[F, NDArray[np.int64]]], draw: Draw,
    parameters: dict[str, float], comparable: dict[str, float],
) -> Effect:  # fmt: skip
    """Fog that the receiver sees to the part 1 - exp(-((R - start) / scale)^2).

    `density` gives, over AIR_M, that of each of a few profiles (profiles, steps) and which one each beam has.
    """
    # Or laser and receiver stand apart, and the air close by is not seen.
    near = draw.rng.random() < 0.6
    start = draw.between(0.5, 2.0) if near else draw.between(3.0, 6.0)
    scale = draw.between(2.0, 5.0) if near else draw.between(5.0, 12.0)
    backscatter = draw.between(0.03, 0.06)
    overlap = np.where(start < AIR_M, 1.0 - np.exp(-(((AIR_M - start) / scale) ** 2)), 0.0)

    def light(light: Light, frame: Frame) -> None:
        dense, profile_of = density(frame.beams.azimuth_deg, frame.beams.elevation_deg, frame)
        alpha = math.log(20.0) / mor_m * dense
        depth = AIR_STEP_M * np.cumsum(alpha, axis=1)
        step = np.clip((light.range_m / AIR_STEP_M).astype(np.int64), 0, len(AIR_M) - 1)
        light.signal = light.signal * np.exp(-2.0 * depth[profile_of[light.beam], step])
        light.haze = np.stack(
            [_backscatter(a, backscatter / mor_m * d, overlap) for a, d in zip(alpha, dense, strict=True)]
        )
        light.haze_of, light.haze_gain = profile_of, np.ones(len(frame.beams))

    parameters = {
        "mor_m": mor_m,
        "backscatter": backscatter,
        "overlap_start_m": start,
        "overlap_scale_m": scale,
    } | parameters
    return Effect("fog", kind, parameters, comparable, light=light, place=IN_AIR)


def _mor(draw: Draw) -> float:
    return 1.0 / draw.level(1 / 2500, 1 / 700, 1 / 150)


@form("fog", "even")
def _even(draw: Draw) -> Effect:
    mor = _mor(draw)

    def density(azimuth: F, elevation: F, frame: Frame) -> tuple[F, NDArray[np.int64]]:
        return np.ones((1, len(AIR_M))), np.zeros(len(azimuth), np.int64)

    return _fog("even", mor, density, draw, {}, {"fog.mor_m": mor})


@form("fog", "layered")
def _layered(draw: Draw) -> Effect:
    height = draw.between(2.0, 5.0)

    def density(azimuth: F, elevation: F, frame: Frame) -> tuple[F, NDArray[np.int64]]:
        slopes = np.deg2rad(np.arange(-2.5, 2.51, 0.25))
        dense = np.exp(-np.maximum(AIR_M[None] * np.sin(slopes)[:, None] + 1.6, 0.0) / height) * math.exp(1.6 / height)
        return dense, np.clip(np.round((elevation + 2.5) / 0.25), 0, len(slopes) - 1).astype(np.int64)

    return _fog("layered", _mor(draw), density, draw, {"height_m": height}, {})


@form("fog", "patchy")
def _patchy(draw: Draw) -> Effect:
    contrast = draw.between(0.3, 0.7)

    def density(azimuth: F, elevation: F, frame: Frame) -> tuple[F, NDArray[np.int64]]:
        phase = frame.rng.uniform(0, 2 * math.pi, (2, 1))
        sector = np.linspace(-6.5, 6.5, 14)
        wave = np.sin(2 * math.pi * AIR_M[None] / 60 + phase[0]) + np.sin(2 * math.pi * sector[:, None] / 9 + phase[1])
        dense = np.maximum(1.0 + contrast / 2 * wave, 0.05)
        return dense, np.clip(np.round(azimuth + 6.5), 0, 13).astype(np.int64)

    return _fog("patchy", _mor(draw), density, draw, {"contrast": contrast}, {})


def _rained(light: Light, rate_mm_h: float, drops: tuple[NDArray[np.int64], F, F]) -> None:
    """Extinction, and drops (beam, range, signal) in front of what each beam meets."""
    alpha = 3.65e-4 * rate_mm_h**0.63
    light.signal = light.signal * np.exp(-2.0 * alpha * light.range_m)
    beam, range_m, signal = drops
    free = (light.surface_m[beam] <= 0) | (range_m < light.surface_m[beam])
    keep = free & (signal > 0.003)
    light.added(beam[keep], range_m[keep], signal[keep] * np.exp(-2.0 * alpha * range_m[keep]))


def _rain(
    kind: str, rate: float, drops: Callable[[Frame], tuple[NDArray[np.int64], F, F]], parameters: dict[str, float]
) -> Effect:
    def light(light: Light, frame: Frame) -> None:
        _rained(light, rate, drops(frame))

    return Effect("rain", kind, {"rate_mm_h": rate, **parameters}, {}, light=light, place=IN_AIR)


@form("rain", "few_bright")
def _few_bright(draw: Draw) -> Effect:
    rate, share, reach = draw.level(2, 8, 35), draw.level(0.005, 0.02, 0.08), draw.between(5, 10)

    def drops(frame: Frame) -> tuple[NDArray[np.int64], F, F]:
        beam = np.flatnonzero(frame.rng.random(len(frame.beams)) < share)
        range_m = 1.0 + frame.rng.exponential(reach, len(beam))
        return beam, range_m, 0.5 * frame.rng.exponential(size=len(beam)) * (6.0 / range_m)

    return _rain("few_bright", rate, drops, {"share": share, "reach_m": reach})


@form("rain", "drop_sizes")
def _drop_sizes(draw: Draw) -> Effect:
    rate, reflects, spread = draw.level(2, 8, 35), draw.level(0.3, 0.6, 1.2), 0.002
    number = draw.level(0.04, 0.1, 0.3)

    def drops(frame: Frame) -> tuple[NDArray[np.int64], F, F]:
        steep = 4.1 * rate**-0.21  # 1 / mm
        per_m3 = number * 8000.0 / steep * math.exp(-0.5 * steep)
        volume = math.pi / 4 * spread**2 * (40.0**3 - 1.0) / 3
        count = frame.rng.poisson(per_m3 * volume, len(frame.beams))
        beam = np.repeat(np.arange(len(frame.beams)), count)
        range_m = (1.0 + frame.rng.random(len(beam)) * (40.0**3 - 1.0)) ** (1 / 3)
        size_m = (0.5 + frame.rng.exponential(1 / steep, len(beam))) * 1e-3
        caught = np.minimum((size_m / (spread * range_m)) ** 2, 1.0)
        return beam, range_m, SIGNAL_AT_1M * reflects * caught / range_m**2

    return _rain("drop_sizes", rate, drops, {"reflects": reflects, "number": number})


@form("rain", "gamma_drops")
def _gamma_drops(draw: Draw) -> Effect:
    rate, mean = draw.level(2, 8, 35), draw.level(0.008, 0.03, 0.12)

    def drops(frame: Frame) -> tuple[NDArray[np.int64], F, F]:
        count = frame.rng.poisson(mean, len(frame.beams))
        beam = np.repeat(np.arange(len(frame.beams)), count)
        range_m = 1.0 + frame.rng.gamma(2.0, 6.0, len(beam))
        return beam, range_m, 0.35 * frame.rng.gamma(1.5, 1.0, len(beam)) * (8.0 / (2.0 + range_m)) ** 2

    return _rain("gamma_drops", rate, drops, {"drops_per_beam": mean})


def _foreign(
    kind: str,
    share: float,
    pulses: Callable[[Frame], tuple[NDArray[np.int64], F, F, NDArray[np.int64]]],
    comparable: dict[str, float],
) -> Effect:
    def light(light: Light, frame: Frame) -> None:
        beam, range_m, signal, mask = pulses(frame)
        light.added(beam, range_m, signal, mask=mask)

    return Effect("interference", kind, {"share": share}, comparable, light=light, place=IN_OPTICS + 1)


@form("interference", "anywhere")
def _anywhere(draw: Draw) -> Effect:
    share, typical = draw.level(0.004, 0.015, 0.07), draw.between(0.5, 1.5)

    def pulses(frame: Frame) -> tuple[NDArray[np.int64], F, F, NDArray[np.int64]]:
        beam = np.flatnonzero(frame.rng.random(len(frame.beams)) < share)
        signal = typical * frame.rng.gamma(2.0, 0.5, len(beam))
        return beam, frame.rng.uniform(0.5, 300.0, len(beam)), signal, np.full(len(beam), ALL_SHOTS, np.int64)

    return _foreign("anywhere", share, pulses, {"interference.share": share})


@form("interference", "one_shot")
def _one_shot(draw: Draw) -> Effect:
    share, typical = draw.level(0.006, 0.02, 0.08), draw.between(3.0, 6.0)

    def pulses(frame: Frame) -> tuple[NDArray[np.int64], F, F, NDArray[np.int64]]:
        beam = np.flatnonzero(frame.rng.random(len(frame.beams)) < share)
        mask = np.left_shift(1, frame.rng.integers(0, SHOTS, len(beam)))
        return beam, frame.rng.uniform(0.5, 300.0, len(beam)), np.full(len(beam), typical), mask.astype(np.int64)

    return _foreign("one_shot", share, pulses, {})


@form("interference", "stripes")
def _stripes(draw: Draw) -> Effect:
    share, typical, hit = draw.level(0.005, 0.02, 0.08), draw.between(0.8, 2.0), draw.level(0.15, 0.3, 0.6)

    def pulses(frame: Frame) -> tuple[NDArray[np.int64], F, F, NDArray[np.int64]]:
        points = frame.beams.point
        first, last = int(points.min()), int(points.max())
        struck = np.zeros(960, bool)
        width = 4
        for _ in range(max(1, round(share / hit * (last - first + 1) / width))):
            start = int(frame.rng.integers(first, max(last - width, first) + 1))
            struck[start : start + width] = True
        beam = np.flatnonzero(struck[points] & (frame.rng.random(len(points)) < hit))
        start_m = frame.rng.uniform(0.0, 250.0, 960)[points[beam]]
        range_m = (start_m + frame.rng.uniform(0, 6.0, len(beam))) % 300.0
        return beam, range_m, typical * frame.rng.gamma(3.0, 1 / 3, len(beam)), np.full(len(beam), ALL_SHOTS, np.int64)

    return _foreign("stripes", share, pulses, {})
