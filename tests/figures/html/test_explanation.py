"""The page of the gap workflow."""

import dataclasses
import math
import re
import time

import numpy as np
import pytest

from explain_report_kit import AFTER, MODEL, FakeCase, candidate, case, explanation, findings, gap, odd_frames
from html_kit import Page
from lidarcheck.errors import InputError
from lidarcheck.explain.report.explanation import Finding, SearchStep
from lidarcheck.figures.gap.data import Detected, FieldMap, Histogram, ResidualCurve
from lidarcheck.figures.html.explanation import explanation_html, verify_pictures, write_html
from lidarcheck.figures.svg.gap_map import map_svg, reach_of
from lidarcheck.figures.svg.gap_plots import detected_svg, histogram_svg, residual_svg
from lidarcheck.figures.svg.gap_strips import candidate_strip, feature_strip, gap_strip
from lidarcheck.figures.words import amount
from lidarcheck.inference.intervals import Gap, Interval
from lidarcheck.sensor import Material


@pytest.fixture(scope="module")
def street():
    return case()


@pytest.fixture(scope="module")
def pictures(street):
    return verify_pictures(explanation(), street)


@pytest.fixture(scope="module")
def page(street, pictures):
    return explanation_html(explanation(), street, pictures)


@pytest.mark.parametrize("which", odd_frames())
def test_odd_frames_have_a_page(which):
    found = explanation(split={"fit": (), "select": (), "verify": (0, 1)})
    odd = FakeCase(odd_frames()[which])
    shown = verify_pictures(found, odd)
    text = explanation_html(found, odd, shown)
    Page(text)
    assert not re.search(r"\b(nan|inf)\b", text)


# The page


def test_it_says_what_is_missing_and_how_sure_that_is(page):
    text = Page(page).text
    assert "✓ fog (or rain) and layer_gain are missing in the model" in text
    assert "On frames 2 and 5, which no fit has seen, 98.9 % of the gap closes: from 0.9 (90 %: 0.85 to 0.95)" in text
    assert "1. fog confidence 97 %" in text
    assert "mor_m 181 172 to 190 m" in text
    assert "These data cannot tell it apart from: rain" in text
    assert "This measurement would: a wall at 100 m" in text
    assert "It shows in: AREA falls with range" in text


def test_it_shows_the_gap_the_model_and_the_evidence(page):
    text = Page(page).text
    assert "As it was 0.9 (0.85 to 0.95) + fog 0.2 (0.17 to 0.23) 79.5 % + layer_gain 0.03" in text
    assert text.index("area 0.5 0.02 0.015") < text.index("range 0.1 0.011 0.01")
    assert '+ name = "fog"' in text
    assert "AREA is 31 standard deviations lower at 60-80 m area range 60-80 m −31.2" in text
    assert "fog 1 900 40 12 71 % rain accepted" in text
    assert "walk_error 1 −3 40 12 – chance may make as much" in text
    assert "mirror_multipath nothing here is mirror-like" in text
    assert "screen: 28 candidates" in text
    assert "Frames to fit 0, 3 Frames to select 1, 4 Frames to verify 2, 5" in text
    for hash_ in ("ab" * 32, "cd" * 32, "ef" * 32):
        assert hash_ in text


def test_no_gap_says_so_and_shows_one_model():
    text = explanation_html(explanation("no_gap"), case(MODEL))
    words = Page(text).text
    assert "= No gap: nothing is missing in the model" in words
    assert "measured and simulated echoes are 0.021 (90 %: 0.014 to 0.029) apart; chance alone makes 0.02" in words
    assert "What is missing" not in words
    assert "Gap closed" not in words
    assert "What changes in the model" not in words
    assert 'class="before"' not in text


def test_unknown_says_so_and_marks_what_is_empirical(street):
    words = Page(explanation_html(explanation("unknown"), street)).text
    assert "? Something is missing that no catalogue has" in words
    assert "Empirical: a curve through the data, not a cause." in words
    assert "It shows in: PEAK depends on the range" in words
    both = explanation("unknown", findings=(findings("explained")[0], *findings("unknown")))
    assert (
        "fog (or rain) is missing in the model, and something that no catalogue has"
        in Page(explanation_html(both, street)).text
    )


