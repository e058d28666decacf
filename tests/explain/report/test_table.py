"""The candidates' table: which start each row is of, what became of it, and what it cannot be told from."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from explain_report_kit import MODEL, case, explanation
from lidarcheck.effects.search import Probe, search_spec
from lidarcheck.explain.decision.findings import candidates_table
from lidarcheck.explain.report.explanation import Candidate, Finding
from lidarcheck.explain.report.text import report_sections
from lidarcheck.explain.search.merit import FittedCandidate
from lidarcheck.explain.search.selection import Search
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.figures.html.explanation import explanation_html
from lidarcheck.inference.effect_fit import Fit

BENCH = SimpleNamespace(select=SimpleNamespace(floor_distance=100.0))


def trial(probe: Probe, gain: float) -> FittedCandidate:
    fit = Fit((probe,), (probe.start(),), 1.0, np.zeros((1, 3)))
    return FittedCandidate(probe.name, 1, fit, gain, 50.0, 300.0, 150.0, gain)


def rows(verdict: str = "explained") -> tuple[Candidate, ...]:
    material = Probe(
        "material_reflectance", {"factor": 0.8}, search_spec("material_reflectance").free, {"material_id": 3}
    )
    kinds = {probe.variant: probe for probe in fixed_probes(["pulse_shape"])}
    trials = [trial(kinds["slow fall"], 400.0), trial(kinds[""], 20.0), trial(material, 380.0)]
    rest = [trial(fixed_probes(["fog"])[0], 390.0)]
    given = Finding("pulse_shape", {}, 0.6, ("fog",), "", "")
    unknown = Finding("unknown", {}, 0.9, (), "", "")
    search = Search(trials[0].fit, trials[0].fit, trials + rest)
    return candidates_table(BENCH, search, verdict, [given if verdict == "explained" else unknown])  # type: ignore[arg-type]


def test_a_row_says_which_start_it_is_of() -> None:
    assert [(one.name, one.start) for one in rows()] == [
        ("pulse_shape", "slow fall"), ("pulse_shape", ""), ("material_reflectance", "material 3"), ("fog", ""),
    ]  # fmt: skip


def test_names_that_cannot_be_told_apart_say_so_of_each_other() -> None:
    assert [one.equivalent_to for one in rows()] == [("fog",), (), (), ("pulse_shape",)]
    assert not any(one.equivalent_to for one in rows("unknown"))


def test_the_share_that_closes_is_of_what_stands_above_the_floor() -> None:
    assert rows()[0].closed == pytest.approx((300.0 - 150.0) / (300.0 - 100.0))


@pytest.mark.parametrize("width", [60, 80, 100])
def test_the_text_shows_the_start(width: int) -> None:
    found = replace(explanation("explained"), candidates=rows())
    lines = report_sections(found, width=width)["Candidates"]
    assert max(map(len, lines)) <= width, "\n".join(lines)
    text = " ".join(" ".join(lines).split())
    assert "accepted, as slow fall (like fog)" in text
    assert "another explains more, as material 3" in text


def test_the_page_shows_the_start() -> None:
    found = replace(explanation("explained"), candidates=rows())
    assert "<small>slow fall</small>" in explanation_html(found, case(MODEL))
