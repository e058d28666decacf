"""Rays into a map: a mesh and a cloud of one hall agree with its own planes, from every pose and on the way."""

import numpy as np
import pytest

from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.geometry.placement import rotation
from lidarcheck.formats.poses import read_poses
from lidarcheck.ideals.map import frame_starts, ideal_at, map_of_mesh
from lidarcheck.ideals.surfels import map_of_cloud, spacing_of
from lidarcheck.scenes.facets import box
from lidarcheck.sensor import shipped

SENSOR = shipped("VLP-16")
LAYER, POINT = SENSOR.beams.every()
HIGH = np.array([12.0, 9.0, 6.0])
"""A hall from 0, 0, 0 to here."""
POSES = "time,x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg\n0,5,4,1.5,0,0,0\n0.1,5.5,4.2,1.6,2,-3,40\n0.2,6,4.4,1.6,2,-3,60\n"


def poses_of(folder, text=POSES):
    file = folder / "poses.csv"
    file.write_text(text, encoding="utf-8")
    return read_poses(file)


def hall_distance(turn, place, origin, direction):
    """The way from inside of the hall to its nearest wall along each ray, and the cosine there."""
    o, u = origin @ turn.T + place, direction @ turn.T
    with np.errstate(divide="ignore", invalid="ignore"):
        ways = np.where(u == 0.0, np.inf, np.where(u > 0.0, (HIGH - o) / u, -o / u))
    wall = ways.argmin(axis=1)
    rows = np.arange(len(o))
    return ways[rows, wall], np.abs(u[rows, wall])


def rays(ideal=None):
    """Of a frame: columns of this sensor look elsewhere in each."""
    beams, layer, point = (SENSOR.beams, LAYER, POINT) if ideal is None else (ideal.beams, ideal.layer, ideal.point)
    origin, u = beams.origins_m(layer, point), beams.directions(layer, point)
    return (np.zeros_like(u) if origin is None else origin), u


def hall_mesh():
    return box((0.0, 0.0, 0.0), tuple(HIGH), 3)


def hall_cloud(spacing, noise, seed=0):
    """Points scattered over the hall's walls, some millimetres off."""
    draw = np.random.default_rng(seed)
    parts = []
    for axis in range(3):
        for side in (0.0, HIGH[axis]):
            others = [i for i in range(3) if i != axis]
            count = int(np.prod(HIGH[others]) / spacing**2)
            points = np.zeros((count, 3))
            points[:, others] = draw.uniform(0.0, HIGH[others], (count, 2))
            points[:, axis] = side + noise * draw.standard_normal(count)
            parts.append(points)
    return np.concatenate(parts)


def test_a_mesh_is_met_where_its_walls_are(tmp_path):
    poses = poses_of(tmp_path)
    surfaces = map_of_mesh(hall_mesh(), HIGH / 2.0)
    for number in range(3):
        ideal = ideal_at(surfaces, SENSOR, poses, number)
        true, cosine = hall_distance(poses.turn[number], poses.place_m[number], *rays(ideal))
        assert np.abs(ideal.distance_m - true).max() < 1e-9
        assert np.abs(np.cos(np.deg2rad(ideal.incidence_deg)) - cosine).max() < 1e-6
        assert set(ideal.material_id) == {3}
        assert ideal.object_id is None
        assert ideal.time_s is None


def test_a_map_in_a_country_grid_keeps_its_millimetres(tmp_path):
    far = np.array([456_789.0, 5_432_100.0, 200.0])
    poses = poses_of(
        tmp_path, POSES.replace("0,5,4,1.5", f"0,{far[0] + 5},{far[1] + 4},{far[2] + 1.5}").split("0.1")[0]
    )
    facets = hall_mesh()
    facets = facets._replace(triangles_m=facets.triangles_m + far)
    ideal = ideal_at(map_of_mesh(facets, far), SENSOR, poses, 0)
    true, _ = hall_distance(np.eye(3), np.array([5.0, 4.0, 1.5]), *rays())
    assert np.abs(ideal.distance_m - true).max() < 1e-6


def test_over_the_sweep_each_beam_starts_where_the_sensor_then_is(tmp_path):
    poses = poses_of(tmp_path)
    surfaces = map_of_mesh(hall_mesh(), HIGH / 2.0)
    assert frame_starts(poses, SENSOR) == pytest.approx([0.0, 0.1])
    ideal = ideal_at(surfaces, SENSOR, poses, 0, 0.0)
    fired = SENSOR.beams.fire_time_s(LAYER, POINT)
    assert np.array_equal(ideal.time_s, fired)
    share = (fired / 0.1)[:, None]
    place = poses.place_m[0] * (1.0 - share) + poses.place_m[1] * share
    turn, _ = poses.at(fired)
    o, u = rays()
    true = np.array([hall_distance(t, p, a[None], b[None])[0][0] for t, p, a, b in zip(turn, place, o, u, strict=True)])
    assert np.abs(ideal.distance_m - true).max() < 1e-6
    still = ideal_at(surfaces, SENSOR, poses, 0)
    assert np.abs(still.distance_m - ideal.distance_m).max() > 0.2


