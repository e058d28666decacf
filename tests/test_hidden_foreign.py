"""Hidden cases of foreign sensors: their generator agrees with the package, and hides what it says."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hidden
from lidarcheck.cases.case import load_case
from lidarcheck.explain.benchmark.run import load_generator
from lidarcheck.explain.benchmark.score import Answer
from lidarcheck.model import simulate

PLACE = Path(hidden.__file__).parent / "foreign"
foreign = load_generator(PLACE)
orders = sys.modules[f"{foreign.__name__}.orders"]
cases = sys.modules[f"{foreign.__name__}.cases"]
visibility = sys.modules[f"{foreign.__name__}.visibility"]
FRAMES = {"street": 3, "bench": 12}


def quiet(sensor: str, seed: int = 5):
    scene = "bench" if orders.DETECTOR[sensor] == "photon_histogram" else "street"
    return foreign.CaseOrder(0, "null", seed, (), "medium", sensor, scene)


def of_scans(ideals, scans) -> dict[str, np.ndarray]:
    """Values (n,) of all echoes of all frames by name, and how many echoes each beam has."""
    found: dict[str, list[np.ndarray]] = {}
    for ideal, scan in zip(ideals, scans, strict=True):
        rows = ideal.beams.index(ideal.layer.astype(np.int64), ideal.point.astype(np.int64))
        ways = {beam: ideal.distance_m[rows == beam] for beam in np.unique(rows)} if len(rows) < 2000 else None
        single = dict(zip(rows.tolist(), ideal.distance_m[:, None], strict=True)) if ways is None else ways
        echo = ideal.beams.index(scan.layer, scan.point)
        way = scan.range_m - scan.beams.range_offset_m(scan.layer)
        nearest = np.array([np.abs(single[beam] - r).min() for beam, r in zip(echo.tolist(), way, strict=True)])
        on = nearest < visibility.ON_SURFACE_M
        beams = np.unique(rows)
        counts, extra = (np.bincount(np.searchsorted(beams, echo[part]), minlength=len(beams)) for part in (on, ~on))
        values = {"found": counts, "extra": extra, "distance": nearest[on]}
        values |= {name: scan.feature(name)[on] for name in scan.feature_names}
        for name, column in values.items():
            found.setdefault(name, []).append(np.asarray(column, np.float64))
    return {name: np.concatenate(columns) for name, columns in found.items()}


@pytest.mark.parametrize("sensor", orders.SENSORS)
def test_agrees_with_the_package_where_nothing_is_hidden(sensor, tmp_path):
    order = quiet(sensor)
    foreign.write_case(order, tmp_path, frames=FRAMES[order.scene])
    case = load_case(tmp_path)
    ideals = [frame.ideal for frame in case.frames]
    measured = of_scans(ideals, [frame.measured for frame in case.frames])
    simulated = of_scans(ideals, [simulate(one, case.model, seed=k) for k, one in enumerate(ideals)])
    again = of_scans(ideals, [simulate(one, case.model, seed=50 + k) for k, one in enumerate(ideals)])
    assert set(measured) == set(simulated)
    for name in measured:
        both = np.concatenate([simulated[name], again[name]])
        a = measured[name]
        spread = np.sqrt((both.var() + 1e-12) * (1 / len(a) + 1 / len(both)))
        assert abs(a.mean() - both.mean()) < visibility.VISIBLE_Z * spread + 1e-9, name
        if name in ("distance", "found"):
            for share in (0.1, 0.9):
                assert np.quantile(a, share) == pytest.approx(np.quantile(both, share), abs=0.004), name


def test_a_plan_hides_every_effect_and_nothing_in_every_fifth_case():
    planned = foreign.plan(60, 0)
    assert planned == foreign.plan(60, 0)
    assert {one.variant for one in planned} == set(orders.SENSORS)
    hidden_there = {name for one in planned for name in one.effects}
    assert set(orders.EFFECTS["linear"]) <= hidden_there
    assert [one.kind for one in planned].count("null") == [one.kind for one in planned].count("null_nuisance") == 6


@pytest.mark.parametrize(
    ("sensor", "name"),
    [("XT32", "signal_gain"), ("VLP-16", "range_offset"), ("HDL-32E", "fog"), ("TMF8820-short", "pulse_shape"),
     ("OS1-128", "ambient_light"), ("SLIM-channels", "walk_error"), ("XT32", "range_ripple")],
)  # fmt: skip
def test_what_is_hidden_stands_out(sensor, name, tmp_path):
    order = replace(quiet(sensor), kind="single", effects=(name,))
    truth = foreign.write_case(order, tmp_path, frames=FRAMES[order.scene]).open({"verdict": "no_gap"})
    assert truth.observable[name], truth.z


def test_answers_are_counted_by_what_they_say():
    sys.path.insert(0, str(PLACE.parents[2] / "ci"))
    import foreign_sensors

    def answer(kind="single", verdict="explained", names=("fog",), alike=(), why=()):
        found = [{"name": name, "equivalent_to": alike, "confidence": 0.9, "parameters": {}} for name in names]
        effects = () if kind == "null" else ("rain",)
        return Answer(
            0, kind, "medium", "XT32", "street", effects, {}, {}, verdict, tuple(found), 0.5, 1.0,
            not_testable=dict.fromkeys(why, "too weak"),
        )  # fmt: skip

    expected = {
        "right": answer(names=("rain",)),
        "right and more": answer(names=("fog", "rain")),
        "equivalent": answer(alike=("rain",)),
        "not testable": answer(verdict="no_gap", names=(), why=("rain",)),
        "unknown": answer(verdict="unknown", names=("unknown",)),
        "no gap": answer(verdict="no_gap", names=()),
        "wrong": answer(),
        "error": replace(answer(), error="no file"),
    }
    assert {word: foreign_sensors.said(one) for word, one in expected.items()} == {word: word for word in expected}
    assert foreign_sensors.said(answer("null", "no_gap", ())) == "right"
    assert foreign_sensors.said(answer("null")) == "wrong"
    table = foreign_sensors.tables(list(expected.values())).splitlines()
    assert table[2].split(" | ")[1:10] == ["8", *["1"] * 8]
