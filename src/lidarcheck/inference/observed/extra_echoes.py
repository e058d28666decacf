"""The echoes of no surface of their own beam: where they lie, beside what, and how strong they are."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.inference.observed.beam_table import SIDES, BeamTable
from lidarcheck.inference.observed.kinds import BLOOM_CELLS, cells_of, features_of
from lidarcheck.inference.observed.observations import Observations
from lidarcheck.inference.observed.strata import OFFSET_EDGES, RANGE_EDGES_M, range_bin
from lidarcheck.inference.observed.summary import Summary

__all__ = ["FalseEchoes", "sides_of_surface"]


_STRAY = 0.15
"""The part of the beams along an edge that a usual error of the pose leads to the other side."""
_GAP_EDGES_M = (-1000.0, -50.0, -20.0, -10.0, -5.0, -2.0, 2.0, 4.0, 7.0, 12.0, 20.0, 50.0)
_RATIO_EDGES = (1.2, 1.5, 1.8, 1.95, 2.05, 2.15, 2.4, 3.0)
"""Bins of how far an echo lies behind its surface, and of its range over its surface's: a ghost lies at twice that."""


class FalseEchoes:
    """Where the other echoes lie: in range, behind their surface, at a neighbour's or a bright target's range; and how
    strong they are. `names`: of what `counts` counts."""

    def __init__(self, beams: BeamTable, base: Sequence[Observations]) -> None:
        """`base`: what the model shows, of which a usual echo's strength is taken where the sensor's laws tell none."""
        self.beams = beams
        self._strength = _usual_strength(beams, base)
        own, beside = beams.distance_m[:, None], beams.neighbour_m
        differs = (beside > 0.0) & (np.abs(own - beside) > 1.0 + 0.03 * np.maximum(own, beside))
        nearer = beside < own
        # Of each side and kind, by how many beams along such edges a usual error of the pose counts.
        edges = np.array([(differs & kind).sum(axis=0) for kind in (nearer, ~nearer)]).T
        self._usual = np.sqrt(1.0 + (_STRAY * edges) ** 2)
        self.names = _names()

    def counts(self, observations: Observations) -> FloatArray:
        """The numbers, those of a kind that edges make divided by how many these usually make, shape (n_names,)."""
        beams = self.beams
        lone = observations.extra_side < 0
        beam, range_m = observations.extra_beam[lone], observations.extra_m[lone]
        own = beams.distance_m[beam]
        times = range_m / np.maximum(own, 1e-9)
        retro, hit = beams.retro[beam], own > 0.0
        strong = (beams.signal[beam] >= 3.0) & ~retro
        parts = [
            _histogram(range_m, RANGE_EDGES_M),
            _histogram((range_m - own)[hit], _GAP_EDGES_M),
            _histogram(times[retro], _RATIO_EDGES),
            _histogram(times[strong], _RATIO_EDGES),
            self._beside(observations),
            *(self._at_bright(observations, side) for side in range(len(SIDES))),
            _strengths(range_m, observations.extra_area[lone], self._strength),
            _bloom_features(beams, observations, self._strength),
        ]
        return np.concatenate(parts)

    def _beside(self, observations: Observations) -> FloatArray:
        """Echoes at the range of what a neighbouring beam meets: besides the own surface's echo, or in its place.

        In its place they come from a pose that is off by a part of a beam, all along an edge at once: such counts are
        measured by the number of beams along such edges. In order of side, nearer or farther, besides or in its place.
        """
        found = observations.extra_side >= 0
        beam, side = observations.extra_beam[found], observations.extra_side[found]
        farther = observations.extra_m[found] >= self.beams.distance_m[beam]
        kind = (side * 2 + farther) * 2 + ~observations.detected[beam]
        counts = np.bincount(kind, minlength=4 * len(SIDES)).reshape(len(SIDES), 2, 2).astype(np.float64)
        counts[:, :, 1] /= self._usual
        return counts.ravel()

    def _at_bright(self, observations: Observations, side: int) -> FloatArray:
        """Echoes at the range of the next bright target along the column or the layer, by how far it lies."""
        beams, beam = self.beams, observations.extra_beam
        match = (beams.bright[beam, side] > 0) & (
            np.abs(observations.extra_m - beams.bright_m[beam, side]) < beams.view.match_m
        )
        match &= (observations.extra_side < 0) | observations.detected[beam]
        return _histogram(beams.bright[beam[match], side], OFFSET_EDGES)


