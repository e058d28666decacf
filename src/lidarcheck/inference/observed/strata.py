"""The covariates over which residuals are summed up: each a division of the beams into bins with names in words."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.inference.observed.beam_table import SIDES, BeamTable
from lidarcheck.inference.observed.echo_view import Slot

__all__ = ["OFFSET_EDGES", "RANGE_EDGES_M", "Division", "binned", "divisions", "fine_divisions", "range_bin"]


RANGE_EDGES_M = (0.0, 3.0, 6.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0, 130.0, 170.0, 230.0)
_INCIDENCE_EDGES_DEG = (0.0, 20.0, 40.0, 55.0, 65.0, 75.0, 80.0, 84.0, 86.0, 87.0, 88.0, 89.0)
OFFSET_EDGES = (1.0, 3.0, 6.0, 11.0, 21.0, 41.0, 81.0)
"""Bins of range, of the incidence, finest where it grazes, and of beams to a bright target, each twice the last."""
_STRIPS, _MAP = 12, 8
"""Strips of layers and of points, and those of either side of the map of the field of view."""
_FINE = 128
"""Up to so many fired layers each have a bin of their own."""
_AMPLITUDES = 10
"""Bins of amplitude with as many beams each."""


@dataclass(frozen=True)
class Division:
    """Beams divided by one covariate: `bin` (n,) from 0, -1 for beams that take no part, and a name for each bin."""

    covariate: str
    bin: IndexArray
    names: tuple[str, ...]


def divisions(beams: BeamTable, log_area: FloatArray, model_names: Mapping[int, str]) -> list[Division]:
    """The covariates for every feature; `log_area` (n,) is the model's mean ln AREA, NaN where it sees no echo."""
    hit = beams.distance_m > 0.0
    found = [
        Division("all", np.zeros(len(beams), dtype=np.int64), ("all beams",)),
        binned("range", np.where(hit, beams.distance_m, np.nan), _range_edges_m(beams), "m"),
        binned("incidence", np.where(hit, beams.incidence_deg, np.nan), _INCIDENCE_EDGES_DEG, "deg"),
        _materials(beams, model_names),
        _amplitudes(log_area, hit, beams.view.slots[0]),
        _strips("layer", beams.layer, _STRIPS),
        _strips("point", beams.point, _STRIPS),
        _numbers("frame", beams.frame),
        _edges(beams),
    ]
    for first, name in ((0, "layers to a bright target"), (2, "points to a bright target")):
        found.append(_to_bright(beams, first, name))
    return [division for division in found if division.names]


def _range_edges_m(beams: BeamTable) -> Sequence[float]:
    """Edges of range that suit the sensor: a chip that sees two metres has bins as well."""
    return [float(f"{edge * beams.view.length_scale:.3g}") for edge in RANGE_EDGES_M]


def fine_divisions(beams: BeamTable) -> list[Division]:
    """Every layer, and the field of view as a map: where a pattern in the sensor's own coordinates shows."""
    rows, columns = _strips("", beams.layer, _MAP), _strips("", beams.point, _MAP)
    names = tuple(f"layer {r}, point {c}" for r in rows.names for c in columns.names)
    found = [Division("field of view", rows.bin * len(columns.names) + columns.bin, names)]
    if len(np.unique(beams.layer)) <= _FINE:
        found.append(_numbers("each layer", beams.layer))
    return found


def binned(covariate: str, value: FloatArray, edges: Sequence[float], unit: str) -> Division:
    """Bins between ascending edges, the last open; NaN takes no part."""
    place = np.searchsorted(np.asarray(edges), value, side="right") - 1
    place = np.where(np.isnan(value), -1, place)
    ends = [*(f"{a:g}-{b:g} {unit}" for a, b in itertools.pairwise(edges)), f"over {edges[-1]:g} {unit}"]
    return _used(covariate, place, ends)


def range_bin(range_m: FloatArray) -> IndexArray:
    """The bin of each range between `RANGE_EDGES_M`, the last open; same shape."""
    return np.asarray(np.searchsorted(np.asarray(RANGE_EDGES_M), range_m, side="right") - 1)


