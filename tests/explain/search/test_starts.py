"""What may be a little wrong, and where the search for each effect begins."""

import numpy as np
import pytest

from explain_core_kit import PANEL, ROAD, SIGN, WALL, frames, model, same, street
from lidarcheck.effects import catalogue, find, make
from lidarcheck.effects.search import FreeParameter, Probe, search_spec
from lidarcheck.explain.search.evidence import SimulatorEvidence
from lidarcheck.explain.search.screening import screen
from lidarcheck.explain.search.starts import fixed_probes, located_probes
from lidarcheck.inference.effect_fit import fit
from lidarcheck.inference.nuisances import (
    GAIN_ERROR,
    LIMIT,
    POSE_ERROR_DEG,
    REFLECTANCE_ERROR,
    Nuisance,
    at,
    axes_of,
    is_usual_error,
)
from lidarcheck.inference.simulator import Simulator
from lidarcheck.model import simulate
from lidarcheck.model.stages import Surfaces
from lidarcheck.sensor import Sensor


@pytest.fixture(scope="module")
def simulator() -> Simulator:
    return Simulator(frames(model(), 2, sign=True), model(), 0)


# Nuisances


def test_a_nuisance_stays_within_its_limits() -> None:
    axes = axes_of([WALL, SIGN])
    far = at(axes, np.array([99.0, -99.0, 99.0, 0.5, 99.0]))
    assert (far.yaw, far.pitch, far.height) == (LIMIT, -LIMIT, LIMIT)
    assert far.materials == {WALL: 0.5, SIGN: LIMIT}
    assert far.penalty == pytest.approx(4 * LIMIT**2 + 0.25)
    assert not far.still
    none = at(axes, np.zeros(5))
    assert none.still
    assert none.penalty == 0.0
    assert none.words() == []
    assert len(far.words()) == 5


def test_a_nuisance_scales_the_named_material_alone() -> None:
    plain = model()
    changed = Nuisance(materials={PANEL: 2.0, WALL: 0.0}).model(plain)
    factor = changed.materials[PANEL].reflectance / plain.materials[PANEL].reflectance
    assert factor == pytest.approx(np.exp(2.0 * REFLECTANCE_ERROR), rel=1e-4)
    assert all(changed.materials[i] == plain.materials[i] for i in (WALL, ROAD, SIGN))
    assert changed.materials[PANEL].name == "panel"
    assert Nuisance(yaw=1.0).model(plain) == plain


def test_a_correction_adds_up_with_a_boresight_that_is_there() -> None:
    there = model(
        make("boresight", {"yaw_deg": 0.1, "pitch_deg": -0.2, "roll_deg": 0.3}), make("dropout", {"share": 0.1})
    )
    corrected = Nuisance(yaw=2.0, pitch=-1.0, materials={WALL: -1.0}).calibrated(there)
    assert [e.name for e in corrected.effects] == ["boresight", "dropout"]
    settings = corrected.effects[0].settings()
    assert settings["yaw_deg"] == pytest.approx(0.1 + 2.0 * POSE_ERROR_DEG)
    assert settings["pitch_deg"] == pytest.approx(-0.2 - POSE_ERROR_DEG)
    assert settings["roll_deg"] == 0.3
    assert corrected.materials[WALL].reflectance == pytest.approx(0.3 * np.exp(-REFLECTANCE_ERROR), rel=1e-4)
    fresh = Nuisance(pitch=1.0).calibrated(model())
    assert fresh.effects[0].settings()["pitch_deg"] == pytest.approx(POSE_ERROR_DEG)
    assert Nuisance().calibrated(there) == there


def test_a_turned_sensor_looks_elsewhere_as_with_a_boresight() -> None:
    ideal = street(0)
    at_rest = [Surfaces(ideal)]
    pose = Nuisance(yaw=2.0, pitch=1.0)
    same_model, turned_surfaces = pose.posed(model(), at_rest)
    turned = turned_surfaces[0].ideal
    assert same_model == model()
    assert not np.array_equal(turned.distance_m, ideal.distance_m)
    assert np.array_equal(turned.object_id, ideal.object_id), "each beam stays on its surface"
    boresight = make("boresight", {"yaw_deg": 2.0 * POSE_ERROR_DEG, "pitch_deg": POSE_ERROR_DEG, "own_surface": 1})
    assert same(simulate(turned, model(), seed=1), simulate(ideal, model(boresight), seed=1))
    assert Nuisance(materials={WALL: 1.0}).posed(model(), at_rest) == (model(), at_rest)


