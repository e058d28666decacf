"""What a search must know of `blockage`: the patch of the window that is dimmed most, its borders line by line."""

from __future__ import annotations

import itertools

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.base import Effect, beams_in
from lidarcheck.effects.search.base import FreeParameter, Probe, SearchSpec
from lidarcheck.effects.search.evidence import BeamTable, Dimming, Evidence

Box = tuple[int, int, int, int]
"""First layer, the one behind the last, first point, the one behind the last."""

_FREE = (
    FreeParameter("transmission", 0.05),
    FreeParameter("soft_edge_deg", 0.3, log=True),
    FreeParameter("roundness", 0.3),
)
_LINES_A_STEP = 4.0
_STRIPS = 16
_ROUNDS = 4
_PARTS = 10
"""A border is looked for within such a part of the view to either side."""
_WHOLE = 0.9
"""A patch over this part of the points, and more, lies over the layers and not on the window."""


def _is_a_band(evidence: Evidence, effect: Effect) -> bool:
    """Whether it is a band over all points that were fired: dirt is local, layers go from side to side."""
    values, points = effect.settings(), np.unique(evidence.beams.point)
    inside = (points >= int(values["first_point"])) & (points <= int(values["last_point"]))
    return bool(inside.mean() >= _WHOLE)


def _starts(evidence: Evidence) -> list[Probe]:
    """The rectangle of the field of view that is dimmed most against the rest, sharp and soft."""
    dimming = evidence.dimming()
    rows, row = _strips(evidence.beams.layer)
    columns, column = _strips(evidence.beams.point)
    gain, weight = dimming.mean(row * (len(columns) - 1) + column, (len(rows) - 1) * (len(columns) - 1))
    shape = (len(rows) - 1, len(columns) - 1)
    dim = -np.clip(gain - np.average(gain, weights=weight + 1e-9), -2.0, 2.0)
    top, bottom, left, right = _best_rectangle((dim * weight).reshape(shape), weight.reshape(shape))
    box = _to_lines(
        evidence.beams, dimming, (int(rows[top]), int(rows[bottom]), int(columns[left]), int(columns[right]))
    )
    place = {
        "first_layer": box[0], "last_layer": box[1] - 1,
        "first_point": box[2], "last_point": box[3] - 1,
    }  # fmt: skip
    beams = evidence.beams
    inside = (beams.layer >= box[0]) & (beams.layer < box[1]) & (beams.point >= box[2]) & (beams.point < box[3])
    means, weights = dimming.mean(inside.astype(np.int64), 2)
    level = float(means[1] - (means[0] if weights[0] > 0.0 else 0.0))
    transmission = float(np.clip(np.exp(level), 0.02, 0.95))
    last = beams_in(evidence.sensor)
    free = (
        *_FREE,
        *(FreeParameter(name, _LINES_A_STEP, whole=True, most=last[name.split("_")[1]]) for name in place),
    )
    # Echoes that are lost say only that little comes through: half of it is a start, too.
    starts = [(t, place, 0.05, 0.0) for t in (transmission, 0.5 * transmission)]
    starts += [(transmission, place, soft, r) for soft, r in ((0.2, 0.2), (1.0, 0.8))]
    # The middle of the view as well: whether dirt would show there tells whether it is testable at all.
    starts.append((0.6, _middle_patch(rows, columns), 1.0, 0.8))
    return [
        Probe("blockage", {"transmission": t, "soft_edge_deg": soft, "roundness": r, **where}, free)
        for t, where, soft, r in starts
    ]


