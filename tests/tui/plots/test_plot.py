"""The plot under the hand: readout, zoom and pan by keys and by mouse, hidden curves, points that are dragged."""

import asyncio
import re

import numpy as np
from textual.app import App
from textual.events import MouseDown, MouseMove, MouseScrollDown, MouseScrollUp, MouseUp

import tui_kit
from lidarcheck.tui.plots.chart import Chart, Trace
from lidarcheck.tui.plots.plot import Plot
from lidarcheck.tui.widgets.themes import THEMES, textual_themes

X = np.arange(0.0, 41.0)
REAL, NOW = 100.0 + X, 100.0 + 1.5 * X
LEFT, TITLE = 6, 1


def chart(**how):
    traces = (Trace("real", X, REAL), Trace("now", X, NOW, "now", "open"))
    return Chart("k", "AREA", "offset", "", traces, compared="difference", **how)


class Bench(App):
    marks = "braille"

    def __init__(self, shown):
        super().__init__()
        self.shown, self.said, self.entered, self.dragged = shown, [], [], []

    def compose(self):
        yield Plot("Curve", id="plot")

    def on_mount(self):
        for theme in textual_themes():
            self.register_theme(theme)
        self.theme = THEMES[0]
        plot = self.query_one(Plot)
        plot.when_said = self.said.append
        plot.when_entered = self.entered.append
        plot.when_dragged = lambda *what: self.dragged.append(what)
        plot.focus()
        self.call_after_refresh(plot.plot, self.shown)


def on_plot(do, shown=None, size=(60, 16)):
    async def session():
        app = Bench(shown or chart())
        async with app.run_test(size=size) as pilot:
            plot = app.query_one(Plot)
            await tui_kit.until(pilot, lambda: plot.drawn is not None)
            await do(app, pilot, plot)

    asyncio.run(session())


async def seen(pilot, plot, true=lambda: True):
    """Wait until what was asked for last is drawn."""
    await tui_kit.until(pilot, lambda: plot._timer is None and true(), lambda: plot.text)


def readout(plot):
    return plot.text.splitlines()[-1].strip()


def test_the_readout_says_the_data_and_the_difference_and_enter_names_the_point():
    async def do(app, pilot, plot):
        assert "offset" in readout(plot)
        await pilot.press("right", "right", "l", "left")
        await seen(pilot, plot, lambda: "at 21" in readout(plot))
        at = int(plot.look.cursor)
        assert readout(plot).endswith(f"at {at}: real {REAL[at]:g}, now {NOW[at]:g}, diff {REAL[at] - NOW[at]:+.3g}")
        await pilot.press("space", "right", "right")
        await seen(pilot, plot, lambda: f"from {at}: dx +2" in readout(plot))
        apart = np.sqrt(np.mean((REAL - NOW)[at : at + 3] ** 2))
        assert f"dx +2, rms {apart:.3g} over 3" in readout(plot)
        await pilot.press("down", "enter")
        assert (app.entered[-1].trace.name, app.entered[-1].point) == ("now", at + 2)
        await pilot.press("1")
        await seen(pilot, plot, lambda: "real 1" not in readout(plot))
        await pilot.press("2", "9")  # the last curve stays
        assert plot.look.hidden == {"real"}
        await pilot.press("3")
        assert app.said == ["there are 2 curves"]

    on_plot(do, size=(100, 16))


def test_zoom_pan_and_scales_by_keys_and_all_is_as_it_was():
    async def do(app, pilot, plot):
        first, whole = plot.text, plot.drawn.axes
        await pilot.press("right", "plus", "plus")
        await seen(pilot, plot, lambda: plot.look.zoomed and plot.drawn.zoom > 3.9)
        assert " x 4" in tui_kit.text_of(app).splitlines()[0]
        x = plot.drawn.axes[0]
        assert x.cell(plot.look.cursor) is not None
        await pilot.press("shift+right")
        await seen(pilot, plot, lambda: plot.drawn.axes[0].span != x.span)
        assert plot.drawn.axes[0].span[0] > x.span[0]
        await pilot.press(*["right"] * 15)  # beyond the edge what is seen goes with it
        await seen(pilot, plot, lambda: plot.drawn.axes[0].cell(plot.look.cursor) is not None)
        spans = [axis.span for axis in plot.drawn.axes]
        # An edit, another size and back: zoom and cursor stay.
        cursor = plot.look.cursor
        plot.plot(chart(at=(0, 3)))
        await pilot.resize_terminal(120, 30)
        await pilot.resize_terminal(60, 16)
        await seen(pilot, plot, lambda: plot.drawn.axes[0].cells == 54)
        assert [axis.span for axis in plot.drawn.axes] == spans
        assert plot.look.cursor == cursor
        await pilot.press("0")
        await seen(pilot, plot, lambda: not plot.look.zoomed)
        assert plot.drawn.axes == whole
        plot.look.cursor = None
        plot.plot(chart())
        assert plot.text == first
        await pilot.press("Y", "X")
        assert app.said == ["Y axis: log", "X axis: log"]
        await seen(pilot, plot, lambda: plot.drawn.axes[0].transform.scale == "log")
        await pilot.press("greater_than_sign", "less_than_sign")
        await seen(pilot, plot)
        assert plot.look.y is None

    on_plot(do)


