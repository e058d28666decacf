"""One of several ways to simulate the beams of a chunk, and those that it is for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.model.exact.pulses import Pulses
from lidarcheck.model.streams import Stream

__all__ = ["Spaces", "Way"]


class Way(NamedTuple):
    """`law`: what the functions must know of the sensor besides its numbers, behind which it stands. `new_space`: what
    a thread works in. `simulate`: beams into echoes, see `exact.kernel.simulate_beams`. `pays`: for which backgrounds,
    avalanches per armed SPAD and bin; None for all.
    """

    law: tuple[Any, ...]
    new_space: Callable[..., Any]
    simulate: Callable[..., None]
    pays: Callable[..., npt.NDArray[np.bool_]] | None = None


class Spaces:
    """The ways of a frame, and their work spaces, which threads share: one is taken out while it is in use."""

    def __init__(self, *ways: Way) -> None:
        self.ways = ways
        self._idle: dict[tuple[int, int], list[Any]] = {}

    def simulate(
        self,
        numbers: Numbers,
        stream: Stream,
        beams: npt.NDArray[np.uint64],
        per_bin: FloatArray,
        pulses: Pulses,
        order: IndexArray,
        echoes: EchoArrays,
    ) -> None:
        """Simulate the beams in `order`, each by the first way that pays."""
        for n, way in enumerate(self.ways):
            pays = None if way.pays is None else way.pays(numbers, *way.law, per_bin[order])
            rows = order if pays is None else order[pays]
            if len(rows) > 0:
                # `pop` and `append` are each one step, between which no other thread comes.
                idle = self._idle.setdefault((n, numbers.threshold), [])
                try:
                    space = idle.pop()
                except IndexError:
                    space = way.new_space(numbers, *way.law)
                way.simulate(numbers, *way.law, stream, beams, per_bin, pulses, rows, space, echoes)
                idle.append(space)
            order = order[:0] if pays is None else order[~pays]
