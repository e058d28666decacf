"""What would make points and beams agree: the smallest set of changes that brings 99 % of them together.

Tried in order: axes mirrored or exchanged, beams numbered otherwise, keys of the sensor's file that are one of two,
angles in the wrong unit; a turn, a shift or a scale; two of the first kind; such a key and a turn; constants of each
layer, alone and after one change; a rigid pose; last one that changes over the sweep.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import BoolArray
from lidarcheck.formats.geometry.changes import (
    Change,
    Echoes,
    angle_units,
    axis_orders,
    one_number,
    per_layer,
    poses,
    renumbered,
)
from lidarcheck.formats.geometry.check import FEWEST_JUDGED, PASSED, angle_errors, outside
from lidarcheck.formats.geometry.sensor_changes import deskewed, fitted_changes, sensor_changes
from lidarcheck.formats.geometry.sensor_lattice import HeadLattice

__all__ = ["MOST_ROWS", "Mismatch", "search"]

MOST_ROWS = 10_000
"""Rows that the search looks at."""
_SCREENED, _SCREEN_PASS = 500, 0.95
"""Rows that a pair of changes is tried on before all are, and the share of them that must pass."""
_WORTH = 0.2
"""A change that does not make all fit is still named where it makes so many more fit."""


@dataclass(frozen=True)
class Mismatch:
    """What the search found: the sets of changes that fit, equally small, the best-known first.

    `share_before`, `share`: of the judged rows within tolerance, as they are and with the first set. `before`, `after`:
    median and 99 % of the angle [deg] between points and beams. Without a set `share` is the best of all changes,
    `nearest`.
    """

    sets: tuple[tuple[Change, ...], ...]
    share_before: float
    share: float
    before: tuple[float, float]
    after: tuple[float, float]
    nearest: str = ""


def search(echoes: Echoes) -> Mismatch:
    """The smallest sets of changes with which the echoes lie where their beams point."""
    echoes = echoes.thinned(MOST_ROWS)
    share_before, before = _share(echoes), _residuals(echoes)
    best, nearest = share_before + _WORTH, ""
    for stage in _stages(echoes):
        shares = [(_share(_changed(echoes, changes)), changes) for changes in stage]
        fitting = [(share, changes) for share, changes in shares if share >= PASSED]
        if fitting:
            after = _residuals(_changed(echoes, fitting[0][1]))
            sets = tuple(changes for _, changes in fitting)
            return Mismatch(sets, share_before, fitting[0][0], before, after)
        for share, changes in shares:
            if share > best:
                best, nearest = share, " and ".join(change.said for change in changes)
    return Mismatch((), share_before, best if nearest else share_before, before, before, nearest)


def _stages(echoes: Echoes) -> Iterator[Iterator[tuple[Change, ...]]]:
    axes, numbers, own = axis_orders(echoes.lattice), renumbered(echoes.lattice), sensor_changes(echoes.lattice)
    yield ((change,) for change in [*axes, *numbers, *own, *angle_units()])
    yield ((change,) for change in [*one_number(echoes), *fitted_changes(echoes)])
    yield _pairs(echoes, axes, [*numbers, *own])
    yield _with_a_turn(echoes, own)
    yield ((change,) for change in per_layer(echoes))
    yield _of_another_unit(echoes, [*axes[:1], *numbers[:1], *own])
    yield ((change,) for change in poses(echoes))
    yield ((change,) for change in deskewed(echoes))


def _with_a_turn(echoes: Echoes, own: list[Change]) -> Iterator[tuple[Change, ...]]:
    """What the sensor's file may have otherwise, and then one number."""
    for change in own:
        for fitted in [*one_number(change.apply(echoes))][:3]:
            yield change, fitted


def _of_another_unit(echoes: Echoes, first: list[Change]) -> Iterator[tuple[Change, ...]]:
    """A change of a sensor's file or a turn, and then each layer's own constants."""
    if isinstance(echoes.lattice, HeadLattice):
        for change in [*first, next(one_number(echoes))]:
            for constants in per_layer(change.apply(echoes)):
                yield change, constants


def _pairs(echoes: Echoes, axes: list[Change], numbers: list[Change]) -> Iterator[tuple[Change, ...]]:
    some = echoes.thinned(_SCREENED)
    for pair in [*itertools.product(axes, numbers), *itertools.combinations(numbers, 2)]:
        if _share(_changed(some, pair)) >= _SCREEN_PASS:
            yield pair


def _changed(echoes: Echoes, changes: tuple[Change, ...]) -> Echoes:
    for change in changes:
        echoes = change.apply(echoes)
    return echoes


def _share(echoes: Echoes) -> float:
    """How many of the rows that can be judged pass; of all rows, where hardly any can be judged."""
    wide, clear = outside(*echoes.placed(), echoes.error_m)
    enough = np.count_nonzero(clear) >= min(FEWEST_JUDGED, max(len(wide) // 2, 1))
    use: BoolArray = clear if enough else np.ones_like(clear)
    return float(np.mean(~wide[use])) if use.any() else 0.0


def _residuals(echoes: Echoes) -> tuple[float, float]:
    relative, beams = echoes.placed()
    off = np.hypot(*angle_errors(relative, beams.direction))
    return float(np.median(off)), float(np.quantile(off, PASSED))
