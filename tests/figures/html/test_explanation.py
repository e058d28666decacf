"""The page of the gap workflow."""

import dataclasses
import math
import re
import time

import pytest

from explain_report_kit import AFTER, MODEL, FakeCase, candidate, case, explanation, findings, gap, odd_frames
from html_kit import Page
from lidarcheck.errors import InputError
from lidarcheck.explain.report.explanation import Alternative, Calibrated, Finding, SearchStep
from lidarcheck.figures.html.explanation import explanation_html, verify_pictures, write_html
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


def test_names_that_do_not_hold_elsewhere_stay_with_both_figures(street):
    span = dataclasses.replace(gap("explained"), closed_span=(0.1, 0.35))
    found = explanation("unknown", findings=findings("explained"), gap=span, closed_seen=0.98)
    words = Page(explanation_html(found, street)).text
    assert "? Fog (or rain) and layer_gain were found, but most is unknown" in words
    assert "98 % of the gap closes on the frames that chose, 99 % (10 to 35 %) on those that nothing has seen" in words


def test_what_is_calibrated_and_other_explanations_have_tables(street):
    numbers = (Calibrated("materials.1.reflectance", 0.17, 0.169, 0.16, 0.18, 0.015),)
    others = (Alternative(("rain", "layer_gain"), -40.5, math.nan, "farther than with fog"),)
    words = Page(explanation_html(explanation(calibrated=numbers, rivals=others), street)).text
    assert "Calibrated besides" in words
    assert "materials.1.reflectance" in words
    assert "1.5 %" in words
    assert "Other explanations" in words
    assert "farther than with fog" in words
    assert "Calibrated besides" not in Page(explanation_html(explanation(), street)).text


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
