"""What a plot shows, as data: traces on two axes. It knows nothing of cells, so that a chart outlives a resize."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.tui.plots.colours import PlotRole
from lidarcheck.tui.plots.transform import Scale

__all__ = ["MOST_TRACES", "Chart", "Form", "Strip", "Trace", "value_text"]

MOST_TRACES = 8
Form = Literal["solid", "open", "dots", "dashes", "points", "filled", "outline"]
"""`solid` a line; `open` an `o` every sixth column, joined by dashes; `dots` one in four; `dashes`; `points` alone;
`filled` and `outline`: of a histogram, whose `x` are the edges of its bins.
"""


@dataclass(frozen=True)
class Trace:
    """`y` over `x` as in the data, shapes (n,), NaN for a gap; of a histogram `x` has n + 1 edges.

    `role`: what it is, which says its colour. `low`, `high`: an interval about y. `counts`: of a histogram, how many
    values each bin holds. `letter`: its mark where a cell is one character; by form where empty.
    """

    name: str
    x: FloatArray
    y: FloatArray
    role: PlotRole = "real"
    form: Form = "solid"
    low: FloatArray | None = None
    high: FloatArray | None = None
    counts: FloatArray | None = None
    letter: str = ""

    @property
    def is_histogram(self) -> bool:
        """Whether x are edges of bins."""
        return self.form in ("filled", "outline")

    @property
    def places(self) -> FloatArray:
        """The x of each value; of a histogram the middle of its bin."""
        return np.asarray(0.5 * (self.x[:-1] + self.x[1:])) if self.is_histogram else self.x


@dataclass(frozen=True)
class Strip:
    """A row of marks below the data, one a column: how far two traces are apart, over their x.

    `y`: shape (n,), NaN for none; `far`: where that is beyond chance. `reach`: what the strip's upper end stands for.
    `words`: what it shows, above it. `unit`: behind its numbers, as `x` of a ratio.
    """

    words: str
    x: FloatArray
    y: FloatArray
    far: np.ndarray = field(repr=False)
    scale: Scale = "lin"
    reach: float = 3.0
    unit: str = ""


@dataclass(frozen=True)
class Chart:
    """Traces on two axes. `key`: what is looked at: zoom, cursor and scales of a chart are kept for its key.

    `own_ticks`: the x axis has the data's own values as ticks. `at`: the point (trace, index) that another pane is at.
    `drag`: the trace whose points the mouse may move.
    `equal`: both axes are lengths, to be seen on one scale. `compared`: how the readout compares the first two traces,
    by their difference or their ratio.
    """

    key: Hashable
    title: str
    x_label: str
    y_label: str
    traces: tuple[Trace, ...]
    x_scale: Scale = "lin"
    y_scale: Scale = "lin"
    own_ticks: bool = False
    at: tuple[int, int] | None = None
    drag: int | None = None
    equal: bool = False
    compared: Literal["difference", "ratio", ""] = ""
    strip: Strip | None = None
    y_names: tuple[str, ...] = ()

    def xs(self) -> FloatArray:
        """All x of all traces."""
        return np.concatenate([np.empty(0), *(np.asarray(trace.x, dtype=np.float64).ravel() for trace in self.traces)])

    def ys(self) -> FloatArray:
        """All y of all traces, with their intervals."""
        parts = [np.empty(0)]
        for trace in self.traces:
            parts += [
                np.asarray(v, dtype=np.float64).ravel() for v in (trace.y, trace.low, trace.high) if v is not None
            ]
        return np.concatenate(parts)


def value_text(value: float) -> str:
    """A number as readouts have it: four digits, no more than the eye can use."""
    return "-" if not np.isfinite(value) else f"{value:.4g}"
