"""How far the other echoes of two samples are apart in AREA, PEAK and WIDTH, each kind and place for itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.inference.observed.beam_table import BeamTable
from lidarcheck.inference.observed.kernels import areas_between
from lidarcheck.inference.observed.kinds import CELLS, KINDS, cells_of, features_of, kind_of_cell
from lidarcheck.inference.observed.observations import Observations

__all__ = ["apart_by_kind", "named_by_kind", "unlike_echoes"]


def unlike_echoes(
    beams: BeamTable, one: Observations, others: Sequence[Observations], weights: Sequence[FloatArray]
) -> FloatArray:
    """How many echoes of one sample have their like in another's place, but not their like in strength, for several
    weights of the beams, shape (n_weights,).

    An echo that is x standard deviations off on the mean of its three features counts x / (1 + x): less than one that
    is not there at all, so that an effect of a wrong form is nearer than none.
    """
    found = []
    for count, apart in _cells(beams, one, others, weights):
        off = apart.mean(axis=1)
        found.append(float((count * off / (1.0 + off)).sum()))
    return np.array(found)


def apart_by_kind(beams: BeamTable, one: Observations, others: Sequence[Observations]) -> FloatArray:
    """The 1-Wasserstein distances of each of `KINDS` in the three features, in standard deviations of an echo, shape
    (n_kinds, 3): means over the echoes that have their like in the other sample's place, NaN where none has."""
    [(count, apart)] = _cells(beams, one, others, [np.ones(len(beams))])
    kind = kind_of_cell()
    number = np.bincount(kind, count, len(KINDS))
    total = np.column_stack([np.bincount(kind, count * column, len(KINDS)) for column in apart.T])
    return np.where(number[:, None] > 0.0, total / np.maximum(number, 1e-12)[:, None], np.nan)


def named_by_kind(
    before: FloatArray, after: FloatArray, floor: FloatArray
) -> dict[str, tuple[float | None, float | None, float | None]]:
    """The same before, after and of the floor, by "area of bloom" and so on; None where a sample lacks the kind.
    Without the kinds that no sample has."""
    found = {}
    for i, kind in enumerate(KINDS):
        for j, feature in enumerate(("area", "peak", "width")):
            values = [None if np.isnan(table[i, j]) else float(table[i, j]) for table in (before, after, floor)]
            if any(value is not None for value in values):
                found[f"{feature} of {kind}"] = (values[0], values[1], values[2])
    return found


def _cells(
    beams: BeamTable, one: Observations, others: Sequence[Observations], weights: Sequence[FloatArray]
) -> list[tuple[FloatArray, FloatArray]]:
    """Of each weight, how many echoes of a cell both samples have, shape (CELLS,), and their distances, (CELLS, 3)."""
    samples = (one, *others)
    cell = np.concatenate([cells_of(beams, s) for s in samples])
    beam = np.concatenate([s.extra_beam for s in samples])
    value = np.concatenate([features_of(s) for s in samples]) / np.array([slot.of_one for slot in beams.view.slots])
    first = np.arange(len(cell)) < len(one.extra_beam)
    order = np.argsort(value, axis=0, kind="stable")
    ascending = [(value[at, j], at, first[at]) for j, at in enumerate(order.T)]
    sides = [np.flatnonzero((cell >= 0) & side) for side in (first, ~first)]
    found, scratch = [], np.empty((5, CELLS))
    for weight in weights:
        each = weight[beam]
        mine, theirs = (np.bincount(cell[rows], each[rows], CELLS) for rows in sides)
        apart = np.empty((CELLS, value.shape[1]))
        for j, ordered in enumerate(ascending):
            areas_between(*ordered, cell, each, scratch)
            apart[:, j] = scratch[4]
        found.append((np.minimum(mine, theirs / len(others)), apart))
    return found
