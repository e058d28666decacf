"""How the panes on the right side of Blooming are drawn."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from lidarcheck.tui.widgets.lines import Lines, line

if TYPE_CHECKING:
    from lidarcheck.calibration.blooming.cells import Profile
    from lidarcheck.formats.lut import Axis, LutTable

__all__ = ["FEATURES", "LEAST", "draw_curve", "draw_fault", "draw_profile", "draw_words"]

FEATURES = ("AREA", "PEAK", "WIDTH", "range")
LEAST = (40, 8)
"""Columns and lines below which there is no plot."""
_UNITS = {"AREA": "AREA", "PEAK": "PEAK", "WIDTH": "WIDTH [ns]", "range": "range [m]"}
_OFFSET = {"vertical": "SPAD rows, upward", "horizontal": "columns of 0.05 deg, to the left"}


def draw_curve(pane: Lines, table: LutTable, saved: LutTable | None, at: int, axis: Axis, *, plain: bool) -> None:
    """The table as it is edited, as the disk has it where that differs, and the cursor in row `at`."""
    here = np.where(np.arange(len(table)) == at, table.y, np.nan)
    curves = [] if saved is None else [("on disk", saved.x, saved.y)]
    curves += [("table", table.x, table.y), ("cursor", table.x, here)]
    _show(pane, "Curve", curves, "Y", f"X [{_OFFSET[axis]}]", log=True, plain=plain)


def draw_profile(
    pane: Lines, feature: str, sides: Mapping[str, Profile | None], title: str, axis: Axis, *, plain: bool
) -> None:
    """One of `FEATURES` of a dataset, by side: what was measured first; None for a side that is being computed."""
    curves, real = [], next(iter(sides.values()))
    assert real is not None
    for name, side in sides.items():
        if side is None:
            curves.append(("computing ...", real.offset, np.full(len(real.offset), np.nan)))
        else:
            curves.append((name, side.offset, _column(side, feature)))
    label = f"offset [{_OFFSET[axis]}]"
    _show(pane, title, curves, _UNITS[feature], label, log=feature in ("AREA", "PEAK"), plain=plain)


def draw_words(pane: Lines, words: str, title: str) -> None:
    """A line where there is no plot yet."""
    pane.show([line(f" {words}", "dim")], title=title)


def draw_fault(pane: Lines, words: str, title: str) -> None:
    """Why there is no plot."""
    pane.show([line(f" {text}", "bad") for text in textwrap.wrap(words, max(pane.size.width - 2, 20))], title=title)


def _show(pane: Lines, title: str, curves: Any, y_label: str, x_label: str, *, log: bool, plain: bool) -> None:
    from lidarcheck.figures.drawing.terminal import Series
    from lidarcheck.figures.drawing.terminal import curves as draw

    width, height = pane.size.width, pane.rows
    if width < LEAST[0] or height < LEAST[1]:
        draw_words(pane, "no room for a plot here", title)
        return
    text = draw(
        [Series(name, x, y) for name, x, y in curves],
        x_label=x_label, y_label=y_label, width=width, height=height, log_y=log, plain=plain,
    )  # fmt: skip
    pane.show([line(row) for row in text.splitlines()], title=title)


def _column(profile: Profile, name: str) -> Any:
    return profile.range_m if name == "range" else profile.value[:, ("PEAK", "AREA", "WIDTH").index(name)]
