"""Frames on the bench: what was measured on them, and what any model would show, in the same summaries."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.cases.frame import Frame
from lidarcheck.effects.base import Effect, make
from lidarcheck.inference.beam_table import BeamTable, beams_of
from lidarcheck.inference.edges import EXTRA, runs_along, runs_past, with_beams_of
from lidarcheck.inference.metric import Metric
from lidarcheck.inference.nuisances import (
    GAIN_ERROR,
    HEIGHT_ERROR_M,
    POSE_ERROR_DEG,
    REFLECTANCE_ERROR,
    Nuisance,
    beside,
)
from lidarcheck.inference.pairing import Observations, observations_of
from lidarcheck.inference.summaries import Summaries, compressed
from lidarcheck.model.incremental import DetectedFrame, simulate_detected
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Surfaces
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor
from lidarcheck.workers import Shared
from lidarcheck.workers.threads import mapped

__all__ = ["Simulator"]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]

EXPECTATION_SEEDS = 8
FLOOR_SEEDS = 20
FLOOR_DRAWS = 120
CHECK_DRAWS = 48
_KEPT = 12
_ALL = 1000
_SEEDS_OF_RANDOM = 4
_VARIES = 0.04
"""Mean logarithm of the variance, beyond that of the case's own model, from which on a model strikes at random."""
EDGE_ERROR = 0.4
"""How often, as a standard deviation, a run of beams at an edge meets what its neighbours do: a usual error of the pose
is a tenth to a fifth of a beam."""
_MISFIT = 1.0
"""Variance that every compressed summary has besides noise: effects' forms are never exactly the sensor's."""


class _Simulated(NamedTuple):
    """What was simulated: the effects before the detectors and those of them, the sensor, the reflectances, the seed,
    the error of the pose."""

    light: tuple[Effect, ...]
    detector: tuple[Effect, ...]
    sensor: Sensor
    reflectances: tuple[tuple[int, float], ...]
    seed: int
    pose: tuple[float, float]

    @classmethod
    def of(cls, model: Model, seed: int, nuisance: Nuisance) -> _Simulated:
        """That of a model."""
        light = tuple(effect for effect in model.effects if effect.stage in ("aim", "light"))
        detector = tuple(effect for effect in model.effects if effect.stage == "detector")
        table = tuple((i, m.reflectance) for i, m in model.materials.items())
        return cls(light, detector, model.sensor, table, seed, (nuisance.yaw, nuisance.pitch))

    def differences(self, other: _Simulated) -> int:
        """In how many effects and reflectances another one differs; `_ALL` where every beam does."""
        if (self.detector, self.sensor, self.seed, self.pose) != (other.detector, other.sensor, other.seed, other.pose):
            return _ALL
        return len({*self.light} ^ {*other.light}) + len({*self.reflectances} ^ {*other.reflectances})


