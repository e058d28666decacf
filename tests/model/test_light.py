"""The range equation, sub-beams, and materials that are missing."""

import numpy as np
import pytest

from lidarcheck.errors import InputError
from lidarcheck.model import Model, light_of
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Material, Sensor

WALL = Material("wall", 0.5)
SIGN = Material("sign", 0.6, "retro", 900.0)


def ideal_of(**columns: object) -> IdealScan:
    defaults = {"layer": [260], "point": [480], "distance_m": [20.0], "material_id": [1], "incidence_deg": [0.0]}
    return IdealScan(**{**defaults, **columns})  # type: ignore[arg-type]


def model(variant: str = "SMART") -> Model:
    return Model(Sensor.of(variant), {1: WALL, 7: SIGN})


def test_a_lambertian_surface_follows_the_range_equation() -> None:
    light = light_of(ideal_of(incidence_deg=[60.0]), model())
    assert light.pulse_signal == pytest.approx([6000.0 * 0.5 * 0.5 / 20.0**2])
    assert light.pulse_range_m == pytest.approx([20.0])
    assert light.background_per_ns == pytest.approx([0.0003])


def test_a_retro_reflector_returns_its_gain_at_any_incidence() -> None:
    light = light_of(ideal_of(material_id=[7], incidence_deg=[45.0]), model())
    assert light.pulse_signal == pytest.approx([6000.0 * 0.6 * 900.0 / 20.0**2])


def test_nothing_returns_nothing_even_of_an_unknown_material() -> None:
    assert light_of(ideal_of(distance_m=[0.0], material_id=[99]), model()).pulse_signal.tolist() == [0.0]


def test_grazing_incidence_returns_nothing_and_nothing_negative() -> None:
    assert light_of(ideal_of(incidence_deg=[90.0]), model()).pulse_signal == pytest.approx([0.0], abs=1e-12)


def test_sub_beams_share_the_light_of_their_beam() -> None:
    rows = ideal_of(
        layer=[5, 3, 5, 5],
        point=[9, 9, 9, 9],
        distance_m=[30.0, 10.0, 0.0, 20.0],
        material_id=[1, 1, 1, 7],
        incidence_deg=np.zeros(4),
    )
    light = light_of(rows, model())
    assert light.layer.tolist() == [3, 5]
    assert light.first_pulse.tolist() == [0, 1, 4]
    assert light.pulse_range_m.tolist() == [10.0, 0.0, 20.0, 30.0]
    expected = [6000 * 0.5 / 100, 0.0, 6000 * 0.6 * 900 / 400 / 3, 6000 * 0.5 / 900 / 3]
    assert light.pulse_signal == pytest.approx(expected)


def test_the_order_of_rows_does_not_matter() -> None:
    rng = np.random.default_rng(2)
    rows = ideal_of(
        layer=rng.integers(0, 5, 200),
        point=rng.integers(0, 5, 200),
        distance_m=rng.uniform(5, 50, 200),
        material_id=rng.choice([1, 7], 200),
        incidence_deg=rng.uniform(0, 80, 200),
    )
    one, other = light_of(rows, model()), light_of(rows.take(rng.permutation(200)), model())
    for name in ("layer", "point", "first_pulse", "pulse_range_m", "pulse_signal"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name


def test_a_missing_material_is_named_with_its_first_beam_and_the_file() -> None:
    rows = ideal_of(
        layer=[1, 2, 3], point=[4, 5, 6], distance_m=[9.0, 9.0, 9.0], material_id=[1, 4, 3], incidence_deg=np.zeros(3)
    )
    with pytest.raises(InputError, match=r"material 4 .*there: 1, 7.*Layer 2, Point 5") as caught:
        light_of(rows, Model(Sensor.of("SLIM"), {1: WALL, 7: SIGN}, file="m.toml"))  # type: ignore[arg-type]
    assert str(caught.value).startswith("error: m.toml: ")


def test_optics_that_lose_light_close_by_add_to_the_ranges_square() -> None:
    from any_detector_kit import sensor

    near = Model(sensor(near_m=5.0, signal_at_1m=1000.0), {1: WALL})
    assert light_of(ideal_of(distance_m=[2.0]), near).pulse_signal == pytest.approx([1000.0 * 0.5 / (4.0 + 25.0)])
