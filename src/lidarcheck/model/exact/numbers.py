"""The sensor's numbers as kernels see them."""

from __future__ import annotations

from typing import NamedTuple

from lidarcheck.sensor import SpadArray

__all__ = ["Numbers", "numbers_of"]


class Numbers(NamedTuple):
    """The sensor as a kernel sees it; times in bins, `pad` bins of history before bin 0."""

    detectors: int
    on: int
    dead: int
    threshold: int
    bins: int
    pad: int
    sigma: float
    max_echoes: int


def numbers_of(sensor: SpadArray) -> Numbers:
    """The sensor as kernels see it."""
    return Numbers(
        detectors=sensor.detectors,
        on=sensor.on_bins,
        dead=sensor.dead_bins,
        threshold=sensor.threshold,
        bins=sensor.bins,
        pad=sensor.dead_bins + 2 * sensor.on_bins + 2,
        sigma=sensor.sigma_ns / sensor.bin_ns,
        max_echoes=sensor.max_echoes,
    )
