"""What an effect may look at to say where a search for it begins, and how far it is from what was measured.

The core that explains satisfies these; effects know no more of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.base import Effect
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Sensor

__all__ = ["AREA", "RANGE", "BeamTable", "Dimming", "Evidence", "Expected", "Observations", "Replays"]


RANGE, AREA = 0, 1
"""The columns of `feature`, `mean` and `spread` that hold the range residual [m] and ln AREA."""


class BeamTable(Protocol):
    """What the beams of all frames meet without effects, a row a beam; see `inference.beam_table`."""

    def __len__(self) -> int: ...

    @property
    def frame(self) -> IndexArray:
        """The frame's place among the frames, (n,)."""

    @property
    def layer(self) -> IndexArray:
        """The beam's layer, (n,)."""

    @property
    def point(self) -> IndexArray:
        """The beam's point column, (n,)."""

    @property
    def distance_m(self) -> FloatArray:
        """The nearest surface, 0 where the beam meets nothing, (n,)."""

    @property
    def material_id(self) -> IndexArray:
        """What it is made of, -1 for nothing, (n,)."""

    @property
    def object_id(self) -> IndexArray:
        """Which object it is of, -1 for none, (n,)."""

    @property
    def incidence_deg(self) -> FloatArray:
        """The angle to its normal, (n,)."""

    @property
    def retro(self) -> BoolArray:
        """Whether it is a retro-reflector, (n,)."""

    @property
    def crease(self) -> BoolArray:
        """Whether it meets another one, so that a pose a little off changes which of them is met, (n,)."""

    @property
    def slope_m_per_deg(self) -> FloatArray:
        """Change of the range with elevation and azimuth, (n, 2)."""


class Observations(Protocol):
    """What scans show of each beam; see `inference.observations`."""

    @property
    def detected(self) -> BoolArray:
        """Beams whose surface has an echo, (n,)."""

    @property
    def feature(self) -> FloatArray:
        """That echo's range residual [m], ln AREA, ln PEAK and WIDTH [ns], (n, 4)."""

    @property
    def extra_beam(self) -> IndexArray:
        """The beams of the other echoes, (m,)."""

    @property
    def extra_area(self) -> FloatArray:
        """Their ln AREA, (m,)."""

    @property
    def extra_side(self) -> IndexArray:
        """The side on which a neighbour's surface is at their range, -1 for none, (m,)."""


class Expected(Protocol):
    """What the case's own model shows of each beam; see `inference.expectation`."""

    @property
    def probability(self) -> FloatArray:
        """How often the surface is detected, (n,)."""

    @property
    def mean(self) -> FloatArray:
        """The features' means, (n, 4)."""

    @property
    def spread(self) -> FloatArray:
        """Their standard deviations, (n, 4)."""

    @property
    def known(self) -> BoolArray:
        """Whether these are known, (n,)."""

    @property
    def at_edge(self) -> BoolArray:
        """Beams beside which there is another surface, or nothing, (n,)."""


@dataclass(frozen=True)
class Dimming:
    """Per beam the ln gain that its echo asks for, and the weight of that; shape (n,)."""

    log_gain: FloatArray
    weight: FloatArray

    def mean(self, group: IndexArray, count: int) -> tuple[FloatArray, FloatArray]:
        """Weighted mean of each group and its weight; groups below 0 take no part."""
        used = group >= 0
        weight = np.bincount(group[used], self.weight[used], count)
        total = np.bincount(group[used], (self.weight * self.log_gain)[used], count)
        return total / np.maximum(weight, 1e-9), weight.astype(np.float64)


class Evidence(Protocol):
    """Some frames against a model: what they show, and what the model shows of them."""

    @property
    def sensor(self) -> Sensor:
        """The model's sensor."""

    @property
    def ideals(self) -> Sequence[IdealScan]:
        """The ideal scans of the frames."""

    @property
    def beams(self) -> BeamTable:
        """What the beams meet."""

    @property
    def measured(self) -> Observations:
        """What was measured."""

    @property
    def expected(self) -> Expected:
        """What the model shows."""

    def rows_of(self, frame: int, layer: npt.ArrayLike, point: npt.ArrayLike) -> IndexArray:
        """The places of a frame's beams in the table, -1 for those that are left out, (n,)."""

    def dimming(self, shown: Sequence[Observations] | None = None) -> Dimming:
        """The gain that each beam's echo asks for beyond what the model shows, or beyond some simulations."""


class Replays(Protocol):
    """Some frames beam by beam with a model that explains them, in which one effect can be replaced."""

    @property
    def sensor(self) -> Sensor:
        """The model's sensor."""

    @property
    def beams(self) -> BeamTable:
        """What the beams meet."""

    @property
    def measured(self) -> Observations:
        """What was measured."""

    def looks(
        self, effects: Sequence[Effect], seeds: int, look: Callable[[BeamTable, Observations], FloatArray]
    ) -> list[list[FloatArray]]:
        """What `look`, a function of a module, says of simulations with each of the effects; a list a seed."""
