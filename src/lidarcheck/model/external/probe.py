"""A small ideal scan on which a program is tried: rows of every decade of range and of every material."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.shared.reflectance import with_reflectance
from lidarcheck.model.external.exchange import Request
from lidarcheck.model.external.handed import BACKGROUND
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Program

__all__ = ["TRIALS", "echoes_as_rows", "probe_request", "probe_scan"]

_IN_DECADE = (1.5, 5.0)
"""Ranges of each decade."""
_BEAMS = 6
"""Beams of each range and material."""
_APART_M = 3.0
_SEED, _OTHER_SEED = 11, 12

TRIALS: Mapping[str, tuple[tuple[str, float], tuple[str, float]]] = {
    "down": (("share", 1.0), ("share", 0.25)),
    "up": (("share", 1.0), ("share", 4.0)),
    "Parts": (("parts", 0.5), ("parts", 0.9)),
    "Reflectance": (("reflectance", 0.1), ("reflectance", 0.8)),
    "Background": (("background", 1.0), ("background", 4.0)),
    "Time": (("time", 1.0), ("time", 4.0)),
    "Frame": (("frame", 0.0), ("frame", 1.0)),
    "Seed": (("seed", _SEED), ("seed", _OTHER_SEED)),
}
"""What is tried, by its word: two values of one thing, which the echoes must tell apart."""


def probe_scan(program: Program) -> IdealScan:
    """Beams, each with one surface: every known material at two ranges of each decade within the gate."""
    low, high = max(program.min_range_m, 0.5) * 1.2, 0.8 * program.max_range_m
    decades = 10.0 ** np.arange(-1, 4)
    ranges = np.array([at * decade for decade in decades for at in _IN_DECADE if low <= at * decade <= high])
    ranges = ranges if len(ranges) else np.array([0.5 * (program.min_range_m + program.max_range_m)])
    material = np.repeat(np.array(sorted(program.known), dtype=np.int64), len(ranges) * _BEAMS)
    range_m = np.tile(np.repeat(ranges, _BEAMS), len(program.known))
    beams = program.beams
    count = min(len(range_m), beams.layers * beams.points)
    place = np.linspace(0, beams.layers * beams.points - 1, count).astype(np.int64)
    return IdealScan(
        layer=(place // beams.points).astype(np.int32),
        point=(place % beams.points).astype(np.int32),
        distance_m=range_m[:count],
        material_id=material[:count].astype(np.int32),
        incidence_deg=np.linspace(0.0, 40.0, count),
        beams=beams,
    )


def probe_request(ideal: IdealScan, what: str, value: float, settings: Mapping[str, float]) -> Request:
    """The request of one trial."""
    n = len(ideal)
    if what == "share":
        return Request(replace(ideal, share=np.full(n, value)), _SEED, 0, settings, ("Share",))
    if what == "parts":
        return Request(_of_two_rows(ideal, value), _SEED, 0, settings, ("Share",))
    if what == "reflectance":
        return Request(with_reflectance(ideal, np.full(n, value)), _SEED, 0, settings, ("Reflectance",))
    if what == "background":
        return Request(replace(ideal, extra={BACKGROUND: np.full(n, value)}), _SEED, 0, settings, (BACKGROUND,))
    if what == "time":
        return Request(replace(ideal, time_s=np.full(n, value)), _SEED, 0, settings, ("Time",))
    if what == "frame":
        return Request(ideal, _SEED, int(value), settings)
    return Request(ideal, int(value), 0, settings)


def _of_two_rows(ideal: IdealScan, first: float) -> IdealScan:
    """Each beam's light on two surfaces, the nearer of which has that part of it."""
    n = len(ideal)
    both = ideal.take(np.repeat(np.arange(n), 2))
    behind = np.tile([0.0, _APART_M], n)
    return replace(both, distance_m=both.distance_m + behind, share=np.tile([first, 1.0 - first], n))


def echoes_as_rows(scan: Scan) -> FloatArray:
    """The echoes as numbers, sorted: two scans are the same where these are, in whatever order they were written."""
    columns = [scan.layer, scan.point, scan.x_m, scan.y_m, scan.z_m]
    columns += [scan.feature(name) for name in scan.feature_names]
    rows = np.column_stack([np.asarray(column, dtype=np.float64) for column in columns])
    return np.asarray(rows[np.lexsort(rows.T[::-1])])
