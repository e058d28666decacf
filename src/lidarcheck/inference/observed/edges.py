"""Runs of beams that see past the edge of a surface together, since the scene is known to a part of a beam only.

Where the border of a panel lies between two columns of beams, an angle that is off by a hundredth of a degree decides
for a whole column what it meets. Beams are not independent there, and such a column is no sign of a missing effect.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import IndexArray
from lidarcheck.inference.observed.beam_table import BeamTable, key_of
from lidarcheck.inference.observed.observations import FEATURES, Observations

__all__ = ["EXTRA", "at_borders", "runs_along", "runs_past", "with_beams_of"]

Flags = npt.NDArray[np.bool_]

EXTRA = ("extra_beam", "extra_m", "extra_area", "extra_peak", "extra_width", "extra_side")
"""The columns of `Observations` that have a row an echo of no surface."""
_FEWEST, _LONG = 3, 5
_TOGETHER = 0.8
"""Of a run so large a part must see past the edge."""
_SEEN = 0.9
"""Only beams whose surface the model sees in so large a part of its simulations can be said to have missed it."""


def runs_past(
    beams: BeamTable, measured: Observations, simulated: Sequence[Observations], *, deep: bool = False
) -> list[IndexArray]:
    """The numbers of the beams of each run along the border of one object of which one side sees the object, the other
    what is beside it: together, and in all simulations.

    Runs are upright (along one point column) or level (along one layer). `deep`: not only the outermost beams but also
    those next to them, as where an effect moves the border by more than a beam.
    """
    past = _otherwise(beams, measured, simulated)
    # A beam that is not the outermost has no neighbour on what comes to stand before it.
    deeper = _otherwise(beams, measured, simulated, before=True) if deep else past
    surface = _surface(beams)
    found = []
    for side, at, group in _lines(beams):
        inside = _inside(beams, side, surface)
        found += _together(at, group, past, inside)
        if deep:
            at = np.setdiff1d(inside[at], [-1, *at])
            found += _together(at, group, deeper, inside)
    return _disjoint(found, len(beams))


def _otherwise(
    beams: BeamTable, measured: Observations, simulated: Sequence[Observations], *, before: bool = False
) -> Flags:
    """Beams that see past their surface where nearly all simulations do not, or the other way round."""
    often = np.mean([_past(beams, one, before=before) for one in simulated], axis=0)
    return np.asarray(np.where(_past(beams, measured, before=before), often < 1.0 - _SEEN, often > _SEEN))


def runs_along(beams: BeamTable) -> list[IndexArray]:
    """The numbers of the beams of each longer run along the border of one object, whatever they see.

    Along it, one part of a beam decides what all of them see: a footprint meets both sides of the edge, and how much of
    either the ideal scan does not say.
    """
    found = []
    for _, at, group in _lines(beams):
        runs = np.unique(group[:, at], axis=1, return_inverse=True)[1].ravel()
        order = np.argsort(runs, kind="stable")
        found += np.split(at[order], np.cumsum(np.bincount(runs))[:-1]) if len(at) else []
    return [run for run in _disjoint(found, len(beams)) if len(run) >= _LONG]


def at_borders(beams: BeamTable) -> Flags:
    """Beams next to which another surface is, nothing, or no beam; shape (n,)."""
    return np.asarray(_borders(beams).any(axis=1))


def _surface(beams: BeamTable) -> IndexArray:
    """The object that each beam meets, or what it is made of."""
    return np.where(beams.object_id >= 0, beams.object_id, beams.material_id)


def _lines(beams: BeamTable) -> Iterator[tuple[int, IndexArray, IndexArray]]:
    """For each side the beams that have a border there, and of each beam the frame, the column or layer that the border
    runs along, and the surface, shape (3, n)."""
    borders, surface = _borders(beams), _surface(beams)
    for line, sides in ((beams.point, (2, 3)), (beams.layer, (0, 1))):
        for side in sides:
            yield side, np.flatnonzero(borders[:, side]), np.stack([beams.frame, line, surface])


def _together(at: IndexArray, group: IndexArray, past: Flags, inside: IndexArray) -> list[IndexArray]:
    """The beams of each group among those `at` the border of which nearly all see past it, and those inside do not:
    what a whole surface suffers, as in fog, is not of its border."""
    runs = np.unique(group[:, at], axis=1, return_inverse=True)[1].ravel()
    count, missed = np.bincount(runs), np.bincount(runs, past[at])
    held, lost = np.bincount(runs, inside[at] >= 0), np.bincount(runs, (inside[at] >= 0) & past[inside[at]])
    whole = (missed >= _FEWEST) & (missed >= _TOGETHER * count) & (lost <= (1.0 - _TOGETHER) * held)
    return [at[(runs == run) & past[at]] for run in np.flatnonzero(whole)]


def _inside(beams: BeamTable, side: int, surface: IndexArray) -> IndexArray:
    """The beam of the same object beside each, away from the side; -1 where there is none."""
    up, left = ((-1, 0), (1, 0), (0, -1), (0, 1))[side]
    step = [np.min(np.diff(np.unique(line)), initial=1 << 20) for line in (beams.layer, beams.point)]
    key = key_of(beams.frame, beams.layer + up * step[0], beams.point + left * step[1])
    place = np.minimum(np.searchsorted(beams.key, key), len(beams) - 1)
    return np.where((beams.key[place] == key) & (surface[place] == surface), place, -1)


def with_beams_of(observations: Observations, other: Observations, rows: IndexArray) -> Observations:
    """The observations, of these beams as the other ones have them."""
    chosen = np.zeros(len(observations.detected), dtype=bool)
    chosen[rows] = True
    kept, taken = ~chosen[observations.extra_beam], chosen[other.extra_beam]
    extra = {name: np.concatenate([getattr(observations, name)[kept], getattr(other, name)[taken]]) for name in EXTRA}
    order = np.argsort(extra["extra_beam"], kind="stable")
    return dataclasses.replace(
        observations,
        detected=np.where(chosen, other.detected, observations.detected),
        feature=np.where(chosen[:, None], other.feature, observations.feature),
        strayed=np.where(chosen, other.strayed, observations.strayed),
        **{name: column[order] for name, column in extra.items()},
    )


def _past(beams: BeamTable, observations: Observations, *, before: bool = False) -> Flags:
    """Beams that show something beside their surface or behind it in its place, or nothing where nothing is beside
    it; or an echo that is taken for their surface's, but as far from it as another surface is. `before`: or anything
    before it."""
    other = np.zeros(len(beams), dtype=bool)
    beyond = (observations.extra_side >= 0) | (observations.extra_m > beams.distance_m[observations.extra_beam])
    other[observations.extra_beam[beyond | before]] = True
    nothing = (beams.neighbour_m == 0.0).any(axis=1)
    moved = observations.detected & (
        np.abs(observations.feature[:, FEATURES.index("range")]) > beams.apart_m(beams.distance_m)
    )
    return np.where(beams.distance_m > 0.0, (~observations.detected & (other | nothing)) | moved, other)


def _borders(beams: BeamTable) -> Flags:
    """Whether each side of a beam shows another surface, nothing, or was not fired at; shape (n, 4)."""
    own, beside = beams.distance_m[:, None], beams.neighbour_m
    apart = np.abs(beside - own) > beams.apart_m(own)
    return np.asarray(np.where(own > 0.0, apart, beside > 0.0))


def _disjoint(runs: Sequence[IndexArray], n: int) -> list[IndexArray]:
    """The runs, the longest first, each without the beams of those before it."""
    taken = np.zeros(n, dtype=bool)
    found = []
    for run in sorted(runs, key=len, reverse=True):
        own = run[~taken[run]]
        if len(own) >= _FEWEST:
            taken[own] = True
            found.append(own)
    return found
