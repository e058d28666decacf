"""The numbers behind the pictures: measured echoes against those of the model before and after, nothing drawn.

Everything is taken on the frames that it is given, which should be frames that no fit has seen.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.cases.frame import Frame
from lidarcheck.figures.gap.data import (
    FEWEST,
    SEEDS,
    Z_90,
    Detected,
    FieldMap,
    Histogram,
    Pictures,
    ResidualCurve,
)
from lidarcheck.inference.observed.beam_table import BeamTable, beams_of
from lidarcheck.inference.observed.echo_view import EchoView
from lidarcheck.inference.observed.observations import FEATURES, Observations, observations_of
from lidarcheck.inference.observed.strata import Division, divisions
from lidarcheck.kpi.detection import wilson
from lidarcheck.model.chain import simulate_frames
from lidarcheck.model.spec import Model

__all__ = ["COVARIATES", "Detected", "FieldMap", "Histogram", "Pictures", "ResidualCurve", "pictures_of"]


COVARIATES = ("range", "amplitude", "layer", "point", "incidence", "material")
_EXPECTATION_SEEDS = 3
"""Simulations that sort beams by amplitude; others than are compared, since chance in both would look like a bias."""
_FIRST_SEED, _FIRST_EXPECTATION = 9000, 9500
_BINS = 60
_TAIL = 5e-4
"""Share of the values at either end that is counted in a histogram's first and last bin, wherever it lies."""
_ROWS, _COLUMNS = 12, 24
_MOST_BEAMS = 250_000
"""Of more frames than have so many beams only the first are shown: the pictures would not change, but take minutes."""

_SLOTS = FEATURES[1:]
"""Features that each sensor has by names of its own; the first is its amplitude."""
_AMPLITUDE = _SLOTS[0]


def _words(view: EchoView) -> Mapping[str, tuple[str, str]]:
    """What histograms are of, and its unit."""
    own = {name: (slot.name, slot.unit) for name, slot in zip(_SLOTS, view.slots, strict=True) if slot.name}
    last = ("range of echoes that belong to no surface", "m")
    return {"range": ("range less the true range", "m"), **own, "others": last}


def _residual_words(view: EchoView) -> Mapping[str, tuple[str, str]]:
    """What residuals are of, and their unit."""
    own = {
        name: (f"{slot.name} residual", slot.unit) for name, slot in zip(_SLOTS, view.slots, strict=True) if slot.name
    }
    if view.slots[0].name and view.slots[0].log:
        own[_AMPLITUDE] = (f"ln {view.slots[0].name} residual", "1")
    return {"range": ("range residual", "m"), **own}


def _map_words(view: EchoView) -> Mapping[str, tuple[str, str]]:
    """What maps are of, and its unit."""
    first = view.slots[0]
    own = (
        {_AMPLITUDE: (f"mean {'ln ' * first.log}{first.name}", "1" if first.log else first.unit)} if first.name else {}
    )
    return {
        "detected": ("surfaces that have an echo", "% of the beams"),
        **own,
        "range": ("mean range", "m"),
        "others": ("echoes that belong to no surface", "per 100 beams"),
    }


def _is_log(view: EchoView, feature: str) -> bool:
    """Whether observations hold the feature as its logarithm."""
    return feature in _SLOTS and view.slots[_SLOTS.index(feature)].log


def pictures_of(frames: Sequence[Frame], before: Model, after: Model, *, seed: int) -> Pictures:
    """What was measured on `frames` against what each model shows of them, with two seeds.

    The same seed, the same numbers. Of frames with more than 250 000 beams together only the first are taken, one at
    least; `Pictures.frames` says which. Without frames, and where no beam meets anything, everything is empty.
    """
    seeds = tuple(_seed(seed, _FIRST_SEED + k) for k in range(SEEDS))
    frames = _some(frames)
    numbers = tuple(frame.number for frame in frames)
    if not any(np.any(frame.ideal.distance_m > 0.0) for frame in frames):
        return Pictures(numbers, seeds, (), (), (), ())
    beams = beams_of([frame.ideal for frame in frames], before)
    measured = observations_of(beams, [frame.measured for frame in frames])
    runs = _Runs(
        beams,
        measured,
        tuple(_simulated(beams, frames, before, one) for one in seeds),
        tuple(_simulated(beams, frames, after, one) for one in seeds),
    )
    expected = [_seed(seed, _FIRST_EXPECTATION + k) for k in range(_EXPECTATION_SEEDS)]
    log_area = _mean_log_area([_simulated(beams, frames, before, one) for one in expected])
    names = {number: material.name for number, material in before.materials.items()}
    found = {division.covariate: division for division in divisions(beams, log_area, names)}
    shown = [found[covariate] for covariate in COVARIATES if covariate in found]
    return Pictures(
        frames=numbers,
        seeds=seeds,
        histograms=tuple(_histogram(runs, feature, len(frames)) for feature in _words(beams.view)),
        curves=tuple(_curve(runs, feature, division) for feature in _residual_words(beams.view) for division in shown),
        detected=tuple(_detected(runs, division) for division in shown),
        maps=_maps(runs),
    )


