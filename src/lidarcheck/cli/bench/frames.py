"""The figures of whole frames: six effects at once, detectors followed one by one, rays cast into a scene."""

from __future__ import annotations

import numpy as np

from lidarcheck.cli.bench.kit import MEGA, Alternative, Figure, duration, rate, times
from lidarcheck.cli.bench.mixes import mixes, with_effects
from lidarcheck.cli.bench.scene import hills, lab_model, signs_frame
from lidarcheck.sensor import SpadArray

__all__ = ["effects_figures", "raycast_figures"]

TRIANGLES = 100_000


def effects_figures(variant: str, repeats: int, quick: bool) -> list[Figure]:
    """Seconds of a full frame with the mixes of `mixes.toml`, and with each effect for which every detector is followed
    on its own, beside the same frame without."""
    from lidarcheck.model import simulate

    frame = signs_frame()
    if quick:
        frame = frame.take(np.arange(0, len(frame), 10))
    plain = lab_model(variant)
    chosen = {**mixes("figures"), **{name: {name: {}} for name in _one_by_one()}}
    without = min(times(lambda: simulate(frame, plain, seed=1), repeats))
    figures = []
    for name, effects in chosen.items():
        model, _ = with_effects(plain, effects)
        seconds = times(lambda model=model: simulate(frame, model, seed=1), repeats)  # type: ignore[misc]
        against = Alternative("the same frame without", without, without / min(seconds))
        figures.append(duration(f"frame_{name}_{variant.lower()}_s", seconds, (against,)))
    return figures


def _one_by_one() -> list[str]:
    """The effects with which SPADs disturb each other, or themselves."""
    from lidarcheck.effects import catalogue
    from lidarcheck.effects.base import DetectorEffect

    typical = {name: effect() for name, effect in catalogue().items() if issubclass(effect, DetectorEffect)}
    return [
        name
        for name, effect in typical.items()
        if SpadArray.narrow(effect.detector(SpadArray.of("SMART"))).nonideal.any
    ]


def raycast_figures(repeats: int, quick: bool) -> list[Figure]:
    """Rays per second of a full frame into an ideal scan, beside trimesh with embree, which gives triangles alone."""
    from lidarcheck.scenes import Scene

    mesh, scene = hills(TRIANGLES)
    full = Scene((scene,))
    points = (0, 95) if quick else (0, 959)
    frame = full.ideal(points=points)
    seconds = times(lambda: full.ideal(points=points), repeats)
    best = len(frame) / MEGA / min(seconds)
    directions = np.random.default_rng(0).normal(size=(len(frame), 3))
    origins = np.zeros_like(directions)
    other = len(frame) / MEGA / min(times(lambda: mesh.ray.intersects_location(origins, directions, False), 1))
    against = (Alternative("trimesh with embree, locations alone", other, best / other),)
    return [rate("raycast_mrays_s", "Mrays/s", len(frame) / MEGA, seconds, against)]
