"""What the hand does in the plots of Blooming: it goes to a row, drags a row's Y, or asks what a point stands for."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from lidarcheck.formats.lut_scale import scaled_of_y
from lidarcheck.tui.plots.look import Look
from lidarcheck.tui.plots.readout import Reading
from lidarcheck.tui.screens.blooming.panes import BloomingPanes
from lidarcheck.tui.screens.blooming.plots import BloomingPlots
from lidarcheck.tui.screens.blooming.table import TableEditor

__all__ = ["connect"]


def connect(panes: BloomingPanes, plots: BloomingPlots, table: TableEditor, draw: Callable[[], object]) -> None:
    """Have the plots tell the table. All tiles look at a dataset alike, in whichever of them it is. `draw`: of the
    screen, for another row.
    """
    looks: dict[Hashable, Look] = {}
    for pane in (panes.curve_pane(), *panes.all_tiles()):
        pane.looks, pane.when_said = looks, panes.say
        pane.when_entered = lambda reading: panes.say(_beams_in_words(plots, reading))
    curve = panes.curve_pane()

    def go(reading: Reading) -> None:
        if reading.point is not None:
            table.at = min(reading.point, max(table.count() - 1, 0))
            draw()
            panes.say(f"row {table.at + 1}: {table.under_cursor()}")

    def drag(row: int, y: float, done: bool) -> None:
        now = table.table()
        if now is None or table.file is None or not row < len(now):
            return
        scaled, before = max(scaled_of_y(y), 1), now.rows()[row]
        table.at, plots.wanted = row, None
        if done:
            if scaled != before.scaled:
                table.edit(lambda file: file.set(table.axis, [row], str(scaled)))
            draw()
        else:
            plots.wanted = table.file.current.with_scaled(table.axis, row, scaled).tables[table.axis]
            panes.say(f"row {row + 1} X {before.x:g}: {before.scaled} to {scaled}, Y {plots.wanted.rows()[row].y:.4g}")
        plots.redraw_curve()

    curve.when_entered, curve.when_dragged = go, drag


def _beams_in_words(plots: BloomingPlots, reading: Reading) -> str:
    """The beams that a point of a profile stands for."""
    shown = plots.shown()
    words = f"{reading.trace.name} at offset {reading.x:g}: {reading.text}"
    if shown is None or reading.point is None or reading.point >= len(shown.real.echoes):
        return words
    where = "on the target" if shown.real.on_target[reading.point] else "beside the target"
    return f"{words}, {shown.real.echoes[reading.point]} echoes {where}, measured"
