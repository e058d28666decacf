"""The names, bounds and starts of what can be fitted."""

import pytest

from lidarcheck.calibration.parameters.parameters import (
    added_effects,
    free_names,
    free_parameters,
    known_names,
    value_of,
    with_fixed,
    with_values,
)
from lidarcheck.effects import make
from lidarcheck.errors import UsageError
from lidarcheck.model import Model
from lidarcheck.sensor import Material, Sensor

MODEL = Model(
    Sensor.of("SMART"),
    {1: Material("wall", 0.3), 2: Material("sign 2", 0.5, "retro", 800.0)},
    (make("fog", {"mor_m": 200.0}), make("range_offset", {"offset_m": 0.1})),
)


def test_every_known_name_can_be_read_and_set():
    for name in known_names(MODEL):
        now = value_of(MODEL, name)
        (free,) = free_parameters(MODEL, [name])
        other = min(now + 1.0, free.high) if free.whole else 0.5 * (now + max(free.low, 0.9 * now - 0.01))
        moved = with_values(MODEL, {name: other})
        assert value_of(moved, name) == other
        assert with_values(moved, {name: now}) == MODEL


def test_one_parameter_has_one_spelling():
    free = free_parameters(
        MODEL, ["sensor.threshold", "threshold", "materials.wall.reflectance", "materials.1.reflectance"]
    )
    assert [one.name for one in free] == ["threshold", "materials.1.reflectance"]
    assert free[0].whole
    assert free[1].logarithmic


def test_all_materials_less_what_is_fixed():
    assert free_names(MODEL, ["materials.*.reflectance", "threshold"], ["materials.wall.reflectance"]) == [
        "materials.2.reflectance",
        "threshold",
    ]
    assert free_names(MODEL, ["materials.*.retro_gain"], []) == ["materials.2.retro_gain"]


def test_a_scale_keeps_its_value_and_its_bounds():
    for name, value in (("signal_at_1m", 5000.0), ("effects.range_offset.offset_m", -0.2), ("threshold", 11.0)):
        (free,) = free_parameters(MODEL, [name])
        assert free.to_value(free.to_x(value)) == pytest.approx(value, rel=1e-12)
        assert free.low <= free.to_value(1e9) <= free.high
        assert free.low <= free.to_value(-1e9) <= free.high


def test_an_effect_that_is_named_is_added_with_zeros_where_it_may_have_either_sign():
    model, added = added_effects(MODEL, ["effects.boresight.yaw_deg", "effects.fog.mor_m", "effects.dropout.share"])
    assert set(added) == {"boresight", "dropout"}
    assert "share = 0.02" in added["dropout"]
    boresight = next(e for e in model.effects if e.name == "boresight").settings()
    assert (boresight["yaw_deg"], boresight["pitch_deg"]) == (0.0, 0.0)
    assert value_of(model, "effects.fog.mor_m") == 200.0


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("signal_at_lm", "did you mean signal_at_1m?"),
        ("xyz", "name a number of the sensor"),
        ("materials.7.reflectance", "known: 1, 2, wall, sign 2"),
        ("materials.wal.reflectance", "did you mean wall?"),
        ("materials.1.retro_gain", "free materials.1.reflectance"),
        ("materials.1.name", "did you mean materials.1.reflectance?"),
        ("effects.fogg.mor_m", "did you mean fog?"),
        ("effects.fog.mor", "did you mean effects.fog.mor_m?"),
        ("effects.layer_gain.gains", "is no number"),
    ],
)
def test_what_is_no_parameter_is_refused_with_the_nearest(name, said):
    with pytest.raises(UsageError) as fault:
        free_parameters(MODEL, [name])
    assert said in str(fault.value)


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"bounds": {"threshold": (-1.0, 20.0)}}, "use two numbers from 0 to 100000 detectors ON"),
        ({"bounds": {"threshold": (20.0, 10.0)}}, "the lower first"),
        ({"bounds": {"threshold": (10.0, 20.0)}}, "outside its bounds"),
        ({"starts": {"threshold": 9.5}}, "not whole"),
        ({"starts": {"signal_at_1m": 1.0}}, "it is not free"),
        ({"bounds": {"signal_at_1m": (1.0, 2.0)}}, "add it to --free"),
    ],
)
def test_bounds_and_starts_that_do_not_fit_are_refused(how, said):
    with pytest.raises(UsageError) as fault:
        free_parameters(MODEL, ["threshold"], **how)
    assert said in str(fault.value)


def test_nothing_free_is_refused():
    with pytest.raises(UsageError, match="no parameter is free"):
        free_parameters(MODEL, [])


def test_what_is_fixed_has_its_bounds_too():
    assert value_of(with_fixed(MODEL, {"materials.wall.reflectance": 0.4}), "materials.1.reflectance") == 0.4
    with pytest.raises(UsageError, match="out of range"):
        with_fixed(MODEL, {"materials.1.reflectance": 1.4})


def test_materials_of_one_name_are_told_apart_by_their_numbers():
    twins = Model(Sensor.of("SMART"), {1: Material("wall", 0.3), 2: Material("wall", 0.4)})
    with pytest.raises(UsageError, match="2 materials are called wall") as fault:
        free_parameters(twins, ["materials.wall.reflectance"])
    assert "1, 2" in str(fault.value)
