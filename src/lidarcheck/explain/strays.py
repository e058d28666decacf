"""The echoes of no surface of their own beam: where they lie, beside what, and how strong they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lidarcheck.explain.beams import SIDES, Beams
from lidarcheck.explain.covariates import RANGE_EDGES_M
from lidarcheck.explain.sights import Sights
from lidarcheck.explain.summary import Summary

__all__ = ["stray_summaries"]

FloatArray = npt.NDArray[np.float64]

_STRAY = 0.15
"""The part of the beams along an edge that a usual error of the pose leads to the other side."""
_GAP_EDGES_M = (-1000.0, -50.0, -20.0, -10.0, -5.0, -2.0, 2.0, 4.0, 7.0, 12.0, 20.0, 50.0)
_RATIO_EDGES = (1.2, 1.5, 1.8, 1.95, 2.05, 2.15, 2.4, 3.0)
_MATCH_OFFSETS = (1.0, 3.0, 6.0, 11.0, 21.0, 41.0, 81.0)


def stray_summaries(beams: Beams, sights: Sights) -> tuple[FloatArray, list[Summary]]:
    """Where the other echoes lie: in range, behind their surface, at a neighbour's or a bright target's range."""
    lone = sights.extra_side < 0
    beam, range_m = sights.extra_beam[lone], sights.extra_m[lone]
    own = beams.distance_m[beam]
    gap = np.where(own > 0.0, range_m - own, np.nan)
    retro = np.where(beams.retro[beam], range_m / np.maximum(own, 1e-9), np.nan)
    strong = (beams.signal[beam] >= 3.0) & ~beams.retro[beam]
    ratio = np.where(strong, range_m / np.maximum(own, 1e-9), np.nan)
    parts = [
        _histogram("range", range_m, RANGE_EDGES_M, "m"),
        _histogram("behind their surface", gap, _GAP_EDGES_M, "m"),
        _histogram("over their retro-reflector's range", retro, _RATIO_EDGES, "times"),
        _histogram("over their surface's range", ratio, _RATIO_EDGES, "times"),
        _beside(beams, sights),
        *(_at_bright(beams, sights, side) for side in range(4)),
        _strengths(sights),
    ]
    return np.concatenate([p[0] for p in parts]), [name for p in parts for name in p[1]]


def _histogram(
    covariate: str, value: FloatArray, edges: Sequence[float], unit: str
) -> tuple[FloatArray, list[Summary]]:
    place = np.searchsorted(np.asarray(edges), value[~np.isnan(value)], side="right") - 1
    counts = np.bincount(place[place >= 0], minlength=len(edges)).astype(np.float64)
    ends = [*edges[1:], np.inf]
    names = [f"{a:g}-{b:g} {unit}" for a, b in zip(edges, ends, strict=True)]
    return counts, [Summary("other echoes", covariate, name) for name in names]


def _beside(beams: Beams, sights: Sights) -> tuple[FloatArray, list[Summary]]:
    """Echoes at the range of what a neighbouring beam meets: besides the own surface's echo, or in its place.

    In its place they come from a pose that is off by a part of a beam, all along an edge at once: such counts are
    measured by the number of beams along such edges.
    """
    found = sights.extra_side >= 0
    beam, side = sights.extra_beam[found], sights.extra_side[found]
    lost = ~sights.detected[beam]
    nearer = sights.extra_m[found] < beams.distance_m[beam]
    own, beside = beams.distance_m[:, None], beams.neighbour_m
    differs = (beside > 0.0) & (np.abs(own - beside) > 1.0 + 0.03 * np.maximum(own, beside))
    counts, names = [], []
    for i, name in enumerate(SIDES):
        for where, text in ((nearer, "nearer"), (~nearer, "farther")):
            mine = where & (side == i)
            counts.append(float((mine & ~lost).sum()))
            names.append(Summary("other echoes", "at a neighbour's range", f"{name}, {text}, besides its own"))
            edge = differs[:, i] & ((beside[:, i] < beams.distance_m) == (text == "nearer"))
            counts.append(float((mine & lost).sum()) / np.sqrt(1.0 + (_STRAY * edge.sum()) ** 2))
            names.append(Summary("other echoes", "at a neighbour's range", f"{name}, {text}, for its own"))
    return np.array(counts), names


def _at_bright(beams: Beams, sights: Sights, side: int) -> tuple[FloatArray, list[Summary]]:
    """Echoes at the range of the next bright target along the column or the layer, by how far it lies."""
    beam = sights.extra_beam
    match = (beams.bright[beam, side] > 0) & (np.abs(sights.extra_m - beams.bright_m[beam, side]) < 2.5)
    match &= (sights.extra_side < 0) | sights.detected[beam]
    offset = np.where(match, beams.bright[beam, side], np.nan)
    return _histogram(f"at a bright target's range {SIDES[side]}", offset, _MATCH_OFFSETS, "beams off")


def _strengths(sights: Sights) -> tuple[FloatArray, list[Summary]]:
    """How strong the other echoes are, over range; a mean that counts as much as the number behind it."""
    lone = sights.extra_side < 0
    place = np.searchsorted(np.asarray(RANGE_EDGES_M), sights.extra_m[lone], side="right") - 1
    n = len(RANGE_EDGES_M)
    count = np.bincount(place, minlength=n)
    z = np.bincount(place, (sights.extra_area[lone] - 4.8) / 0.6, n) / np.sqrt(np.maximum(count, 1))
    return z, [Summary("strength of other echoes", "range", _range_name(i)) for i in range(n)]


def _range_name(i: int) -> str:
    """The name of a range bin."""
    ends = (*RANGE_EDGES_M[1:], np.inf)
    return f"{RANGE_EDGES_M[i]:g}-{ends[i]:g} m"
