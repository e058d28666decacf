"""A start for beams that lose their echoes in blocks, whose size is read off the data."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lidarcheck.explain.beams import key_of
from lidarcheck.explain.candidates import Probe, free_of
from lidarcheck.explain.lab import Lab

__all__ = ["loss_probes"]

_SURE = 0.9
"""Beams that the model detects so often, which is with every seed that it was asked, tell of losses."""
_FEWEST = 20
_MOST = 64
_SINGLE = 1.3
"""Smaller blocks than this are single beams."""


def loss_probes(lab: Lab) -> list[Probe]:
    """Dropout in blocks, where a lost beam's neighbours are lost more often than others."""
    beams, expected = lab.beams, lab.summaries.expected
    sure = expected.known & (expected.probability > _SURE)
    lost = sure & ~lab.measured_sights.detected
    if lost.sum() < _FEWEST:
        return []
    share = float(lost.sum() / sure.sum())
    sizes = []
    for layers, points in ((0, 1), (1, 0)):
        key = key_of(beams.frame, beams.layer + layers, beams.point + points)
        place = np.minimum(np.searchsorted(beams.key, key), len(beams) - 1)
        both = lost & (beams.key[place] == key) & sure[place]
        sizes.append(_size(lost[place[both]], share))
    if max(sizes) < _SINGLE:
        return []
    fixed = {"block_points": round(sizes[0]), "block_layers": round(sizes[1])}
    return [Probe("dropout", {"share": share}, free_of("dropout"), fixed, "blocks")]


def _size(beside_lost: npt.NDArray[np.bool_], share: float) -> float:
    """The length of blocks of which a part beside_lost.mean() of the next beams is lost too.

    Of a block of n, n - 1 have the next beam in the same block; the last one's is lost as often as any.
    """
    if not len(beside_lost):
        return 1.0
    same = float(np.clip((beside_lost.mean() - share) / (1.0 - share), 0.0, 1.0 - 1.0 / _MOST))
    return 1.0 / (1.0 - same)