@dataclass(frozen=True)
class _Runs:
    """The measurement and the simulations of both models, a seed each, beam by beam."""

    beams: BeamTable
    measured: Observations
    before: tuple[Observations, ...]
    after: tuple[Observations, ...]


def _some(frames: Sequence[Frame]) -> Sequence[Frame]:
    """As many frames as have not too many beams, one at least."""
    beams = np.cumsum([len(frame.ideal) for frame in frames])
    return frames[: max(1, int(np.searchsorted(beams, _MOST_BEAMS, side="right")))]


def _seed(seed: int, number: int) -> int:
    return ((seed << 16) + number) % 2**64


def _simulated(beams: BeamTable, frames: Sequence[Frame], model: Model, seed: int) -> Observations:
    numbers = [frame.number for frame in frames]
    scans = simulate_frames([frame.ideal for frame in frames], model, seed=seed, frames=numbers)
    return observations_of(beams, scans)


def _mean_log_area(runs: Sequence[Observations]) -> FloatArray:
    """Mean ln AREA of each beam's surface echo, NaN where there never is one; shape (n,)."""
    seen = np.sum([run.detected for run in runs], axis=0)
    total = np.sum([run.feature[:, FEATURES.index("area")] for run in runs], axis=0)
    return np.where(seen > 0, total / np.maximum(seen, 1), np.nan)


def _values(observations: Observations, feature: str, view: EchoView) -> FloatArray:
    """The feature of every echo that has it, in its own unit."""
    if feature == "others":
        return observations.extra_m
    column = observations.feature[observations.detected, FEATURES.index(feature)]
    return np.asarray(np.exp(column)) if _is_log(view, feature) else column


def _histogram(runs: _Runs, feature: str, frames: int) -> Histogram:
    sides = [
        [_values(observations, feature, runs.beams.view) for observations in side]
        for side in ((runs.measured,), runs.before, runs.after)
    ]
    view = runs.beams.view
    edges = _edges(np.concatenate([values for side in sides for values in side]), feature, view)
    last = np.nextafter(edges[-1], edges[0])
    measured, before, after = (
        np.sum([np.histogram(np.clip(values, edges[0], last), edges)[0] for values in side], axis=0)
        / (len(side) * frames)
        for side in sides
    )
    words, unit = _words(view)[feature]
    log_x = feature == _AMPLITUDE and _is_log(view, feature)
    return Histogram(feature, words, unit, edges, measured, before, after, log_x=log_x)


def _edges(values: FloatArray, feature: str, view: EchoView) -> FloatArray:
    """Bins for all but the last of the tails, whole multiples of what the sensor resolves, so that none is odd."""
    if not len(values):
        return np.array([0.0, 1.0])
    low, high = (float(q) for q in np.quantile(values, [_TAIL, 1.0 - _TAIL]))
    if feature == _AMPLITUDE and _is_log(view, feature):
        whole = np.floor(np.geomspace(max(low, 1.0), max(high, low + 1.0, 2.0) + 1.0, _BINS + 1))
        return np.asarray(np.unique(whole) - 0.5)
    own = {name: 1.0 if slot.log else slot.step for name, slot in zip(_SLOTS, view.slots, strict=True)}
    step = {"range": view.range_step_m, "others": view.reach_m / 4.0, **own}[feature]
    begin = np.floor(low / step + 0.5) - 0.5
    width = max(1.0, np.ceil((high / step - begin) / _BINS))
    bins = int(np.ceil((high / step - begin + 1e-9) / width))
    return np.asarray((begin + width * np.arange(bins + 1)) * step)


def _curve(runs: _Runs, feature: str, division: Division) -> ResidualCurve:
    k, view = len(division.names), runs.beams.view
    sides = []
    for side in (runs.before, runs.after):
        pairs = [_residuals(runs.measured, observations, feature, division.bin, view) for observations in side]
        sides.append((np.concatenate([place for place, _ in pairs]), np.concatenate([value for _, value in pairs])))
    count = np.bincount(sides[0][0], minlength=k).astype(np.int64)
    before, after = (_quantiles(place, value, k) for place, value in sides)
    words, unit = _residual_words(view)[feature]
    return ResidualCurve(feature, words, unit, division.covariate, division.names, count, before, after)


