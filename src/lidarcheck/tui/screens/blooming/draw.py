"""How the panes on the right side of Blooming are drawn."""

from __future__ import annotations

import textwrap
from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING

from lidarcheck.session.session import CURRENT
from lidarcheck.tui.engine import Known
from lidarcheck.tui.plots.plot import Plot
from lidarcheck.tui.screens.blooming.charts import curve_chart, profile_chart
from lidarcheck.tui.widgets.lines import line

if TYPE_CHECKING:
    from lidarcheck.formats.lut import Axis, LutTable
    from lidarcheck.tui.jobs.profiles import Shown

__all__ = ["LEAST", "draw_curve", "draw_fault", "draw_profile", "draw_words"]

LEAST = (40, 8)
"""Columns and lines that a plot needs to be of use."""


def draw_curve(pane: Plot, tables: Mapping[str, LutTable], at: int, axis: Axis) -> None:
    """The table as it is edited, first, and others by name, as the disk has it where that differs; row `at`."""
    pane.plot(curve_chart(tables, axis, at))


def draw_profile(
    pane: Plot,
    feature: str,
    sides: Mapping[str, Shown],
    where: str,
    axis: Axis,
    *,
    key: Hashable,
    state: str = CURRENT,
    known: Known | None = None,
) -> None:
    """A feature of a dataset, by side, what was measured first. `where`: at which distance; `key`: of the
    dataset; `state`: whether what is expected belongs to the table as it is shown; `known`: its number.
    """
    pane.plot(profile_chart(feature, sides, where, axis, key, known), state=state)


def draw_words(pane: Plot, words: str, title: str) -> None:
    """A line where there is no plot yet."""
    pane.show([line(f" {words}", "dim")], title=title)


def draw_fault(pane: Plot, words: str, title: str) -> None:
    """Why there is no plot."""
    pane.show([line(f" {text}", "bad") for text in textwrap.wrap(words, max(pane.size.width - 2, 20))], title=title)
