"""Scenes before other sensors: rays from where their beams begin, to where they look, when they are fired."""

from dataclasses import replace

import numpy as np
import pytest

from lidarcheck.errors import ConfigError, UsageError
from lidarcheck.scenes import Scene, SceneObject
from lidarcheck.scenes.facets import box, floor, placed, wall
from lidarcheck.scenes.files.file import builtin_path, load_scene
from lidarcheck.sensor import sensor_of, shipped

CLOSE_M = 1e-9
ROOM_M = 6.0


def room():
    """Walls 6 m from the sensor on all sides, floor and ceiling 2 m from it."""
    shell = box((-ROOM_M, -ROOM_M, -2.0), (ROOM_M, ROOM_M, 2.0), 1)
    return Scene((SceneObject(shell.triangles_m, shell.material_id, 1, name="room"),))


def to_the_shell(origin, direction):
    """Slab method, from inside."""
    half = np.array([ROOM_M, ROOM_M, 2.0])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(direction == 0.0, np.inf, (half * np.sign(direction) - origin) / direction).min(axis=1)


def aimed(ideal):
    """Where the rows' beams begin and look, by the sensor's description."""
    beams = ideal.beams
    origin = beams.origins_m(ideal.layer, ideal.point)
    return np.zeros((len(ideal), 3)) if origin is None else origin, beams.directions(ideal.layer, ideal.point)


@pytest.mark.parametrize("name", ["VLP-16", "HDL-32E", "OS1-128", "XT32", "CARLA", "SLIM"])
def test_every_beam_is_cast_from_its_own_origin_along_its_own_direction(name):
    sensor = shipped(name)
    ideal = room().ideal(sensor, points=(0, 170), max_range_m=100.0)
    assert len(ideal) == sensor.beams.layers * 171
    assert ideal.beams == sensor.beams
    origin, direction = aimed(ideal)
    assert np.abs(ideal.distance_m - to_the_shell(origin, direction)).max() < CLOSE_M
    assert (name == "OS1-128") == bool(origin.any())


def test_a_sensor_sees_as_far_as_its_description_says():
    nearest = floor(20.0, 20.0, 3)
    scene = Scene((SceneObject(placed(nearest, (0.0, 0.0, -3.0)).triangles_m, nearest.material_id, 1),))
    carla = shipped("CARLA")
    seen = scene.ideal(carla)
    direction = aimed(seen)[1]
    to_floor = np.where(direction[:, 2] < 0.0, -3.0 / np.minimum(direction[:, 2], -1e-12), 1e9)
    inside = (to_floor <= 10.0) & (np.abs(direction[:, :2] * to_floor[:, None]) < 10.0).all(axis=1)
    assert np.array_equal(seen.distance_m > 0.0, inside)
    assert inside.any()
    farther = scene.ideal(replace(carla, max_range_m=14.0))
    assert (farther.distance_m > 10.0).any()


@pytest.mark.parametrize("name", ["VLP-16", "HDL-32E"])
def test_frames_of_columns_that_do_not_repeat_go_on_where_the_last_one_ended(name):
    sensor = shipped(name)
    frames = [room().ideal(sensor, layers=(3, 3), frame=k) for k in range(4)]
    columns = sensor.beams.columns
    # The head turns on: firing number n of the run looks at n steps, whatever frame it belongs to.
    fired = 0
    for ideal in frames:
        n = fired + ideal.point
        azimuth0 = float(np.unique(ideal.extra["Azimuth0"])[0])
        assert np.isclose(np.mod(azimuth0 - fired * sensor.beams.step_deg + 180.0, 360.0) - 180.0, 0.0, atol=1e-6)
        again = sensor.beams.with_phase(azimuth0).directions(ideal.layer, ideal.point)
        whole = sensor.beams.directions(ideal.layer, n)
        assert np.abs(again - whole).max() < 1e-7
        assert np.array_equal(ideal.point, np.arange(len(ideal)))
        fired += len(ideal)
    assert [len(ideal) for ideal in frames] == np.diff(np.ceil(np.arange(5) * columns)).astype(int).tolist()
    assert len({len(ideal) for ideal in frames}) == 2


