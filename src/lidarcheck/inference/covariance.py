"""How the summaries of a measurement scatter: by noise, and by usual errors that are worth no name."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Protocol

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import Effect
from lidarcheck.effects.finding import make, with_role
from lidarcheck.inference.metric import Metric
from lidarcheck.inference.nuisances import (
    GAIN_ERROR,
    POSE_ERROR_DEG,
    REFLECTANCE_ERROR,
    beside,
)
from lidarcheck.inference.observed.beam_table import BeamTable
from lidarcheck.inference.observed.edges import EXTRA
from lidarcheck.inference.observed.observations import Observations
from lidarcheck.inference.observed.summaries import Summaries
from lidarcheck.inference.usual_ranges import farther_by_height_m
from lidarcheck.model.spec import Model
from lidarcheck.workers.threads import mapped

__all__ = ["Simulates", "metrics", "nuisances", "shuffled"]


_MISFIT = 1.0
"""Variance that every compressed summary has besides noise: effects' forms are never exactly the sensor's."""
_SEEDS = 2
"""Simulations of which a nuisance's shift is the mean, paired with as many of the case's own model."""
_GAIN_STEP, _REFLECTANCE_STEP, _POSE_STEP = 0.06, 0.1, 2.0
"""Over how wide a difference a shift is taken: 6 %, 10 %, and two usual errors of an angle; less is lost in flips."""


class Simulates(Protocol):
    """What simulates the frames: see `simulator.Simulator`."""

    @property
    def model(self) -> Model:
        """The case's own."""

    @property
    def beams(self) -> BeamTable:
        """Those of the frames."""

    @property
    def summaries(self) -> Summaries:
        """What observations are turned into."""

    def observations(self, model: Model, seed: int) -> Observations:
        """What a model shows of each beam."""

    def plain_base(self, k: int) -> FloatArray:
        """The summaries of the case's own model with a seed, not compressed."""


def shuffled(beams: BeamTable, drawn: Sequence[Observations], seeds: Iterable[int]) -> Iterator[Observations]:
    """More measurements that the model could have made: each beam as one of some simulations shows it.

    Beams are independent under the model, but for those that were estimated together, so that this is as good as
    another simulation.
    """
    groups = int(beams.estimate.max(initial=-1)) + 1
    all_detected, all_features = np.array([s.detected for s in drawn]), np.array([s.feature for s in drawn])
    all_strayed, rows = np.array([s.strayed for s in drawn]), np.arange(len(beams))
    for seed in seeds:
        rng = np.random.default_rng(np.random.SeedSequence([seed & 0xFFFFFFFF, 77]))
        pick = rng.integers(0, len(drawn), groups)[beams.estimate]
        mine = [np.flatnonzero(pick[s.extra_beam] == k) for k, s in enumerate(drawn)]
        extra = {
            name: np.concatenate([getattr(s, name)[m] for s, m in zip(drawn, mine, strict=True)]) for name in EXTRA
        }
        order = np.argsort(extra["extra_beam"], kind="stable")
        yield Observations(
            detected=all_detected[pick, rows],
            feature=all_features[pick, rows],
            strayed=all_strayed[pick, rows],
            **{name: column[order] for name, column in extra.items()},
        )


def metrics(floor: FloatArray, edges: FloatArray, usual: Mapping[str, FloatArray]) -> tuple[Metric, Metric]:
    """The noise of a measurement and its correlations, with the nuisances as further noise and without.

    `floor` (draws, n_summaries): of the noise. `edges` (n_summaries, runs), `usual` (n_summaries,) each: what a usual
    error of the pose does along an edge, and what each nuisance does, as standard deviations.
    """
    noise = np.concatenate([(floor / np.sqrt(len(floor) - 1.0)).T, edges], axis=1)
    bare = Metric(np.full(len(noise), _MISFIT), noise)
    return bare.widened(np.column_stack([*usual.values()])), bare


def nuisances(simulator: Simulates) -> Mapping[str, FloatArray]:
    """What errors of one standard deviation in gain, reflectances and pose would do to the summaries."""
    steps: dict[str, tuple[Effect, float]] = {
        "gain": (make(with_role("gain").name, {"gain": 1.0 + _GAIN_STEP}), GAIN_ERROR / _GAIN_STEP)
    }
    present = np.unique(simulator.beams.material_id[simulator.beams.material_id >= 0])
    for material in present:
        effect = make(with_role("reflectance").name, {"factor": 1.0 + _REFLECTANCE_STEP, "material_id": int(material)})
        steps[f"reflectance of material {material}"] = (effect, REFLECTANCE_ERROR / _REFLECTANCE_STEP)
    for name in ("yaw_deg", "pitch_deg"):
        settings = {"yaw_deg": 0.0, "pitch_deg": 0.0} | {name: _POSE_STEP * POSE_ERROR_DEG}
        steps[name] = (make(with_role("pose").name, settings), 1.0 / _POSE_STEP)
    sensor = simulator.model.sensor
    able = {name: step for name, step in steps.items() if not step[0].why_not(sensor)}
    found = {name: factor * _shift(simulator, effect) for name, (effect, factor) in able.items()}
    found["sensor's height"] = _moved(simulator, 0, farther_by_height_m(simulator.beams))
    return found


def _shift(simulator: Simulates, effect: Effect) -> FloatArray:
    """Change of the summaries, not compressed, by an effect on top of the model's; paired seeds."""
    model = beside(simulator.model, effect)
    return np.asarray(
        np.mean(
            mapped(
                lambda k: simulator.summaries.plain(simulator.observations(model, k)) - simulator.plain_base(k),
                range(_SEEDS),
            ),
            axis=0,
        )
    )


def _moved(simulator: Simulates, feature_index: int, by: FloatArray) -> FloatArray:
    """Change of the summaries where a feature of each beam is off by so much, `by` of shape (n_beams,)."""
    shifts = []
    for k in range(_SEEDS):
        one = simulator.observations(simulator.model, k)
        feature = one.feature.copy()
        feature[:, feature_index] += by
        other = dataclasses.replace(one, feature=feature)
        shifts.append(simulator.summaries.plain(other) - simulator.summaries.plain(one))
    return np.asarray(np.mean(shifts, axis=0))
