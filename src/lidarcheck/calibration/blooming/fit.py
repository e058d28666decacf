"""Fit a blooming table to measured profiles, all distances together.

The light of a cell is linear in the table (`blooming_operator`), and what a sensor makes of light is known from the
exact chain (`blooming_response`). So the table's log10 Y follow by least squares: PEAK, AREA and WIDTH of the echoes,
weighted by their scatter, and how many beams have an echo at all, by the binomial deviance; Huber's loss; a weight on
bends of log10 Y. That weight is the largest whose tables predict left-out distances no worse than the best, by the
error of the difference. The pulse's length, its tail and the target's brightness may be free too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.calibration.blooming.cells import Cells
from lidarcheck.calibration.blooming.operator import LEAST_Y, Nodes
from lidarcheck.calibration.blooming.problem import TableProblem
from lidarcheck.calibration.blooming.pulses import FreeLight
from lidarcheck.calibration.blooming.residuals import huber_cost, huber_weight
from lidarcheck.scan import PulseShape
from lidarcheck.sensor import Sensor

__all__ = ["SMOOTHNESS", "FittedNumber", "FreeLight", "SmoothnessScore", "TableFit", "fit_table"]

ProgressCallback = Callable[[str], object]

SMOOTHNESS = (10.0, 3.0, 1.0, 0.3, 0.1, 0.03, 0.01)
"""Weights to choose from: 1 over the variance of a bend [decades per unit of asinh(x/10), squared]."""
_TOLD = 0.15
"""Standard deviation [decades] to which data must know a node, were all others known, to tell of it."""
_WITHIN_95 = 1.96
_ONE_SIDED_95 = 2.71
_ROUNDS = 3
"""How often a fit is made anew with the scatter that the last one expects."""
_MOST = 9.0
"""Decades beyond which an interval says nothing."""


class SmoothnessScore(NamedTuple):
    """How well tables of one smoothness predict cells that were left out: the mean loss, how far it is above the least,
    and the standard error of that difference, cell by cell.
    """

    smoothness: float
    loss: float
    above: float
    error: float


@dataclass(frozen=True)
class FittedNumber:
    """A fitted number with its 95 % interval."""

    name: str
    unit: str
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class TableFit:
    """A fitted table. Shapes (k,) over its nodes.

    `active`: nodes that were fitted. `log_y`, `sigma`: log10 Y and its standard deviation. `data_sigma`: that by the
    data alone, were all other nodes known; infinite where no cell sees the node. `limit`: the largest log10 Y that the
    data allow. `dark`: none of the beams fired that get a third of their bloom by the node has an echo. `clear`: of
    those that it lights most, nine of ten have one, at some distance. `misfit`: mean squared residual in variances,
    where 1 is chance; intervals are widened by it. `light` (cells,) and `expected` (cells, 3), for each data set: S of
    its cells and the features that it makes.
    """

    nodes: Nodes
    active: BoolArray
    log_y: FloatArray
    sigma: FloatArray
    data_sigma: FloatArray
    limit: FloatArray
    dark: BoolArray
    clear: BoolArray
    parameters: tuple[FittedNumber, ...]
    shape: PulseShape
    brightness: float
    smoothness: float
    scores: tuple[SmoothnessScore, ...]
    left_out: str
    misfit: float
    light: tuple[FloatArray, ...] = field(repr=False)
    expected: tuple[FloatArray, ...] = field(repr=False)


def fit_table(
    cells: Sequence[Cells],
    nodes: Nodes,
    sensor: Sensor,
    *,
    shape: PulseShape | None = None,
    free: FreeLight = FreeLight(),  # noqa: B008 - frozen
    smoothness: float | None = None,
    progress: ProgressCallback = lambda _what: None,
) -> TableFit:
    """The table that the cells of all distances show; `smoothness` None: chosen by leaving one out.

    `shape`: the model's pulse, the sensor's own where None; its length is where a free pulse starts. `progress` gets
    what is being done, in words.
    """
    problem = TableProblem(cells, nodes, sensor, shape=shape or PulseShape(sensor.pulse_fwhm_ns), free=free)
    progress("first fit")
    theta = problem.start()
    for _ in range(_ROUNDS if len(problem.pulses) else 1):
        theta = problem.solve(theta, smoothness or SMOOTHNESS[len(SMOOTHNESS) // 2])
    scores: tuple[SmoothnessScore, ...] = ()
    if smoothness is None:
        progress("leaving out each distance")
        scores = _scores(problem, theta)
        smoothness = max(score.smoothness for score in scores if score.above <= score.error)
    progress("last fit")
    for _ in range(_ROUNDS):
        theta = problem.solve(theta, smoothness)
    return _result(problem, theta, smoothness, scores)


def _folds(problem: TableProblem) -> tuple[str, list[BoolArray]]:
    """What is left out in turn: a distance, or every fourth offset where there is but one."""
    if len(problem.cells) > 1:
        return "a distance", [problem.used & (problem.set_of == i) for i in range(len(problem.cells))]
    rank = np.unique(np.round(problem.cells[0].offset, 6), return_inverse=True)[1].ravel()
    return "every fourth offset", [problem.used & (rank % 4 == i) for i in range(4)]


def _scores(problem: TableProblem, theta: FloatArray) -> tuple[SmoothnessScore, ...]:
    """The loss of left-out cells by the tables that the others give; all but the table stays as fitted to all.

    Only cells count of whose light the others know nine tenths: of the rest no smoothness could know anything.
    """
    weight = problem.weights(theta)
    losses: list[list[FloatArray]] = [[] for _ in SMOOTHNESS]
    for left in _folds(problem)[1]:
        fitted, others = theta, problem.used & ~left
        scored = left & _predicted_by(problem, theta, weight, others)
        for found, smoothness in zip(losses, SMOOTHNESS, strict=True):
            fitted = problem.solve(fitted, smoothness, others, only_table=True)
            found.append(huber_cost(problem.residuals(fitted, weight, scored)))
    joined = [np.concatenate([*parts, [0.0]]) for parts in losses]  # never empty
    best = joined[int(np.argmin([loss.mean() for loss in joined]))]
    return tuple(
        SmoothnessScore(
            smoothness, float(loss.mean()), float((loss - best).mean()), float((loss - best).std() / np.sqrt(len(loss)))
        )
        for smoothness, loss in zip(SMOOTHNESS, joined, strict=True)
    )


def _predicted_by(problem: TableProblem, theta: FloatArray, weight: FloatArray, use: BoolArray) -> BoolArray:
    """Cells at least nine tenths of whose bloom comes by nodes that the cells in `use` determine."""
    slopes = problem.slopes(theta, weight, use)[:, : problem.k]
    known = np.sum(slopes**2, axis=0) > _TOLD**-2
    bloom = problem.matrix * 10.0 ** theta[: problem.k]
    total = bloom.sum(axis=1)
    return np.asarray((total > 0.0) & (bloom[:, known].sum(axis=1) >= 0.9 * total))


def _result(
    problem: TableProblem, theta: FloatArray, smoothness: float, scores: tuple[SmoothnessScore, ...]
) -> TableFit:
    """The fit with its intervals: Gauss-Newton, widened by the misfit where that exceeds chance."""
    weight, k = problem.weights(theta), problem.k
    residual, slopes = problem.residuals(theta, weight, problem.used), problem.slopes(theta, weight, problem.used)
    damped = huber_weight(residual)
    telling = int(np.sum(np.any(slopes != 0.0, axis=1)))
    misfit = float(np.sum(damped * residual**2) / max(telling - len(theta), 1))
    known = slopes.T @ (damped[:, None] * slopes) / max(misfit, 1.0)
    prior = problem.prior(smoothness)
    sigma = np.sqrt(np.maximum(np.diag(np.linalg.pinv(known + prior.T @ prior)), 0.0))
    with np.errstate(divide="ignore"):
        alone = 1.0 / np.sqrt(np.diag(known)[:k])
    light, values = problem.light(theta), theta[k:]
    every = np.ones(len(light), dtype=bool)
    expected = problem.response(values, every).features(np.log10(light))[0]
    ends = np.cumsum([len(part) for part in problem.cells])[:-1]
    given = np.log10(np.maximum(problem.nodes.y, LEAST_Y))
    dark, clear = _sight(problem, theta)

    def over_nodes(part: FloatArray, elsewhere: FloatArray | float) -> FloatArray:
        whole = np.broadcast_to(np.asarray(elsewhere, dtype=np.float64), len(problem.nodes)).copy()
        whole[problem.active] = part
        return whole

    return TableFit(
        nodes=problem.nodes, active=problem.active, log_y=over_nodes(theta[:k], given),
        sigma=over_nodes(sigma[:k], np.inf), data_sigma=over_nodes(alone, np.inf),
        limit=over_nodes(_limits(problem, theta, weight), 0.0), dark=over_nodes(dark, 0.0) > 0.0,
        clear=over_nodes(clear, 0.0) > 0.0, parameters=_parameters(problem, values, sigma[k:]),
        shape=problem.pulses.pulse(values), brightness=problem.pulses.brightness(values), smoothness=smoothness,
        scores=scores, left_out=_folds(problem)[0], misfit=misfit, light=tuple(np.split(light, ends)),
        expected=tuple(np.split(expected, ends)),
    )  # fmt: skip


def _parameters(problem: TableProblem, values: FloatArray, sigma: FloatArray) -> tuple[FittedNumber, ...]:
    half = np.minimum(_WITHIN_95 * sigma, _MOST)
    ends = (10.0 ** np.stack([values, values - half, values + half], axis=1)).tolist()
    return tuple(
        FittedNumber(extra.name, extra.unit, *end) for extra, end in zip(problem.pulses.extras, ends, strict=True)
    )


def _sight(problem: TableProblem, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """1 for nodes that are dark, and 1 for nodes that are clear, else 0 (see `TableFit`); shape (nodes,) each."""
    bloom = problem.matrix * 10.0 ** theta[: problem.k]
    mostly = bloom >= 0.3 * np.maximum(bloom.sum(axis=1), 1e-12)[:, None]
    beside = (problem.used & (problem.target == 0.0))[:, None] & mostly
    fired, seen = (np.any(beside & (count > 0)[:, None], axis=0) for count in (problem.beams, problem.echoes))
    share = bloom / np.maximum(bloom.sum(axis=1), 1e-12)[:, None]
    near = beside & (share >= 0.8 * np.max(share * beside, axis=0))
    often = np.zeros(problem.k, dtype=bool)
    for part in range(len(problem.cells)):
        own = near & (problem.set_of == part)[:, None]
        echoes, beams = (count @ own for count in (problem.echoes, problem.beams))
        often |= (echoes > 0) & (echoes >= 0.9 * beams)
    return (fired & ~seen).astype(np.float64), often.astype(np.float64)


def _limits(problem: TableProblem, theta: FloatArray, weight: FloatArray) -> FloatArray:
    """The largest log10 Y of each node that the data allow (95 %, one-sided), all else as fitted."""
    limits = np.zeros(problem.k)
    for k in range(problem.k):
        use = problem.used & (problem.matrix[:, k] > 0.0)
        moved, least = theta.copy(), huber_cost(problem.residuals(theta, weight, use)).sum()
        while moved[k] < 0.0:
            moved[k] = min(moved[k] + 0.1, 0.0)
            if huber_cost(problem.residuals(moved, weight, use)).sum() > least + _ONE_SIDED_95:
                limits[k] = moved[k]
                break
    return limits
