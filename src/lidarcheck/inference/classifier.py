"""The second number of a gap: how well a classifier tells the measured echoes of frames from a model's.

What it is shown of a beam is what a stranger could use: where its echoes lie and how strong they are, beside what the
ideal scan says of the beam. It is asked by `kpi.classifier`; here frames are drawn, simulated and laid out in rows.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.cases.frame import Frame
from lidarcheck.inference.intervals import ClassifierGap
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.observed.beam_table import BeamTable, beams_of
from lidarcheck.inference.observed.coarse import amplitude_tells
from lidarcheck.kpi.classifier import classifier_gap, folds_of
from lidarcheck.kpi.lattice import piece_of
from lidarcheck.kpi.pairing import nearest_on_line
from lidarcheck.model.chain import simulate_frames
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Surfaces
from lidarcheck.scan import Scan
from lidarcheck.workers import Shared, WorkerPool

__all__ = ["COLUMNS", "Chance", "Classifier", "classifier_gaps"]

COLUMNS = (
    "range_off_m", "log_area", "log_peak", "width_ns", "echo_number", "distance_m", "material", "incidence_deg",
    "layer", "point", "log_strength_beside",
)  # fmt: skip
"""What the classifier is shown of each echo, and of each beam without one, whose echo's columns are NaN. Where nothing
is met, ranges are counted from the sensor; `material`: its number, or ln S where ideal scans come from repeats."""

MOST_BEAMS = 20_000
"""Of more, so many are drawn by whole columns: the figure no longer changes by more than its floor."""
_FLOOR_BEAMS = 5_000
"""The floor is taken on so many and scaled by the root of their number."""
_PAIRS, _OF_PAIRS = 20, 2.60
"""Pairs of seeds of the model, and the floor in their standard deviations: 1 % of further pairs lie above it."""
_FIRST, _FIRST_PAIR = 9700, 9800
"""Where the seeds begin: no fit, and no distance, uses any of them."""


@dataclass(frozen=True, slots=True)
class Chance:
    """The standard deviation of the figure between seeds of a model, times the root of the number of beams."""

    model: Model
    sd_of_root: float


@dataclass(frozen=True)
class Classifier:
    """Some frames as a classifier is shown them: the beams that were drawn, their folds, and what is known of them.

    `frames`, `surfaces`: in the order of the beams' frames. `drawn` (n_beams,) marks the beams that are shown; `fold`
    (n_beams,) is theirs, None where there are too few blocks; `known` (n_beams, 6) are the columns of a beam.
    """

    frames: tuple[Frame, ...]
    surfaces: tuple[Surfaces, ...]
    beams: BeamTable
    drawn: BoolArray
    fold: IndexArray | None
    known: FloatArray
    seed: int
    amplitude: bool = True
    """Whether the amplitude is shown."""

    @classmethod
    def of(cls, frames: Sequence[Frame], model: Model, seed: int, *, most: int = MOST_BEAMS) -> Classifier:
        """Of frames, the same for every model. `model` says what materials the beams meet."""
        beams = beams_of([f.ideal for f in frames], model)
        repeated = any(f.repeated for f in frames)
        lattice = [np.unique(number, return_inverse=True)[1] for number in (beams.layer, beams.point)]
        fold = folds_of(beams.frame, *lattice, repeated=repeated, piece=_pieces(beams, frames))
        drawn = _drawn(beams.column, most)
        surfaces = tuple(Surfaces(f.ideal) for f in frames)
        known = _known(beams, lattice, repeated=repeated)
        return cls(tuple(frames), surfaces, beams, drawn, fold, known, seed, amplitude_tells(frames, model))

    @functools.cached_property
    def shared(self) -> Shared[Classifier]:
        """This for the tasks of a worker pool."""
        return Shared(self)

    def __getstate__(self) -> dict[str, object]:
        """Without what is kept only to save time."""
        return {name: value for name, value in self.__dict__.items() if name != "shared"}

    def but_for(self, beams: BoolArray) -> Classifier:
        """The same without some beams, (n_beams,)."""
        return replace(self, drawn=self.drawn & ~beams)

    def gap(self, model: Model, nuisance: Nuisance | None = None, longer_m: FloatArray | None = None) -> float | None:
        """2 AUC - 1 between what was measured and what a model shows.

        `nuisance`: usual errors that are put right in the model; `longer_m` (n_beams,): by how much measured ranges of
        surfaces are longer for such errors, which is taken off.
        """
        if self.fold is None:
            return None
        one, other = [f.measured for f in self.frames], self._simulated(model, _FIRST, nuisance)
        return self._between(one, other, model, 0, longer_m)

    def floor(self, chance: Chance | None) -> float | None:
        """What chance makes of the figure on these frames' beams."""
        return None if chance is None else chance.sd_of_root / float(np.sqrt(self.drawn.sum())) * _OF_PAIRS

    def chance(self, model: Model, pool: WorkerPool | None = None) -> Chance | None:
        """How the figure scatters between pairs of a model's own seeds."""
        few = Classifier.of(self.frames, model, self.seed, most=_FLOOR_BEAMS)
        if few.fold is None:
            return None
        found = [*(pool or WorkerPool()).map(Classifier.pair, ((few.shared, model, k) for k in range(_PAIRS)))]
        return Chance(model, float(np.std(found, ddof=1) * np.sqrt(few.drawn.sum())))

    def pair(self, model: Model, k: int) -> float:
        """2 AUC - 1 between what a model shows with two seeds, the k-th pair of these."""
        one, other = (self._simulated(model, _FIRST_PAIR + 2 * k + i) for i in range(2))
        return self._between(one, other, model, 1 + k)

    def _simulated(self, model: Model, seed: int, nuisance: Nuisance | None = None) -> list[Scan]:
        nuisance = nuisance or Nuisance()
        run, posed = nuisance.posed(nuisance.model(model), self.surfaces)
        seed += self.seed << 16
        numbers = [f.number for f in self.frames]
        return simulate_frames([s.ideal for s in posed], run, seed=seed, frames=numbers, surfaces=posed)

    def _between(
        self,
        one: Sequence[Scan],
        other: Sequence[Scan],
        model: Model,
        dither: int,
        longer_m: FloatArray | None = None,
    ) -> float:
        """2 AUC - 1 between two samples of scans, the first the measured one."""
        assert self.fold is not None
        step_m = model.sensor.range_resolution_m
        sides = [self.rows(scans, step_m, [dither, side]) for side, scans in enumerate((one, other))]
        rows, beam = (np.concatenate(parts) for parts in zip(*sides, strict=True))
        measured = np.arange(len(rows)) < len(sides[0][0])
        if longer_m is not None:
            of_surface = measured & (np.abs(rows[:, 0]) <= self.beams.view.reach_m)
            rows[of_surface, 0] -= longer_m[beam[of_surface]]
        return classifier_gap(rows, measured, self.fold[beam])

    def rows(self, scans: Sequence[Scan], step_m: float, dither: Sequence[int]) -> tuple[FloatArray, IndexArray]:
        """What scans show of the drawn beams in `COLUMNS`, a row for each echo and for each beam without one, and the
        beam of each; ranges dithered by `step_m`, as how many digits a file has is no artefact of a sensor."""
        beams = self.beams
        scans, beam = beams.echoes_of(scans)
        names = ("range_m", "echo_number")
        range_m, number = (np.concatenate([np.asarray(getattr(scan, name)) for scan in scans]) for name in names)
        range_m = range_m - beams.range_offset_m[beam]
        surface = nearest_on_line(beams.hit_beam, beams.hit_m, beam, range_m)
        met_m = np.where(surface >= 0, np.append(beams.hit_m, 0.0)[np.maximum(surface, 0)], 0.0)
        rng = np.random.default_rng([0, *dither])
        off = range_m - met_m + step_m * (rng.random(len(beam)) - 0.5)
        amplitude, *others = beams.view.columns(scans)
        amplitude = amplitude if self.amplitude else np.zeros(len(amplitude))
        echoes = np.column_stack([off, amplitude, *others, number])
        shown = self.drawn[beam]
        lost = np.flatnonzero(self.drawn & (np.bincount(beam, minlength=len(beams)) == 0))
        every = np.concatenate([beam[shown], lost])
        nothing = np.full((len(lost), echoes.shape[1]), np.nan)
        return np.column_stack([np.concatenate([echoes[shown], nothing]), self.known[every]]), every


