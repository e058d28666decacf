"""What a plot draws in its cells: dots of several curves merged, forms that need no colour, outlines, and the frame."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.tui.plots.chart import Chart, Strip, Trace
from lidarcheck.tui.plots.draw import drawn, legend
from lidarcheck.tui.plots.layers import cells_of_traces
from lidarcheck.tui.plots.look import Look
from lidarcheck.tui.plots.marks import glyphs, level_of
from lidarcheck.tui.plots.raster import DASHED, DOTTED, curve_dots, empty
from lidarcheck.tui.plots.transform import Axis, Transform

X = np.linspace(0.0, 10.0, 41)


def axes(cells, x=(0.0, 10.0), y=(0.0, 1.0)):
    return Axis(Transform(), x, cells[0]), Axis(Transform(), y, cells[1])


def rows_of(chart, look=None, size=(50, 12), level="braille"):
    return ["".join(text for text, _ in parts) for parts in drawn(chart, look or Look(), size, level).lines]


def test_two_curves_in_one_cell_hold_the_dots_of_both():
    real = Trace("real", np.array([0.0, 10.0]), np.array([0.52, 0.52]))
    now = Trace("now", np.array([0.0, 10.0]), np.array([0.42, 0.42]), "now", "dashes")
    own = axes((12, 5))
    alone = [cells_of_traces([trace], own, "braille").letters[2] for trace in (real, now)]
    both = cells_of_traces([real, now], own, "braille")
    codes = [[0 if letter == " " else ord(letter) - 0x2800 for letter in row] for row in (*alone, both.letters[2])]
    assert codes[2] == [one | other for one, other in zip(codes[0], codes[1], strict=True)]
    shared = [bool(one) and bool(other) for one, other in zip(codes[0], codes[1], strict=True)]
    assert any(shared)
    assert [both.names[role] == "both" for role in both.roles[2]] == shared


@pytest.mark.parametrize("pattern", [DOTTED, DASHED])
def test_a_moved_point_leaves_the_rest_of_a_patterned_curve_as_it_was(pattern):
    y = np.full(41, 4.0)
    before = curve_dots(X * 4, y, (41, 9), pattern)
    y[20] = 1.0
    after = curve_dots(X * 4, y, (41, 9), pattern)
    changed = np.flatnonzero((before != after).any(axis=0))
    assert changed.size
    assert changed.min() >= 2 * 19 * 1 - 1
    assert changed.max() <= 2 * 21 + 1


def test_gaps_stay_open_single_points_are_seen_and_what_is_outside_costs_nothing():
    y = np.array([1.5, np.nan, 1.5, np.nan, 1.5, 1.5])
    dots = curve_dots(np.array([1.0, 3.0, 5.0, 7.0, 9.0, 11.0]), y, (12, 3))
    assert dots[6, [2, 10]].all()
    assert not dots[:, 3:10].any()
    assert dots[6, 18:23].all()
    far = curve_dots(np.array([-1e12, 1e12]), np.array([1.5, 1.5]), (12, 3))
    assert far[6].all()
    assert far.sum() == 24


def test_marks_by_the_terminal():
    dots = empty((1, 1))
    dots[[0, 3], [0, 1]] = True
    assert [glyphs(dots, level)[0, 0] for level in ("braille", "blocks", "half", "ascii")] == ["⢁", "▚", "█", "#"]
    assert glyphs(empty((1, 1)), "braille")[0, 0] == " "
    utf8 = {"LANG": "de_DE.UTF-8", "TERM": "xterm-256color"}
    assert level_of("", utf8) == "braille"
    assert level_of("blocks", utf8) == "blocks"
    assert level_of("", utf8 | {"TERM": "linux"}) == "half"
    assert level_of("braille", {"LANG": "C"}) == "ascii"
    assert level_of("braille", utf8 | {"LC_ALL": "C"}) == "ascii"
    # Python itself sets LC_CTYPE where the locale is C.
    assert level_of("", {"LANG": "C", "LC_CTYPE": "C.UTF-8"}) == "ascii"


def curves(y, *more):
    forms = (("real", "real", "solid"), ("now", "now", "open"), ("saved", "saved", "dots"))
    traces = (Trace(name, X, values, role, form) for (name, role, form), values in zip(forms, (y, *more), strict=False))
    return Chart("k", "AREA", "offset", "AREA", tuple(traces), compared="difference")


@pytest.mark.parametrize("level", ["braille", "blocks", "half", "ascii"])
def test_real_now_and_saved_differ_without_colour(level):
    chart = curves(0.2 + 0 * X, 0.5 + 0 * X, 0.8 + 0 * X)
    lines = rows_of(chart, level=level)
    dotted, opened, solid = (row[6:] for row in lines[:9] if row[6:].strip())
    assert len({solid, opened, dotted}) == 3
    assert "o" in opened
    if level == "ascii":
        assert "".join(lines).isascii()
        assert [set(row) - {" "} for row in (solid, opened, dotted)] == [{"#"}, {"o"}, {"."}]
    samples = [text for text, role in legend(chart, Look(), level, 60)[0] if role in ("real", "now", "saved")]
    assert len(set(samples)) == 3


def test_a_histogram_is_filled_and_its_rival_an_outline():
    edges = np.arange(0.0, 10.5, 0.5)
    share = np.exp(-((edges[:-1] - 4.75) ** 2) / 4) / 4
    real = Trace("real", edges, share, "real", "filled", counts=share * 100)
    now = Trace("simulated", edges, np.roll(share, 4), "now", "outline", counts=share * 800)
    chart = Chart("h", "AREA", "AREA", "share", (real, now), compared="ratio")
    text = "\n".join(rows_of(chart, Look(cursor=6.2), (84, 14)))
    assert "█" in text
    assert {"┌", "┐", "┘", "└", "─"} <= set(text)
    assert "at 6..6.5: real " in text
    assert "simulated" in text
    assert "ratio" in text
    plain = "\n".join(rows_of(chart, Look(), (60, 14), "ascii"))
    assert plain.isascii()
    assert "#" in plain
    assert "_" in plain


def test_a_strip_marks_each_column_and_gives_way_where_there_is_no_room():
    strip = Strip("real - now [sd] rms 1.8", X, np.where(X > 5, 4.0, 0.0), X > 5)
    chart = Chart("k", "AREA", "offset", "AREA", (Trace("real", X, X),), strip=strip)
    lines = rows_of(chart)
    assert "rms 1.8" in lines[8]
    assert lines[9].endswith("!!!!!")
    assert "ooo" in lines[10]
    assert "rms" not in "\n".join(rows_of(chart, size=(50, 9)))


def test_cursors_are_seen_beside_the_data_and_never_over_it():
    chart = curves(0.2 + 0 * X, 0.5 + 0.1 * X)
    bare, read = rows_of(chart), rows_of(chart, Look(cursor=5.0, second=2.0))
    for before, after in zip(bare[:9], read[:9], strict=True):
        for x, letter in enumerate(before):
            assert letter == " " or after[x] == letter
    assert any("│" in row[8:] for row in read[:9])
    assert "at 5: real 0.2, now 1, diff -0.8" in read[-1]
    assert rows_of(chart, Look(cursor=5.1))[-1].count("~") == 2


@pytest.mark.parametrize("y", [[], [np.nan] * 41, [1.0] * 41, [1e300, -1e300] * 20, [0.0] * 41])
@pytest.mark.parametrize("scale", ["lin", "log", "symlog"])
def test_whatever_the_values_there_is_a_plot_of_the_same_size(y, scale):
    trace = Trace("real", X[: len(y)], np.array(y, dtype=float))
    lines = rows_of(Chart("k", "t", "x", "y", (trace,), scale, scale), Look(cursor=3.0))
    assert len(lines) == 12
    assert max(map(len, lines)) <= 50


_DRAWN = """
import numpy as np
from test_cells import X, curves, rows_of
from lidarcheck.tui.plots.look import Look
for level in ("braille", "ascii"):
    print(*rows_of(curves(np.sin(X), np.cos(X), np.sin(X) + 0.02 * X), Look(cursor=3.0), level=level), sep="\\n")
"""


def test_the_same_is_drawn_whatever_the_seed_of_hashes():
    drawn = [
        subprocess.run(
            [sys.executable, "-c", _DRAWN],
            env=os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(sys.path)},
            cwd=Path(__file__).parent, capture_output=True, text=True, check=True,
        ).stdout
        for seed in ("1", "2")
    ]  # fmt: skip
    assert drawn[0] == drawn[1]
    assert len(drawn[0].splitlines()) == 24
