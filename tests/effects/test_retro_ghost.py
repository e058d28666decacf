"""The ghost of a retro-reflector: on its own beam, at twice its range and a little more, fainter."""

from types import SimpleNamespace

import numpy as np
import pytest

from lidarcheck.effects import Effect, make
from lidarcheck.kpi.ghost import ghost, ghost_partners
from lidarcheck.model import Model, light_of, simulate
from lidarcheck.model.stages import light_after_effects
from lidarcheck.scan import IdealScan, Light
from lidarcheck.sensor import Material, Sensor

MATERIALS = {1: Material("wall", 0.4), 2: Material("sign", 0.8, "retro", 1000.0), 3: Material("plate", 0.5, "retro", 2)}
SETTINGS = {"strength": 1e-4, "exponent": 0.5, "extra_m": 0.3, "min_signal": 0.0}


def scan_of(*rows: tuple[int, int, float, int]) -> IdealScan:
    """An ideal scan of (layer, point, distance, material)."""
    layer, point, distance, material = np.array(rows, dtype=np.float64).reshape(-1, 4).T
    return IdealScan(layer, point, distance, material, np.zeros(len(rows)))


def own(ideal: IdealScan, variant: str = "SLIM") -> Light:
    return light_of(ideal, Model(Sensor.of(variant), MATERIALS))


def on(light: Light, ideal: IdealScan, **settings: float) -> Light:
    around = SimpleNamespace(sensor=Sensor.of("SLIM"), ideal=ideal, materials=MATERIALS)
    return make("retro_ghost", SETTINGS | settings).light(light, around)


def new_pulses(light: Light, before: Light) -> list[tuple[int, float, float, int]]:
    """(beam, range, S, row) of each pulse that is new."""
    at = light.pulse_beam
    place = np.arange(len(at)) - light.first_pulse[at]
    new = np.flatnonzero(place >= np.diff(before.first_pulse)[at])
    columns = (at[new], light.pulse_range_m[new], light.pulse_signal[new], light.rows()[new])
    return list(zip(*(column.tolist() for column in columns), strict=True))


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_a_ghost_stands_at_twice_the_range_and_the_extra_way(variant: str) -> None:
    ideal = scan_of((10, 10, 20.0, 1), (10, 11, 25.0, 2), (10, 12, 100.0, 2), (11, 11, 0.0, 2), (11, 12, 30.0, 2))
    effect = make("retro_ghost", SETTINGS)
    light = light_after_effects(ideal, Model(Sensor.of(variant), MATERIALS, (effect,)))[0]
    s = [4.8e6 / r**2 for r in (25.0, 100.0, 30.0)]
    expected = [
        (1, 50.3, 1e-4 * s[0], 1),
        (2, 200.3, 1e-4 * s[1] * 0.5, 2),
        (4, 60.3, 1e-4 * s[2] * (25 / 30) ** 0.5, 4),
    ]
    found = new_pulses(light, own(ideal, variant))
    assert len(found) == 3
    for one, other in zip(found, expected, strict=True):
        assert one == (other[0], pytest.approx(other[1], abs=1e-12), pytest.approx(other[2], rel=1e-12), other[3])


def test_typical_ghosts_fall_as_r_to_minus_2_25() -> None:
    ideal = scan_of((10, 10, 20.0, 2), (10, 11, 80.0, 2))
    near, far = (p[2] for p in new_pulses(on(own(ideal), ideal, exponent=make("retro_ghost", {}).exponent), own(ideal)))
    assert np.log(far / near) / np.log(4.0) == pytest.approx(-2.25, abs=1e-9)


def test_which_surfaces_have_a_ghost() -> None:
    ideal = scan_of((10, 10, 20.0, 1), (10, 11, 20.0, 2), (10, 12, 20.0, 3))
    light = own(ideal)
    assert light.pulse_signal.tolist() == pytest.approx([6.0, 12000.0, 15.0])

    def beams(**settings: float) -> list[int]:
        return [p[0] for p in new_pulses(on(light, ideal, **settings), light)]

    assert beams() == [1, 2]
    assert beams(min_signal=15.5) == [1]
    assert beams(retro_only=0) == [0, 1, 2]
    assert beams(retro_only=0, min_signal=10.0) == [1, 2]
    assert beams(retro_only=0, min_signal=2e4) == []


