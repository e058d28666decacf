"""How the panes on the right side of Blooming are drawn."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from lidarcheck.tui.widgets.lines import Line, Lines, line

if TYPE_CHECKING:
    from lidarcheck.calibration.blooming.cells import Profile
    from lidarcheck.tui.screens.blooming.plots import BloomingPlots
    from lidarcheck.tui.screens.blooming.screen import Blooming

__all__ = ["FEATURES", "LEAST", "draw_curve", "draw_profile"]

FEATURES = ("AREA", "PEAK", "WIDTH", "range")
LEAST = (40, 8)
"""Columns and lines below which there is no plot."""
_UNITS = {"AREA": "AREA", "PEAK": "PEAK", "WIDTH": "WIDTH [ns]", "range": "range [m]"}
_OFFSET = {"vertical": "SPAD rows, upward", "horizontal": "columns of 0.05 deg, to the left"}


def draw_curve(view: Blooming, pane: Lines) -> None:
    """The table as it is edited, as the disk has it, and the cursor."""
    table, saved = view.table.table(), view.table.table(saved=True)
    if table is None or saved is None or view.table.session is None:
        return
    here = np.where(np.arange(len(table)) == view.table.at, table.y, np.nan)
    curves = [("on disk", saved.x, saved.y)] if view.table.session.dirty else []
    curves += [("table", table.x, table.y), ("cursor", table.x, here)]
    _show(view, pane, "Curve", curves, "Y", f"X [{_OFFSET[view.axis]}]", log=True)


def draw_profile(plots: BloomingPlots, pane: Lines, dataset: int, feature: int) -> None:
    """One feature of one dataset, measured and expected; or in words why there is none."""
    choice, name = plots.choice(dataset), FEATURES[feature]
    if choice is None:
        what = "no model" if plots.datasets else "no measured profile or scan"
        pane.show([line(f" {what} in this project", "dim")], title="Profile")
        return
    found = plots.found(choice)
    where = f"{dataset + 1}/{len(plots.datasets)} {choice.dataset.name}"
    if isinstance(found, str):
        pane.show(_wrapped(plots.view.host.inside(found), pane.size.width), title=where)
        return
    if found is None:
        pane.show([line(" reading ...", "dim")], title=where)
        return
    curves = [("real", found.real.offset, _column(found.real, name))]
    if name != "range" and plots.view.table.session is not None:
        expected = plots.expectation(choice)
        nothing = np.full(len(found.real.offset), np.nan)
        curves.append(
            ("computing ...", found.real.offset, nothing)
            if expected is None
            else ("expected", expected.offset, _column(expected, name))
        )
    several = not plots.four and len(plots.tiles()) > 1
    distance = f"{found.cells.distance_m:.1f} m"
    title = (
        f"{'<' + distance + '>' if several and dataset == plots.dataset else distance}, {where}, {choice.model.stem}"
    )
    label = f"offset [{_OFFSET[choice.axis]}]"
    _show(plots.view, pane, title, curves, _UNITS[name], label, log=name in ("AREA", "PEAK"))


def _wrapped(words: str, room: int) -> list[Line]:
    return [line(f" {text}", "bad") for text in textwrap.wrap(words, max(room - 2, 20))]


def _show(view: Blooming, pane: Lines, title: str, curves: Any, y_label: str, x_label: str, *, log: bool) -> None:
    from lidarcheck.figures.drawing.terminal import Series
    from lidarcheck.figures.drawing.terminal import curves as draw

    width, height = pane.size.width, pane.rows
    if width < LEAST[0] or height < LEAST[1]:
        pane.show([line(" no room for a plot here", "dim")], title=title)
        return
    text = draw(
        [Series(name, x, y) for name, x, y in curves],
        x_label=x_label, y_label=y_label, width=width, height=height, log_y=log, plain=view.app.theme == "plain",
    )  # fmt: skip
    pane.show([line(row) for row in text.splitlines()], title=title)


def _column(profile: Profile, name: str) -> Any:
    return profile.range_m if name == "range" else profile.value[:, ("PEAK", "AREA", "WIDTH").index(name)]
