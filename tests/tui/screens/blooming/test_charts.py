"""What the plots of Blooming are made of."""

import numpy as np
import pytest

from lidarcheck.calibration.blooming.cells import Profile
from lidarcheck.calibration.number.number import Number, Residual
from lidarcheck.tui.engine import Known
from lidarcheck.tui.screens.blooming.charts import NOW, REAL, profile_chart

OFFSET = np.array([-30.0, 0.0, 30.0])


def profile(area):
    value = np.column_stack([np.full(3, 50.0), np.full(3, area), np.full(3, 6.0)])
    return Profile(OFFSET, np.full(3, 69.0), value, np.full(3, 100), np.array([False, True, False]))


def number(rms, off, *, exact=True):
    residual = Residual(OFFSET, {"AREA": np.array(off)}, {"AREA": np.full(3, 0.2)})
    parts = {"AREA": rms, "PEAK": 9.0}
    return Number("misfit", 2.0, 0.4, parts, "", np.zeros(3), "", "", str(rms), exact=exact, residual=residual)


def strip(known, feature="AREA"):
    chart = profile_chart(feature, {REAL: profile(1000.0), NOW: profile(500.0)}, "69 m", "vertical", "k", known)
    return chart.strip


@pytest.mark.parametrize(("state", "exact", "ends"), [
    ("current", True, ""), ("computing 5/8 seeds", False, ""), ("OLD, of edit 3", True, ", OLD"),
])  # fmt: skip
def test_the_strip_is_in_standard_deviations_and_says_of_what_it_is(state, exact, ends):
    now, before = number(1.84, [-3.1, 0.1, np.nan], exact=exact), number(2.31, [0.0, 0.0, 0.0])
    found = strip(Known(state, now, None, before))
    assert found.words == f"real - now [sd], rms 1.84, was 2.31{ends}"
    assert found.far.tolist() == [True, False, False]
    assert (found.scale, found.reach) == ("lin", 5.0)


def test_without_a_number_it_compares_the_curves():
    for known, feature in (
        (None, "AREA"),
        (Known("not yet known"), "AREA"),
        (Known("", number(1.0, [1, 1, 1])), "PEAK"),
    ):
        assert strip(known, feature).words.startswith("real / now, rms ")