def test_surface_points_of_columns_that_do_not_repeat_are_told():
    ideal = room().ideal(shipped("HDL-32E"), frame=2, max_range_m=8.0)
    xyz = np.column_stack([ideal.extra[name] for name in "XYZ"])
    met = ideal.distance_m > 0.0
    assert 0 < met.sum() < len(ideal)
    assert np.abs(np.linalg.norm(xyz, axis=1) - ideal.distance_m).max() < CLOSE_M
    assert np.abs(np.abs(xyz[met]) / [ROOM_M, ROOM_M, 2.0]).max(axis=1) == pytest.approx(1.0)
    assert dict(room().ideal(shipped("XT32"), points=(0, 9)).extra) == {}


def test_moving_things_are_met_when_their_beam_fires():
    panel = placed(wall(400.0, 100.0, 2), (10.0, 0.0, 0.0))
    scene = Scene((SceneObject(panel.triangles_m, panel.material_id, 4, (5.0, 0.0, 0.0)),))
    sensor = shipped("VLP-16")
    ideal = scene.ideal(sensor, points=(0, 100), swept=True)
    time_s = sensor.beams.fire_time_s(ideal.layer, ideal.point)
    assert np.array_equal(ideal.time_s, time_s)
    assert len(np.unique(time_s)) == len(ideal)
    assert np.abs(ideal.distance_m * aimed(ideal)[1][:, 0] - (10.0 + 5.0 * time_s)).max() < 1e-8
    # A flash sees one instant.
    assert not scene.ideal(shipped("CARLA"), points=(0, 5), swept=True).time_s.any()


def test_a_head_that_turns_on_its_way_takes_its_beams_origins_along():
    sensor = shipped("OS1-128")
    still, turned = (room().ideal(sensor, points=(500, 520), swept=True, yaw_deg_s=yaw) for yaw in (0.0, 90.0))
    origin, direction = aimed(turned)
    angle = np.deg2rad(90.0) * turned.time_s
    cosine, sine = np.cos(angle), np.sin(angle)

    def about_z(v):
        return np.column_stack([cosine * v[:, 0] - sine * v[:, 1], sine * v[:, 0] + cosine * v[:, 1], v[:, 2]])

    expected = to_the_shell(about_z(origin), about_z(direction))
    assert np.abs(turned.distance_m - expected).max() < CLOSE_M
    assert not np.allclose(still.distance_m, turned.distance_m)


def test_a_zone_is_filled_with_rays_in_equal_cells():
    sensor = shipped("TMF8820-short")
    face = placed(wall(9.0, 9.0, 5), (0.5, 0.0, 0.0))
    ideal = Scene((SceneObject(face.triangles_m, face.material_id, 1),)).ideal(sensor)
    assert len(ideal) == 9 * 81
    assert ideal.share is None
    assert np.allclose(ideal.shares(), 1.0 / 81)
    cells = (np.arange(27) + 0.5) / 27 * 29.001 - 14.5005
    up, left = np.deg2rad(np.repeat(cells, 27)), np.deg2rad(np.tile(cells, 27))
    assert np.allclose(np.sort(ideal.distance_m), np.sort(0.5 / (np.cos(up) * np.cos(left))), atol=1e-9)
    # Cut by the gate of 1.6 m, a ray that meets nothing still counts.
    gone = Scene((SceneObject(placed(wall(0.2, 9.0, 5), (0.5, 0.0, 0.0)).triangles_m, face.material_id, 1),))
    some = gone.ideal(sensor)
    assert len(some) == 9 * 81
    assert (some.distance_m == 0.0).any()