class Simulator:
    """Some frames with a model: simulates other models on them and measures how far they are from the measurement."""

    def __init__(self, frames: Sequence[Frame], model: Model, seed: int, *, seeds: int = 2) -> None:
        self.frames = tuple(frames)
        self.model = model
        self.seed = seed
        self.seeds = seeds
        self._unread: dict[_Simulated, list[DetectedFrame]] = {}
        self._plain: dict[int, list[DetectedFrame]] = {}
        self._surfaces = [Surfaces(f.ideal) for f in self.frames]
        self._posed: dict[tuple[float, float], list[Surfaces]] = {}
        self.beams: BeamTable = beams_of([f.ideal for f in frames], model)
        names = {i: m.name for i, m in model.materials.items()}
        base = mapped(lambda k: self.observations(model, 1000 + k), range(EXPECTATION_SEEDS))
        drawn = mapped(lambda k: self.observations(model, 2000 + k), range(FLOOR_SEEDS))
        fresh = _shuffled(self.beams, drawn, range(self.seed, self.seed + FLOOR_DRAWS))
        self.summaries = Summaries(self.beams, base, fresh, names)
        self.measured_sights = observations_of(self.beams, [f.measured for f in frames])
        self.measured_plain = self.summaries.plain(self.measured_sights)
        self.measured = compressed(self.measured_plain)
        # Half of the draws teach the metric; the others tell how far it errs on data that it does not know.
        self.floor, self.check = self.summaries.fresh[CHECK_DRAWS:], self.summaries.fresh[:CHECK_DRAWS]
        self._paired: dict[int, FloatArray] = {}
        self._plain = {k: self._simulated(model, k, Nuisance()) for k in range(seeds)}
        self.edges = self.edges_beside(base)
        self.metric, self.bare = _metrics(self)
        kinds = [(name.feature, name.covariate) for name in self.summaries.names]
        self._kind = np.unique(np.array([" by ".join(kind) for kind in kinds]), return_inverse=True)[1]
        zero = np.zeros((1, len(self.measured)))
        self.floor_distance = float(np.mean([self.distance(zero, draw) for draw in self.check]))

    def edges_beside(self, simulated: Sequence[Observations], *, deep: bool = False) -> FloatArray:
        """What each run of beams that sees past an edge, and not so in simulations, or the other way round, does to the
        measured summaries, as a usual error of the pose; shape (n_summaries, runs). `deep`: see `edges.runs_past`."""
        return self._of_runs(runs_past(self.beams, self.measured_sights, simulated, deep=deep), simulated[0])

    def along_edges(self, model: Model, seed: int, nuisance: Nuisance | None = None) -> Metric:
        """The metric for which a model shows the same whatever part of a beam an edge is off by."""
        shown = self.observations(model, seed, nuisance)
        edges = self._of_runs(runs_along(self.beams), shown)
        return self.metric.widened(edges)

    def _of_runs(self, runs: Sequence[IndexArray], shown: Observations) -> FloatArray:
        """What each run of beams does to the measured summaries, against what is shown, as a usual error of the pose;
        shape (n_summaries, runs)."""
        columns = [np.zeros((len(self.measured), 0))]
        for run in runs:
            without = with_beams_of(self.measured_sights, shown, run)
            columns.append(EDGE_ERROR * (self.measured - self.summaries.of(without))[:, None])
        return np.concatenate(columns, axis=1)

    @functools.cached_property
    def held(self) -> Shared[Simulator]:
        """The lab for the tasks of a crew."""
        return Shared(self)

    def __getstate__(self) -> dict[str, object]:
        """Without what is kept only to save time."""
        kept = {name: value for name, value in self.__dict__.items() if name != "held"}
        return {**kept, "_unread": {}, "_posed": {}}

    def scans(self, model: Model, seed: int, nuisance: Nuisance | None = None) -> list[Scan]:
        """What the model shows of every frame, with random numbers of its own."""
        nuisance = nuisance or Nuisance()
        run = nuisance.model(model)
        echoes = self._echoes(run, seed, nuisance)
        return [one.read_out(run) for one in echoes]

    def _echoes(self, model: Model, seed: int, nuisance: Nuisance) -> list[DetectedFrame]:
        """The echoes before the readout, kept for the next model that differs by its readout alone, or by little."""
        key = _Simulated.of(model, seed, nuisance)
        found = self._unread.get(key)
        if found is None:
            near, like = self._nearest(key)
            found = self._simulated(model, seed, nuisance, like)
            # Replaced, not changed: other threads may look at it. What was of use is kept longer.
            kept = {k: v for k, v in self._unread.items() if k != near}
            kept |= {near: like} if near is not None and like is not None else {}
            self._unread = {**dict([*kept.items()][1 - _KEPT :]), key: found}
        return found

    def _nearest(self, key: _Simulated) -> tuple[_Simulated | None, list[DetectedFrame] | None]:
        """Of what is kept, what has most of its beams in common with a model: the latest, or the case's own model."""
        plain = self._plain.get(key.seed)
        least = key.differences(_Simulated.of(self.model, key.seed, Nuisance())) if plain is not None else _ALL
        kept = self._unread
        near = min(reversed(kept), key=key.differences, default=None)
        if near is None or key.differences(near) >= least:
            return None, plain
        return near, kept[near]

    def _simulated(
        self, model: Model, seed: int, nuisance: Nuisance, like: Sequence[DetectedFrame] | None = None
    ) -> list[DetectedFrame]:
        model, surfaces = self._posed_of(model, nuisance)
        return [
            simulate_detected(
                one.ideal,
                model,
                seed=(self.seed << 16) + seed,
                frame=f.number,
                threads=1,
                like=None if like is None else like[i],
                surfaces=one,
            )
            for i, (f, one) in enumerate(zip(self.frames, surfaces, strict=True))
        ]

    def _posed_of(self, model: Model, nuisance: Nuisance) -> tuple[Model, list[Surfaces]]:
        """The model and the surfaces with the pose's error; the latter kept for the next model."""
        pose = (nuisance.yaw, nuisance.pitch)
        kept = self._posed.get(pose)
        if kept is not None and all(effect.stage != "aim" for effect in model.effects):
            return model, kept
        posed, surfaces = nuisance.posed(model, self._surfaces)
        if posed is model:
            self._posed = {**dict(list(self._posed.items())[-3:]), pose: surfaces}
        return posed, surfaces

    def observations(self, model: Model, seed: int, nuisance: Nuisance | None = None) -> Observations:
        """What the model shows of each beam."""
        return observations_of(self.beams, self.scans(model, seed, nuisance))

    def shows(self, model: Model, seeds: int | None = None, nuisance: Nuisance | None = None) -> FloatArray:
        """The model's summaries, a row a seed, shape (seeds, n_summaries); the seeds are the same for every model.

        What chance does to the case's own model with a seed is taken off, since it does nearly the same to a model
        that differs a little. Of a model that strikes at random two seeds tell little: without `seeds` it gets more.
        """
        rows = mapped(lambda k: self._shown(model, k, nuisance), range(seeds or self.seeds))
        if seeds is None and self.varies(np.array(rows)):
            rows += mapped(lambda k: self._shown(model, k, nuisance), range(len(rows), _SEEDS_OF_RANDOM))
        return np.array(rows)

    def _shown(self, model: Model, seed: int, nuisance: Nuisance | None) -> FloatArray:
        return self.summaries.of(self.observations(model, seed, nuisance)) - self._chance(seed)

    def plain_base(self, k: int) -> FloatArray:
        """The summaries of the case's own model with a seed, not compressed."""
        if k not in self._paired:
            self._paired[k] = self.summaries.plain(self.observations(self.model, k))
        return self._paired[k]

    def _chance(self, k: int) -> FloatArray:
        return compressed(self.plain_base(k))

    def distance(self, shown: FloatArray, measured: FloatArray | None = None, metric: Metric | None = None) -> float:
        """How far a model's summaries, a row a seed, are from the measured ones, without the noise of the seeds.

        The mean over pairs of seeds of r_i' C^-1 r_j: the noise of two seeds is independent and falls out. Where the
        model itself varies more from seed to seed than C says (see `_own_variance`), as one that strikes at random
        does, residuals count by that, and its logarithm is added, as the likelihood has it. `metric`: the one that
        forgives nuisances by default.
        """
        metric = metric or self.metric
        r = (self.measured if measured is None else measured) - np.atleast_2d(shown)
        n = len(r)
        if n == 1:
            return metric.square(r[0])
        variance = self._own_variance(np.atleast_2d(shown))
        r = r / np.sqrt(variance)
        total = metric.square(r.sum(axis=0)) - sum(metric.square(row) for row in r)
        return float(total / (n * (n - 1)) + np.sum(np.log(variance)))

    def varies(self, shown: FloatArray) -> bool:
        """Whether a model's summaries vary of themselves, as those of one that strikes at random do."""
        return len(shown) > 1 and float(np.mean(np.log(self._own_variance(shown)))) > _VARIES

    def _own_variance(self, shown: FloatArray) -> FloatArray:
        """By how much a model's summaries vary more than those of the case's own model, at least 1, (n_summaries,).

        The mean over summaries of a kind, since few seeds tell little of one. The seeds of the case's own model, which
        were taken off, add a variance of 1 where they have become independent; that is not the model's own.
        """
        spread = np.var(shown, axis=0, ddof=1)
        mean = np.bincount(self._kind, spread) / np.bincount(self._kind)
        return np.asarray(np.maximum(mean - 1.0, 1.0)[self._kind])