def _used(covariate: str, place: IndexArray, names: Sequence[str]) -> Division:
    """Only the bins that have beams."""
    used = np.unique(place[place >= 0])
    number = np.full(len(names) + 1, -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    return Division(covariate, number[place], tuple(names[i] for i in used))


def _materials(beams: BeamTable, names: Mapping[int, str]) -> Division:
    ids = np.unique(beams.material_id[beams.material_id >= 0])
    place = np.searchsorted(ids, beams.material_id) if len(ids) else np.zeros(len(beams), dtype=np.int64)
    place = np.where(beams.material_id >= 0, place, -1)
    return Division("material", place, tuple(names.get(int(i)) or f"material {i}" for i in ids))


def _amplitudes(log_area: FloatArray, hit: npt.NDArray[np.bool_], slot: Slot) -> Division:
    known = ~np.isnan(log_area)
    if not known.any():
        return Division("amplitude", np.full(len(log_area), -1, dtype=np.int64), ())
    edges = np.unique(np.round(np.quantile(log_area[known], np.linspace(0.0, 1.0, _AMPLITUDES + 1)[:-1]), 2))
    edges = np.unique(np.concatenate([edges, np.log(slot.edges)]))
    place = np.searchsorted(edges, log_area, side="right") - 1
    place = np.where(known, np.maximum(place, 0), -1)
    used = np.unique(place[place >= 0])
    number = np.searchsorted(used, place)
    bins = np.where(known, number, np.where(hit, len(used), -1))
    values = np.exp(edges) if slot.log else edges
    texts = [f"{slot.name} from {values[i]:.1f}" for i in used] + ["seldom seen"]
    return _used("amplitude", bins, texts)


def _strips(covariate: str, line: IndexArray, count: int) -> Division:
    low, high = int(line.min()), int(line.max()) + 1
    edges = np.unique(np.linspace(low, high, min(count, high - low) + 1).astype(np.int64))
    place = np.searchsorted(edges, line, side="right") - 1
    return _used(covariate, place, [f"{a}-{b - 1}" for a, b in itertools.pairwise(edges)])


def _numbers(covariate: str, number: IndexArray) -> Division:
    values, place = np.unique(number, return_inverse=True)
    return Division(covariate, place, tuple(str(v) for v in values))


def _edges(beams: BeamTable) -> Division:
    """What stands beside a beam: the same surface, a nearer one, a farther one, or nothing at all."""
    hit = beams.distance_m > 0.0
    beside, own = beams.neighbour_m, beams.distance_m[:, None]
    step = beams.apart_m(own)
    nearer = ((beside > 0.0) & (beside < own - step)).any(axis=1)
    farther = (beside > own + step).any(axis=1)
    sky = (beside == 0.0).any(axis=1)
    place = np.select([~hit & (beside > 0.0).any(axis=1), ~hit, nearer, farther, sky], [4, 5, 1, 2, 3], 0)
    names = ("inside", "a nearer edge", "a farther edge", "the sky's edge", "beside a surface", "sky")
    return _used("edge", np.asarray(place, dtype=np.int64), names)


def _to_bright(beams: BeamTable, first: int, covariate: str) -> Division:
    """Offset to the nearer of the bright surfaces on two opposite sides, signed as the surface sees it."""
    ahead, behind = beams.bright[:, first], beams.bright[:, first + 1]
    use_ahead = (ahead > 0) & ((behind == 0) | (ahead <= behind))
    offset = np.where(use_ahead, ahead, behind).astype(np.float64)
    bins = np.searchsorted(np.asarray(OFFSET_EDGES), offset, side="right") - 1
    count = len(OFFSET_EDGES)
    place = np.where(offset == 0.0, -1, np.where(use_ahead, bins, count + bins))
    ends = [*(f"{a:g}-{b - 1:g}" for a, b in itertools.pairwise(OFFSET_EDGES)), f"over {OFFSET_EDGES[-1] - 1:g}"]
    texts = [f"{end}, target {side}" for side in (SIDES[first], SIDES[first + 1]) for end in ends]
    return _used(covariate, place, texts)
