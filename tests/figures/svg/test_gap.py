"""The pictures of a gap as SVG: plots, maps and strips."""

import dataclasses
import math
import re

import numpy as np
import pytest

from explain_report_kit import candidate
from lidarcheck.figures.gap import Detected, FieldMap, Histogram, ResidualCurve
from lidarcheck.figures.svg.gap_map import map_svg, reach_of
from lidarcheck.figures.svg.gap_plots import detected_svg, histogram_svg, residual_svg
from lidarcheck.figures.svg.gap_strips import candidate_strip, feature_strip, gap_strip
from lidarcheck.figures.words import amount
from lidarcheck.inference.intervals import Interval

UP, ASIDE = (-12.975, 12.975), (-59.9375, 59.9375)
"""Elevations of the first and the last layer, azimuths of the first and the last point [deg]."""


def numbers(pattern, text):
    return [float(found) for found in re.findall(pattern, text)]


def test_a_histogram_on_a_log_scale():
    edges = np.arange(5.0)
    counts = np.array([1.0, 10.0, 100.0, 0.0])
    text = histogram_svg(Histogram("peak", "PEAK", "counts", edges, counts, counts, 10.0 * counts), changed=True)
    heights = numbers(r"V([\d.]+)", re.search(r'class="before" d="([^"]+)"', text)[1])
    assert heights[0] - heights[1] == pytest.approx(heights[1] - heights[2], abs=0.11)
    assert heights[3] == pytest.approx(122.0)  # no count at all stands on the axis
    assert "measured 111 echoes a frame, mean 2.39" in text
    nothing = np.zeros(4)
    assert histogram_svg(Histogram("peak", "PEAK", "counts", edges, nothing, nothing, nothing), changed=True) == ""


def test_residuals_on_zero_lie_on_the_line():
    before, after = np.tile([-3.0, -1.0, 1.0], (4, 1)), np.tile([-1.0, 0.0, 1.0], (4, 1))
    before[2] = math.nan
    curve = ResidualCurve("area", "ln AREA residual", "1", "range", tuple("abcd"), np.full(4, 50), before, after)
    text = residual_svg(curve, changed=True)
    zero = numbers(r'class="zero" d="M[\d.]+ ([\d.]+)H', text)
    assert numbers(r'class="after-dot" cx="[\d.]+" cy="([\d.]+)"', text) == zero * 4
    assert len(numbers(r'class="before-dot" cx="[\d.]+" cy="([\d.]+)"', text)) == 3
    assert "median before at most −1, after at most 0" in text
    none = np.full((4, 3), math.nan)
    assert residual_svg(dataclasses.replace(curve, before=none, after=none), changed=True) == ""


def test_detection_of_every_beam_and_of_none():
    measured = np.array([[1.0, 0.9, 1.0], [0.0, 0.0, 0.1]])
    one = Detected("range", ("near", "far"), np.array([30, 30]), measured, np.ones(2), np.array([1.0, 0.0]))
    text = detected_svg(one, changed=True)
    assert numbers(r'after-dot" cx="[\d.]+" cy="([\d.]+)"', text) == numbers(r'axis" d="M[\d.]+ ([\d.]+)H', text)[:2]
    assert "measured less simulated at most before −100 %, after 0 %" in text


def test_a_map_has_left_on_its_left_and_signs_on_it():
    before = np.array([[0.0, 1.0], [-1.0, math.nan]])
    one = FieldMap(
        "area", "mean ln AREA", "1", ((0, 0), (519, 519)), ((0, 0), (959, 959)), before, 0.0 * before, UP, ASIDE
    )
    assert reach_of(one) == pytest.approx(1.0)
    text = map_svg(one, "before", 1.0)
    boxes = {name: (float(x), float(y)) for name, x, y in re.findall(r'class="([zn]\d)" d="M([\d.]+) ([\d.]+)h', text)}
    assert set(boxes) == {"z0", "z5", "n5"}
    assert boxes["z5"][0] < boxes["z0"][0]  # the higher point is farther to the left
    assert boxes["n5"][1] < boxes["z0"][1]  # the higher layer is above
    assert text.count('class="sign strong"') == 1
    assert "59.9° left" in text
    assert "59.9° right" in text
    assert "z5" not in map_svg(one, "after", 1.0)


@pytest.mark.parametrize(("most", "reach"), [(0.011, 0.015), (2.7, 3.0), (0.0, 1.0), (5.0, 5.0), (97.0, 100.0)])
def test_a_map_s_scale_ends_at_a_round_number(most, reach):
    values = np.full((2, 2), most)
    ends = ((0, 1), (2, 3))
    assert reach_of(FieldMap("area", "", "1", ends, ends, values, -values, UP, ASIDE)) == pytest.approx(reach)


def test_strips_are_to_scale():
    floor = Interval(0.1, 0.1, 0.1)
    text = gap_strip(Interval(0.5, 0.4, 0.6), 0.75, floor, 1.0)
    assert numbers(r'class="left" x="0" y="5" width="([\d.]+)"', text) == [110.0]
    assert numbers(r'class="closed" x="110.0" y="5.5" width="([\d.]+)"', text) == [55.0]
    assert 'class="opened"' in gap_strip(Interval(0.5, 0.4, 0.6), 0.3, floor, 1.0)
    assert numbers(r'class="enough" x="110.0" y="6" width="([\d.]+)"', candidate_strip(candidate("x", 160.0))) == [52.0]
    assert 'class="little"' in candidate_strip(candidate("x", 20.0))
    assert candidate_strip(candidate("x", math.nan)) == ""
    assert "before 2, after 1, floor 0.5" in feature_strip(2.0, 1.0, 0.5)


@pytest.mark.parametrize(
    ("value", "written"),
    [(0.0, "0"), (-0.0, "0"), (-1.5, "−1.5"), (12345.0, "12345"), (math.nan, "–"), (1e-9, "1e−09"), (1e9, "1e+09")],
)
def test_numbers_as_a_person_reads_them(value, written):
    assert amount(value) == written