def test_a_cloud_is_met_within_the_error_that_it_says(tmp_path):
    poses = poses_of(tmp_path)
    cloud = hall_cloud(0.05, 0.005)
    assert spacing_of(cloud) == pytest.approx(0.05, rel=0.1)
    surfaces = map_of_cloud(cloud, np.full(len(cloud), 4, dtype=np.int32))
    ideal = ideal_at(surfaces, SENSOR, poses, 1)
    true, _ = hall_distance(poses.turn[1], poses.place_m[1], *rays(ideal))
    met = ideal.distance_m > 0.0
    inner = met & (ideal.extra["Edge"] == 0)
    assert met.mean() > 0.995
    assert inner.mean() > 0.95
    off = (ideal.distance_m - true)[inner]
    assert np.median(np.abs(off)) < 0.003
    z = off / ideal.extra["DistanceError"][inner]
    assert 0.7 < np.sqrt(np.mean(np.minimum(np.abs(z), 5.0) ** 2)) < 1.4
    assert set(ideal.material_id[met]) == {4}


def test_what_no_point_shows_is_unknown_and_not_empty(tmp_path):
    poses = poses_of(tmp_path)
    cloud = hall_cloud(0.1, 0.002)
    cloud = cloud[cloud[:, 0] < 11.5]  # the wall ahead is missing
    stray = np.array([[7.0, 4.0, 1.5]])  # and a single point stands before it
    ideal = ideal_at(
        map_of_cloud(np.concatenate([cloud, stray]), np.ones(len(cloud) + 1, dtype=np.int32)), SENSOR, poses, 0
    )
    _, u = rays()
    ahead = u[:, 0] > 0.99
    assert np.isnan(ideal.distance_m[ahead & (np.abs(u[:, 1]) < 0.005)]).all()
    assert np.isnan(ideal.distance_m[ahead]).mean() > 0.8
    assert not (ideal.distance_m == 0.0).any()


def test_poses_are_read_as_trajectories_have_them(tmp_path):
    turn, place = rotation(5.0, -7.0, 110.0), (1.0, 2.0, 3.0)
    from scipy.spatial.transform import Rotation

    quaternion = Rotation.from_matrix(turn).as_quat()
    (tmp_path / "tum.txt").write_text(f"# t x y z q\n12.5 {' '.join(map(repr, map(float, [*place, *quaternion])))}\n")
    matrix = np.column_stack([turn, place])
    (tmp_path / "kitti.txt").write_text(" ".join(map(repr, matrix.ravel().tolist())) + "\n")
    for name in ("tum.txt", "kitti.txt"):
        poses = read_poses(tmp_path / name)
        assert np.abs(poses.turn[0] - turn).max() < 1e-9
        assert poses.place_m[0] == pytest.approx(place)
    assert read_poses(tmp_path / "tum.txt").time_s[0] == 12.5


WRONG = {
    "# nothing": "holds no pose",
    "a,b\n1,2\n": ":1: no column x_m",
    POSES + "0.3,1,2\n": ":5: has 3 cells",
    POSES + "0.15,1,2,3,0,0,0\n": ":5: is not later",
    POSES + "0.3,1,2,3,0,0,nan\n": ":5: yaw_deg is 'nan'",
    "1 2 3\n": ":1: the first row has 3 numbers",
    "0 1 2 3 0 0 0 2\n": ":1: the quaternion has not the length 1",
    "1 0 0 0 0 1 0 0 0 0 -1 0\n": ":1: the matrix does not turn alone",
    "name,x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg\n../a,1,2,3,0,0,0\n": ":2: the name '../a' is no name of a file",
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_poses_are_refused_with_their_line(tmp_path, text):
    with pytest.raises(InputError) as caught:
        poses_of(tmp_path, text)
    assert WRONG[text] in caught.value.lines()[0]
    assert len(caught.value.lines()) == 1


def test_a_sweep_that_the_poses_do_not_cover_is_refused(tmp_path):
    poses = poses_of(tmp_path, POSES.split("0.1,")[0] + "0.05,5,4,1.5,0,0,0\n")
    with pytest.raises(UsageError, match="a sweep takes"):
        frame_starts(poses, SENSOR)
