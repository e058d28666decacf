"""Which frames show one scene, told by their ideal scans."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from lidarcheck.scan import IdealScan

__all__ = ["number_of_scenes", "same_scene"]

SAME_M, SAME_SHARE = 0.02, 0.99
"""Distances that are as good as equal, and the share of the beams that must have them."""


def same_scene(one: IdealScan, other: IdealScan) -> bool:
    """Whether two ideal scans are of one scene: the same beams, 99 % of which meet something at one distance."""
    if one is other:
        return True
    if len(one) != len(other) or not (
        np.array_equal(one.layer, other.layer) and np.array_equal(one.point, other.point)
    ):
        return False
    return bool(np.mean(np.abs(one.distance_m - other.distance_m) <= SAME_M) >= SAME_SHARE)


def number_of_scenes(ideals: Iterable[IdealScan]) -> int:
    """How many scenes the ideal scans are of."""
    known: list[IdealScan] = []
    for ideal in ideals:
        if not any(same_scene(ideal, other) for other in known):
            known.append(ideal)
    return len(known)
