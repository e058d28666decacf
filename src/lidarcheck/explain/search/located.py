"""Starts that need a look at the data: which layers, which patch of the window, which material, which frequency."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.base import make
from lidarcheck.explain.search.located_losses import loss_probes
from lidarcheck.explain.search.located_patch import to_lines
from lidarcheck.explain.search.located_ranges import range_probes
from lidarcheck.explain.search.located_rhythms import rhythm_probes
from lidarcheck.explain.search.starts import FreeParameter, Probe, free_of
from lidarcheck.inference.dimming import Dimming
from lidarcheck.inference.nuisances import beside
from lidarcheck.inference.simulator import Simulator

__all__ = ["Dimming", "dimming_of", "gains_of_layers", "located_probes"]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]

_LOST = -1.0
"""ln gain that a surely expected but missing echo stands for."""
_BLOCKS = 16
_PERIODS = (2, 3, 4, 5, 6, 8)


def located_probes(simulator: Simulator, names: Iterable[str]) -> list[Probe]:
    """The starts for effects that have a place: layers, a patch, a material, a rhythm."""
    wanted = set(names)
    expected = simulator.summaries.expected
    dimming = dimming_of(simulator, expected.mean[:, 1], expected.known)
    found: list[Probe] = []
    if "material_reflectance" in wanted:
        found += _materials(simulator, dimming)
    if "layer_gain" in wanted:
        found += _layers(simulator, dimming)
    if "blockage" in wanted:
        found += _patches(simulator, dimming)
    if "vibration" in wanted:
        found += rhythm_probes(simulator)
    if "dropout" in wanted:
        found += loss_probes(simulator)
    found += range_probes(simulator, wanted)
    if "motion" in wanted:
        found += _movers(simulator)
    if "mirror_multipath" in wanted:
        found += _mirrors(simulator)
    return found


def dimming_of(simulator: Simulator, log_area: FloatArray, known: npt.NDArray[np.bool_]) -> Dimming:
    """The gain that each beam asks for, against a model's mean ln AREA where that is known, shapes (n,).

    From ln AREA, by its slope over ln S at that amplitude, as the case's model itself shows with more light.
    """
    expected = simulator.summaries.expected
    brighter = simulator.observations(beside(simulator.model, make("signal_gain", {"gain": 1.25})), 0)
    seen = expected.known & brighter.detected
    change = np.where(seen, brighter.feature[:, 1] - expected.mean[:, 1], 0.0) / np.log(1.25)
    slope = _by_amplitude(simulator, change, seen)
    measured = simulator.measured_sights
    valid = measured.detected & known & expected.known & (slope > 0.1)
    spread = np.maximum(expected.spread[:, 1], 1e-3)
    gain = np.where(valid, (measured.feature[:, 1] - log_area) / np.maximum(slope, 0.1), 0.0)
    weight = np.where(valid, (slope / spread) ** 2, 0.0)
    lost = ~measured.detected & known & expected.known & (expected.probability > 0.8)
    typical = float(np.median(weight[valid])) if valid.any() else 1.0
    return Dimming(
        np.where(lost, _LOST, np.clip(gain, -2.0, 2.0)), np.where(lost, typical, np.minimum(weight, 4.0 * typical))
    )


def _by_amplitude(simulator: Simulator, value: FloatArray, seen: npt.NDArray[np.bool_]) -> FloatArray:
    """The mean of beams alike in amplitude, for every beam."""
    amplitude = simulator.summaries.expected.mean[:, 1]
    edges = np.quantile(amplitude[seen], np.linspace(0.0, 1.0, 25)[1:-1]) if seen.any() else np.zeros(0)
    place = np.searchsorted(edges, amplitude)
    count = np.bincount(place[seen], minlength=len(edges) + 1)
    total = np.bincount(place[seen], value[seen], len(edges) + 1)
    return (total / np.maximum(count, 1))[place]


def _materials(simulator: Simulator, dimming: Dimming) -> list[Probe]:
    ids, place = np.unique(simulator.beams.material_id, return_inverse=True)
    gain, _ = dimming.mean(np.where(simulator.beams.material_id >= 0, place, -1), len(ids))
    free = free_of("material_reflectance")
    found = []
    for material, g in zip(ids, gain, strict=True):
        if material < 0:
            continue
        factor = float(np.exp(g)) if abs(g) > 0.05 else 1.3
        found.append(Probe("material_reflectance", {"factor": factor}, free, {"material_id": int(material)}))
    return found


def _layers(simulator: Simulator, dimming: Dimming) -> list[Probe]:
    """A band, every k-th layer of the whole view or of a band, by the largest contrast with the other layers."""
    layers, place = np.unique(simulator.beams.layer, return_inverse=True)
    if len(layers) < 4:
        return []
    gain, weight = dimming.mean(place, len(layers))
    mean = float(np.average(gain, weights=weight + 1e-9))
    gain = gain - mean
    free = free_of("layer_gain")
    found = []
    for sign in (1.0, -1.0):
        first, last = _best_run(sign * gain * weight, weight)
        inside = slice(first, last + 1)
        outside = np.ones(len(layers), dtype=bool)
        outside[inside] = False
        rest = np.average(gain[outside], weights=weight[outside] + 1e-9) if outside.any() else 0.0
        level = float(np.exp(np.average(gain[inside], weights=weight[inside] + 1e-9) - rest))
        band = {"first_layer": int(layers[first]), "last_layer": int(layers[last]), "every": 1}
        found.append(Probe("layer_gain", {"gain": level}, free, band))
    third = max(len(layers) // 3, 1)
    middle = {"first_layer": int(layers[third]), "last_layer": int(layers[-third]), "every": 1}
    found.append(Probe("layer_gain", {"gain": 0.85}, free, middle))
    found += [_comb(layers, gain, weight), _each_layer(layers, gain, weight, mean)]
    return found


def _each_layer(layers: IndexArray, gain: FloatArray, weight: FloatArray, mean: float) -> Probe:
    """A gain of its own for every layer, nearer to that of all where little is known of it."""
    gains = np.round(gains_of_layers(layers, gain, weight), 3)
    place = {"first_layer": int(layers[0]), "last_layer": int(layers[-1]), "every": 1}
    settings = {"gain": float(np.exp(np.clip(mean, -3.0, 2.0))), "gains": tuple(gains.tolist())}
    return Probe("layer_gain", settings, free_of("layer_gain"), place, "pattern")


def gains_of_layers(layers: IndexArray, log_gain: FloatArray, weight: FloatArray) -> FloatArray:
    """The gain of each layer from the first to the last of `layers`, ascending, by their ln gains, shape (n,); nearer
    to 1 where little is known of it; shape (last - first + 1,)."""
    scatter = max(float(np.average(log_gain**2, weights=weight + 1e-9)), 1e-6)
    shrunk = log_gain * weight / (weight + 1.0 / scatter)
    span = np.arange(layers[0], layers[-1] + 1)
    return np.asarray(np.exp(np.clip(np.interp(span, layers, shrunk), -3.0, 2.0)))


def _best_run(total: FloatArray, weight: FloatArray) -> tuple[int, int]:
    """First and last of the run whose mean stands out most: largest sum over the root of its weight."""
    sums, weights = np.concatenate([[0.0], np.cumsum(total)]), np.concatenate([[0.0], np.cumsum(weight)])
    score = (sums[None, :] - sums[:, None]) / np.sqrt(np.maximum(weights[None, :] - weights[:, None], 1e-9))
    n = len(total)
    length = np.arange(n + 1)[None, :] - np.arange(n + 1)[:, None]
    score = np.where((length > 0) & (length <= 0.8 * n), score, -np.inf)
    first, after = np.unravel_index(int(np.argmax(score)), score.shape)
    return int(first), int(after) - 1


def _comb(layers: IndexArray, gain: FloatArray, weight: FloatArray) -> Probe:
    best = (-1.0, 2, 0, 0.8)
    for period in _PERIODS:
        for phase in range(period):
            mine = (layers % period) == phase
            if not mine.any() or mine.all():
                continue
            a, b = (np.average(gain[m], weights=weight[m] + 1e-9) for m in (mine, ~mine))
            noise = np.sqrt(1.0 / max(weight[mine].sum(), 1e-9) + 1.0 / max(weight[~mine].sum(), 1e-9))
            if abs(a - b) / noise > best[0]:
                best = (abs(a - b) / noise, period, phase, float(np.exp(a - b)))
    _, period, phase, level = best
    first = int(layers[layers % period == phase][0])
    settings = {"first_layer": first, "last_layer": int(layers[-1]), "every": period}
    return Probe("layer_gain", {"gain": level}, free_of("layer_gain"), settings)


def _patches(simulator: Simulator, dimming: Dimming) -> list[Probe]:
    """The rectangle of the field of view that is dimmed most against the rest, sharp and soft."""
    rows, row = _blocks(simulator.beams.layer)
    columns, column = _blocks(simulator.beams.point)
    gain, weight = dimming.mean(row * (len(columns) - 1) + column, (len(rows) - 1) * (len(columns) - 1))
    shape = (len(rows) - 1, len(columns) - 1)
    dim = -np.clip(gain - np.average(gain, weights=weight + 1e-9), -2.0, 2.0)
    top, bottom, left, right = _best_rectangle((dim * weight).reshape(shape), weight.reshape(shape))
    box = to_lines(simulator, dimming, (int(rows[top]), int(rows[bottom]), int(columns[left]), int(columns[right])))
    place = {
        "first_layer": box[0], "last_layer": box[1] - 1,
        "first_point": box[2], "last_point": box[3] - 1,
    }  # fmt: skip
    beams = simulator.beams
    inside = (beams.layer >= box[0]) & (beams.layer < box[1]) & (beams.point >= box[2]) & (beams.point < box[3])
    means, weights = dimming.mean(inside.astype(np.int64), 2)
    level = float(means[1] - (means[0] if weights[0] > 0.0 else 0.0))
    transmission = float(np.clip(np.exp(level), 0.02, 0.95))
    free = (
        *free_of("blockage"),
        *(FreeParameter(name, step, whole=True) for name, step in zip(place, (4.0, 4.0, 4.0, 4.0), strict=True)),
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


def _blocks(line: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Edges of about sixteen strips, and the strip of each beam."""
    low, high = int(line.min()), int(line.max()) + 1
    edges = np.unique(np.linspace(low, high, min(_BLOCKS, high - low) + 1).astype(np.int64))
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


def _movers(simulator: Simulator) -> list[Probe]:
    """Objects that have a number may move on their own."""
    ids, counts = np.unique(simulator.beams.object_id[simulator.beams.object_id >= 0], return_counts=True)
    found = []
    for number in ids[np.argsort(-counts)][:6]:
        for sign in (1.0, -1.0):
            settings = {"forward_m_s": 8.0 * sign, "left_m_s": 0.0}
            free = (FreeParameter("forward_m_s", 1.0), FreeParameter("left_m_s", 1.0))
            found.append(Probe("motion", settings, free, {"object_id": int(number)}))
    return found


def _mirrors(simulator: Simulator) -> list[Probe]:
    """Each material as the mirror."""
    ids = np.unique(simulator.beams.material_id[(simulator.beams.material_id >= 0) & ~simulator.beams.retro])
    free = (FreeParameter("reflectivity", 0.2, log=True), FreeParameter("grazing", 0.1))
    return [
        Probe("mirror_multipath", {"reflectivity": value}, free, {"material_id": int(i)})
        for i in ids
        for value in (0.5,)
    ]