def _middle_patch(rows: IndexArray, columns: IndexArray) -> dict[str, int]:
    """The middle third of the field of view either way."""
    (low, high), (left, right) = (
        (int(edges[len(edges) // 3]), int(edges[-1 - len(edges) // 3])) for edges in (rows, columns)
    )
    return {"first_layer": low, "last_layer": max(high, low), "first_point": left, "last_point": max(right, left)}


def _strips(line: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Edges of about sixteen strips, and the strip of each beam."""
    low, high = int(line.min()), int(line.max()) + 1
    edges = np.unique(np.linspace(low, high, min(_STRIPS, high - low) + 1).astype(np.int64))
    return edges, np.searchsorted(edges, line, side="right") - 1


def _best_rectangle(total: FloatArray, weight: FloatArray) -> tuple[int, int, int, int]:
    sums, weights = (np.pad(x.cumsum(0).cumsum(1), ((1, 0), (1, 0))) for x in (total, weight))
    best, where = -np.inf, (0, 1, 0, 1)
    rows, columns = total.shape
    for top, bottom in itertools.combinations(range(rows + 1), 2):
        s, w = sums[bottom] - sums[top], weights[bottom] - weights[top]
        score = (s[None, :] - s[:, None]) / np.sqrt(np.maximum(w[None, :] - w[:, None], 1e-9))
        score = np.where(np.arange(columns + 1)[None, :] > np.arange(columns + 1)[:, None], score, -np.inf)
        left, right = np.unravel_index(int(np.argmax(score)), score.shape)
        if score[left, right] > best and (bottom - top) * (right - left) < 0.7 * rows * columns:
            best, where = float(score[left, right]), (top, bottom, int(left), int(right))
    return where


def _to_lines(beams: BeamTable, dimming: Dimming, start: Box) -> Box:
    """The rectangle near `start` that is dimmed most against the rest, its borders moved one after another."""
    layers, row = np.unique(beams.layer, return_inverse=True)
    points, column = np.unique(beams.point, return_inverse=True)
    group = row * len(points) + column
    mean, weight = dimming.mean(group, len(layers) * len(points))
    shape = len(layers), len(points)
    # Against the rest, and not against the mean of all, of which the patch is a part.
    rest = _outside(beams, start)
    base, _ = dimming.mean(np.where(rest, 0, -1), 1)
    total = _summed((np.clip(base[0] - mean, -2.0, 2.0) * weight).reshape(shape))
    weights = _summed(weight.reshape(shape))
    found = [
        int(np.searchsorted(lines, edge)) for lines, edge in zip((layers, layers, points, points), start, strict=True)
    ]
    for _ in range(_ROUNDS):
        before = list(found)
        for side in range(4):
            found[side] = _best_border(total, weights, found, side, shape)
        if found == before:
            break
    ends = np.append(layers, layers[-1] + 1), np.append(points, points[-1] + 1)
    return int(ends[0][found[0]]), int(ends[0][found[1]]), int(ends[1][found[2]]), int(ends[1][found[3]])


def _outside(beams: BeamTable, box: Box) -> BoolArray:
    layer, point = beams.layer, beams.point
    return np.asarray((layer < box[0]) | (layer >= box[1]) | (point < box[2]) | (point >= box[3]))


def _summed(cells: FloatArray) -> FloatArray:
    return np.asarray(np.pad(cells.cumsum(0).cumsum(1), ((1, 0), (1, 0))))


def _best_border(total: FloatArray, weights: FloatArray, box: list[int], side: int, shape: tuple[int, int]) -> int:
    """Where one border of the box lies best: half of what is dimmed counts against what is taken in undimmed."""
    lines = shape[side // 2]
    reach = max(lines // _PARTS, 2)
    low = box[side - 1] + 1 if side % 2 else 0
    high = lines if side % 2 else box[side + 1] - 1
    places = np.arange(max(low, box[side] - reach), min(high, box[side] + reach) + 1)
    if len(places) == 0:
        return box[side]
    own = _within(total, box) / max(_within(weights, box), 1e-9)
    scores = []
    for place in places:
        tried = [*box[:side], int(place), *box[side + 1 :]]
        scores.append(_within(total, tried) - 0.5 * own * _within(weights, tried))
    return int(places[int(np.argmax(scores))])


def _within(summed: FloatArray, box: list[int]) -> float:
    top, bottom, left, right = box
    return float(summed[bottom, right] - summed[top, right] - summed[bottom, left] + summed[top, left])


SPEC = SearchSpec(
    "blockage",
    free=_FREE,
    starts=_starts,
    order=3,
    factors=("transmission",),
    groups=frozenset({"light"}),
    confused_with={"layer_gain": "the same wall with the sensor turned by some degrees"},
    is_another=_is_a_band,
    form_errors={"transmission": 0.06},  # what a border is taken to be
    watched_by=("area_mean", "detection_probability", "area_point_spread", "area_layer_spread"),
    shown_by=("area", "map"),
)
