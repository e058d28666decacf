"""Mirrors: what they reflect stands at its mirror image, behind them."""

from dataclasses import replace

import numpy as np
import pytest

from analytic_scene import GROUND, Patch, PatchScene, around, box
from lidarcheck import effects
from lidarcheck.effects.geometry.reflections import ground_of, reflected
from lidarcheck.model import Model, light_of
from reference_grid import beam_directions

HEIGHT = 1.8
LAYERS, POINTS = np.arange(60, 330), np.arange(450, 510)
ROAD = Patch((0, 0, -HEIGHT), **GROUND, material=1, number=1)
WALL = Patch((30, 0, 0), (0, 500, 0), (0, 0, 12), 2, 2)
ROOM = PatchScene([ROAD, WALL])


def shown(ideal, scene=None, aim=(), **values):
    """The light before and behind the effect."""
    facts = around(ideal, scene)
    for name, given in aim:
        facts = facts.after(effects.make(name, given).aim(facts.ideal, facts))
    light = light_of(facts.ideal, Model(facts.sensor, facts.materials))
    return light, effects.make("mirror_multipath", values).light(light, facts), facts


def added(before, after):
    """Beam, range, signal and row of the pulses that were added: they stand behind those of their beam."""
    n = np.diff(before.first_pulse)
    rank = np.arange(len(after.pulse_signal)) - after.first_pulse[after.pulse_beam]
    new = rank >= n[after.pulse_beam]
    return after.pulse_beam[new], after.pulse_range_m[new], after.pulse_signal[new], after.rows()[new]


def image_of_wall(light, beam):
    """What the beam sees of the wall in the road: the wall stands upright, so its image is itself continued below."""
    u = beam_directions(light.layer[beam], light.point[beam])
    return 30 / u[:, 0], u[:, 0]


@pytest.mark.parametrize("with_scene", [True, False])
@pytest.mark.parametrize("order", [False, True])
def test_a_wall_stands_on_its_head_in_a_wet_road(with_scene, order):
    ideal = ROOM.ideal(LAYERS, POINTS)
    if order:
        ideal = ideal.take(np.random.default_rng(0).permutation(len(ideal)))
    before, after, _ = shown(ideal, ROOM if with_scene else None, reflectivity=0.3)
    beam, range_m, signal, row = added(before, after)
    expected, cosine = image_of_wall(before, beam)
    np.testing.assert_allclose(range_m, expected, rtol=1e-3 if with_scene else 1e-6, atol=5e-3)
    np.testing.assert_allclose(signal, 0.3**2 * 6000 * 0.2 * cosine / range_m**2, rtol=1e-3)
    # Every beam on the road within 30 m sees the wall there, and no other does.
    on_road = ideal.material_id == 1
    assert set(before.layer[beam] * 960 + before.point[beam]) == set((ideal.layer * 960 + ideal.point)[on_road])
    assert (ideal.material_id[row] == 2).all()
    sees = ideal.distance_m[row] * np.sin(np.deg2rad((ideal.layer[row] - 259.5) * 0.05))
    mirrored = -2 * HEIGHT - range_m * np.sin(np.deg2rad((before.layer[beam] - 259.5) * 0.05))
    np.testing.assert_allclose(sees, mirrored, atol=0.05, rtol=0.0)


def test_pulses_that_there_were_stay_as_they_were():
    before, after, _ = shown(ROOM.ideal(LAYERS, POINTS))
    rank = np.arange(len(after.pulse_signal)) - after.first_pulse[after.pulse_beam]
    assert np.array_equal(after.pulse_signal[rank == 0], before.pulse_signal)
    assert np.array_equal(after.pulse_range_m[rank == 0], before.pulse_range_m)
    assert len(after.pulse_signal) > len(before.pulse_signal)


@pytest.mark.parametrize("with_scene", [True, False])
def test_the_sky_is_not_reflected(with_scene):
    scene = PatchScene([ROAD])
    before, after, _ = shown(scene.ideal(LAYERS, POINTS), scene if with_scene else None)
    assert after is before


def test_a_car_s_front_in_the_road_by_marching_is_where_casting_finds_it():
    car = box((20, -1, -1.6), (24, 1, -0.2), material=3, number=3)
    scene = PatchScene([ROAD, replace(WALL, centre=(60, 0, 0)), *car])
    ideal = scene.ideal(LAYERS, POINTS)
    results = []
    for known in (scene, None):
        before, after, _ = shown(ideal, known)
        beam, range_m, *_ = added(before, after)
        image = np.zeros(len(before))
        image[beam] = range_m
        results.append(image)
    cast, marched = results
    # The image of the front, which the sensor sees; the underside, which it does not see, is nearer the road.
    front = (cast > 0) & (cast < 40) & (before.layer < 144)
    assert front.sum() > 500
    assert (np.abs(marched - cast)[front] < 0.02).mean() > 0.97
    underneath = (before.layer >= 144) & (cast < 40)
    wrong = (marched > 0) & (np.abs(marched - cast) > 0.1) & ~underneath
    assert wrong.sum() < 0.005 * (cast > 0).sum()


