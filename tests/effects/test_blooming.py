"""The two bloomings: on the light itself, against closed forms and slow loops."""

import math

import numpy as np
import pytest

from lidarcheck.effects import make
from lidarcheck.effects.base import Curve
from lidarcheck.effects.shared.blooming import CLUSTER_M, CLUSTERS_PER_LINE, NEGLIGIBLE
from lidarcheck.formats.lut import load_lut
from lidarcheck.scan import IdealScan, Light
from lidarcheck.sensor import Sensor
from light_kit import added, alone, cross, lit, own, scan_of, signal
from places import shared_path

VERTICAL, HORIZONTAL = "blooming_vertical", "blooming_horizontal"
TABLE = Curve((-30.0, -3.0, 0.0, 6.0, 12.0, 12.0), (0.001, 0.01, 1.0, 0.02, 0.004, 0.002), "table.ini")


@pytest.mark.parametrize(("name", "step"), [(VERTICAL, 3.0), (HORIZONTAL, 2.5)])
def test_a_table_is_what_a_beam_at_that_offset_gets(name: str, step: float) -> None:
    ideal = cross((260, 480, 50.0))
    new = added(lit(ideal, make(name, {"lut": TABLE})), own(ideal))
    expected = {}
    for k in range(-40, 41):
        x = step * k
        y = TABLE.y[-1] if x == TABLE.x[-1] else float(np.interp(x, TABLE.x, TABLE.y, left=0.0, right=0.0))
        if k and y > 0.0:
            expected[(260 + k, 480) if name == VERTICAL else (260, 480 + k)] = y * signal(50.0)
    row = int(np.flatnonzero(ideal.distance_m == 50.0)[0])
    assert new.keys() == expected.keys()
    for beam, pulses in new.items():
        ((range_m, s, of),) = pulses
        assert range_m == 50.0
        assert s == pytest.approx(expected[beam], rel=1e-12)
        assert of == row
    if name == VERTICAL:
        assert new[264, 480][0][1] == pytest.approx(0.002 * signal(50.0)), "the last row of a repeated X holds"
        assert new[250, 480][0][1] == pytest.approx(0.001 * signal(50.0)), "the first row still counts"
        assert (249, 480) not in new


def test_the_sample_tables_have_their_signs() -> None:
    ideal = cross((260, 480, 30.0))
    for axis, name in (("vertical", VERTICAL), ("horizontal", HORIZONTAL)):
        table = load_lut(shared_path(f"samples/{axis}_lut.ini")).tables[axis]
        effect = make(name, {"lut": Curve(tuple(table.x.tolist()), tuple(table.y.tolist()), "sample.ini")})
        new = added(lit(ideal, effect), own(ideal))
        for k in (-8, -1, 1, 8):
            beam, step = ((260 + k, 480), 3.0) if name == VERTICAL else ((260, 480 + k), 2.5)
            at = k * step if name == VERTICAL else abs(k) * step
            y = float(table.interp(at)) * signal(30.0)
            assert new.get(beam, [(0, 0, 0)])[0][1] == pytest.approx(y if y * 315 >= NEGLIGIBLE else 0.0, rel=1e-12)


def closed_form(name: str, x: float, sides: dict[str, float]) -> float:
    plus, minus, unit = ("up", "down", "rows") if name == VERTICAL else ("left", "right", "columns")
    side = plus if x > 0 else minus
    if abs(x) > sides[f"reach_{unit}"]:
        return 0.0
    skirt = sides[f"skirt_{side}"] * math.exp(-((x / sides[f"skirt_{side}_{unit}"]) ** 2))
    return sides["strength"] * (sides[f"core_{side}"] * math.exp(-abs(x) / sides[f"core_{unit}"]) + skirt)


@pytest.mark.parametrize("name", [VERTICAL, HORIZONTAL])
@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_without_a_table_the_profile_follows_its_formula(name: str, variant: str) -> None:
    effect = make(name, {"strength": 0.7})
    ideal = cross((200, 300, 20.0))
    new = added(lit(ideal, effect, variant=variant), own(ideal, variant))
    step = 3.0 if name == VERTICAL else 2.5
    detectors = Sensor.of(variant).detectors
    for k in range(-90, 91):
        s = closed_form(name, step * k, effect.settings()) * signal(20.0)
        beam = (200 + k, 300) if name == VERTICAL else (200, 300 + k)
        if k and s * detectors >= NEGLIGIBLE:
            ((range_m, found, _),) = new.pop(beam)
            assert (range_m, found) == (20.0, pytest.approx(s, rel=1e-12))
    assert not new


def test_vertical_blooming_is_by_far_the_stronger_one() -> None:
    ideal = cross((260, 480, 30.0))
    total = [
        sum(p[1] for ps in added(lit(ideal, make(n, {})), own(ideal)).values() for p in ps)
        for n in (VERTICAL, HORIZONTAL)
    ]
    assert total[0] > 20 * total[1] > 0


