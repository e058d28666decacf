"""The gap on columns spread over the frames, whole: what `explain` measures, on few beams.

A beam's light may come from any other beam, so that the frame's light is found whole, and only then cut. Strata and
spreads are those of the model that the session began with, so that two models are measured alike.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.calibration.number.frames import Frames
from lidarcheck.calibration.number.light import Keys, Lights, keys_of, lights_of
from lidarcheck.calibration.number.models import said_of
from lidarcheck.calibration.number.number import Number
from lidarcheck.inference.observed.beam_table import beams_of
from lidarcheck.inference.observed.observations import Observations, observations_of
from lidarcheck.inference.wasserstein import EXPECTATION_SEEDS, FIRST_EXPECTATION, PARTS, Scale, by_chance
from lidarcheck.model.spec import Model
from lidarcheck.scan import Scan

__all__ = ["Spread"]

MOST_BEAMS = 20_800
"""So many beams are looked at, by whole columns: every 24th of one frame of the reference sensors."""
_BLOCKS = 12
"""Blocks of neighbouring columns, each of which is left out in turn."""
_FLOORS = 4
"""Seeds that are each held against the others: what a model's own noise makes of the distance."""


@dataclass(frozen=True)
class Spread:
    """Columns of some frames, ready to be compared. `keys`: their beams, ascending, of each frame."""

    data: Frames
    keys: tuple[Keys, ...]
    scale: Scale
    key: str

    @classmethod
    def of(cls, data: Frames, start: Model, seed: int, *, all_columns: bool = False) -> Spread:
        """The columns of some frames, or all of them, in the strata and spreads of a model."""
        keys = tuple(_spread(data, None if all_columns else MOST_BEAMS))
        whole = beams_of([frame.ideal for frame in data.frames], start)
        mine = np.zeros(len(whole), dtype=bool)
        for i, some in enumerate(keys):
            mine |= (whole.frame == i) & np.isin(keys_of(whole.layer, whole.point), some)
        beams = whole if mine.all() else whole.without(~mine)
        seeds = [(seed << 16) + FIRST_EXPECTATION + k for k in range(EXPECTATION_SEEDS)]
        lights = lights_of(data, start, seeds, keys)
        runs = [observations_of(beams, lights.scans(k)) for k in range(len(seeds))]
        scale = Scale.on(data.frames, data.surfaces, beams, runs, start, seed)
        key = hashlib.sha256(repr((data.key, said_of(start), seed, all_columns)).encode()).hexdigest()
        return cls(data, keys, scale, key)

    @cached_property
    def measured(self) -> Observations:
        """What was measured of these columns."""
        return self.seen([f.measured for f in self.data.frames])

    def lights(self, model: Model, seeds: Sequence[int]) -> Lights:
        """What these columns get with a model."""
        return lights_of(self.data, model, seeds, self.keys)

    def seen(self, scans: Sequence[Scan]) -> Observations:
        """What is seen of them in scans of all frames."""
        return observations_of(self.scale.beams, scans)

    def number(
        self, seen: Sequence[Observations], others: Sequence[Observations], *, simulated: str, sample: str
    ) -> Number:
        """The number of what a model shows with some seeds; `others`: with further ones, which tell its own noise.

        Without others each of some seeds is held against the rest of them.
        """
        own = [self.scale.distance(one, seen) for one in others] or [
            self._rest(seen, k) for k in range(min(_FLOORS, len(seen)))
        ]
        noise, chance = np.mean(own, axis=0), by_chance(np.array(own))
        weights, words = self._weights
        beyond = np.abs(self.scale.distances(self.measured, seen, weights) - noise)
        names = self.scale.beams.view.names
        parts = {names.get(part, part): float(at) for part, at in zip(PARTS, beyond[0], strict=True)}
        parts.pop("", None)  # features that the sensor has not
        return Number(
            "gap", float(beyond[0].mean()), float(chance.mean()), parts, sample, beyond[1:].mean(axis=1), words,
            self.key, simulated, noise=float(noise.mean()),
        )  # fmt: skip

    def _rest(self, seen: Sequence[Observations], k: int) -> FloatArray:
        return self.scale.distance(seen[k], [*seen[:k], *seen[k + 1 :]])

    @cached_property
    def _weights(self) -> tuple[list[FloatArray], str]:
        """The beams' weights: all alike, and without each block of columns; and what the blocks are called."""
        block = self._blocks()
        count = int(block.max()) + 1
        weights = [np.ones(len(block)), *((block != k).astype(np.float64) for k in range(count))]
        columns = int(self.scale.beams.column.max()) + 1
        return weights, f"{count} blocks of {columns} columns"

    def _blocks(self) -> IndexArray:
        column = self.scale.beams.column
        columns = int(column.max()) + 1
        return np.asarray(column * min(_BLOCKS, columns) // columns)


def _spread(data: Frames, most: int | None) -> list[Keys]:
    """The beams of columns spread over each frame, `most` in all; of each frame other columns."""
    fired = [np.unique(keys_of(frame.ideal.layer, frame.ideal.point)) for frame in data.frames]
    if most is None:
        return fired
    step = max(round(sum(map(len, fired)) / most), 1)
    found = []
    for i, keys in enumerate(fired):
        columns, of = np.unique(keys & 0xFFFFFFFF, return_inverse=True)
        first = (step // 2 + i * step // len(fired)) % step
        # A frame of few columns gives one at least.
        found.append(keys[(np.arange(len(columns)) % step == min(first, len(columns) - 1))[of]])
    return found