def _residuals(
    measured: Observations, simulated: Observations, feature: str, place: IndexArray, view: EchoView
) -> tuple[IndexArray, FloatArray]:
    """Measured less simulated of the beams that both see: their bins and the differences."""
    both = measured.detected & simulated.detected & (place >= 0)
    column = FEATURES.index(feature)
    pair = [observations.feature[both, column] for observations in (measured, simulated)]
    if feature != _AMPLITUDE and _is_log(view, feature):
        pair = [np.exp(values) for values in pair]
    return place[both], pair[0] - pair[1]


def _quantiles(place: IndexArray, value: FloatArray, k: int) -> FloatArray:
    """The 10 %, 50 % and 90 % quantiles of each bin, shape (k, 3)."""
    order = np.argsort(place, kind="stable")
    bounds = np.searchsorted(place[order], np.arange(k + 1))
    found = np.full((k, 3), np.nan)
    for i, (first, last) in enumerate(itertools.pairwise(bounds)):
        if last - first >= FEWEST:
            found[i] = np.quantile(value[order[first:last]], [0.1, 0.5, 0.9])
    return found


def _detected(runs: _Runs, division: Division) -> Detected:
    inside = (division.bin >= 0) & (runs.beams.distance_m > 0.0)
    k, place = len(division.names), division.bin[inside]
    beams = np.bincount(place, minlength=k)
    enough = beams >= FEWEST

    def found(side: Sequence[Observations]) -> FloatArray:
        weights = np.mean([observations.detected[inside] for observations in side], axis=0)
        return np.asarray(np.bincount(place, weights=weights, minlength=k))

    own = found((runs.measured,))
    columns = np.stack([own / np.maximum(beams, 1), *wilson(own, beams, z=Z_90)], axis=1)
    before, after = (np.where(enough, found(side) / np.maximum(beams, 1), np.nan) for side in (runs.before, runs.after))
    measured = np.where(enough[:, None], columns, np.nan)
    return Detected(division.covariate, division.names, beams.astype(np.int64), measured, before, after)


def _maps(runs: _Runs) -> tuple[FieldMap, ...]:
    row, layers = _blocks(runs.beams.layer, _ROWS)
    column, points = _blocks(runs.beams.point, _COLUMNS)
    block, shape = row * len(points) + column, (len(layers), len(points))
    ends = [np.array([first[0], last[-1]]) for first, last in ((layers[0], layers[-1]), (points[0], points[-1]))]
    angles = [(float(ends_deg[0]), float(ends_deg[1])) for ends_deg in runs.beams.sensor.angles_deg(*ends)]
    sides = [[_differences(runs.measured, s, runs.beams) for s in side] for side in (runs.before, runs.after)]
    found = []
    for quantity, (words, unit) in _map_words(runs.beams.view).items():
        before, after = (_mean(block, [one[quantity] for one in side], shape) for side in sides)
        found.append(FieldMap(quantity, words, unit, layers, points, before, after, *angles))
    return tuple(found)


def _differences(measured: Observations, simulated: Observations, beams: BeamTable) -> Mapping[str, FloatArray]:
    """Measured less simulated of each beam by quantity, shape (n,), NaN for beams that take no part."""
    n = len(beams)
    both = measured.detected & simulated.detected
    seen = 100.0 * (measured.detected.astype(np.float64) - simulated.detected)
    others = [
        np.bincount(observations.extra_beam, minlength=n).astype(np.float64) for observations in (measured, simulated)
    ]
    echo = {name: FEATURES.index(name) for name in ("area", "range")}
    return {
        "detected": np.where(beams.distance_m > 0.0, seen, np.nan),
        "others": 100.0 * (others[0] - others[1]),
        **{name: np.where(both, measured.feature[:, j] - simulated.feature[:, j], np.nan) for name, j in echo.items()},
    }


def _mean(block: IndexArray, values: Sequence[FloatArray], shape: tuple[int, int]) -> FloatArray:
    """The mean of each block over the beams and the seeds, NaN where too few take part."""
    use = [~np.isnan(value) for value in values]
    place = np.concatenate([block[u] for u in use])
    cells = shape[0] * shape[1]
    count = np.bincount(place, minlength=cells)
    weights = np.concatenate([value[u] for value, u in zip(values, use, strict=True)])
    total = np.bincount(place, weights=weights, minlength=cells)
    return np.where(count >= FEWEST * len(values), total / np.maximum(count, 1), np.nan).reshape(shape)


def _blocks(line: IndexArray, most: int) -> tuple[IndexArray, tuple[tuple[int, int], ...]]:
    """Fired lines in at most so many blocks of as many lines each: the block of each beam, and each block's ends."""
    lines, rank = np.unique(line, return_inverse=True)
    count = min(most, len(lines))
    block = np.arange(len(lines)) * count // len(lines)
    ends = tuple((int(lines[block == i][0]), int(lines[block == i][-1])) for i in range(count))
    return block[rank], ends