@pytest.mark.parametrize("name", [VERTICAL, HORIZONTAL])
def test_two_targets_are_the_sum_of_each(name: str) -> None:
    beams = [(260, 480, 30.0), (266, 480, 45.0), (260, 490, 60.0)]
    together = added(lit(cross(*beams), make(name, {})), own(cross(*beams)))
    found: dict[tuple[int, int], list[float]] = {}
    for beam in beams:
        ideal = cross(*beams)
        distance = np.where(ideal.distance_m == beam[2], ideal.distance_m, 0.0)
        one = IdealScan(ideal.layer, ideal.point, distance, ideal.material_id, ideal.incidence_deg)
        for at, pulses in added(lit(one, make(name, {})), own(one)).items():
            found.setdefault(at, []).extend(p[0:2] for p in pulses)
    assert together.keys() == found.keys()
    for at, pulses in together.items():
        assert [p[:2] for p in pulses] == [pytest.approx(p, rel=1e-12) for p in sorted(found[at])]


def slow(light: Light, ideal: IdealScan, name: str, y) -> dict[tuple[int, int], tuple[float, float]]:
    """Sum of S and of S R at each beam, pair by pair."""
    out: dict[tuple[int, int], tuple[float, float]] = {}
    beams = list(zip(light.layer.tolist(), light.point.tolist(), strict=True))
    beam_of = np.repeat(np.arange(len(light)), np.diff(light.first_pulse))
    for s, r, i in zip(light.pulse_signal.tolist(), light.pulse_range_m.tolist(), beam_of.tolist(), strict=True):
        if s < 30.0:
            continue
        layer, point = beams[i]
        for other in beams:
            if other == beams[i] or (other[1] != point if name == VERTICAL else other[0] != layer):
                continue
            share = s * y(3.0 * (other[0] - layer) if name == VERTICAL else 2.5 * (other[1] - point))
            before = out.get(other, (0.0, 0.0))
            out[other] = (before[0] + share, before[1] + share * r)
    return out


@pytest.mark.parametrize("name", [VERTICAL, HORIZONTAL])
@pytest.mark.parametrize("spread_m", [0.0, 0.1, 3.0, 150.0])
def test_clusters_conserve_light_and_its_mean_range(name: str, spread_m: float) -> None:
    rng = np.random.default_rng(5)
    layer, point = np.divmod(np.arange(400), 20)
    distance = 40.0 + rng.uniform(0.0, spread_m, 400)
    ideal = IdealScan(layer + 100, point + 200, distance, rng.choice([1, 2], 400, p=[0.3, 0.7]), np.zeros(400))
    shuffled = ideal.take(rng.permutation(400))
    wide = {VERTICAL: {"core_up": 0.1, "core_down": 0.2}, HORIZONTAL: {"core_left": 0.1, "core_right": 0.2}}[name]
    effect = make(name, wide)
    settings = effect.settings()
    light = own(shuffled)
    new = added(lit(shuffled, effect), light)
    expected = slow(light, shuffled, name, lambda x: closed_form(name, x, settings))
    assert new.keys() == expected.keys()
    for beam, pulses in new.items():
        total, moment = expected[beam]
        ranges, signals = (np.array(column) for column in list(zip(*pulses, strict=True))[:2])
        left_out = CLUSTERS_PER_LINE * NEGLIGIBLE / 315
        assert signals.sum() == pytest.approx(total, rel=1e-9, abs=left_out)
        mean_m = (signals * ranges).sum() / signals.sum()
        assert mean_m == pytest.approx(moment / total, abs=1e-9 + left_out / total * spread_m)
        assert np.all((ranges >= distance.min()) & (ranges <= distance.max() + 1e-9))
        if spread_m <= 0.1:
            assert len(pulses) == 1
            assert (signals[0], ranges[0]) == (
                pytest.approx(total, rel=1e-12),
                pytest.approx(moment / total, rel=1e-12),
            )


def test_ranges_stay_apart_from_a_bin_on_and_carry_their_strongest_source() -> None:
    ideal = scan_of((50, 7, 20.0, 2), (51, 7, 20.1, 2), (52, 7, 20.4, 2), (53, 7, 30.0, 2), (60, 7, 0.0, 1))
    table = Curve((-60.0, 60.0), (0.01, 0.01), "flat.ini")
    new = added(lit(ideal, make(VERTICAL, {"lut": table})), own(ideal))
    merged = (20.0 * signal(20.0) + 20.1 * signal(20.1)) / (signal(20.0) + signal(20.1))
    assert 0.1 < CLUSTER_M < 0.3
    assert [p[0] for p in new[60, 7]] == pytest.approx([merged, 20.4, 30.0], abs=1e-9)
    assert [p[2] for p in new[60, 7]] == [0, 2, 3]
    assert new[60, 7][0][1] == pytest.approx(0.01 * (signal(20.0) + signal(20.1)), rel=1e-12)


def test_a_line_of_many_ranges_stays_bounded() -> None:
    distance = 20.0 + 0.4 * np.arange(300)
    ideal = IdealScan(np.arange(300), np.full(300, 7), distance, np.full(300, 2), np.zeros(300))
    table = Curve((-900.0, 900.0), (0.1, 0.1), "flat.ini")
    light = lit(ideal, make(VERTICAL, {"lut": table}))
    assert np.diff(light.first_pulse).max() <= CLUSTERS_PER_LINE + 1
    total = sum(signal(d) for d in distance)
    for pulses, d in zip(added(light, own(ideal)).values(), distance.tolist(), strict=True):
        assert sum(p[1] for p in pulses) == pytest.approx(0.1 * (total - signal(d)), rel=1e-9)