def test_light_of_other_beams_and_of_no_surface_has_none() -> None:
    ideal = scan_of((10, 10, 50.0, 1), (10, 11, 25.0, 2))
    light = own(ideal).with_pulses([0, 0, 1], [25.0, 30.0, 40.0], [90.0, 90.0, 90.0], [1, -1, -1])
    assert [p[0] for p in new_pulses(on(light, ideal, retro_only=0), light)] == [0, 1]
    assert [p[1] for p in new_pulses(on(light, ideal), light)] == [pytest.approx(50.3)]


def test_nothing_to_do_is_the_very_same_light() -> None:
    wall, sign = scan_of((10, 10, 20.0, 1), (10, 11, 0.0, 2)), scan_of((10, 10, 20.0, 2))
    empty = IdealScan(*(np.empty(0) for _ in range(5)))
    for ideal in (wall, empty):
        light = own(ideal)
        assert on(light, ideal) is light
    light = own(sign)
    assert on(light, sign, strength=0.0) is light
    assert on(light, sign, extra_m=-10.0, strength=0.1) is not light
    close = scan_of((10, 10, 2.0, 2))
    light = own(close)
    assert on(light, close, extra_m=-10.0) is light, "no light from behind the sensor"


@pytest.mark.parametrize("exponent", [-10.0, 10.0])
@pytest.mark.parametrize("distance", [1e-3, 0.5, 299.9])
def test_a_ghost_is_never_brighter_than_its_target_and_always_finite(exponent: float, distance: float) -> None:
    ideal = scan_of((10, 10, distance, 2))
    light = on(own(ideal), ideal, strength=1.0, exponent=exponent)
    assert np.all(np.isfinite(light.pulse_signal))
    assert np.all(light.pulse_signal <= own(ideal).pulse_signal[0])


def test_the_place_among_other_effects_counts_as_on_the_way_of_light() -> None:
    ideal = scan_of((10, 10, 25.0, 2))
    gain = make("signal_gain", {"gain": 0.5})

    def last(*effects: Effect) -> float:
        return float(light_after_effects(ideal, Model(Sensor.of("SLIM"), MATERIALS, effects))[0].pulse_signal[-1])

    plain = last(make("retro_ghost", SETTINGS))
    assert last(gain, make("retro_ghost", SETTINGS)) == pytest.approx(0.5 * plain)
    assert last(make("retro_ghost", SETTINGS), gain) == pytest.approx(0.5 * plain)
    dim = make("material_reflectance", {"factor": 0.25, "material_id": 2})
    assert last(make("retro_ghost", SETTINGS), dim) == pytest.approx(0.25 * plain), "the light of the sign"
    once = last(make("retro_ghost", SETTINGS))
    light = light_after_effects(
        ideal, Model(Sensor.of("SLIM"), MATERIALS, (make("retro_ghost", SETTINGS), make("blooming_vertical", {})))
    )[0]
    assert light.pulse_signal.tolist() == pytest.approx([4.8e6 / 625, once])


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_the_ghost_has_twice_the_size_on_the_same_beams(variant: str) -> None:
    layer, point = np.divmod(np.arange(400), 20)
    ideal = IdealScan(layer + 250, point + 470, np.full(400, 40.0), np.full(400, 2), np.zeros(400))
    effects = (make("retro_ghost", {}), make("pulse_shape", {"stretch": 0.5, "tail_share": 0.0}))
    scan = simulate(ideal, Model(Sensor.of(variant), MATERIALS, effects), seed=4)
    target = scan.range_m < 50.0
    partner = ghost_partners(scan, target, tolerance_m=3.0)
    is_ghost = partner >= 0
    assert is_ghost.sum() > 350
    xyz = np.column_stack([scan.x_m, scan.y_m, scan.z_m])
    found = ghost(
        xyz[target], scan.area[target], scan.peak[target], xyz[is_ghost], scan.area[is_ghost], scan.peak[is_ghost]
    )
    assert found.size_ratio == pytest.approx(2.0, abs=0.1)
    assert found.range_ratio == pytest.approx(2.0, abs=0.05)
    assert found.area_ratio < 0.25