def test_before_another_effect_of_aim_the_pose_is_an_effect_too() -> None:
    """Aimed twice, each with a scan of its own, edges would be moved twice."""
    at_rest = [Surfaces(street(0))]
    shaken = model(make("vibration", {"pitch_deg": 0.1}))
    posed, surfaces = Nuisance(yaw=-1.0).posed(shaken, at_rest)
    assert surfaces == at_rest
    assert [effect.name for effect in posed.effects] == ["boresight", "vibration"]
    assert posed.effects[0].settings()["yaw_deg"] == pytest.approx(-POSE_ERROR_DEG)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_a_usual_error_is(sign: float) -> None:
    def usual(name: str, **settings: float) -> bool:
        return is_usual_error(make(name, settings))

    for inside, expected in ((0.98, True), (1.02, False)):
        off = sign * inside * LIMIT
        assert usual("signal_gain", gain=float(np.exp(off * GAIN_ERROR))) is expected
        assert usual("material_reflectance", factor=float(np.exp(off * REFLECTANCE_ERROR)), material_id=1) is expected
        for axis in ("yaw_deg", "pitch_deg", "roll_deg"):
            angles = {"yaw_deg": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0} | {axis: off * POSE_ERROR_DEG}
            assert usual("boresight", **angles) is expected
    assert not usual("range_offset", offset_m=0.0)


def test_an_effect_is_judged_with_the_nuisance_that_it_adds_to() -> None:
    half = float(np.exp(0.6 * LIMIT * REFLECTANCE_ERROR))
    more = make("material_reflectance", {"factor": half, "material_id": 5})
    assert is_usual_error(more, Nuisance(materials={4: 0.6 * LIMIT}))
    assert not is_usual_error(more, Nuisance(materials={5: 0.6 * LIMIT}))
    assert is_usual_error(more, Nuisance(materials={5: -0.6 * LIMIT}))
    brighter = make("signal_gain", {"gain": float(np.exp(0.6 * LIMIT * GAIN_ERROR))})
    assert not is_usual_error(brighter, Nuisance(materials={4: LIMIT, 5: LIMIT}))
    turned = make("boresight", {"yaw_deg": 0.6 * LIMIT * POSE_ERROR_DEG, "pitch_deg": 0.0})
    assert is_usual_error(turned, Nuisance(pitch=0.6 * LIMIT))
    assert not is_usual_error(turned, Nuisance(yaw=0.6 * LIMIT))


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "settings", "within"),
    [
        ("boresight", {"yaw_deg": 0.15, "pitch_deg": -0.06}, 0.02),
        ("motion", {"forward_m_s": 20.0, "left_m_s": 0.0, "up_m_s": 0.0, "yaw_deg_s": -25.0}, 12.0),
        ("range_offset", {"offset_m": 0.12}, 0.01),
        ("range_scale", {"fraction": -0.006}, 0.001),
    ],
)
def test_an_aim_a_speed_an_offset_and_a_scale_are_read_off_the_ranges(
    name: str, settings: dict[str, float], within: float
) -> None:
    how = {"layers": range(230, 270), "points": range(320, 640, 4)}
    there = Simulator(frames(model(make(name, settings)), 3, **how), model(), 5)
    starts = search_spec(name).starts
    assert starts is not None
    found = [probe.settings for probe in starts(SimulatorEvidence(there))]
    off = [max(abs(one[key] - value) for key, value in settings.items()) for one in found]
    assert min(off) < within, found


@pytest.mark.parametrize("transmission", [0.15, 0.5])
def test_a_blocked_patch_is_read_off_line_by_line(transmission: float) -> None:
    place = {"first_layer": 236, "last_layer": 249, "first_point": 421, "last_point": 447}
    dirt = make("blockage", {"transmission": transmission, "soft_edge_deg": 0.0, **place})
    how = {"layers": range(230, 270), "points": range(400, 480)}
    found = [p.settings for p in located_probes(Simulator(frames(model(dirt), 2, **how), model(), 5), ["blockage"])]
    # One border is two lines off with one of twenty seeds; strips alone are four lines off and more in all.
    assert sum(abs(found[0][name] - value) for name, value in place.items()) <= 2, found[0]
    nearest = min((one["transmission"] for one in found[:2]), key=lambda t: abs(np.log(t / transmission)))
    assert nearest == pytest.approx(transmission, rel=0.35)


def test_an_offset_of_the_light_is_a_start_of_its_own(simulator: Simulator) -> None:
    kinds = {
        probe.variant: probe.effect().stage for probe in located_probes(simulator, ["range_offset", "range_scale"])
    }
    assert kinds == {"": "readout", "light": "light"}


# Candidates


def probes_of(simulator: Simulator, name: str) -> list[Probe]:
    return fixed_probes([name]) + located_probes(simulator, [name])


@pytest.mark.parametrize("name", list(catalogue()))
def test_every_effect_of_the_catalogue_has_starts_that_it_can_have(simulator: Simulator, name: str) -> None:
    probes = probes_of(simulator, name)
    assert probes, f"the search for {name} begins nowhere: give it starts"
    ranges = {p.name: p for p in find(name).parameters()}
    for probe in probes:
        effect = probe.effect()
        assert effect.name == name
        assert len(probe.start()) == len(probe.free) > 0
        settings = effect.settings()
        for one in probe.free:
            assert one.name in ranges, f"{name} has no parameter {one.name}"
            assert one.step > 0.0
            assert one.name not in probe.fixed
            assert ranges[one.name].low <= float(settings[one.name]) <= ranges[one.name].high
        simulate(simulator.frames[0].ideal, model(effect), seed=1)