@pytest.mark.parametrize("name", [VERTICAL, HORIZONTAL])
def test_the_edges_of_the_field_of_view_end_a_line(name: str) -> None:
    corners = [(0, 0, 30.0), (519, 959, 40.0)]
    ideal = cross(*corners)
    light = lit(ideal, make(name, {}))
    new = added(light, own(ideal))
    assert np.array_equal(light.layer, own(ideal).layer)
    low, high = [(layer, point) for layer, point in new if layer < 200 and point < 400], len(new)
    assert 0 < len(low) < high
    for layer, point in new:
        assert (point in (0, 959)) if name == VERTICAL else (layer in (0, 519))
    assert (0, 0) not in new
    assert (519, 959) not in new


@pytest.mark.parametrize("name", [VERTICAL, HORIZONTAL])
def test_nothing_bright_is_the_very_same_light(name: str) -> None:
    empty = IdealScan(*(np.empty(0) for _ in range(5)))
    dark = scan_of((10, 10, 20.0, 1), (11, 10, 0.0, 1), (10, 11, 0.0, 2))
    alone_in_line = scan_of((10, 10, 20.0, 2))
    for ideal in (empty, dark, alone_in_line):
        light = own(ideal)
        assert alone(make(name, {}), light, ideal) is light
    bright = cross((260, 480, 30.0))
    light = own(bright)
    for off in ({"strength": 0.0}, {"bright_signal": signal(29.99)}, {"lut": Curve((300.0, 400.0), (0.0, 0.0), "f")}):
        assert alone(make(name, off), light, bright) is light
    assert alone(make(name, {"bright_signal": signal(30.01)}), light, bright) is not light


def test_scattered_light_does_not_scatter_again_and_the_order_does_not_matter() -> None:
    ideal = cross((260, 480, 10.0), (262, 486, 12.0))
    strong = {"strength": 50.0}
    one = lit(ideal, make(VERTICAL, strong), make(HORIZONTAL, strong))
    other = lit(ideal, make(HORIZONTAL, strong), make(VERTICAL, strong))
    before = own(ideal)
    first, second = added(one, before), added(other, before)
    assert first == second
    each = [added(lit(ideal, make(n, strong)), before) for n in (VERTICAL, HORIZONTAL)]
    assert sum(map(len, first.values())) == sum(len(p) for part in each for p in part.values())
    twice = added(lit(ideal, make(VERTICAL, strong), make(VERTICAL, strong)), before)
    assert {beam: len(p) for beam, p in twice.items()} == {beam: 2 * len(p) for beam, p in each[0].items()}


def test_blooming_takes_the_light_as_it_stands_there() -> None:
    ideal = cross((260, 480, 30.0))
    plain = added(lit(ideal, make(VERTICAL, {})), own(ideal))
    dimmer = added(lit(ideal, make("signal_gain", {"gain": 0.5}), make(VERTICAL, {})), own(ideal))
    for beam, pulses in dimmer.items():
        assert pulses[0][1] == pytest.approx(0.5 * plain[beam][0][1], rel=1e-12)
    behind = lit(ideal, make(VERTICAL, {}), make("signal_gain", {"gain": 0.5}))
    assert added(behind, own(ideal))[262, 480][0][1] == pytest.approx(0.5 * plain[262, 480][0][1], rel=1e-12)
    gone = added(
        lit(ideal, make(VERTICAL, {}), make("material_reflectance", {"factor": 0.0, "material_id": 2})), own(ideal)
    )
    assert all(p[1] == 0.0 for pulses in gone.values() for p in pulses), "bloom keeps the material that it comes from"


def test_the_typical_profile_follows_a_measured_sign() -> None:
    """Light on the column of a sign 7 layers high at 157.7 m, against what the measured PEAK demands of 315 SPADs."""
    lines = shared_path("data/sign_blooming/vertical_157m.csv").read_text().splitlines()[1:]
    measured = {int(o): float(p) for o, _, p, *_ in (line.split(",") for line in lines) if p != "nan"}
    ideal = cross(*((260 + k, 480, 157.7) for k in range(-3, 4)), points=range(480, 481))
    bloom = {layer - 260: p[0][1] for (layer, _), p in added(lit(ideal, make(VERTICAL, {})), own(ideal)).items()}
    ratio = []
    for offset in (-60, -45, -30, -15, 30, 45, 60, 75, 90, 105, 120, 135, 150):
        expected = -math.log(1.0 - measured[offset] / 315.0)
        ratio.append(bloom[offset // 3] / expected)
    assert math.exp(np.std(np.log(ratio))) < 1.35
    assert np.mean(np.log(ratio)) == pytest.approx(0.0, abs=0.25)
    assert bloom.get(-50, 0.0) * 315 < 10
    assert bloom.get(66, 0.0) * 315 < 10, "no echo near +200 rows"
