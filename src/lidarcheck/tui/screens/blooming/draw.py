"""How the panes on the right side of Blooming are drawn."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from lidarcheck.figures.data import Course, Curve
from lidarcheck.figures.pages.blooming_courses import profile_course, profile_curve, table_course
from lidarcheck.session.session import CURRENT
from lidarcheck.tui.widgets.lines import Lines, line

if TYPE_CHECKING:
    from lidarcheck.calibration.blooming.cells import Profile
    from lidarcheck.formats.lut import Axis, LutTable

__all__ = ["LEAST", "draw_curve", "draw_fault", "draw_profile", "draw_words"]

LEAST = (40, 8)
"""Columns and lines below which there is no plot."""


def draw_curve(pane: Lines, table: LutTable, saved: LutTable | None, at: int, axis: Axis, *, plain: bool) -> None:
    """The table as it is edited, as the disk has it where that differs, and the cursor in row `at`."""
    here = np.where(np.arange(len(table)) == at, table.y, np.nan)
    curves = [] if saved is None else [Curve("on disk", saved.x, saved.y)]
    curves += [Curve("table", table.x, table.y), Curve("cursor", table.x, here)]
    _show(pane, table_course("Curve", axis, curves), plain=plain)


def draw_profile(
    pane: Lines,
    feature: str,
    sides: Mapping[str, Profile | None],
    title: str,
    axis: Axis,
    *,
    plain: bool,
    state: str = CURRENT,
) -> None:
    """One of `FEATURES` of a dataset, by side: what was measured first; None for a side that is being computed.
    `state`: whether the other side belongs to the table as it is shown.
    """
    curves, real = [], next(iter(sides.values()))
    assert real is not None
    for name, side in sides.items():
        if side is None:
            curves.append(Curve("computing ...", real.offset, np.full(len(real.offset), np.nan)))
        else:
            curves.append(profile_curve(name, side, feature))
    _show(pane, profile_course(title, feature, axis, curves), plain=plain, state=state)


def draw_words(pane: Lines, words: str, title: str) -> None:
    """A line where there is no plot yet."""
    pane.show([line(f" {words}", "dim")], title=title)


def draw_fault(pane: Lines, words: str, title: str) -> None:
    """Why there is no plot."""
    pane.show([line(f" {text}", "bad") for text in textwrap.wrap(words, max(pane.size.width - 2, 20))], title=title)


def _show(pane: Lines, course: Course, *, plain: bool, state: str = CURRENT) -> None:
    from lidarcheck.figures.terminal import course_text

    width, height = pane.size.width, pane.rows
    if width < LEAST[0] or height < LEAST[1]:
        draw_words(pane, "no room for a plot here", course.title)
        return
    text = course_text(course, width=width, height=height, plain=plain)
    pane.show([line(row) for row in text.splitlines()], title=course.title, state=state)
