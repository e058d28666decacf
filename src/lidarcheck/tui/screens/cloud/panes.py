"""What the panes of Cloud say: both sides as points, and where they differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.calibration.scenes.slices import slices_of
from lidarcheck.tui.jobs.clouds import Clouds
from lidarcheck.tui.screens.cloud.density import (
    SIDES,
    Side,
    Window,
    class_words,
    classes,
    cloud_lines,
    counts,
    over_lines,
    with_axes,
)
from lidarcheck.tui.widgets.lines import Line, line, wrapped

if TYPE_CHECKING:
    from lidarcheck.scan import Scan

__all__ = ["VIEWS", "Points", "Seen", "View", "beams_at", "difference_lines", "points_of", "views_of", "xyz_of"]


@dataclass(frozen=True)
class View:
    """What is looked at: the whole frame, or the vehicle in it, from one of `SIDES`; `merged`: in one cloud."""

    frame: bool
    side: str
    merged: bool = False

    @property
    def words(self) -> str:
        """As titles have it."""
        what = "frame " if self.frame else "merged, " if self.merged else ""
        return f"{what}{SIDES[self.side].words}"


VIEWS = (
    View(False, "above"),
    View(False, "behind"),
    View(False, "side"),
    View(False, "above", merged=True),
    View(True, "above"),
    View(True, "behind"),
    View(True, "side"),
)


def views_of(clouds: Clouds | None) -> tuple[View, ...]:
    """The views that there are: without a vehicle those of the whole frame."""
    vehicle = clouds is not None and clouds.at is not None
    return VIEWS if vehicle else tuple(view for view in VIEWS if view.frame)


@dataclass(frozen=True)
class Points:
    """Positions of both sides [m], shapes (n, 3); simulated None where there is none."""

    real_m: FloatArray
    simulated_m: FloatArray | None

    @property
    def sides(self) -> list[FloatArray]:
        """Those that there are."""
        return [self.real_m] if self.simulated_m is None else [self.real_m, self.simulated_m]


def points_of(clouds: Clouds, view: View, moved_m: FloatArray | None) -> Points:
    """The points that a view shows; `moved_m`: of a merged one the simulated vehicle where it was moved to."""
    if not view.frame and clouds.at is not None:
        real, simulated = clouds.at.clouds
        return Points(real, moved_m if view.merged and moved_m is not None else simulated)
    return Points(xyz_of(clouds.real), None if clouds.simulated is None else xyz_of(clouds.simulated))


def xyz_of(scan: Scan) -> FloatArray:
    """Positions, shape (n, 3) [m]."""
    return np.stack([scan.x_m, scan.y_m, scan.z_m], axis=-1)


class Seen:
    """Both sides of a view in a window, counted: one scale of marks for both."""

    def __init__(self, points: Points, side: Side, window: Window, size: tuple[int, int]) -> None:
        self.points, self.side, self.window, self.size = points, side, window, size
        self.real, *rest = (counts(side.places(one), window, size) for one in points.sides)
        self.simulated: IndexArray | None = rest[0] if rest else None
        self.limits = classes(self.real, *rest)

    def lines(self, which: str, cursor: tuple[int, int] | None) -> list[Line]:
        """The lines of a pane: `real`, `simulated` or `over`."""
        if which == "over" and self.simulated is not None:
            cells = over_lines(self.real, self.simulated)
        else:
            count = self.simulated if which == "simulated" else self.real
            assert count is not None
            cells = cloud_lines(count, self.limits, "now" if which == "simulated" else "real")
        return with_axes(cells, self.window, self.side, cursor)

    def legend(self, over: bool) -> str:
        """What the marks stand for."""
        return "# real  o simulated  % both" if over and self.simulated is not None else class_words(self.limits)

    def at(self, cell: tuple[int, int]) -> tuple[int, int | None]:
        """How many echoes a cell has, real and simulated."""
        column, row = cell
        if not (0 <= column < self.size[0] and 0 <= row < self.size[1]):
            return 0, None if self.simulated is None else 0
        return int(self.real[row, column]), None if self.simulated is None else int(self.simulated[row, column])


def difference_lines(points: Points, sd_words: str, width: int, most: int) -> list[Line]:
    """Slices whose counts differ most; `sd_words`: what stands instead where there is nothing to compare with."""
    if points.simulated_m is None:
        return wrapped(sd_words, width, "bad")
    found = slices_of(points.real_m, points.simulated_m)[: max(most, 0)]
    return [line(f" {one.words():<25} {one.real:>9} {one.simulated:>11} {one.off_sd:>7.1f} sd") for one in found]


def beams_at(scan: Scan, own: BoolArray) -> str:
    """The beams of some echoes, in words."""
    layers, points = scan.layer[own], scan.point[own]
    if not len(layers):
        return "none"
    return f"layer {_span(layers.tolist())}, point {_span(points.tolist())}"


def _span(values: Sequence[int]) -> str:
    low, high = min(values), max(values)
    return str(low) if low == high else f"{low}-{high}"
