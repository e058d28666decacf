"""An effect must be what its name says: dirt is local, rain has drops; and small errors put right must help."""

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import Effect, make
from lidarcheck.explain.answer import CALIBRATION, Answer
from lidarcheck.explain.candidates import fixed_probes
from lidarcheck.explain.explanation import Finding
from lidarcheck.explain.fit import Fit
from lidarcheck.explain.lab import Lab
from lidarcheck.explain.located_patch import from_side_to_side
from lidarcheck.explain.trials import tried

FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 6)}
HAZE = make("fog", {"mor_m": 120.0, "backscatter": 0.0})
DRIZZLE = make("rain", {"rate_mm_h": 40.0})


@pytest.fixture(scope="module")
def plain() -> Lab:
    return Lab(frames(model(), 2, **FINE), model(), 3)


@pytest.mark.parametrize(
    ("first", "last", "whole"), [(0, 959, True), (320, 640, True), (320, 500, False), (450, 470, False)]
)
def test_a_band_over_all_points_is_no_dirt(plain: Lab, first: int, last: int, whole: bool) -> None:
    place = {"first_layer": 240, "last_layer": 250, "first_point": first, "last_point": last}
    assert from_side_to_side(plain, make("blockage", place)) is whole
    assert not from_side_to_side(plain, make("signal_gain", {}))


@pytest.mark.parametrize(("missing", "is_rain"), [(HAZE, False), (DRIZZLE, True)], ids=["haze", "rain"])
def test_there_is_no_rain_without_drops(missing: Effect, is_rain: bool) -> None:
    lab = Lab(frames(model(missing), 2, **FINE), model(), 3)
    nothing = np.zeros((1, len(lab.measured)))
    now = Fit((), (), lab.distance(nothing), nothing)
    found = [tried(lab, lab, now, nothing, 10.0, probe)[0] for probe in fixed_probes(["rain"])]
    assert any(fit.possible for fit in found) is is_rain
    fog = min((tried(lab, lab, now, nothing, 10.0, probe)[0] for probe in fixed_probes(["fog"])), key=_distance)
    assert fog.possible


def _distance(fit: Fit) -> float:
    return fit.distance


def test_what_an_answer_is_without() -> None:
    own, named, tuned = model(), model(HAZE), model(DRIZZLE)
    finding = Finding("fog", {}, 0.9, (), "", "", (HAZE,))
    stages = (("", own), ("fog", named), (CALIBRATION, tuned))
    assert Answer("explained", (finding,), stages, "").without_calibration().stages == stages[:-1]
    terms = Answer("unknown", (finding,), (("", own), ("empirical: loss", named)), "").without_terms()
    assert [model_ for _, model_ in terms.stages] == [own, own]
    assert terms.findings[0].effects == ()
