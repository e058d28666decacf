"""Plots of text: their marks, their size, and that they leave nothing behind."""

import numpy as np
import plotext
import pytest

from lidarcheck.figures.data import Course, Curve
from lidarcheck.figures.terminal import course_text

X = np.arange(30.0)


def two_curves(x, before, after, *, names=("before", "after"), x_label="", y_label="", logs=(False, False), **size):
    x, before, after = (np.asarray(values, dtype=float) for values in (x, before, after))
    curves = (Curve(names[0], x, before), Curve(names[1], x, after))
    return course_text(Course("", x_label, y_label, curves, *logs), **size)


def body(text):
    """The lines inside the frame."""
    return [line.split("┤" if "┤" in line else "│", 1)[1] for line in text.splitlines() if line.endswith("│")]


@pytest.mark.parametrize("width", [1, 40, 79, 80, 133, 200, 5000])
@pytest.mark.parametrize("height", [1, 8, 15, 60, 900])
def test_a_plot_keeps_its_size(width, height):
    text = two_curves(X, X, X**2, x_label="layer", y_label="AREA of something [counts]", width=width, height=height)
    lines = text.splitlines()
    assert len(lines) == min(max(height, 8), 60)
    assert max(map(len, lines)) <= min(max(width, 40), 200)
    assert text.endswith("\n")
    assert lines[-1].strip() == "layer"


def test_two_curves_have_two_marks_and_a_legend():
    text = two_curves(X, X, X + 10.0, names=("without", "with"), y_label="y", width=80)
    assert text.splitlines()[0].startswith("y ")
    assert text.splitlines()[0].endswith("· without   # with")
    drawn = "".join(body(text))
    assert drawn.count("·") > 20
    assert drawn.count("#") > 20


def test_curves_stand_where_their_values_are():
    rows = body(two_curves(X, np.zeros(30), np.where(X < 15, 0.0, 1.0), width=80))
    assert "·" not in rows[1]
    assert rows[0].strip("│").strip() == "" or "#" in rows[0]
    top = next(row for row in rows if "#" in row)
    bottom = [row for row in rows if "·" in row][-1]
    assert top.index("#") > len(top) // 3
    assert bottom.index("#") < 3
    assert bottom.rindex("·") > 60


def test_a_gap_is_left_empty():
    y = np.where((X > 9) & (X < 21), np.nan, 1.0)
    row = next(row for row in body(course_text(Course("", "", "", (Curve("a", X, y),)), width=80)) if "·" in row)
    assert row[30:45].strip() == ""
    assert "·" in row[:25]
    assert "·" in row[55:]


@pytest.mark.parametrize(
    ("x", "y"),
    [
        ([], []),
        ([1.0], [np.nan]),
        ([np.nan, 1.0], [1.0, np.inf]),
        ([1.0], [2.0]),
        ([1.0, 1.0], [2.0, 2.0]),
        ([0.0, 1.0], [0.0, 0.0]),
        ([0.0, 1.0], [1e300, -1e300]),
        ([0.0, 1e-300], [1e15, 1e15 + 0.125]),
        ([3.0, 2.0, 1.0], [1, 2, 3]),
    ],
)
@pytest.mark.parametrize("log", [False, True])
def test_whatever_the_values_there_is_a_plot_of_the_same_size(x, y, log):
    text = two_curves(x, y, y, x_label="x", logs=(log, log))
    assert len(text.splitlines()) == 15
    assert max(map(len, text.splitlines())) <= 80
    assert "nan" not in text
    assert "inf" not in text


def test_nothing_to_draw_is_said():
    assert "nothing to draw" in two_curves([], [], [])
    assert "nothing to draw" in two_curves([1.0], [-1.0], [0.0], logs=(False, True))


def test_logarithms_are_drawn_straight_and_written_as_numbers():
    x = np.geomspace(1.0, 1000.0, 40)
    text = two_curves(x, x, x, logs=(True, True))
    steps = np.diff([row.index("#") for row in body(text) if "#" in row])[:-1]
    assert np.all(np.abs(steps - steps.mean()) <= 2)
    ticks = text.splitlines()[-2].split()
    assert ticks[0] == "1"
    assert ticks[-1] == "1000"


def test_plain_text_is_ascii_and_says_the_same():
    drawn, plain = (two_curves(X, X, X + 5.0, width=60, plain=plain) for plain in (False, True))
    assert plain.isascii()
    assert plain.count("#") == drawn.count("#")
    assert ". before   # after" in plain


def test_colour_only_repeats_the_marks():
    import re

    bare, coloured = (two_curves(X, X, X + 5.0, colour=colour) for colour in (False, True))
    assert "\x1b" not in bare
    assert "\x1b[" in coloured
    stripped = re.sub(r"\x1b\[[0-9;]*m", "", coloured)
    assert [line.rstrip() for line in stripped.splitlines()] == bare.splitlines()


def test_the_same_values_give_the_same_text_and_leave_nothing_behind():
    plotext.clear_figure()
    empty = plotext.build()
    first = two_curves(X, X, -X, x_label="x", y_label="y")
    assert plotext.build() == empty
    two_curves(X, X**2, X, width=120, height=30)
    assert two_curves(X, X, -X, x_label="x", y_label="y") == first
    plotext.clear_figure()


def test_threads_do_not_draw_into_each_other_s_plots():
    from concurrent.futures import ThreadPoolExecutor

    alone = [two_curves(X, X * k, X - k) for k in range(8)]
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(lambda k: two_curves(X, X * k, X - k), range(8))) == alone


def test_of_more_than_eight_curves_the_rest_is_counted():
    text = course_text(Course("", "", "", tuple(Curve(str(n), X, X + n) for n in range(9))))
    assert "@ 7   (1 more)" in text


def test_a_long_legend_is_cut_and_a_long_label_has_its_own_line():
    text = two_curves(X, X, X, names=("n" * 50, "m" * 50), y_label="l" * 90, width=60)
    lines = text.splitlines()
    assert max(map(len, lines)) <= 60
    assert len(lines) == 15
    assert lines[0] == "l" * 57 + "..."
    assert lines[1].endswith("...")