def classifier_gaps(
    classifier: Classifier, before: Model, after: Model, chance: Chance | None = None, pool: WorkerPool | None = None
) -> ClassifierGap:
    """The figure with the case's model and with the explained one, and its floor, which is the latter's.

    `chance`: of some model, if it is known already; it is taken again where that is another one.
    """
    pool = pool or WorkerPool()
    if classifier.fold is None:
        return ClassifierGap()
    models = [before] if after == before else [before, after]
    found = [*pool.map(Classifier.gap, ((classifier.shared, model) for model in models))]
    if chance is None or chance.model != after:
        chance = classifier.chance(after, pool)
    return ClassifierGap(found[0], found[-1], classifier.floor(chance))


def _drawn(column: IndexArray, most: int) -> BoolArray:
    """The beams of whole columns drawn at random, at most so many in all but for the first column."""
    sizes = np.bincount(column)
    order = np.random.default_rng(0).permutation(len(sizes))
    count = max(int(np.searchsorted(np.cumsum(sizes[order]), most, side="right")), 1)
    taken = np.zeros(len(sizes), dtype=bool)
    taken[order[:count]] = True
    return taken[column]


def _pieces(beams: BeamTable, frames: Sequence[Frame]) -> IndexArray | None:
    """The piece of its frame that each beam lies in, (n_beams,); None where beams have a lattice."""
    if all(frame.ideal.beams.lattice for frame in frames):
        return None
    found, points = np.zeros(len(beams), dtype=np.int64), int(beams.point.max(initial=0)) + 1
    for i, frame in enumerate(frames):
        rows = beams.frame == i
        found[rows] = piece_of(frame.ideal.beams, beams.layer[rows], beams.point[rows], points)
    return found


