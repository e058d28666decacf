"""Axes of plots: values to cells and back, ticks that touch nobody, zoom, and the readout's way along the data."""

from itertools import pairwise

import numpy as np
import pytest

from lidarcheck.tui.plots.chart import Chart, Trace
from lidarcheck.tui.plots.look import Look, axes_of, moved_cursor
from lidarcheck.tui.plots.ticks import own_ticks, ticks_across, ticks_up
from lidarcheck.tui.plots.transform import Axis, Transform, limits, next_scale, panned, zoomed

# The X of a sign's table: rows from -160 to 200, six of them from 2.5 to 20 on either side.
TABLE = np.array([-160, -120, -80, -50, -33, -20, -10.4, -5.87, -4.4, -3.37, -2.5, 0,
                  2.5, 3.37, 4.4, 5.87, 10.4, 20, 33, 50, 80, 120, 200])  # fmt: skip


def axis_of(scale, values, cells):
    transform = Transform.of(scale, values)
    return Axis(transform, limits(transform.to(values)), cells)


@pytest.mark.parametrize("scale", ["lin", "log", "symlog"])
def test_a_value_stands_in_its_cell_and_comes_back(scale):
    values = TABLE if scale != "log" else np.abs(TABLE[TABLE != 0])
    axis = axis_of(scale, values, 37)
    assert np.allclose(axis.transform.back(axis.transform.to(values)), values)
    assert axis.cell(values.min()) == 0
    assert axis.cell(values.max()) == 36
    assert axis.cell(values.max() * 1.5) is None
    for cell in range(37):
        assert axis.cell(axis.value(cell)) == cell


def test_a_logarithmic_axis_has_no_place_for_what_is_not_above_0():
    assert np.isnan(Transform("log").to([0.0, -1.0, np.nan, np.inf])).all()


def test_at_80_columns_near_rows_of_a_table_fall_into_columns_of_their_own():
    # 34 columns are the editor's, 6 the labels'.
    symlog, linear = (axis_of(scale, TABLE, 40) for scale in ("symlog", "lin"))
    for sign in (1, -1):
        near = sign * np.array([2.5, 3.37, 4.4, 5.87, 10.4, 20])
        assert len({symlog.cell(x) for x in near}) >= 5
        assert len({linear.cell(x) for x in near}) <= 3


def texts(axis, ticks):
    """The line of the ticks' texts as plotext lays them out, and how many blanks are between neighbours."""
    line, ends = [" "] * axis.cells, []
    for at, text in ticks:
        column = round((at - axis.span[0]) / (axis.span[1] - axis.span[0]) * (axis.cells - 1))
        start = min(max(column - len(text) // 2, 0), axis.cells - len(text))
        line[start : start + len(text)] = text
        ends.append((start, start + len(text)))
    return "".join(line), [b[0] - a[1] for a, b in pairwise(ends)]


@pytest.mark.parametrize("cells", [20, 40, 76])
def test_a_table_has_its_own_values_as_ticks_and_none_touches_another(cells):
    axis = axis_of("symlog", TABLE, cells)
    line, apart = texts(axis, own_ticks(axis, TABLE))
    assert line.startswith("-160")
    assert line.endswith("200")
    assert " 0 " in line
    assert min(apart) >= 2
    assert {float(word) for word in line.split()} <= set(TABLE)


@pytest.mark.parametrize(
    ("scale", "values"),
    [("lin", [-3.0, 8.0]), ("lin", [1e-9, 1.1e-9]), ("log", [30.0, 5000.0]), ("log", [410.0, 480.0]),
     ("log", [1e-30, 1e30]), ("symlog", [-160.0, 200.0]), ("symlog", [2.5, 3.0]), ("symlog", [-1e-3, 1e6])],
)  # fmt: skip
def test_round_ticks_have_room_whatever_is_seen(scale, values):
    axis = axis_of(scale, values, 60)
    line, apart = texts(axis, ticks_across(axis))
    assert len(line.split()) >= 2
    assert all(blanks >= 2 for blanks in apart)
    rows = [round((at - axis.span[0]) / (axis.span[1] - axis.span[0]) * 59) for at, _ in ticks_up(axis)]
    assert len(rows) >= 2
    assert len(set(rows)) == len(rows)
    # Nothing like 3.16: what is written is where it says.
    for at, text in ticks_across(axis):
        assert axis.transform.to(float(text)) == pytest.approx(at, rel=1e-3, abs=1e-9 * np.ptp(axis.span))


def test_zoom_keeps_what_is_under_the_hand_and_pan_keeps_the_width():
    axis = axis_of("log", [1.0, 1e4], 41)
    about = axis.transformed(13)
    closer = Axis(axis.transform, zoomed(axis.span, about, 2.0), 41)
    assert closer.cell(float(axis.transform.back(about))) == 13
    assert np.ptp(closer.span) == pytest.approx(2.0)
    assert panned((0.0, 4.0), 0.25) == (1.0, 5.0)
    span = (0.0, 1.0)
    for _ in range(200):
        span = zoomed(span, 0.3, 2.0)
    assert span[1] > span[0]


def test_scales_that_cannot_show_the_numbers_are_passed_over():
    assert next_scale("lin", [1.0, 2.0]) == "log"
    assert next_scale("lin", [-1.0, 2.0]) == "symlog"
    assert next_scale("symlog", [-1.0, 2.0]) == "lin"


def test_limits_stay_where_they_are_while_a_value_is_edited():
    y = np.array([1.0, 2.1e-3, 3e-4])

    def chart(y):
        return Chart("k", "", "", "", (Trace("now", np.arange(3.0), y),), y_scale="log")

    before = axes_of(chart(y), Look(), (30, 8))[1].span
    assert axes_of(chart(y * [1, 1.4, 1.02]), Look(), (30, 8))[1].span == before


def test_the_readout_goes_from_point_to_point_of_its_trace():
    traces = (Trace("real", np.array([0.0, 2.0, 4.0, 9.0]), np.array([1.0, np.nan, 3.0, 4.0])),)
    chart, look = Chart("k", "", "", "", traces), Look()
    axis = axes_of(chart, look, (30, 8))[0]
    found = []
    for by in (0, 1, 1, -1, -1, -1):
        look.cursor = moved_cursor(chart, look, axis, by)
        found.append(look.cursor)
    assert found == [4.0, 9.0, 9.0, 4.0, 0.0, 0.0]
    look.cursor = 3.0
    assert moved_cursor(chart, look, axis, 1) == 4.0
    assert moved_cursor(chart, look, axis, -1) == 0.0