def test_a_gaussian_footprint_has_equally_probable_rays():
    document = {
        "name": "wide", "detector": "linear", "frame_rate_hz": 10, "linear": {"signal_at_1m": 1e5},
        "beams": {
            "kind": "channels", "elevation_deg": [5.0, -5.0], "columns": 8,
            "footprint_deg": {"horizontal": 2.0, "vertical": 0.5}, "sub_rays": {"horizontal": 4, "vertical": 2},
        },
    }  # fmt: skip
    sensor = sensor_of(document)
    ideal = room().ideal(sensor, points=(1, 1))
    assert len(ideal) == 2 * 8
    xyz = ideal.rays.direction
    azimuth = np.rad2deg(np.arctan2(xyz[:, 1], xyz[:, 0])) - 45.0
    elevation = np.rad2deg(np.arcsin(xyz[:, 2])) - np.where(ideal.layer == 0, 5.0, -5.0)
    # Quantiles 1/8, 3/8, 5/8, 7/8 and 1/4, 3/4 of a normal distribution, from a table.
    aside = np.array([-1.1503494, -0.3186394, 0.3186394, 1.1503494]) * 2.0 / 2.3548
    high = np.array([-0.6744898, 0.6744898]) * 0.5 / 2.3548
    for layer in (0, 1):
        own = ideal.layer == layer
        assert np.allclose(np.unique(np.round(azimuth[own], 6)), aside, atol=1e-5)
        assert np.allclose(np.unique(np.round(elevation[own], 6)), high, atol=1e-5)
    # What a caller asks for goes before: the beam's axis alone.
    assert len(room().ideal(sensor, points=(1, 1), sub_beams=1)) == 2


def test_sub_beams_fill_the_cell_between_a_channels_neighbours():
    sensor = shipped("XT32")
    ideal = room().ideal(sensor, layers=(4, 4), points=(10, 10), sub_beams=2)
    xyz = ideal.rays.direction
    elevation, azimuth = sensor.beams.angles_deg([4], [10])
    found = np.sort(np.rad2deg(np.arcsin(xyz[:, 2])) - elevation[0])
    assert np.allclose(found, [-0.25, -0.25, 0.25, 0.25], atol=1e-9)
    aside = np.sort(np.rad2deg(np.arctan2(xyz[:, 1], xyz[:, 0])) - azimuth[0])
    assert np.allclose(aside, [-0.045, -0.045, 0.045, 0.045], atol=1e-9)


def test_a_sensor_whose_beams_a_scan_brings_is_cast_along_that_scan():
    livox = shipped("Livox")
    with pytest.raises(UsageError, match="Livox HAP has no beams of its own"):
        room().ideal(livox)
    rows = {
        "Layer": [0, 0, 1],
        "Point": [0, 1, 0],
        "elevation_deg": [1.0, -3.0, 7.0],
        "azimuth_deg": [10.0, 80.0, -44.0],
    }
    columns = {name: np.asarray(values) for name, values in rows.items()}
    beams = type(livox.beams).of_columns(livox.sweep, columns, from_scan=True)
    ideal = room().ideal(replace(livox, beams=beams))
    assert ideal.layer.tolist() == [0, 0, 1]
    assert ideal.point.tolist() == [0, 1, 0]
    origin, direction = aimed(ideal)
    assert np.abs(ideal.distance_m - to_the_shell(origin, direction)).max() < CLOSE_M
    assert np.abs(np.column_stack([ideal.extra[n] for n in "XYZ"]) - direction * ideal.distance_m[:, None]).max() < 1e-9
    assert "Azimuth0" not in ideal.extra


def test_a_scene_that_asks_for_beams_which_a_sensor_lacks_says_so_with_its_line(tmp_path):
    file = tmp_path / "scene.toml"
    text = '[[objects]]\nshape = "panel"\nposition_m = [20.0, 0.0, 0.0]\nwidth_m = 4.0\nheight_m = 2.0\nmaterial = 3\n'
    file.write_text(text + "[sampling]\nlayers = [10, 20]\npoints = [0, 99]\n")
    scene = load_scene(file)
    assert len(scene.ideal()) == 11 * 100
    assert len(scene.ideal(shipped("XT32"))) == 11 * 100
    with pytest.raises(ConfigError) as caught:
        scene.ideal(shipped("VLP-16"))
    said = f"error: {file}:8: layers = [10, 20] is out of range; use [first, last], both included, from 0 to 15"
    assert caught.value.lines() == [said]
    assert len(scene.ideal(shipped("VLP-16"), layers=(0, 1))) == 200


def test_a_shipped_scene_stands_before_any_shipped_sensor():
    ideal = load_scene(builtin_path("city_street")).ideal(shipped("HDL-32E"), layers=(5, 6), points=(0, 400))
    assert (ideal.distance_m > 0.0).mean() > 0.5
    assert set(np.unique(ideal.layer)) == {5, 6}