def _known(beams: BeamTable, lattice: Sequence[IndexArray], *, repeated: bool) -> FloatArray:
    """The columns of a beam, shape (n_beams, 6).

    Of repeats, distance and signal are those of the beams beside: a beam's own have the error of its estimate in them,
    which its residuals have too, and where a scene is even that error can be read off.
    """
    beside = np.log1p(_strongest_beside(beams, *lattice))
    met: tuple[FloatArray | IndexArray, ...] = (beams.distance_m, beams.material_id)
    if repeated:
        met = tuple(_mean_beside(beams, c, *lattice) for c in (beams.distance_m, np.log1p(beams.signal)))
    return np.column_stack([*met, beams.incidence_deg, beams.layer, beams.point, beside]).astype(np.float64)


def _mean_beside(beams: BeamTable, values: FloatArray, row: IndexArray, column: IndexArray) -> FloatArray:
    """The mean over those of the four beams beside each that meet something, (n_beams,); its own where none does."""
    shape = (int(beams.frame.max()) + 1, int(row.max()) + 3, int(column.max()) + 3)
    grid, met = np.zeros(shape), np.zeros(shape)
    there = beams.distance_m > 0.0
    at = beams.frame, row + 1, column + 1
    grid[at], met[at] = np.where(there, values, 0.0), there
    sides = ((2, 1), (0, 1), (1, 2), (1, 0))
    total, count = (sum(a[beams.frame, row + up, column + left] for up, left in sides) for a in (grid, met))
    return np.where(count > 0, total / np.maximum(count, 1.0), values)


def _strongest_beside(beams: BeamTable, row: IndexArray, column: IndexArray) -> FloatArray:
    """The largest S of the four beams beside each on the fired lattice, shape (n_beams,)."""
    grid = np.zeros((int(beams.frame.max()) + 1, int(row.max()) + 3, int(column.max()) + 3))
    grid[beams.frame, row + 1, column + 1] = beams.signal
    sides = ((2, 1), (0, 1), (1, 2), (1, 0))
    return np.asarray(np.max([grid[beams.frame, row + up, column + left] for up, left in sides], axis=0))