@pytest.mark.parametrize("with_scene", [True, False])
def test_a_material_mirrors_at_any_angle(with_scene):
    # A window that turns the beam by 45 degrees to the left, onto a wall that the sensor sees, too.
    window = Patch((20, -4, 0), (0.8, 0.8, 0), (0, 0, 0.3), 5, 5)
    side = Patch((20, 8, 0), (20, 0, 0), (0, 0, 10), 2, 2)
    scene = PatchScene([window, side])
    ideal = scene.ideal(np.arange(220, 300), np.arange(300, 700))
    before, after, _ = shown(ideal, scene if with_scene else None, material_id=5, reflectivity=0.5, exponent=1)
    beam, range_m, signal, _ = added(before, after)
    normal = np.array([-1, 1, 0]) / np.sqrt(2)
    # The wall's mirror image: reflect the plane y = 8 about the window's plane.
    offset = normal @ np.array([20, -4, 0])
    image_normal = np.array([0, 1.0, 0]) - 2 * normal[1] * normal
    image_point = np.array([20, 8.0, 0]) - 2 * (normal @ np.array([20, 8.0, 0]) - offset) * normal
    u = beam_directions(before.layer[beam], before.point[beam])
    assert len(beam) > 0.9 * (ideal.material_id == 5).sum() > 100
    np.testing.assert_allclose(range_m, (image_normal @ image_point) / (u @ image_normal), rtol=2e-3)
    np.testing.assert_allclose(signal, 0.5 * 6000 * 0.2 * np.abs(u @ image_normal) / range_m**2, rtol=2e-3)


def test_grazing_light_is_reflected_as_schlick_says():
    ideal = ROOM.ideal(LAYERS, POINTS)
    before, after, _ = shown(ideal, ROOM, reflectivity=0.02, grazing=1.0)
    beam, range_m, signal, _ = added(before, after)
    _, cosine = image_of_wall(before, beam)
    down = np.sin(np.deg2rad((259.5 - before.layer[beam]) * 0.05))
    schlick = 0.02 + 0.98 * (1 - down) ** 5
    np.testing.assert_allclose(signal, schlick**2 * 6000 * 0.2 * cosine / range_m**2, rtol=1e-3)


def test_only_what_is_within_range_appears():
    ideal = ROOM.ideal(LAYERS, POINTS)
    before, after, _ = shown(ideal, ROOM, max_range_m=30.1)
    _, range_m, _, _ = added(before, after)
    assert len(range_m) > 0
    assert range_m.max() <= 30.1
    assert shown(ideal, ROOM, max_range_m=10)[1].first_pulse[-1] == len(ideal)


def test_a_rough_road_blurs_the_image_and_keeps_it_in_place():
    ideal = ROOM.ideal(LAYERS, POINTS)
    _, smooth, _ = shown(ideal, ROOM)
    before, rough, _ = shown(ideal, ROOM, roughness_deg=0.5)
    again = shown(ideal, ROOM, roughness_deg=0.5)[1]
    assert np.array_equal(rough.pulse_range_m, again.pulse_range_m)
    beam, range_m, *_ = added(before, rough)
    error = range_m - image_of_wall(before, beam)[0]
    assert 0.001 < np.median(np.abs(error)) < 0.5
    assert len(beam) > 0.8 * (len(smooth.pulse_signal) - len(before.pulse_signal))


def test_zero_strength_and_tables_without_mirrors_are_left_alone():
    ideal = ROOM.ideal(LAYERS, POINTS)
    before, after, _ = shown(ideal, reflectivity=0)
    assert after is before
    for table in (
        ideal.take(np.array([], dtype=int)),
        ideal.take(np.array([5])),
        replace(ideal, distance_m=np.zeros(len(ideal))),
        ideal.take(ideal.material_id == 2),
    ):
        for scene in (ROOM, None):
            before, after, _ = shown(table, scene)
            assert after is before
            before, after, _ = shown(table, scene, material_id=77)
            assert after is before


def test_it_works_behind_effects_that_aim_the_beams():
    ideal = ROOM.ideal(LAYERS, POINTS)
    turn = ("boresight", {"yaw_deg": 0.0, "pitch_deg": 0.5, "rigid": 0})
    for scene in (ROOM, None):
        before, after, facts = shown(ideal, scene, aim=(turn, ("beam_divergence", {})))
        beam, range_m, signal, row = added(before, after)
        assert len(beam) > 1000
        assert np.isfinite(signal).all()
        up = np.deg2rad((before.layer[beam] + 10 - 259.5) * 0.05)
        left = np.deg2rad((before.point[beam] - 479.5) * 0.125)
        np.testing.assert_allclose(range_m, 30 / (np.cos(up) * np.cos(left)), rtol=5e-3)
        assert (facts.ideal.material_id[row[row >= 0]] == 2).all()


def test_shares_of_a_beam_are_reflected_by_their_part():
    ideal = ROOM.ideal(LAYERS, POINTS)
    share = np.full(len(ideal), 0.25)
    before, after, _ = shown(replace(ideal, share=share), ROOM)
    whole_before, whole, _ = shown(ideal, ROOM)
    assert added(before, after)[2] == pytest.approx(0.25 * added(whole_before, whole)[2])


def test_the_ground_is_found_among_other_things():
    rng = np.random.default_rng(5)
    xy = rng.uniform(-30, 30, (4000, 2))
    plane = -1.7 + 0.02 * xy[:, 0] - 0.01 * xy[:, 1]
    clutter = np.where(rng.uniform(size=4000) < 0.25, rng.uniform(0.2, 2.0, 4000), 0.0)
    ground = ground_of(np.column_stack([xy, plane + clutter]), np.ones(4000, dtype=bool))
    normal = np.array([-0.02, 0.01, 1.0]) / np.linalg.norm([-0.02, 0.01, 1.0])
    assert ground.normal == pytest.approx(normal, abs=1e-3)
    assert ground.height_m == pytest.approx(1.7 * normal[2], abs=0.01)
    assert ground_of(np.zeros((4, 3)), np.ones(4, dtype=bool)) is None


def test_reflection_turns_the_part_along_the_normal():
    out = reflected(np.array([[0.6, 0.0, -0.8]]), np.array([0.0, 0.0, 1.0]))
    assert out == pytest.approx(np.array([[0.6, 0.0, 0.8]]))
