"""Hidden effects in repeats: the scene stands still, sensors state all their numbers, each kind hides what it says."""

import sys
from pathlib import Path

import numpy as np
import pytest

import hidden
from lidarcheck.cases.case import load_case
from lidarcheck.cases.origin import Origin
from lidarcheck.effects.search import search_spec
from lidarcheck.explain.benchmark.run import load_generator
from lidarcheck.sensor.document import stated_numbers

repeats = load_generator(Path(hidden.__file__).parent / "repeats")
orders = sys.modules[f"{repeats.__name__}.orders"]
cases = sys.modules[f"{repeats.__name__}.cases"]


def order(sensor, *effects, kind="single"):
    return repeats.CaseOrder(0, kind if effects else "null", 5, effects, "medium", sensor)


def test_two_of_three_recordings_hide_what_repeats_show() -> None:
    planned = repeats.plan(30, 3)
    assert planned == repeats.plan(30, 3)
    kinds = [one.kind for one in planned]
    assert (kinds.count("single"), kinds.count("untestable")) == (20, 10)
    for kind, names in (("single", orders.CHANGES), ("untestable", orders.CONSTANT)):
        mine = [one for one in planned if one.kind == kind]
        assert {one.effects[0] for one in mine} == set(names)
        assert len({one.variant for one in mine}) == 3
    unseen = {name for name in (*orders.CHANGES, *orders.CONSTANT) if Origin("repeats").why_unseen(search_spec(name))}
    assert unseen == set(orders.CONSTANT)


@pytest.mark.parametrize("sensor", orders.SENSORS)
def test_frames_are_repeats_of_one_scene_by_a_sensor_that_states_its_numbers(sensor: str, tmp_path: Path) -> None:
    repeats.write_case(order(sensor), tmp_path, frames=3)
    case = load_case(tmp_path)
    assert {"threshold", "signal_at_1m"} <= stated_numbers(case.model.sensor)
    ranges = []
    for frame in case.frames:
        scan = frame.measured
        first = scan.take(scan.echo_number == 1)
        ranges.append({(a, b): r for a, b, r in zip(first.layer, first.point, first.range_m, strict=True)})
    both = sorted(ranges[0].keys() & ranges[1].keys())
    apart = np.array([ranges[0][key] - ranges[1][key] for key in both])
    assert len(both) > 1000
    assert 0.0 < np.median(np.abs(apart)) < 0.1


def test_what_shakes_is_another_view_in_each_repeat_and_no_other_effect(tmp_path: Path) -> None:
    still, shaking = (cases.setting(order("XT32", *names)) for names in ((), ("vibration",)))
    echoes = [[s.echoes(k) for k in range(2)] for s in (still, shaking)]
    spreads = []
    for one, other in echoes:
        both = np.intersect1d(one.beam, other.beam)
        place = [dict(zip(e.beam.tolist(), e.path_m, strict=True)) for e in (one, other)]
        spreads.append(np.mean([abs(place[0][b] - place[1][b]) > 0.05 for b in both.tolist()]))
    assert spreads[1] > 2.0 * spreads[0] + 0.02