@pytest.mark.parametrize("name", list(catalogue()))
def test_a_start_is_where_the_fit_s_scale_says(simulator: Simulator, name: str) -> None:
    for probe in probes_of(simulator, name):
        settings, again = probe.effect().settings(), probe.effect(probe.start()).settings()
        assert again.keys() == settings.keys()
        for key, value in settings.items():
            if isinstance(value, float):
                assert again[key] == pytest.approx(value, rel=1e-9, abs=1e-9), key
            else:
                assert again[key] == value, key


@pytest.mark.parametrize("name", list(catalogue()))
def test_the_fit_s_scale_ends_where_the_parameter_does(simulator: Simulator, name: str) -> None:
    ranges = {p.name: p for p in find(name).parameters()}
    for one in {one for probe in probes_of(simulator, name) for one in probe.free}:
        p = ranges[one.name]
        for x in (-1e9, -3.0, 0.0, 3.0, 1e9):
            assert p.low <= one.decode(x, p.low, p.high) <= p.high
        # The logarithm of nothing is that of very little.
        inside = one.decode(one.encode(p.typical), p.low, p.high)
        assert inside == pytest.approx(p.typical, rel=1e-6, abs=1e-9)


def test_steps_on_the_fit_s_scale() -> None:
    plain, log, whole = FreeParameter("a", 0.5), FreeParameter("b", 0.1, log=True), FreeParameter("c", 2.0, whole=True)
    assert plain.encode(3.0) == pytest.approx(6.0)
    assert plain.decode(7.0, 0.0, 100.0) == pytest.approx(3.5)
    assert log.decode(log.encode(3.0) + 1.0, 0.0, 100.0) == pytest.approx(3.0 * np.exp(0.1))
    assert whole.decode(1.6, 0.0, 100.0) == 3.0
    assert np.isfinite(log.encode(0.0))


# Of these a part has no strength of its own in every start: a skirt, a spread, a tail.
PARTLY = ("blooming_horizontal", "blooming_vertical", "dead_time", "mirror_multipath", "pulse_shape")
# With these SPADs are followed one by one, with random numbers of their own: chance alone changes the summaries.
FOLLOWED = ("afterpulsing", "crosstalk")
SCALED = set(catalogue()) - {*PARTLY, *FOLLOWED}


@pytest.mark.parametrize("name", sorted(SCALED))
def test_a_start_scaled_down_comes_near_the_model_itself(simulator: Simulator, name: str) -> None:
    for probe in probes_of(simulator, name):
        whole, little = (
            simulator.metric.square(simulator.shows(model(probe.scaled(s).effect()), 1)[0]) for s in (1.0, 0.001)
        )
        assert little <= max(0.4 * whole, 50.0), probe.settings
        assert probe.scaled(1.0).effect() == probe.effect()


def test_a_weak_dead_time_that_varies_has_a_start_that_leads_to_it() -> None:
    """It acts in whole bins: starts three or four bins off change summaries in other directions, which no factor on
    their strength mends."""
    fine = {"layers": range(230, 290, 2), "points": range(320, 640, 6)}
    weak = make("dead_time", {"shift_ns": 1.0, "spread_ns": 1.2})
    there = Simulator(frames(model(weak), 2, sign=True, **fine), model(), 3)
    excess = there.distance(np.zeros((1, len(there.measured)))) - there.floor_distance
    gains = [one.gain(there, there.measured)[0] for one in screen(there, fixed_probes(["dead_time"]))]
    assert max(gains) > 0.5 * excess


def test_foreign_pulses_in_lines_are_told_from_those_at_any_range() -> None:
    fine = {"layers": range(230, 290, 2), "points": range(320, 640, 6)}
    truth = {"share": 0.03, "columns": 0.1, "signal": 2.0, "spread_decades": 0.1, "column_span_m": 5.0}
    there = Simulator(frames(model(make("interference", truth)), 2, sign=True, **fine), model(), 3)
    starts = {one.variant: one for one in fixed_probes(["interference"])}
    lines, stripes = (fit(there, [starts[k]], [starts[k].start()], leaps=True) for k in ("lines", "stripes"))
    assert lines.distance < 0.9 * stripes.distance
    found = lines.effects()[0].settings()
    # A signal of 2 fires every SPAD that it meets, and so does a larger one.
    assert found["share"] == pytest.approx(0.03, rel=0.5)
    assert found["columns"] == pytest.approx(0.1, rel=0.3)
    assert float(found["column_span_m"]) < 15.0


@pytest.mark.parametrize(
    ("sensor", "name", "background"),
    [("XT32", "ambient_light", 1.0), ("OS1-128", "ambient_light", 16.0), ("TMF8820", "dark_counts", 2e-6)],
)
def test_starts_are_in_the_unit_of_the_sensors_background(sensor: str, name: str, background: float) -> None:
    reference = [probe.settings["rate_per_ns"] for probe in fixed_probes([name])]
    assert [probe.settings["rate_per_ns"] for probe in fixed_probes([name], Sensor.of("SLIM"))] == reference
    own = [probe.settings["rate_per_ns"] for probe in fixed_probes([name], Sensor.of(sensor))]
    assert own == pytest.approx([rate / 0.0003 * background for rate in reference])