def _shuffled(beams: BeamTable, drawn: Sequence[Observations], seeds: Iterable[int]) -> Iterator[Observations]:
    """More measurements that the model could have made: each beam as one of some simulations shows it.

    Beams are independent under the model, so that this is as good as another simulation.
    """
    all_detected, all_features = np.array([s.detected for s in drawn]), np.array([s.feature for s in drawn])
    all_strayed, rows = np.array([s.strayed for s in drawn]), np.arange(len(beams))
    for seed in seeds:
        rng = np.random.default_rng(np.random.SeedSequence([seed & 0xFFFFFFFF, 77]))
        pick = rng.integers(0, len(drawn), len(beams))
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


def _metrics(simulator: Simulator) -> tuple[Metric, Metric]:
    """The noise of a measurement and its correlations, with the nuisances as further noise and without."""
    noise = np.concatenate([(simulator.floor / np.sqrt(len(simulator.floor) - 1.0)).T, simulator.edges], axis=1)
    bare = Metric(np.full(len(noise), _MISFIT), noise)
    return bare.widened(np.column_stack([*nuisances(simulator).values()])), bare


def nuisances(simulator: Simulator) -> Mapping[str, FloatArray]:
    """What errors of one standard deviation in gain, reflectances and pose would do to the summaries."""
    steps: dict[str, tuple[Effect, float]] = {"gain": (make("signal_gain", {"gain": 1.06}), GAIN_ERROR / 0.06)}
    present = np.unique(simulator.beams.material_id[simulator.beams.material_id >= 0])
    for material in present:
        effect = make("material_reflectance", {"factor": 1.1, "material_id": int(material)})
        steps[f"reflectance of material {material}"] = (effect, REFLECTANCE_ERROR / 0.1)
    for name in ("yaw_deg", "pitch_deg"):
        settings = {"yaw_deg": 0.0, "pitch_deg": 0.0} | {name: 2.0 * POSE_ERROR_DEG}
        steps[name] = (make("boresight", settings), 0.5)
    found = {name: factor * _shift(simulator, effect) for name, (effect, factor) in steps.items()}
    found["sensor's height"] = _height(simulator)
    return found


def _shift(simulator: Simulator, effect: Effect) -> FloatArray:
    """Change of the summaries, not compressed, by an effect on top of the model's; paired seeds."""
    model = beside(simulator.model, effect)
    return np.asarray(
        np.mean(
            mapped(
                lambda k: simulator.summaries.plain(simulator.observations(model, k)) - simulator.plain_base(k),
                range(2),
            ),
            axis=0,
        )
    )


def _height(simulator: Simulator) -> FloatArray:
    """A sensor higher by h sees a surface as if it looked up by h / R: ranges change along the surface's slope."""
    observations = [simulator.observations(simulator.model, k) for k in range(2)]
    beams = simulator.beams
    turn_deg = np.rad2deg(HEIGHT_ERROR_M / np.maximum(beams.distance_m, 1.0))
    moved = np.clip(beams.slope_m_per_deg[:, 0] * turn_deg, -1.0, 1.0)
    shifts = []
    for one in observations:
        feature = one.feature.copy()
        feature[:, 0] += moved
        other = dataclasses.replace(one, feature=feature)
        shifts.append(simulator.summaries.plain(other) - simulator.summaries.plain(one))
    return np.asarray(np.mean(shifts, axis=0))
