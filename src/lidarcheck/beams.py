"""What a scan says of its beams: which were fired, and whether its echoes lie where they point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IntArray, freeze

__all__ = ["ANOTHER_SENSOR", "NOT_READ", "BeamHistograms", "Fired", "Geometry"]


ANOTHER_SENSOR = "the beams are another sensor's"
"""How the note of a geometry begins whose columns are in other steps than the sensor's."""


class Geometry(NamedTuple):
    """How a file's X, Y, Z agree with its beams. `verdict`: `ok`, `warning` or `not checked`; `note`: of what, or why.

    Of the `rows` that were looked at so many could be `judged`, so many of these `passed`, and so many of all lie
    `outside` their bound.
    `unit_checked`: whether a RANGE beside X, Y, Z says that they are in metres. `yaw_checked`: not where columns do not
    repeat, since each is then turned onto its own.
    """

    verdict: str = "not checked"
    rows: int = 0
    judged: int = 0
    passed: int = 0
    outside: int = 0
    note: str = "the echoes were not read from a file"
    unit_checked: bool = False
    yaw_checked: bool = True


NOT_READ = Geometry()


@dataclass(frozen=True)
class BeamHistograms:
    """The photons that a sensor counts bin by bin: `layer`, `point` (m,) of beams, each once, `counts` (m, bins)."""

    layer: IntArray
    point: IntArray
    counts: FloatArray

    def __post_init__(self) -> None:
        freeze(self, dict.fromkeys(("layer", "point"), np.int32), len(self.layer))
        counts = np.ascontiguousarray(self.counts, dtype=np.float64)
        counts.flags.writeable = False
        object.__setattr__(self, "counts", counts)


@dataclass(frozen=True)
class Fired:
    """Beams that were fired, with an echo or without, each once a frame; columns of shape (n,), in any order.

    `frame`: of each, None where all are of one frame. `source`: who says that they were fired.
    """

    layer: IntArray
    point: IntArray
    frame: IntArray | None = None
    source: Literal["scan", "ideal", "sensor"] = "scan"

    def __post_init__(self) -> None:
        freeze(self, dict.fromkeys(("layer", "point"), np.int32), len(self.layer))
        freeze(self, {"frame": np.int64}, len(self.layer))

    def __len__(self) -> int:
        return len(self.layer)

    def of_frame(self, frame: int) -> Fired:
        """The beams that were fired in one frame."""
        if self.frame is None:
            return self
        own = self.frame == frame
        return Fired(self.layer[own], self.point[own], None, self.source)

    def has(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Which of these beams were fired, in any frame; shapes (m,)."""
        keys, asked = (
            np.asarray(a, dtype=np.int64) * 2**32 + np.asarray(b) for a, b in ((self.layer, self.point), (layer, point))
        )
        return np.isin(asked, keys)