def test_every_picture_is_there_and_has_words(page):
    drawn = Page(page)
    pictures = [attrs for attrs in drawn.tags("svg") if attrs.get("role") == "img"]
    assert all(len(attrs["aria-label"]) > 10 for attrs in pictures)
    kinds = [attrs["class"] for attrs in pictures]
    assert kinds.count("map") == 8
    assert kinds.count("scale") == 4
    assert kinds.count("plot") == 5 + 4 * 6 + 6
    assert len(drawn.tags("svg")) - len(pictures) == sum("aria-hidden" in attrs for attrs in drawn.tags("svg"))


def test_nothing_is_fetched_and_nothing_runs(page):
    drawn = Page(page)
    assert not {"script", "link", "img", "iframe", "image", "use"} & {tag for tag, _ in drawn.elements}
    assert not [name for _, attrs in drawn.elements for name in attrs if name.startswith("on")]
    assert "http" not in page.replace("http-equiv", "")
    assert "url(" not in page
    assert page.startswith("<!doctype html>")


def test_every_colour_is_the_page_s_own_and_has_a_dark_twin(page):
    style, body = page.split("</style>")
    assert not re.search(r"#[0-9a-fA-F]{3,6}\b", body)
    light, dark = ("".join(re.findall(pattern, style, re.DOTALL))
                   for pattern in (r"(?<!  ):root \{(.*?)\}", r"\n  :root \{(.*?)\n  \}"))  # fmt: skip
    named = set(re.findall(r"var\((--\w+)\)", style)) - {"--font"}
    assert named <= set(re.findall(r"(--\w+):", light))
    assert named <= set(re.findall(r"(--\w+):", dark))


def test_everything_is_escaped(street):
    evil = "<script>alert('x')</script> & \"q\""
    materials = dict(MODEL.materials) | {1: Material(evil, 0.5)}
    model = dataclasses.replace(MODEL, materials=materials)
    finding = Finding(evil, {evil: Interval(1.0, 0.9, 1.1, evil)}, 0.5, (evil,), evil, evil)
    found = explanation(
        findings=(finding,), model=dataclasses.replace(AFTER, materials=materials), steps=(SearchStep(evil, evil),),
        not_testable={evil: evil}, hashes={evil: evil}, left_out={evil: evil}, candidates=(candidate(evil, 50.0),),
        gap=dataclasses.replace(gap("explained"), waterfall=((evil, Interval(0.1, 0.0, 0.2)),)),
        seeds={"seed": 1, evil: 2},
    )  # fmt: skip
    text = explanation_html(found, FakeCase(street.frames, model, street.directory / "x<b>y"))
    assert "<script" not in text
    assert "alert('x')" not in re.sub(r"alert\(&#(39|x27);x", "", text)
    assert Page(text).text.count("<script>") > 10


def test_the_same_arguments_give_the_same_bytes(street, page):
    assert explanation_html(explanation(), street) == page


def test_it_is_small_and_quick(street, tmp_path):
    start = time.process_time()
    write_html(explanation(), street, tmp_path / "report.html")
    assert time.process_time() - start < 4.0
    assert (tmp_path / "report.html").stat().st_size < 1_000_000


def test_written_whole_or_not_at_all(street, pictures, tmp_path):
    write_html(explanation(), street, tmp_path / "report.html", pictures)
    assert (tmp_path / "report.html").read_text(encoding="utf-8").rstrip().endswith("</html>")
    with pytest.raises(InputError):
        write_html(explanation(), street, tmp_path / "nowhere" / "report.html", pictures)
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.parametrize("value", [math.nan, math.inf, 0.0, -1.0, 1e300, 1e-300])
def test_odd_gaps_are_drawn_or_left_out(street, pictures, value):
    one = Interval(value, value, value)
    odd = Gap(one, one, one, {"area": (value, value, value)}, (("fog", one),))
    found = explanation(gap=odd, candidates=(candidate("fog", value, needed=value, pull=value, closed=value),))
    text = explanation_html(found, street, pictures)
    Page(text)
    assert not re.search(r'="[^"]*\b(nan|inf)\b[^"]*"', text)


# Single pictures


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
    one = FieldMap("area", "mean ln AREA", "1", ((0, 0), (519, 519)), ((0, 0), (959, 959)), before, 0.0 * before)
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
    assert reach_of(FieldMap("area", "", "1", ends, ends, values, -values)) == pytest.approx(reach)


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
