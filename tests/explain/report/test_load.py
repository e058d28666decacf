"""What a run has left is read again as it was; what is no report is refused in a line."""

import dataclasses
import json
import math

import pytest

from explain_kit import explanation, write_case
from lidarcheck.cases.case import case_model, load_case
from lidarcheck.errors import InputError, LidarcheckError
from lidarcheck.explain.report.explanation import Alternative, Calibrated
from lidarcheck.explain.report.load import changed_since, load_explanation
from lidarcheck.explain.report.model_diff import model_diff, write_model
from lidarcheck.explain.report.text import report_text
from lidarcheck.inference.intervals import Interval
from lidarcheck.model import load_model


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return write_case(tmp_path_factory.mktemp("earlier") / "case")


@pytest.fixture
def left(made, tmp_path):
    """A case, an explanation, and the report and model that a run leaves."""

    def leave(verdict="explained", names=("fog", "walk_error")):
        case = load_case(made)
        found = explanation(case, verdict, names)
        fitted = {"mor_m": Interval(812.0, 790.0, 840.0, "m")}  # the kit's own parameter is none of fog's
        shown = [dataclasses.replace(one, parameters=fitted if one.name == "fog" else {}) for one in found.findings]
        found = dataclasses.replace(found, findings=tuple(shown))
        (tmp_path / "report.json").write_text(json.dumps(found.to_dict()))
        write_model(case.model_file, found.model, tmp_path / "model.toml")
        return case, found, load_explanation(tmp_path / "report.json", tmp_path / "model.toml", case.model)

    return leave


@pytest.mark.parametrize(
    ("verdict", "names"), [("explained", ("fog", "walk_error")), ("no_gap", ()), ("unknown", ("unknown",))]
)
def test_it_says_again_what_it_said(left, verdict, names):
    case, found, again = left(verdict, names)
    assert again.to_dict() == found.to_dict()
    assert [one.effects for one in again.findings] == [one.effects for one in found.findings]
    diff = model_diff(case.model, found.model)
    assert model_diff(case.model, again.model) == diff
    assert report_text(again, diff=diff) == report_text(found, diff=diff)


def test_what_is_calibrated_and_what_else_was_tried_is_said_again(left, tmp_path):
    case, found, _ = left()
    numbers = (
        Calibrated("materials.1.reflectance", 0.17, 0.169, 0.16, 0.18, 0.015),
        Calibrated("x", 1.0, 2.0, 1.5, 3.0),
    )
    others = (
        Alternative(("rain", "walk_error"), -40.5, 0.2, "farther"),
        Alternative(("rain",), -400.0, math.nan, "far"),
    )
    found = dataclasses.replace(found, calibrated=numbers, rivals=others, closed_seen=0.98)
    (tmp_path / "report.json").write_text(json.dumps(found.to_dict()))
    again = load_explanation(tmp_path / "report.json", tmp_path / "model.toml", case.model)
    assert again.to_dict() == found.to_dict()
    text = report_text(again, width=100)
    assert "materials.1.reflectance  0.17 -> 0.169  (0.16 ... 0.18)  1.5 % of the gap" in text
    assert "- rain and walk_error: score -40, leaves 0.2 of the gap on the frames seen; farther" in text
    assert text.index("Calibrated besides") > text.index("What is missing")


def test_a_report_of_an_earlier_version_is_read(left, tmp_path):
    case, found, _ = left()
    old = found.to_dict()
    for name in ("calibrated", "rivals"):
        del old[name]
    del old["gap"]["closed_seen"]
    del old["gap"]["intervals"]["closed"]
    (tmp_path / "report.json").write_text(json.dumps(old))
    again = load_explanation(tmp_path / "report.json", tmp_path / "model.toml", case.model)
    assert (again.calibrated, again.rivals, again.closed_seen) == ((), (), None)
    assert again.gap.closed == found.gap.closed


def test_what_is_no_report_is_refused_in_a_line(left, tmp_path):
    case, found, _ = left()
    report, model = tmp_path / "report.json", tmp_path / "model.toml"
    whole = found.to_dict()
    for text, says in (
        ("not json", "this is not JSON"),
        ("[1, 2]", "no report of `explain`"),
        (json.dumps({**whole, "gap": {}}), "no report of `explain`"),
        (json.dumps({**whole, "effects": [{**whole["effects"][0], "name": "nothing"}]}), "no report of `explain`"),
        (json.dumps({**whole, "where": [{"x": 1}]}), "no report of `explain`"),
    ):
        report.write_text(text)
        with pytest.raises(InputError, match=says) as caught:
            load_explanation(report, model, case.model)
        assert len(caught.value.lines()) == 1
    report.unlink()
    with pytest.raises(InputError, match="cannot read"):
        load_explanation(report, model, case.model)


def test_what_has_changed_since(made, left):
    case, found, _ = left()
    assert changed_since(case.directory, found.hashes) == []
    other = dataclasses.replace(found, hashes={**found.hashes, "m1.txt": "0", "gone.txt": "0"})
    assert changed_since(case.directory, other.hashes) == ["m1.txt", "gone.txt"]


def test_the_model_of_a_case_without_reading_its_frames(made, tmp_path):
    assert case_model(made) == case_model(made / "case.toml") == made / "model.toml"
    assert load_model(case_model(made)) == load_case(made).model
    (tmp_path / "case.toml").write_text('model = "../model.toml"\n')
    with pytest.raises(LidarcheckError, match="no frames"):
        case_model(tmp_path)
