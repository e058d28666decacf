"""The classifier's figure in the report: as text, in the verdict's sentence, in report.json and back."""

import dataclasses
import json

import pytest

import explain_report_kit as kit
from lidarcheck.explain.report.explanation import Explanation
from lidarcheck.explain.report.load import _gap
from lidarcheck.explain.report.text import report_text, verdict_sentence
from lidarcheck.figures.gap.verdict import verdict_of
from lidarcheck.inference.intervals import ClassifierGap


def explained(figure: ClassifierGap, **kinds: tuple[float | None, float | None, float | None]) -> Explanation:
    found = kit.explanation()
    return dataclasses.replace(found, gap=dataclasses.replace(found.gap, classifier=figure, by_kind=kinds))


def test_a_form_that_still_differs_is_said_with_both_numbers() -> None:
    for text in (verdict_sentence, lambda found: verdict_of(found).sentence):
        differs, closes = (text(explained(ClassifierGap(0.87, after, 0.03))) for after in (0.31, 0.02))
        assert "still differs" in differs
        assert "0.310" in differs
        assert "0.030" in differs
        assert "still differs" not in closes


def test_before_after_and_floor_stand_in_the_report() -> None:
    text = report_text(explained(ClassifierGap(0.87, 0.02, 0.03)))
    assert "classifier (2 AUC - 1): 0.870 before, 0.020 after; chance makes up to 0.030" in text
    assert "rests on the" in report_text(explained(ClassifierGap()))


@pytest.mark.parametrize("figure", [ClassifierGap(0.87, 0.31, 0.03), ClassifierGap()])
def test_the_report_gives_the_figure_and_the_kinds_back(figure: ClassifierGap) -> None:
    found = explained(figure, **{"area of bloom": (None, 0.4, 0.1)})
    document = json.loads(json.dumps(found.to_dict(), allow_nan=False))["gap"]
    assert document["classifier"] == figure.to_dict()
    assert document["by_kind"] == {"area of bloom": {"before": None, "after": 0.4, "floor": 0.1}}
    assert _gap(document) == found.gap
    earlier = {key: value for key, value in document.items() if key not in ("classifier", "by_kind")}
    assert _gap(earlier).classifier == ClassifierGap()
