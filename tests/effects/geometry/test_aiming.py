"""Effects that aim beams elsewhere, against closed forms and a scene cast by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr, ndtri
from scipy.stats import kstest

from analytic_scene import GROUND, WALL_AHEAD, Patch, PatchScene, around, box
from effect_kit import sweep_time_s
from lidarcheck import effects
from lidarcheck.effects.geometry.aiming import rays_of, turned
from lidarcheck.errors import UsageError
from lidarcheck.model import Model, simulate
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Material, Sensor
from reference_grid import beam_directions

LAYERS, POINTS = np.arange(240, 281), np.arange(440, 520)
ZERO = {
    "boresight": {"yaw_deg": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0},
    "vibration": {"pitch_deg": 0.0, "yaw_deg": 0.0, "random_deg": 0.0},
    "motion": {"forward_m_s": 0.0, "left_m_s": 0.0, "up_m_s": 0.0, "yaw_deg_s": 0.0, "objects": 0.0},
    "beam_divergence": {"vertical_deg": 0.0, "horizontal_deg": 0.0},
}
STREET = PatchScene(
    [
        Patch((0, 0, -1.8), **GROUND, material=1, number=1),
        Patch((60, 0, 0), **WALL_AHEAD, material=2, number=2),
        *box((18, -2, -1.8), (22, 0.1, 0.2), material=3, number=3),
        *box((12, 1.5, -1.8), (12.1, 1.6, 3), material=4, number=4),
    ]
)
LEANING = PatchScene([Patch((30, 0, 0), (100, 0, 30), (20, 200, 0))])
"""A plane through (30, 0, 0) that is met aslant both ways."""


def aimed(ideal, scene=None, known=None, **chosen):
    """The ideal scan behind the named effects, in that order."""
    facts = known or around(ideal, scene)
    for name, values in chosen.items():
        ideal = effects.make(name, values).aim(ideal, facts.after(ideal))
    return ideal


@pytest.mark.parametrize("name", ZERO)
@pytest.mark.parametrize("scene", [None, STREET])
def test_zero_strength_is_the_same_table(name, scene):
    ideal = STREET.ideal(LAYERS, POINTS)
    assert aimed(ideal, scene, **{name: ZERO[name]}) is ideal


@pytest.mark.parametrize("name", ZERO)
@pytest.mark.parametrize("objects", [True, False])
def test_typical_strength_shows_and_stays_sane_on_any_table(name, objects):
    street = STREET.ideal(LAYERS, POINTS, objects=objects, extra={"Lane": np.arange(3280) % 7})
    rng = np.random.default_rng(3)
    tables = [
        street,
        street.take(rng.permutation(len(street))),
        street.take(rng.integers(0, len(street), 500)),
        street.take(np.array([7])),
        street.take(np.array([], dtype=int)),
        replace(street, distance_m=np.zeros(len(street))),
    ]
    for table in tables:
        out = aimed(table, **{name: {}})
        for column in ("distance_m", "incidence_deg"):
            assert np.isfinite(getattr(out, column)).all()
            assert (getattr(out, column) >= 0).all()
        assert (out.object_id is None) == (not objects)
        assert set(out.layer * 960 + out.point) == set(table.layer * 960 + table.point)
        assert np.array_equal(np.unique(out.extra["Lane"]), np.unique(table.extra["Lane"]))
    assert not np.array_equal(aimed(street, **{name: {}}).distance_m, street.distance_m)
    twice = aimed(street, **{name: {}}), aimed(street, **{name: {}})
    assert np.array_equal(twice[0].distance_m, twice[1].distance_m)


def test_all_of_them_together_keep_every_beam_and_the_model_runs():
    ideal = STREET.ideal(LAYERS, POINTS)
    chosen = [effects.make(name, {}) for name in ZERO]
    materials = {i: Material(f"m{i}", 0.3) for i in range(5)}
    for scene in (None, STREET):
        scan = simulate(ideal, Model(Sensor.of("SMART"), materials, tuple(chosen)), scene=scene)
        assert len(scan) > 1000
        assert np.isfinite(scan.x_m).all()


# Boresight.


@pytest.mark.parametrize("scene", [None, LEANING])
def test_a_turned_sensor_meets_a_plane_where_it_is(scene):
    ideal = LEANING.ideal(LAYERS, POINTS)
    out = aimed(ideal, scene, boresight={"yaw_deg": 0.5, "pitch_deg": -0.3, "roll_deg": 0.4})
    # An independent rotation: Euler angles agree with the rotation vector to the product of the angles.
    yaw, pitch, roll = np.deg2rad([0.5, -0.3, 0.4])
    about_z = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    about_y = np.array([[np.cos(pitch), 0, -np.sin(pitch)], [0, 1, 0], [np.sin(pitch), 0, np.cos(pitch)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    direction = beam_directions(ideal.layer, ideal.point) @ (about_z @ about_y @ about_x).T
    normal = np.cross((100, 0, 30), (20, 200, 0)) / np.linalg.norm(np.cross((100, 0, 30), (20, 200, 0)))
    expected = 30 * normal[0] / (direction @ normal)
    assert out.distance_m == pytest.approx(expected, rel=3e-4)
    assert out.incidence_deg == pytest.approx(np.rad2deg(np.arccos(np.abs(direction @ normal))), abs=3e-3)
    # The scene and the scan's own surfaces agree to rounding.
    assert out.distance_m == pytest.approx(aimed(ideal, LEANING, boresight=_YPR).distance_m, rel=1e-9)


_YPR = {"yaw_deg": 0.5, "pitch_deg": -0.3, "roll_deg": 0.4}


@pytest.mark.parametrize("scene", [None, STREET])
def test_on_its_own_surface_no_beam_looks_past_an_edge(scene):
    """Within a surface it meets what a turned beam meets; at an edge the plane of its own surface goes on."""
    ideal, turn = STREET.ideal(LAYERS, POINTS), {"yaw_deg": 0.2, "pitch_deg": 0.1}
    free = aimed(ideal, boresight=turn)
    held = aimed(ideal, scene, boresight={**turn, "own_surface": 1})
    same = free.object_id == ideal.object_id
    assert 0.5 < same.mean() < 0.99
    assert np.array_equal(held.object_id, ideal.object_id)
    assert np.array_equal(held.material_id, ideal.material_id)
    inside = same & np.isin(ideal.object_id, (1, 2))
    assert held.distance_m[inside] == pytest.approx(free.distance_m[inside], rel=1e-6)
    straight = beam_directions(ideal.layer, ideal.point)
    front = (ideal.object_id == 3) & ~same & (np.abs(ideal.distance_m * straight[:, 0] - 18.0) < 1e-6)
    assert front.any()
    direction = turned(straight, 0.2, 0.1)
    assert held.distance_m[front] == pytest.approx(18.0 / direction[front, 0], rel=1e-3)
    assert np.array_equal(held.distance_m == 0.0, ideal.distance_m == 0.0)
    kept = aimed(ideal, scene, boresight={"yaw_deg": 0.0, "pitch_deg": 0.0, "own_surface": 1})
    assert np.array_equal(kept.distance_m, ideal.distance_m)


def test_yaw_looks_left_and_pitch_looks_up():
    post = Patch((20, 1.0, 0), (0, 0.2, 0), (0, 0, 5), 2, 2)
    ideal = PatchScene([post]).ideal(LAYERS, POINTS)
    out = aimed(ideal, PatchScene([post]), boresight={"yaw_deg": 1.25, "pitch_deg": 0})
    # The post, to the left, moves ten columns to the right on the sensor's own grid.
    assert ideal.point[ideal.distance_m > 0].mean() - out.point[out.distance_m > 0].mean() == pytest.approx(10, abs=1)
    ground = PatchScene([Patch((0, 0, -1.8), **GROUND)])
    below = ground.ideal(np.arange(100, 140), POINTS)
    farther = aimed(below, ground, boresight={"yaw_deg": 0, "pitch_deg": 0.5})
    assert (farther.distance_m > below.distance_m).all()


def test_roll_lifts_the_left_side():
    ground = PatchScene([Patch((0, 0, -1.8), **GROUND)])
    ideal = ground.ideal(np.arange(100, 140), [100, 860])
    out = aimed(ideal, ground, boresight={"yaw_deg": 0, "pitch_deg": 0, "roll_deg": 0.5})
    assert np.array_equal(out.distance_m > ideal.distance_m, ideal.point == 860)


def test_offsets_of_the_angles_are_the_same_at_any_azimuth():
    ground = PatchScene([Patch((0, 0, -1.8), **GROUND)])
    ideal = ground.ideal(np.arange(100, 140), np.arange(0, 960, 60))
    out = aimed(ideal, ground, boresight={"yaw_deg": 0.3, "pitch_deg": 0.25, "rigid": 0})
    assert out.distance_m == pytest.approx(1.8 / -np.sin(np.deg2rad((ideal.layer + 5 - 259.5) * 0.05)))


@pytest.mark.parametrize("scene", [None, STREET])
def test_turning_there_and_back_is_the_identity(scene):
    ideal = STREET.ideal(LAYERS, POINTS)
    there = {"yaw_deg": 0.7, "pitch_deg": 0.4, "roll_deg": -0.3}
    back = {name: -value for name, value in there.items()}
    known = around(ideal, scene)
    once = aimed(ideal, known=known, boresight=there)
    out = effects.make("boresight", back).aim(once, known.after(once))
    assert not np.array_equal(once.distance_m, ideal.distance_m)
    assert out.distance_m == pytest.approx(ideal.distance_m, rel=1e-9)
    assert np.array_equal(out.object_id, ideal.object_id)


def test_rotations_of_a_body_keep_lengths_and_angles():
    direction = beam_directions(np.arange(0, 520, 7), np.arange(0, 520, 7))
    out = turned(direction, 3.0, np.linspace(-5, 5, len(direction)), 2.0)
    assert np.sqrt((out**2).sum(axis=1)) == pytest.approx(1.0, abs=1e-15)
    assert turned(np.array([[1.0, 0, 0]]), 90.0, 0.0) == pytest.approx(np.array([[0, 1.0, 0]]), abs=1e-15)
    assert turned(np.array([[1.0, 0, 0]]), 0.0, 90.0) == pytest.approx(np.array([[0, 0, 1.0]]), abs=1e-15)
    assert turned(np.array([[0, 1.0, 0]]), 0.0, 0.0, 90.0) == pytest.approx(np.array([[0, 0, 1.0]]), abs=1e-15)


# Vibration.


def test_vibration_swings_over_the_sweep():
    ideal = PatchScene([Patch((0, 0, -1.8), **GROUND)]).ideal(np.arange(149, 152), np.arange(960))
    values = {"pitch_deg": 0.2, "yaw_deg": 0, "frequency_hz": 100, "phase_deg": 30, "random_deg": 0, "rigid": 0}
    out = aimed(ideal, vibration=values)
    time = ideal.point * 0.030 / 959
    elevation = (ideal.layer - 259.5) * 0.05 + 0.2 * np.sin(2 * np.pi * 100 * time + np.deg2rad(30))
    assert out.distance_m == pytest.approx(1.8 / -np.sin(np.deg2rad(elevation)), rel=1e-6)


def test_random_shaking_is_one_angle_per_column_of_the_rms_it_says():
    ideal = PatchScene([Patch((0, 0, -1.8), **GROUND)]).ideal([100, 101, 102], np.arange(960))
    values = {"pitch_deg": 0, "yaw_deg": 0, "random_deg": 0.1, "rigid": 0}
    out = aimed(ideal, vibration=values)
    pitch = np.rad2deg(-np.arcsin(1.8 / out.distance_m)) - (ideal.layer - 259.5) * 0.05
    assert pitch[:960] == pytest.approx(pitch[1920:], abs=1e-9)
    assert pitch[:960].std() == pytest.approx(0.1, rel=0.1)
    assert abs(np.corrcoef(pitch[:959], pitch[1:960])[0, 1]) < 0.12


def test_random_shaking_with_a_memory_is_correlated_and_of_the_same_rms():
    ideal = PatchScene([Patch((0, 0, -1.8), **GROUND)]).ideal([100, 101, 102], np.arange(960))
    values = {"pitch_deg": 0, "yaw_deg": 0, "random_deg": 0.1, "memory_columns": 4.0, "rigid": 0}
    found = []
    for seed in range(8):
        out = aimed(ideal, known=around(ideal, None, seed=seed), vibration=values)
        found.append((np.rad2deg(-np.arcsin(1.8 / out.distance_m)) - (ideal.layer - 259.5) * 0.05)[:960])
    pitch = np.array(found)
    assert pitch.std() == pytest.approx(0.1, rel=0.05)
    for lag in (1, 4, 12):
        assert np.mean(pitch[:, lag:] * pitch[:, :-lag]) / 0.01 == pytest.approx(np.exp(-lag / 4.0), abs=0.07)
    few = np.flatnonzero(ideal.point % 7 < 3)
    part = aimed(ideal.take(few), known=around(ideal.take(few), None, seed=7), vibration=values)
    assert part.distance_m[ideal.point[few] % 7 == 1] == pytest.approx(
        out.distance_m[few][ideal.point[few] % 7 == 1], rel=1e-4
    )


def test_every_frame_may_begin_the_swing_anew():
    ideal = PatchScene([Patch((0, 0, -1.8), **GROUND)]).ideal([100, 101, 102], np.arange(960))
    values = {"pitch_deg": 0.2, "yaw_deg": 0, "frequency_hz": 100, "random_deg": 0, "new_phase": 1, "rigid": 0}
    swing = 2 * np.pi * 100 * sweep_time_s(np.arange(960))
    phases = []
    for seed in range(40):
        out = aimed(ideal, known=around(ideal, None, seed=seed), vibration=values)
        pitch = np.rad2deg(-np.arcsin(1.8 / out.distance_m)) - (ideal.layer - 259.5) * 0.05
        part = np.linalg.lstsq(np.column_stack([np.sin(swing), np.cos(swing)]), pitch[:960], rcond=None)[0]
        assert np.hypot(*part) == pytest.approx(0.2, rel=1e-3)
        phases.append(np.arctan2(part[1], part[0]) / (2 * np.pi) % 1.0)
    assert kstest(phases, "uniform").pvalue > 1e-3


# Motion.


@pytest.mark.parametrize("with_scene", [True, False])
def test_a_wall_comes_nearer_while_the_sensor_drives_at_it(with_scene):
    scene = PatchScene([Patch((25, 0, 0), **WALL_AHEAD)])
    ideal = scene.ideal([255, 260, 265], np.arange(0, 960, 3))
    out = aimed(ideal, scene if with_scene else None, motion={"forward_m_s": 30})
    direction = beam_directions(ideal.layer, ideal.point)
    expected = ideal.distance_m - 30 * sweep_time_s(ideal.point) / direction[:, 0]
    assert out.distance_m == pytest.approx(expected, rel=1e-9)


def test_only_the_time_that_is_left_counts():
    scene = PatchScene([Patch((25, 0, 0), **WALL_AHEAD)])
    ideal = scene.ideal([260], np.arange(960), time_s=sweep_time_s(np.arange(960)) - 0.01)
    out = aimed(ideal, scene, motion={"forward_m_s": 30})
    assert (ideal.distance_m - out.distance_m) * rays_of(ideal).direction[:, 0] == pytest.approx(0.3)
    assert np.array_equal(out.time_s, ideal.time_s)


def test_a_turning_sensor_looks_further_left_as_the_sweep_goes_on():
    scene = PatchScene([Patch((25, 0, 0), **WALL_AHEAD)])
    ideal = scene.ideal([260], np.arange(960))
    out = aimed(ideal, motion={"forward_m_s": 0, "yaw_deg_s": 20})
    azimuth = np.deg2rad((np.arange(960) - 479.5) * 0.125 + 20 * sweep_time_s(np.arange(960)))
    assert out.distance_m == pytest.approx(25 / np.cos(azimuth) / np.cos(np.deg2rad(0.025)), rel=1e-9)


def car_and_wall(velocity=None):
    patches = [Patch((40, 0, 0), **WALL_AHEAD), Patch((20, 0.5, 0), (0, 1, 0), (0, 0, 0.4), 2, 7)]
    return PatchScene(patches, {} if velocity is None else {7: velocity})


@pytest.mark.parametrize("with_scene", [True, False])
def test_one_object_moves_and_the_rest_stands(with_scene):
    scene = car_and_wall()
    ideal = scene.ideal(LAYERS, np.arange(400, 560))
    out = aimed(
        ideal, scene if with_scene else None, motion={"forward_m_s": -60, "left_m_s": 0, "object_id": 7, "objects": 0}
    )
    both = (out.object_id == 7) & (ideal.object_id == 7)
    assert both.sum() > 200
    moved = 60 * sweep_time_s(ideal.point) / rays_of(ideal).direction[:, 0]
    assert (ideal.distance_m - out.distance_m)[both] == pytest.approx(moved[both], rel=1e-7)
    rest = (out.object_id == 1) & (ideal.object_id == 1)
    assert np.array_equal(out.distance_m[rest], ideal.distance_m[rest])


def test_the_scene_s_own_velocities_count_by_their_factor():
    ideal = car_and_wall().ideal(LAYERS, np.arange(400, 560))
    slow, own = car_and_wall((-30.0, 8.0, 0.0)), car_and_wall((-60.0, 16.0, 0.0))
    half = aimed(ideal, own, motion={"forward_m_s": 0, "objects": 0.5})
    whole = aimed(ideal, slow, motion={"forward_m_s": 0})
    assert np.array_equal(half.distance_m, whole.distance_m)
    assert not np.array_equal(half.distance_m, ideal.distance_m)
    assert aimed(ideal, own, motion={"forward_m_s": 0, "objects": 0}) is ideal
    assert aimed(ideal, car_and_wall(), motion={"forward_m_s": 0}) is ideal


def test_an_effect_behind_motion_still_sees_the_objects_move():
    scene = car_and_wall((-60.0, 16.0, 0.0))
    ideal = scene.ideal(LAYERS, np.arange(400, 560))
    turn = {"yaw_deg": 0.25, "pitch_deg": 0, "rigid": 0}
    one = aimed(ideal, scene, motion={"forward_m_s": 0}, boresight=turn)
    other = aimed(ideal, scene, boresight=turn, motion={"forward_m_s": 0})
    assert np.array_equal(one.distance_m, other.distance_m)
    assert not np.array_equal(one.distance_m, aimed(ideal, scene, boresight=turn).distance_m)


@pytest.mark.parametrize("with_scene", [True, False])
def test_objects_move_each_on_its_own(with_scene):
    patches = [Patch((40, 0, 0), **WALL_AHEAD)]
    patches += [Patch((20, 1.2 * k, 0), (0, 0.8, 0), (0, 0, 0.4), 2, 7 + k) for k in (-1, 0, 1)]
    scene = PatchScene(patches)
    ideal = scene.ideal(LAYERS, np.arange(400, 560))
    listed = {"movers": [6, 8, 99], "movers_forward_m_s": [-60.0, 30.0, 20.0]}
    out = aimed(ideal, scene if with_scene else None, motion={"forward_m_s": 0, "objects": 0.5, **listed})
    along = (out.distance_m - ideal.distance_m) * rays_of(ideal).direction[:, 0]
    for number, speed in ((6, -30.0), (7, 0.0), (8, 15.0), (1, 0.0)):
        both = (out.object_id == number) & (ideal.object_id == number)
        assert both.sum() > 50
        assert along[both] == pytest.approx(speed * sweep_time_s(ideal.point)[both], abs=1e-9)


def test_objects_move_on_beside_a_sensor_that_drives():
    scene = car_and_wall()
    ideal = scene.ideal(LAYERS, np.arange(400, 560))
    out = aimed(ideal, motion={"forward_m_s": 25.0, "movers": [7], "movers_forward_m_s": [25.0]})
    both = (out.object_id == 7) & (ideal.object_id == 7)
    assert out.distance_m[both] == pytest.approx(ideal.distance_m[both], rel=1e-9)


def test_every_mover_has_a_velocity():
    with pytest.raises(UsageError, match="2 movers and 1 velocities"):
        effects.make("motion", {"movers": [1, 2], "movers_forward_m_s": [3.0]})
    with pytest.raises(UsageError, match="is not whole"):
        effects.make("motion", {"movers": [1.5], "movers_forward_m_s": [3.0]})


def test_without_object_numbers_no_object_moves():
    ideal = car_and_wall().ideal(LAYERS, POINTS, objects=False)
    assert aimed(ideal, motion={"object_id": 7}) is ideal
    assert aimed(ideal, motion={"forward_m_s": 0, "movers": [7], "movers_forward_m_s": [9.0]}) is ideal


# Beam divergence.


@pytest.mark.parametrize("with_scene", [True, False])
@pytest.mark.parametrize("axis", ["horizontal", "vertical"])
def test_an_edge_shares_a_footprint_by_the_area_of_its_gaussian(axis, with_scene):
    edge = {"horizontal": (0, -500, 0), "vertical": (0, 0, -500)}[axis]
    far = {"horizontal": (0, 1000, 0), "vertical": (0, 0, 1000)}[axis]
    near = Patch((10, *edge[1:]), **WALL_AHEAD, material=1, number=1)
    scene = PatchScene([near, Patch((20, *far[1:]), (0, 2000, 0), (0, 0, 2000), 2, 2)])
    ideal = scene.ideal(np.arange(250, 270), np.arange(470, 490))
    width = {"vertical_deg": 0.4, "horizontal_deg": 0.4, "rays": 7, "least_m": 0}
    out = aimed(ideal, scene if with_scene else None, beam_divergence=width)
    sigma = 0.4 / 2.3548
    offset = {"horizontal": (ideal.point - 479.5) * 0.125, "vertical": (ideal.layer - 259.5) * 0.05}[axis]
    beam = (out.layer - 250) * 20 + out.point - 470
    share = np.bincount(beam, weights=out.shares() * (out.object_id == 1), minlength=400)
    assert np.bincount(beam, weights=out.shares()) == pytest.approx(np.ones(400))
    # Seven equal parts tell an area to a fourteenth.
    assert np.abs(share - ndtr(-offset / sigma)).max() <= 1 / 14 + 1e-3


def test_a_grazing_ground_is_spread_in_range():
    scene = PatchScene([Patch((0, 0, -1.8), **GROUND)])
    ideal = scene.ideal([219, 220, 221], np.arange(470, 490))
    out = aimed(ideal, beam_divergence={"vertical_deg": 0.2, "horizontal_deg": 0.2, "rays": 5, "least_m": 0.05})
    assert len(out) == 3 * 20 * 5
    elevation = (220 - 259.5) * 0.05 + 0.2 / 2.3548 * ndtri([0.1, 0.3, 0.5, 0.7, 0.9])
    for point in (470, 489):
        mine = np.sort(out.distance_m[(out.point == point) & (out.layer == 220)])
        assert mine == pytest.approx(1.8 / -np.sin(np.deg2rad(elevation)), rel=1e-6)


def test_a_wall_that_is_met_squarely_needs_one_row():
    ideal = PatchScene([Patch((25, 0, 0), **WALL_AHEAD)]).ideal(LAYERS, POINTS)
    assert aimed(ideal, beam_divergence={}) is ideal
    scene = PatchScene([Patch((25, 0, 0), **WALL_AHEAD)])
    assert aimed(ideal, scene, beam_divergence={}) is ideal


def test_a_scene_s_wire_between_the_beams_is_found():
    wire = Patch((10, np.tan(np.deg2rad(0.0625)) * 10 + 0.0109, 0), (0, 0.004, 0), (0, 0, 50), 2, 2)
    scene = PatchScene([Patch((25, 0, 0), **WALL_AHEAD), wire])
    ideal = scene.ideal([260], np.arange(470, 490))
    assert 2 not in ideal.material_id
    out = aimed(ideal, scene, beam_divergence={"vertical_deg": 0.1, "horizontal_deg": 0.3, "rays": 7})
    assert 2 in out.material_id


@pytest.mark.parametrize("with_scene", [True, False])
def test_unequal_shares_are_split_and_kept(with_scene):
    ideal = STREET.ideal(LAYERS, POINTS)
    share = np.random.default_rng(1).uniform(0.2, 1.0, len(ideal))
    out = aimed(replace(ideal, share=share), STREET if with_scene else None, beam_divergence={})
    beam = out.layer.astype(int) * 960 + out.point
    total = np.bincount(beam, weights=out.share)[ideal.layer * 960 + ideal.point]
    assert len(out) > len(ideal)
    assert total == pytest.approx(share)


def test_rows_of_one_beam_are_divided_alike():
    ideal = STREET.ideal(LAYERS, POINTS)
    twice = IdealScan(
        *(np.concatenate([getattr(ideal, c)] * 2) for c in ("layer", "point", "distance_m", "material_id")),
        np.zeros(2 * len(ideal)),
    )
    out = aimed(twice, beam_divergence={})
    rows = np.bincount(out.layer.astype(int) * 960 + out.point)
    assert set(rows[rows > 0]) == {2, 50}
    assert out.share is None


def test_footprints_follow_beams_that_were_turned_before():
    ideal = STREET.ideal(LAYERS, POINTS)
    turn = {"yaw_deg": 0.5, "pitch_deg": 0.0, "rigid": 0}
    wide = {"least_m": 0.0}
    one = aimed(ideal, STREET, boresight=turn, beam_divergence=wide)
    # Four columns of 0.125 deg: the same footprints as of the beams there.
    shifted = STREET.ideal(LAYERS, POINTS + 4)
    other = aimed(shifted, STREET, beam_divergence=wide)
    assert np.sort(one.distance_m) == pytest.approx(np.sort(other.distance_m), rel=1e-9)


# Scenes with panes, and scans that were swept.


@pytest.mark.parametrize("name", ["boresight", "beam_divergence", "vibration", "motion"])
def test_what_a_pane_shows_behind_itself_stays_behind_it(name):
    pane = Patch((10, 0, 0), (0, 0.8, 0), (0, 0, 0.3), 5, 5)
    wall = Patch((25, 0, 0), **WALL_AHEAD, material=2, number=2)
    scene = PatchScene([pane, wall])
    first = scene.ideal(LAYERS, np.arange(400, 560))
    through = np.flatnonzero(first.material_id == 5)
    behind = PatchScene([wall]).ideal(LAYERS, np.arange(400, 560)).take(through)
    columns = ("layer", "point", "distance_m", "material_id", "incidence_deg")
    table = IdealScan(
        *(np.concatenate([getattr(first, c), getattr(behind, c)]) for c in columns),
        object_id=np.concatenate([first.object_id, behind.object_id]),
        share=np.concatenate([np.ones(len(first)), np.full(len(behind), 0.6)]),
    )
    values = {"boresight": {"yaw_deg": 0.3, "pitch_deg": 0.1}, "beam_divergence": {"vertical_deg": 0.2}}
    out = aimed(table, scene, **{name: values.get(name, {})})
    beam = out.layer.astype(int) * 960 + out.point
    lit = np.bincount(beam, weights=out.share)
    before = np.bincount(table.layer.astype(int) * 960 + table.point, weights=table.share)
    assert lit[before > 0] == pytest.approx(before[before > 0])
    # The second rows show the wall, where a beam beside them did, and never the pane again.
    share = np.bincount(beam, weights=np.where(out.material_id == 5, out.share, 0) * (out.distance_m > 0))
    assert share.max() <= 1 + 1e-12
    second = rays_of(out).direction[out.share < (0.61 if name != "beam_divergence" else 0)]
    if len(second):
        shown = out.distance_m[out.share < 0.61]
        met = shown > 0
        shift = 10 * sweep_time_s(out.point[out.share < 0.61]) if name == "motion" else 0.0
        assert met.mean() > 0.85
        assert shown[met] == pytest.approx(((25 - shift) / second[:, 0])[met], rel=1e-3)


def test_effects_behind_a_swept_scan_see_the_objects_where_they_were():
    scene = car_and_wall((-60.0, 16.0, 0.0))
    still = scene.ideal(LAYERS, np.arange(400, 560))
    rays = replace(rays_of(still), time_s=sweep_time_s(still.point))
    hits = scene.cast(rays, moving=scene.velocities_m_s)
    swept = replace(
        still, distance_m=hits.distance_m, object_id=hits.object_id, time_s=sweep_time_s(still.point), rays=rays
    )
    there = {"yaw_deg": 0.3, "pitch_deg": 0.1, "roll_deg": 0.0}
    known = around(swept, scene)
    once = aimed(swept, known=known, boresight=there)
    back = effects.make("boresight", {name: -value for name, value in there.items()}).aim(once, known.after(once))
    assert back.distance_m == pytest.approx(swept.distance_m, rel=1e-9)
    assert aimed(swept, scene, motion={}) is swept