def sides_of_surface(beams: BeamTable, beam: IndexArray, range_m: FloatArray) -> IndexArray:
    """Whether echoes of some beams lie in front of their surface (0), behind it (1), or there is none (2); (m,)."""
    distance = beams.distance_m[beam]
    return np.where(distance == 0.0, 2, np.where(range_m < distance, 0, 1))


def _histogram(value: npt.NDArray[Any], edges: Sequence[float]) -> FloatArray:
    """How many lie between ascending edges, the last bin open."""
    place = np.searchsorted(np.asarray(edges), value, side="right")
    return np.bincount(place, minlength=len(edges) + 1)[1:].astype(np.float64)


def _usual_strength(beams: BeamTable, base: Sequence[Observations]) -> FloatArray:
    """Mean and spread of the three features after the range of a usual echo, shape (2, 3)."""
    found = np.empty((2, 3))
    for j, slot in enumerate(beams.view.slots):
        if slot.others is not None:
            found[:, j] = slot.others
            continue
        values = np.concatenate(
            [one.feature[one.detected, 1 + j] for one in base] + [features_of(o)[:, j] for o in base]
        )
        found[:, j] = (values.mean(), max(float(values.std()), slot.of_one)) if len(values) else (0.0, slot.of_one)
    return found


def _strengths(range_m: FloatArray, log_area: FloatArray, usual: FloatArray) -> FloatArray:
    """How strong echoes are, over range; a mean that counts as much as the number behind it."""
    place = range_bin(range_m)
    n = len(RANGE_EDGES_M)
    standard = (log_area - usual[0, 0]) / usual[1, 0]
    count = np.bincount(place, minlength=n)
    return np.asarray(np.bincount(place, standard, n) / np.sqrt(np.maximum(count, 1)))


def _bloom_features(beams: BeamTable, observations: Observations, usual: FloatArray) -> FloatArray:
    """How strong, high and wide echoes at a bright target's range are, by its side and offset; means that count as much
    as the numbers behind them."""
    cell = cells_of(beams, observations)
    bloom = (cell >= 0) & (cell < BLOOM_CELLS)
    place = cell[bloom]
    count = np.sqrt(np.maximum(np.bincount(place, minlength=BLOOM_CELLS), 1))
    standard = (features_of(observations)[bloom] - usual[0]) / usual[1]
    return np.concatenate([np.bincount(place, column, BLOOM_CELLS) / count for column in standard.T])


def _names() -> list[Summary]:
    """The names of what `FalseEchoes.counts` counts."""
    others = "other echoes"
    found = _between(others, "range", RANGE_EDGES_M, "m")
    found += _between(others, "behind their surface", _GAP_EDGES_M, "m")
    found += _between(others, "over their retro-reflector's range", _RATIO_EDGES, "times")
    found += _between(others, "over their surface's range", _RATIO_EDGES, "times")
    kinds = itertools.product(SIDES, ("nearer", "farther"), ("besides its own", "for its own"))
    found += [Summary(others, "at a neighbour's range", ", ".join(kind)) for kind in kinds]
    for side in SIDES:
        found += _between(others, f"at a bright target's range {side}", OFFSET_EDGES, "beams off")
    found += _between("strength of other echoes", "range", RANGE_EDGES_M, "m")
    for feature in ("area", "peak", "width"):
        for side in SIDES:
            found += _between(f"{feature} of bloom", f"beams from a bright target {side}", OFFSET_EDGES, "beams off")
    return found


def _between(feature: str, covariate: str, edges: Sequence[float], unit: str) -> list[Summary]:
    """The names of the bins between ascending edges, the last open."""
    ends = [*edges[1:], np.inf]
    return [Summary(feature, covariate, f"{a:g}-{b:g} {unit}") for a, b in zip(edges, ends, strict=True)]
