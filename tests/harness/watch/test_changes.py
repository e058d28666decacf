"""A model with one parameter changed: by how much, and what is tried where that cannot be."""

import dataclasses

import pytest

from lidarcheck.effects import catalogue, make
from lidarcheck.effects.parameters import Curve, FileParameter, ListParameter, Parameter
from lidarcheck.harness.watch.changes import change_of, parameters_of
from lidarcheck.model.spec import Model
from lidarcheck.sensor import VARIANTS, Sensor, SpadArray


def model(*effects: object) -> Model:
    return Model(Sensor.of("SMART"), effects=tuple(effects))


@pytest.mark.parametrize("name", catalogue())
def test_every_parameter_says_what_is_noticeable_and_can_be_changed_by_it(name: str) -> None:
    effect = catalogue()[name]
    for one in effect.parameters():
        assert one.noticeable != 0.0, one.name
        assert one.low <= one.typical + one.noticeable <= one.high, one.name
        assert one.to_dict()["noticeable"] == one.noticeable
        assert one.nearby(one.typical)[0] == pytest.approx(one.typical + one.noticeable)
    for numbers in effect.lists():
        assert 0.0 < numbers.noticeable <= numbers.high - numbers.low, numbers.name
    assert all(0.0 < file.noticeable < 1.0 for file in effect.files())


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", SpadArray.bounds)
def test_every_number_of_the_sensor_can_be_changed(name: str, variant: str) -> None:
    before = Model(Sensor.of(variant))
    change = change_of(before, "sensor", name)
    assert change is not None
    assert set(change.model.sensor.overrides()) == {name}
    step = getattr(change.model.sensor, name) - getattr(before.sensor, name)
    assert step == pytest.approx(SpadArray.bounds[name].noticeable)


def test_what_has_no_sign_changes_in_proportion_and_all_else_by_as_much() -> None:
    rate = Parameter("rate", "", 0.0, 100.0, 2.0, False, "", noticeable=0.5)
    assert rate.nearby(8.0) == (10.0, 6.0)
    assert rate.nearby(0.0) == (0.5,)
    angle = Parameter("angle", "deg", -10.0, 10.0, 2.0, False, "", noticeable=0.5)
    assert angle.nearby(8.0) == (8.5, 7.5)
    assert angle.nearby(10.0) == (9.5,)
    switch = Parameter("switch", "", 0, 1, 1, True, "", noticeable=-1)
    assert switch.nearby(1) == (0,)


def test_of_a_list_every_other_number_moves_and_of_a_rising_one_all() -> None:
    numbers = ListParameter("gains", "", 0.0, 2.0, False, (), "", noticeable=0.5)
    assert numbers.nearby((1.0, 1.0, 1.0)) == ((1.5, 1.0, 1.5), (0.5, 1.0, 0.5))
    assert numbers.nearby(()) == ()
    rising = dataclasses.replace(numbers, ascending=True)
    assert rising.nearby((0.0, 0.4)) == ((0.5, 0.9),)


def test_a_curve_is_scaled_as_a_whole() -> None:
    file = FileParameter("lut", "lut.vertical", "", noticeable=0.25)
    assert file.nearby(Curve((0.0, 1.0), (0.0, 2.0), "a.ini")) == (Curve((0.0, 1.0), (0.0, 2.5), "a.ini"),)
    assert file.nearby(None) == ()


def test_what_a_model_has_not_on_or_gives_no_value_is_not_changed() -> None:
    fog = make("fog", {})
    assert change_of(model(), "fog", "mor_m") is None
    assert change_of(model(fog), "fog", "mor_m").words == "100 -> 110 m"
    assert change_of(model(make("layer_gain", {})), "layer_gain", "gains") is None


def test_a_word_that_moves_the_effect_moves_its_place_too() -> None:
    jitter, offset = make("timing_jitter", {}), make("range_offset", {})
    change = change_of(model(jitter, offset), "range_offset", "moves")
    assert change.words == "left out -> light"
    assert [effect.name for effect in change.model.effects] == ["range_offset", "timing_jitter"]


def test_a_change_that_makes_no_model_goes_the_other_way() -> None:
    # Both ends of the patch are one layer: the first can only go down.
    patch = make("blockage", {"first_layer": 250, "last_layer": 250})
    assert change_of(model(patch), "blockage", "first_layer").words == "250 -> 240 layer"


def test_the_parameters_are_the_sensors_and_those_of_effects_that_a_model_has_on() -> None:
    names = parameters_of([model(make("signal_gain", {}))])
    assert names == (*(("sensor", name) for name in SpadArray.bounds), ("signal_gain", "gain"))
