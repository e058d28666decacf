"""The page of a check."""

import math
import re

import pytest

from html_kit import Page
from lidarcheck.errors import InputError
from lidarcheck.figures.html.check import report_html, write_report
from lidarcheck.figures.html.environment import breakable
from lidarcheck.figures.svg.kpi_strip import strip
from lidarcheck.harness.gate.evidence import KpiEvidence, KpiVerdict
from report_kit import distance, kpi, missing, regressed, report, scenario


@pytest.fixture(scope="module")
def failing():
    return report(
        scenario(
            "wall", kpi(), regressed(), distance(), missing(), problems=("it has changed: run `lidarcheck review`",)
        ),
        scenario("panel", kpi(), notes=("another machine?",)),
        scenario("slim", notes=("not run: for SLIM",)),
        problems=["goldens/x.toml has no scenario"],
    )


@pytest.fixture(scope="module")
def page(failing):
    return Page(report_html(failing))


def test_it_says_what_fell_out(page):
    assert "✗ 2 of 5 KPIs fell out" in page.text
    assert "= 2 identical ~ 1 changed ✗ 1 regressed ∅ 1 missing" in page.text
    assert "goldens/x.toml has no scenario" in page.text
    assert "wall: it has changed: run lidarcheck review; regressed area_mean.near; missing gone" in page.text
    assert "area_mean.near ✗ regressed 100 109 +9 ±0.5 ±2 counts ≥ 90 3.5" in page.text
    assert "Golden accepted because: a new lens (area_mean.near)" in page.text
    assert "not run: for SLIM" in page.text
    assert "Note: another machine?" in page.text


def test_it_says_how_the_run_was_made(page):
    assert "numpy 2.4.6, python 3.11.7" in page.text
    assert "efefefefefefefef" in page.text
    assert "abababababababab" in page.text
    assert "0.001 for an unchanged model to fail anywhere, shared by 12 KPIs" in page.text
    assert "drawn from 7" in Page(report_html(report(scenario("wall", kpi()), seed=7))).text


def test_a_run_that_holds():
    text = Page(report_html(report(scenario("wall", kpi())))).text
    assert "✓ Everything holds" in text
    assert "What to do" not in text


def test_a_run_of_nothing():
    text = Page(report_html(report(problems=["a run that compares nothing proves nothing"]))).text
    assert "✗ The run fails" in text
    assert "a run that compares nothing" in text


def test_plots_are_inline_and_distances_have_their_distribution(page):
    plots = [attrs["aria-label"] for attrs in page.tags("svg") if attrs["class"] == "plot"]
    assert plots == [
        "area_mean, value of each seed, golden and now",
        "area_mean.near, value of each seed, golden and now",
        "area_distance, value of each seed, golden and now",
        "area_distance, cumulative distribution, golden and now",
        "area_distance, shift of each quantile, now minus golden",
        "area_mean, value of each seed, golden and now",
    ]


def test_nothing_is_fetched_and_nothing_runs(failing):
    text = report_html(failing)
    page = Page(text)
    assert not {"script", "link", "img", "iframe", "image"} & {tag for tag, _ in page.elements}
    assert not [name for _, attrs in page.elements for name in attrs if name.startswith("on")]
    links = [attrs.get("href") or "" for _, attrs in page.elements if "href" in attrs or "src" in attrs]
    assert links
    assert all(link.startswith("#") for link in links)
    assert "http" not in text.replace("http-equiv", "").replace('xmlns="http://www.w3.org/2000/svg"', "")


def test_every_identifier_is_unique_and_every_reference_has_its_target(failing):
    text = report_html(failing)
    names = re.findall(r'\bid="([^"]+)"', text)
    assert len(names) == len(set(names))
    assert set(re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', text)) != set()
    assert {a or b for a, b in re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', text)} <= set(names)


def test_everything_is_escaped():
    evil = "<script>alert('x')</script> & \"q\" `<b>`"
    found = scenario(
        evil, kpi(evil, KpiVerdict.REGRESSED, 9.0, note=evil, reason=evil), problems=(evil,), notes=(evil,)
    )
    page = Page(report_html(report(found, problems=[evil])))
    assert page.tags("script") == []
    assert page.tags("svg")[-1]["aria-label"].startswith(evil)
    assert page.text.count("<script>alert('x')</script>") > 5


def test_the_same_report_gives_the_same_bytes(failing):
    import matplotlib

    first = report_html(failing)
    with matplotlib.rc_context({"axes.linewidth": 7.0, "font.size": 30.0}):
        assert report_html(failing) == first
        assert matplotlib.rcParams["font.size"] == 30.0


def test_colours_are_the_page_s_own(failing):
    text = report_html(failing)
    drawn = text.split("</style>")[1]
    assert set(re.findall(r"(?:fill|stroke): ([^;\"]+)", drawn)) <= {
        "none", "var(--ink)", "var(--muted)", "var(--band)", "var(--old)", "var(--new)",
    }  # fmt: skip


@pytest.mark.parametrize(
    "odd",
    [
        kpi(old_paired=(), paired=(), fresh=()),
        kpi(old_paired=(math.nan,) * 8, paired=(math.nan,) * 8, fresh=(math.nan,) * 64),
        kpi(old_paired=(math.nan, *[1.0] * 7), paired=(2.0,) * 8, fresh=()),
        kpi(paired=(5.0,) * 8, old_paired=(5.0,) * 8, fresh=(5.0,) * 16),
        kpi(golden=KpiEvidence(KpiVerdict.INDETERMINATE, math.nan, math.nan, math.nan, 0), new=math.nan),
        kpi(old_paired=(1e300,) * 8, paired=(-1e300,) * 8),
    ],
)
def test_odd_values_are_drawn_or_left_out(odd):
    Page(report_html(report(scenario("odd", odd))))


def test_a_strip_places_the_change():
    assert 'cx="75.0"' in strip(kpi())
    assert "circle" in strip(kpi(delta=3.0))
    assert "circle" not in strip(kpi(delta=30.0))
    assert "change +15.00 tolerances, ±0.25 by chance" in strip(kpi(delta=30.0))
    assert strip(missing()) == ""


def test_a_page_of_a_suite_is_small():
    suite = report(
        *(scenario(f"s{index}", *(kpi(f"k{number}") for number in range(9)), distance()) for index in range(12))
    )
    assert len(report_html(suite).encode()) < 2_000_000


def test_written_whole_or_not_at_all(tmp_path):
    write_report(report(scenario("wall", kpi())), tmp_path / "check.html")
    assert (tmp_path / "check.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    with pytest.raises(InputError):
        write_report(report(), tmp_path / "nowhere" / "check.html")
    assert [path.name for path in tmp_path.iterdir()] == ["check.html"]


def test_a_page_breaks_names_and_no_number():
    assert breakable("signal_at_1m") == "signal_<wbr>at_<wbr>1m"
    assert breakable("result.json") == "result.<wbr>json"
    assert breakable("-10.4 ... 0.5") == "-10.4 .<wbr>.<wbr>.<wbr> 0.5"
