"""The second line: whole words and numbers, and of these as many as there is room for."""

import re
from dataclasses import replace

import numpy as np
import pytest

from lidarcheck.calibration.number.number import Number, Step
from lidarcheck.tui.context import Context, context_line, course_of, step_words
from lidarcheck.tui.engine import Known

BETTER, WORSE = Step(-0.47, -0.6, -0.3, "better"), Step(0.2, 0.1, 0.3, "worse")


def number(value, exact=True):
    left_out = np.zeros(3)
    return Number("misfit", value, 0.4, {}, "7 200 beams x 8", left_out, "", "", str(value), exact=exact, seconds=0.6)


NOW = Known("current", number(1.84), BETTER, number(2.31), Step(-2.06, -3.0, -2.0, "better"), number(3.9))
WIRED = Context("vert.ini", 3, "SLIM.toml", "sign 69 m", "2/3", "gap", NOW, (3.9, 3.9, 3.2, 2.31, 1.84))


def text(context, width):
    return "".join(part for part, _ in context_line(context, width))


def test_it_is_as_drawn_at_the_widths_that_terminals_have():
    assert text(WIRED, 80) == "vert.ini *3 SLIM | sign 69 m 2/3 | gap 1.84 sd  edit -0.47 better  start -2.06"
    wide = "vert.ini *3 SLIM.toml | sign 69 m 2/3 | gap 1.84 sd  before 2.31 (-0.47 better)  start 3.90"
    assert text(WIRED, 100) == wide
    assert text(WIRED, 120) == f"{wide} | ##=-. | current".replace("##=-.", course_of(WIRED.course))
    # At 80 a state takes the place of the difference to the start, and what is expected has a tilde.
    computing = replace(WIRED, known=Known("computing 5/8 seeds", number(1.9, exact=False)))
    assert text(computing, 80) == "vert.ini *3 SLIM | sign 69 m 2/3 | gap ~1.90 sd  computing 5/8 seeds"
    none = replace(WIRED, known=Known("none: no ideal scan"))
    assert text(none, 80) == "vert.ini *3 SLIM | sign 69 m 2/3 | none: no ideal scan"


def test_a_long_reason_is_cut_between_words():
    none = replace(WIRED, known=Known("none: model.toml: PandarXT-32 does not bloom, as its beams have receivers"))
    assert text(none, 80) == "vert.ini *3 SLIM | sign 69 m 2/3 | none: model.toml: .."
    assert text(none, 160).endswith("beams have receivers")


@pytest.mark.parametrize("state", ["current", "OLD, of edit 12", "failed: the disk is full"])
def test_no_word_or_number_is_cut_at_any_width(state):
    context = replace(WIRED, file="vertical_of_the_sign_lut.ini", known=replace(NOW, state=state))
    narrow = text(replace(context, file="f", model="SLIM"), 99)
    whole = set(re.split(r"[ |]+", f"{text(context, 300)} {narrow}")) | {"vertical_of_the_sign_lut"}
    for width in range(40, 200):
        line = text(context, width)
        assert len(line) <= max(width, len(f"sign 69 m | gap 1.84 sd  {state}")), (width, line)
        assert set(re.split(r"[ |]+", line)) <= whole, (width, line)
        assert "gap 1.84 sd" in line
    for width in range(10, 40):
        line = text(context, width)
        assert set(re.split(r"[ |]+", line)) <= whole, (width, line)
        assert state == "current" or state in line


def test_what_an_edit_did_is_said_of_all_distances():
    worse = replace(NOW, step=WORSE)
    alone = step_words("edit 14", NOW, "69 m", [], "")
    assert alone == "edit 14: 2.31 -> 1.84 sd at 69 m, better beyond chance (7 200 beams x 8, 0.6 s)"
    both = step_words("edit 14", NOW, "69 m", [("157 m", worse)], "")
    assert both == "edit 14: better at 69 m, worse at 157 m; 2.31 -> 1.84 sd at 69 m"
    waits = step_words("edit 14", NOW, "69 m", [("157 m", Known("computing 5/8 seeds"))], "5/8 seeds")
    assert waits.startswith("edit 14: better at 69 m, not yet known at 157 m (5/8 seeds)")
    assert step_words("edit 14", replace(NOW, state="OLD, of edit 3"), "69 m", [], "") == ""