def test_the_wheel_zooms_at_the_pointer_and_over_ticks_one_axis_alone():
    async def do(app, pilot, plot):
        whole = plot.drawn.axes
        column, row = 11, 4
        under = [whole[0].value(column), whole[1].value(whole[1].cells - 1 - row)]
        for event in (MouseScrollUp, MouseScrollUp, MouseScrollUp, MouseScrollDown):
            await pilot._post_mouse_events([event], plot, (LEFT + column, TITLE + row))
        await seen(pilot, plot, lambda: plot.drawn.zoom > 3.9)
        x, y = plot.drawn.axes
        assert abs(x.cell(under[0]) - column) <= 1
        assert abs(y.cells - 1 - y.cell(under[1]) - row) <= 1
        await pilot.press("0")
        await seen(pilot, plot, lambda: not plot.look.zoomed)
        assert plot.drawn.axes == whole
        await pilot._post_mouse_events([MouseScrollUp], plot, (2, TITLE + row))
        assert plot.look.x is None
        assert plot.look.y is not None
        plot.look.fit()
        await pilot._post_mouse_events([MouseScrollUp], plot, (LEFT + column, TITLE + whole[1].cells))
        assert plot.look.y is None
        assert plot.look.x is not None

    on_plot(do)


async def drag(pilot, plot, ways, button=1):
    """Press, move and let go; places in cells of the data."""
    events = [MouseDown, *[MouseMove] * (len(ways) - 2), MouseUp]
    for event, (column, row) in zip(events, ways, strict=True):
        await pilot._post_mouse_events([event], plot, (LEFT + column, TITLE + row), button=button)


def test_a_box_is_zoomed_to_the_right_button_moves_and_a_click_reads():
    async def do(app, pilot, plot):
        whole = plot.drawn.axes
        await drag(pilot, plot, [(10, 2), (20, 5), (30, 8), (30, 8)])
        await seen(pilot, plot, lambda: plot.look.zoomed)
        x, y = plot.drawn.axes
        assert x.span == (whole[0].transformed(10), whole[0].transformed(30))
        assert y.span == (whole[1].transformed(whole[1].cells - 9), whole[1].transformed(whole[1].cells - 3))
        assert plot.look.box is None
        await drag(pilot, plot, [(10, 5), (13, 5), (15, 6), (15, 6)], button=3)
        await seen(pilot, plot, lambda: plot.drawn.axes[0].span != x.span)
        moved = plot.drawn.axes[0]
        assert abs(moved.place(x.value(10)) - moved.place(moved.value(15))) < 1.0
        await pilot.press("0")
        await seen(pilot, plot, lambda: plot.drawn.axes == whole)
        await drag(pilot, plot, [(20, 5), (20, 5)])
        assert abs(plot.look.cursor - whole[0].value(20)) <= 0.5
        assert not plot.look.zoomed

    on_plot(do)


def test_a_point_of_the_curve_that_may_be_moved_is_dragged():
    async def do(app, pilot, plot):
        axes = plot.drawn.axes
        column, row = int(axes[0].cell(10.0)), axes[1].cells - 1 - axes[1].cell(NOW[10])
        await drag(pilot, plot, [(column, row), (column, row - 1), (column, row - 2), (column, row - 2)])
        assert [(index, done) for index, _, done in app.dragged] == [(10, False), (10, False), (10, True)]
        assert app.dragged[-1][1] == axes[1].value(axes[1].cells - 1 - (row - 2))
        assert not plot.look.zoomed

    on_plot(do, chart(drag=1))


def test_no_text_lies_over_the_data_and_the_legend_is_in_the_title():
    async def do(app, pilot, plot):
        lines = tui_kit.text_of(app).splitlines()
        assert re.fullmatch(r">AREA +⠤⠤ real +o⠤ now *", lines[0])
        await pilot.press("right")
        await seen(pilot, plot, lambda: "at " in readout(plot))
        for line in tui_kit.text_of(app).splitlines()[1:13]:
            assert not re.search(r"[A-Za-np-z]", line)

    on_plot(do)
