"""The gap workflow beside ideal scans estimated from repeats: what it names, cannot test, and says of no gap."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from explain_core_kit import model, street
from lidarcheck.cases.case import Case
from lidarcheck.cases.frame import Frame
from lidarcheck.cases.origin import Origin
from lidarcheck.effects import make
from lidarcheck.explain.report.load import _explanation
from lidarcheck.explain.report.text import verdict_sentence
from lidarcheck.explain.workflow import explain
from lidarcheck.figures.gap.verdict import verdict_of
from lidarcheck.model import simulate
from lidarcheck.model.estimates import drawn

ORIGIN = Origin("repeats", repeats=9)
PARTS = ("fit", "fit", "select", "verify")
ERROR_M, ERROR = 0.03, 0.02


def estimate():
    """A street in which each ray has a reflectance of its own, a texture that no table of materials has."""
    ideal = street(0, sign=True)
    rho = 0.3 * np.exp(0.5 * np.random.default_rng(3).standard_normal(len(ideal)))
    extra = {
        "Reflectance": np.minimum(rho, 1.0),
        "ReflectanceError": ERROR * rho,
        "DistanceError": np.full(len(ideal), ERROR_M),
    }
    return dataclasses.replace(ideal, material_id=np.full(len(ideal), 1), object_id=None, extra=extra)


def repeats(*hidden, origin=ORIGIN):
    """A case of repeats: the estimate is off the scene as much as it says, in all frames alike."""
    ideal = estimate()
    truth = drawn(ideal, 999)
    known = {name: column for name, column in truth.extra.items() if name == "Reflectance"}
    truth = dataclasses.replace(truth, extra=known)
    frames = [
        Frame(k, ideal, simulate(truth, model(*hidden), seed=77, frame=k), 0.1 * k, part=part, origin=origin)
        for k, part in enumerate(PARTS)
    ]
    return Case(Path(), model(), Path("model.toml"), tuple(frames), origin=origin)


def test_nothing_is_missing_that_repeats_can_show():
    found = explain(repeats(), seed=1)
    assert found.verdict == "no_gap"
    assert found.split == {"fit": (0, 1), "select": (2,), "verify": (3,)}
    assert verdict_sentence(found).endswith("Nothing is missing that repeats can show.")
    assert verdict_of(found).headline == "No gap: nothing is missing that repeats can show"
    assert found.to_dict()["ideals_from"] == "repeats"
    assert "range_offset" in found.not_testable


def test_what_is_lost_at_random_is_named_also_where_laws_were_fitted_here():
    fitted = dataclasses.replace(ORIGIN, laws_fitted=True)
    found = explain(repeats(make("dropout", {"share": 0.06}), origin=fitted), seed=1)
    assert [one.name for one in found.findings] == ["dropout"]
    assert "shows only as a change between the frames to fit and those to verify" in found.not_testable["timing_jitter"]
    assert "constant in time" in found.not_testable["range_offset"]
    assert "dropout" not in found.not_testable
    again = _explanation(json.loads(json.dumps(found.to_dict())), model(), found.model)
    assert again.ideals_from == "repeats"


@pytest.mark.long
def test_what_the_air_sends_back_all_the_time_gets_no_other_name():
    veil = make("fog", {"mor_m": 1e4, "backscatter": 1.5, "overlap_start_m": 1.0, "overlap_full_m": 7.0})
    found = explain(repeats(veil), seed=1)
    assert found.verdict == "unknown"
    assert [one.name for one in found.findings] == ["unknown"]
    assert found.findings[0].where.startswith("what is left looks like fog, which such ideal scans cannot show")
    assert "constant in time" in found.not_testable["fog"]
