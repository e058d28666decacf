"""What rays meet in a scene, held against closed forms and against a search over all triangles."""

import pickle

import numpy as np
import pytest

from lidarcheck.errors import InputError, UsageError
from lidarcheck.rays import Rays
from lidarcheck.scenes import Facets, Optics, Scene, SceneObject
from lidarcheck.scenes.facets import box, cylinder, ellipsoid, floor, joined, placed, wall
from lidarcheck.scenes.meshes import load_mesh
from lidarcheck.scenes.vehicles import BUILDERS, CAR_M, TRUCK_M, VAN_M, Paint, person, tree
from reference_grid import azimuth_deg, beam_directions, elevation_deg

SOME = {"layers": (100, 400), "points": (300, 700)}
SMALL = {"layers": (255, 264), "points": (470, 489)}


def thing(facets, number=1, velocity=(0.0, 0.0, 0.0)):
    return SceneObject(facets.triangles_m, facets.material_id, number, velocity)


def scene_of(*facets, optics=None):
    return Scene(tuple(thing(part, i + 1) for i, part in enumerate(facets)), optics or {})


def rays_of(origin, direction, time_s=None):
    direction = np.asarray(direction, dtype=float)
    n = len(direction)
    unit = direction / np.linalg.norm(direction, axis=1)[:, None]
    times = np.zeros(n) if time_s is None else np.asarray(time_s)
    return Rays(np.broadcast_to(np.asarray(origin, dtype=float), (n, 3)), unit, times, np.zeros(n, dtype=np.int32))


def random_directions(n, seed=1):
    direction = np.random.default_rng(seed).normal(size=(n, 3))
    return direction / np.linalg.norm(direction, axis=1)[:, None]


def test_level_ground_is_met_where_the_beam_sinks_to_it():
    ideal = scene_of(placed(floor(400.0, 400.0, 7), (0.0, 0.0, -1.8))).ideal()
    down = -beam_directions(ideal.layer, ideal.point)[:, 2]
    with np.errstate(divide="ignore"):
        expected = np.where(down > 0.0, 1.8 / down, np.inf)
    reach = expected * np.cos(np.deg2rad(elevation_deg(ideal.layer)))
    met = (expected <= 300.0) & (reach < 199.0)
    assert np.array_equal(ideal.distance_m[met] > 0.0, np.ones(met.sum(), bool))
    assert np.allclose(ideal.distance_m[met], expected[met], rtol=1e-12)
    assert np.allclose(ideal.incidence_deg[met], np.rad2deg(np.arccos(down[met])), atol=1e-9)
    assert np.all(ideal.distance_m[down <= 0.0] == 0.0)
    assert set(ideal.material_id[met]) == {7}
    assert len(ideal) == 520 * 960


def in_local_frame(direction, centre, yaw, pitch, roll):
    """Beam and sensor as the turned shape sees them, by elementary rotations one after another."""

    def back(vectors):
        a, b, c = np.deg2rad([yaw, pitch, roll])
        x, y, z = vectors.T
        x, y = np.cos(a) * x + np.sin(a) * y, -np.sin(a) * x + np.cos(a) * y
        x, z = np.cos(b) * x + np.sin(b) * z, -np.sin(b) * x + np.cos(b) * z
        y, z = np.cos(c) * y + np.sin(c) * z, -np.sin(c) * y + np.cos(c) * z
        return np.stack([x, y, z], axis=1)

    return back(-np.asarray([centre])), back(direction)


@pytest.mark.parametrize("turn", [(0, 0, 0), (30, 0, 0), (0, 20, 0), (0, 0, 25), (-40, 15, 10)])
def test_a_turned_panel_is_met_inside_its_borders(turn):
    centre = (25.0, 3.0, 1.0)
    yaw, pitch, roll = turn
    panel = placed(wall(4.0, 2.0, 3), centre, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)
    ideal = scene_of(panel).ideal(**SOME)
    origin, direction = in_local_frame(beam_directions(ideal.layer, ideal.point), centre, *turn)
    distance = -origin[:, 0] / direction[:, 0]
    point = origin + distance[:, None] * direction
    margin = np.minimum(2.0 - np.abs(point[:, 1]), 1.0 - np.abs(point[:, 2]))
    clear = np.abs(margin) > 1e-4
    assert np.array_equal((ideal.distance_m > 0)[clear], (margin > 0)[clear])
    met = ideal.distance_m > 0
    assert met.sum() > 500
    assert np.allclose(ideal.distance_m[met], distance[met], rtol=1e-12)
    incidence = np.rad2deg(np.arccos(np.abs(direction[:, 0])))
    assert np.allclose(ideal.incidence_deg[met], incidence[met], atol=1e-7)


def test_positive_pitch_lifts_what_lies_ahead_and_positive_roll_the_left():
    ahead = placed(Facets(np.array([[[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]]), np.zeros(1)), (0, 0, 0), pitch_deg=90.0)
    assert np.allclose(ahead.triangles_m[0], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    left = placed(Facets(np.array([[[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]]), np.zeros(1)), (0, 0, 0), roll_deg=90.0)
    assert np.allclose(left.triangles_m[0], [[1, 0, 0], [0, 0, 1], [0, -1, 0]])


def test_a_box_is_met_as_by_the_slab_method():
    low, high = np.array([12.0, -3.0, -1.8]), np.array([15.0, 1.0, 0.7])
    ideal = scene_of(box(tuple(low), tuple(high), 2)).ideal(**SOME)
    direction = beam_directions(ideal.layer, ideal.point)
    near, far = np.sort(np.stack([low / direction, high / direction]), axis=0)
    enter, leave = near.max(axis=1), far.min(axis=1)
    clear = np.abs(leave - enter) > 1e-3
    assert np.array_equal((ideal.distance_m > 0)[clear], (enter < leave)[clear])
    met = (ideal.distance_m > 0) & clear
    assert np.allclose(ideal.distance_m[met], enter[met], rtol=1e-12)
    cosine = np.abs(direction)[np.arange(len(direction)), near.argmax(axis=1)]
    assert np.allclose(ideal.incidence_deg[met], np.rad2deg(np.arccos(cosine))[met], atol=1e-7)


@pytest.mark.parametrize("sides", [12, 64])
def test_a_pole_lies_between_its_inner_and_its_outer_circle(sides):
    pole = placed(cylinder(2.0, 50.0, 1, sides=sides), (20.0, 1.0, -25.0))
    ideal = scene_of(pole).ideal(**SOME)
    direction = beam_directions(ideal.layer, ideal.point)
    level = np.hypot(direction[:, 0], direction[:, 1])
    flat = direction[:, :2] / level[:, None]
    along, aside = flat @ [20.0, 1.0], flat[:, 1] * 20.0 - flat[:, 0] * 1.0

    def entry(radius):
        return (along - np.sqrt(np.maximum(radius**2 - aside**2, 0.0))) / level

    inner = np.cos(np.pi / sides)
    met = ideal.distance_m > 0
    assert np.all(met[np.abs(aside) < inner - 1e-4])
    assert not np.any(met[np.abs(aside) > 1.0 + 1e-4])
    core = np.abs(aside) < 0.95 * inner
    assert np.all(ideal.distance_m[core] >= entry(1.0)[core] - 1e-9)
    assert np.all(ideal.distance_m[core] <= entry(inner)[core] + 1e-9)
    # The facet's normal is at most half a facet's angle from the cylinder's, seen in the plane.
    angle = np.rad2deg(np.arcsin(np.abs(aside[core])))
    seen = np.rad2deg(np.arccos(np.minimum(np.cos(np.deg2rad(ideal.incidence_deg[core])) / level[core], 1.0)))
    assert np.abs(seen - angle).max() <= 360.0 / sides


@pytest.mark.parametrize("suffix", [".stl", ".obj", ".ply", ".glb"])
def test_a_sphere_from_a_mesh_file(tmp_path, suffix):
    trimesh = pytest.importorskip("trimesh")
    sphere = trimesh.creation.icosphere(subdivisions=5, radius=2000.0)
    file = tmp_path / f"ball{suffix}"
    sphere.export(file)
    ball = placed(load_mesh(file, 9, scale=1e-3), (15.0, 0.0, 0.0))
    ideal = scene_of(ball).ideal(**SOME)
    direction = beam_directions(ideal.layer, ideal.point)
    along = direction[:, 0] * 15.0
    aside = np.sqrt(np.maximum(15.0**2 - along**2, 0.0))
    assert not np.any(ideal.distance_m[aside > 2.0 + 1e-6])
    inside = aside < 1.9
    expected = along - np.sqrt(4.0 - np.minimum(aside, 2.0) ** 2)
    assert np.abs(ideal.distance_m - expected)[inside].max() < 0.01
    incidence = np.rad2deg(np.arcsin(np.minimum(aside / 2.0, 1.0)))
    assert np.abs(ideal.incidence_deg - incidence)[inside].max() < 2.5


def test_an_ellipsoid_has_its_diameters():
    corners = ellipsoid((2.0, 4.0, 6.0), 1, sides=16).triangles_m.reshape(-1, 3)
    assert np.allclose(np.abs(corners / [1.0, 2.0, 3.0]) @ [0, 0, 1], np.abs(corners[:, 2]) / 3.0)
    assert np.allclose(np.linalg.norm(corners / [1.0, 2.0, 3.0], axis=1), 1.0)
    assert np.allclose(corners.max(axis=0), [1.0, 2.0, 3.0])


def first_by_search(triangles, origin, direction):
    """Moeller and Trumbore's test of every ray against every triangle, the nearest taken."""
    a, b, c = (triangles[:, i] for i in range(3))
    e1, e2 = b - a, c - a
    p = np.cross(direction[:, None], e2[None])
    determinant = np.einsum("rtj,tj->rt", p, e1)
    s = origin[:, None] - a[None]
    u = np.einsum("rtj,rtj->rt", s, p) / determinant
    q = np.cross(s, e1[None])
    v = np.einsum("rj,rtj->rt", direction, q) / determinant
    t = np.einsum("tj,rtj->rt", e2, q) / determinant
    edge = np.min(np.stack([u, v, 1.0 - u - v]), axis=0)
    distance = np.where((edge >= 0.0) & (t > 0.0), t, np.inf)
    near_edge = np.any((np.abs(edge) < 1e-4) & (t > 0.0), axis=1)
    return distance.argmin(axis=1), distance.min(axis=1), near_edge


def test_random_triangles_are_met_as_by_a_search_over_all():
    random = np.random.default_rng(7)
    triangles = random.uniform(-20.0, 20.0, (250, 1, 3)) + random.normal(size=(250, 3, 3)) * 2.0
    material = np.arange(250, dtype=np.int32)
    scene = Scene((SceneObject(triangles[:100], material[:100], 4), SceneObject(triangles[100:], material[100:], 9)))
    origin, direction = random.uniform(-5.0, 5.0, (3000, 3)), random_directions(3000)
    hits = scene.cast(Rays(origin, direction, np.zeros(3000), np.zeros(3000, dtype=np.int32)))
    face, distance, near_edge = first_by_search(triangles, origin, direction)
    sure = ~near_edge
    assert sure.sum() > 2500
    met = np.isfinite(distance) & sure
    assert met.sum() > 500
    assert np.array_equal((hits.distance_m > 0)[sure], np.isfinite(distance)[sure])
    assert np.allclose(hits.distance_m[met], distance[met], rtol=1e-9)
    assert np.array_equal(hits.material_id[met], face[met])
    assert np.array_equal(hits.object_id[met], np.where(face < 100, 4, 9)[met])
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])[face]
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    cosine = np.einsum("ij,ij->i", normal, direction)
    assert np.allclose(hits.incidence_deg[met], np.rad2deg(np.arccos(np.abs(cosine)))[met], atol=1e-6)
    assert np.allclose(hits.normal[met], (normal * -np.sign(cosine)[:, None])[met], atol=1e-9)
    miss = ~np.isfinite(distance) & sure
    assert not hits.normal[miss].any()
    assert not hits.incidence_deg[miss].any()


def test_both_sides_of_a_face_are_met_up_to_the_range_asked_for():
    scene = scene_of(placed(wall(10.0, 10.0, 1), (5.0, 0.0, 0.0)))
    for origin, direction in (((0, 0, 0), (1, 0, 0)), ((10, 0, 0), (-1, 0, 0))):
        hits = scene.cast(rays_of(origin, [direction]))
        assert hits.distance_m[0] == pytest.approx(5.0)
        assert np.allclose(hits.normal[0], -np.asarray(direction))
    assert scene.cast(rays_of((0, 0, 0), [(1, 0, 0)]), max_range_m=5.0).distance_m[0] == 5.0
    assert scene.cast(rays_of((0, 0, 0), [(1, 0, 0)]), max_range_m=4.999).distance_m[0] == 0.0


def test_an_object_moves_with_the_time_of_the_ray():
    moving = thing(placed(wall(4.0, 4.0, 2), (20.0, 0.0, 0.0)), 5, (10.0, 4.0, 0.0))
    scene = Scene((moving, thing(placed(wall(100.0, 100.0, 3), (50.0, 0.0, 0.0)), 6)))
    assert scene.velocities_m_s == {5: (10.0, 4.0, 0.0)}
    times = np.array([0.0, 0.1, 0.4, 0.6])
    rays = rays_of((0, 0, 0), np.tile([1.0, 0.0, 0.0], (4, 1)), times)
    # Its right border stands at y = -2 + 4 t, so that after half a second it has left the ray.
    hits = scene.cast(rays, moving=scene.velocities_m_s)
    assert np.allclose(hits.distance_m, [20.0, 21.0, 24.0, 50.0], rtol=1e-12)
    assert hits.object_id.tolist() == [5, 5, 5, 6]
    assert hits.material_id.tolist() == [2, 2, 2, 3]
    assert np.allclose(scene.cast(rays).distance_m, 20.0)
    assert np.allclose(scene.cast(rays, moving={6: (-10.0, 0.0, 0.0)}).distance_m, 20.0)
    assert np.allclose(scene.cast(rays, moving={99: (-10.0, 0.0, 0.0)}).distance_m, 20.0)


def test_several_movers_are_where_a_scene_of_that_moment_has_them():
    random = np.random.default_rng(3)
    parts = [random.uniform(-10, 10, (40, 1, 3)) + random.normal(size=(40, 3, 3)) * 2.0 for _ in range(4)]
    velocities = [(0.0, 0.0, 0.0), (5.0, 1.0, -2.0), (-8.0, 0.0, 0.0), (5.0, 1.0, -2.0)]

    def made(time_s):
        return Scene(
            tuple(
                SceneObject(part + time_s * np.asarray(v), np.full(40, i), i, v)
                for i, (part, v) in enumerate(zip(parts, velocities, strict=True))
            )
        )

    scene, direction = made(0.0), random_directions(2000)
    hits = scene.cast(rays_of((0, 0, 0), direction, np.full(2000, 0.7)), moving=scene.velocities_m_s)
    then = made(0.7).cast(rays_of((0, 0, 0), direction))
    same = hits.object_id == then.object_id
    assert same.mean() > 0.999
    assert len(set(hits.object_id)) == 4
    assert np.allclose(hits.distance_m[same], then.distance_m[same], rtol=1e-9)
    assert np.allclose(hits.incidence_deg[same], then.incidence_deg[same], atol=1e-5)


def test_a_swept_scan_sees_the_scene_from_the_moving_sensor():
    scene = scene_of(placed(wall(500.0, 50.0, 1), (30.0, 0.0, 0.0)))
    ideal = scene.ideal(layers=(259, 260), swept=True, velocity_m_s=(20.0, 3.0, 0.0), yaw_deg_s=90.0)
    time_s = ideal.point * 0.03 / 959
    assert np.allclose(ideal.time_s, time_s, rtol=1e-12)
    azimuth = np.deg2rad(azimuth_deg(ideal.point) + 90.0 * time_s)
    elevation = np.deg2rad(elevation_deg(ideal.layer))
    forward = np.cos(azimuth) * np.cos(elevation)
    assert np.allclose(ideal.distance_m, (30.0 - 20.0 * time_s) / forward, rtol=1e-9)
    assert np.allclose(ideal.rays.origin_m, time_s[:, None] * [20.0, 3.0, 0.0])
    assert np.allclose(ideal.rays.direction[:, 1], np.sin(azimuth) * np.cos(elevation))


def test_a_swept_scan_moves_the_objects():
    scene = Scene((thing(placed(wall(500.0, 50.0, 1), (30.0, 0.0, 0.0)), 1, (-40.0, 0.0, 0.0)),))
    swept, still = scene.ideal(**SMALL, swept=True), scene.ideal(**SMALL)
    forward = beam_directions(still.layer, still.point)[:, 0]
    assert np.allclose(still.distance_m, 30.0 / forward)
    assert np.allclose(swept.distance_m, (30.0 - 40.0 * swept.time_s) / forward)
    assert still.time_s is None
    assert still.rays is None


def test_a_level_mirror_shows_the_image_below_it():
    ground, panel = placed(floor(80.0, 80.0, 6), (0.0, 0.0, -1.8)), placed(wall(60.0, 6.0, 2), (30.0, 0.0, 1.2))
    ideal = scene_of(ground, panel, optics={6: Optics(mirror=0.5)}).ideal(layers=(120, 200), points=(400, 560))
    rows = np.flatnonzero(ideal.share < 1.0)
    assert set(ideal.share[rows]) == {0.25}
    assert set(ideal.share) == {1.0, 0.25}
    forward, _, up = beam_directions(ideal.layer, ideal.point).T
    # A beam that sinks to the ground before x = 30 sees the panel's image, which hangs below the ground.
    reaches = (1.8 / -up * forward < 30.0) & (-up * 30.0 / forward < 1.8 + 6.0)
    assert len(rows) == np.sum(reaches & (ideal.share == 1.0))
    assert np.allclose(ideal.distance_m[rows], 30.0 / forward[rows], rtol=1e-9)
    assert set(ideal.material_id[rows]) == {2}
    assert set(ideal.object_id[rows]) == {2}
    assert np.allclose(ideal.incidence_deg[rows], np.rad2deg(np.arccos(forward[rows])), atol=1e-6)
    surface = rows - 1
    assert np.array_equal(ideal.layer[surface], ideal.layer[rows])
    assert np.array_equal(ideal.point[surface], ideal.point[rows])
    assert np.allclose(ideal.distance_m[surface], 1.8 / -up[rows], rtol=1e-9)
    assert set(ideal.material_id[surface]) == {6}


def test_a_slanted_mirror_shows_the_image_point():
    mirror = placed(wall(6.0, 6.0, 1), (10.0, 0.0, 0.0), yaw_deg=45.0)
    target = placed(wall(3.0, 3.0, 2), (10.0, -8.0, 0.0), yaw_deg=90.0)
    other_side = placed(wall(3.0, 3.0, 3), (10.0, 8.0, 0.0), yaw_deg=90.0)
    ideal = scene_of(mirror, target, other_side, optics={1: Optics(mirror=1.0)}).ideal(**SMALL)
    behind = ideal.distance_m > 12.0
    # The mirror's plane x + y = 10 maps (x, y) to (10 - y, 10 - x): the wall y = -8 appears at x = 18.
    assert behind.sum() == 200
    forward = beam_directions(ideal.layer, ideal.point)[:, 0]
    assert np.allclose(ideal.distance_m[behind], 18.0 / forward[behind], rtol=1e-9)
    assert set(ideal.material_id[behind]) == {2}
    assert set(ideal.share) == {1.0}


def test_a_pane_shows_what_stands_behind_and_what_it_reflects():
    pane, target = placed(wall(40.0, 40.0, 1), (10.0, 0.0, 0.0)), placed(wall(90.0, 90.0, 2), (20.0, 0.0, 0.0))
    behind_the_sensor = placed(wall(90.0, 90.0, 3), (-5.0, 0.0, 0.0))
    glass = {1: Optics(mirror=0.1, transmission=0.8)}
    ideal = scene_of(pane, target, behind_the_sensor, optics=glass).ideal(**SMALL)
    forward = beam_directions(ideal.layer, ideal.point)[:, 0]
    for material, x, share in ((1, 10.0, 1.0), (2, 20.0, 0.64), (3, 25.0, 0.01)):
        rows = ideal.material_id == material
        assert rows.sum() >= 200
        assert np.allclose(ideal.distance_m[rows], x / forward[rows], rtol=1e-9)
        assert np.allclose(ideal.share[rows], share)
    key = ideal.layer.astype(float) * 1e6 + ideal.point * 1e3 + ideal.distance_m
    assert np.all(np.diff(key) >= 0.0)


def test_two_panes_take_light_twice_and_without_optics_shares_are_equal():
    panes = [placed(wall(40.0, 40.0, 1), (x, 0.0, 0.0)) for x in (10.0, 11.0)]
    target = placed(wall(90.0, 90.0, 2), (20.0, 0.0, 0.0))
    scene = scene_of(*panes, target, optics={1: Optics(transmission=0.9)})
    ideal = scene.ideal(**SMALL)
    assert np.allclose(ideal.share.reshape(-1, 3), [1.0, 0.9**2, 0.9**4])
    assert scene.ideal(**SMALL, second_hits=False).share is None
    assert len(scene.ideal(**SMALL, second_hits=False)) == 200
    assert scene_of(target, optics={1: Optics(transmission=0.9)}).ideal(**SMALL).share is None


def test_second_hits_keep_to_the_range():
    pane, target = placed(wall(40.0, 40.0, 1), (10.0, 0.0, 0.0)), placed(wall(90.0, 90.0, 2), (20.0, 0.0, 0.0))
    scene = scene_of(pane, target, optics={1: Optics(transmission=0.8)})
    assert len(scene.ideal(**SMALL, max_range_m=19.0)) == 200
    assert len(scene.ideal(**SMALL, max_range_m=21.0)) == 400


def test_facing_mirrors_come_to_an_end():
    mirrors = [placed(wall(9.0, 9.0, 1), (x, 0.0, 0.0)) for x in (5.0, -5.0)]
    ideal = scene_of(*mirrors, optics={1: Optics(mirror=1.0)}).ideal(**SMALL)
    per_beam = np.bincount((ideal.layer - 255) * 20 + ideal.point - 470)
    assert per_beam.max() == 5
    assert np.allclose(np.sort(ideal.distance_m)[:200], 5.0, rtol=1e-2)


def test_sub_beams_divide_a_beam_at_an_edge():
    edge_deg = 0.05
    left = 20.0 * np.tan(np.deg2rad(edge_deg))
    panel = placed(wall(10.0, 10.0, 1), (20.0, left + 5.0, 0.0))
    ideal = scene_of(panel).ideal(layers=(259, 259), points=(478, 482), sub_beams=8)
    met = np.bincount(ideal.point[ideal.distance_m > 0.0] - 478, minlength=5)
    # The cell of point 480 reaches from 0 to 0.125 deg; 5 of its 8 columns have their middles left of the edge.
    assert met.tolist() == [0, 0, 40, 64, 64]
    assert ideal.share is None
    assert np.allclose(ideal.shares(), 1 / 64)
    for point in range(478, 483):
        rows = ideal.point == point
        assert sorted(ideal.rays.slot[rows]) == list(range(64))
        azimuth = np.rad2deg(np.arctan2(ideal.rays.direction[rows, 1], ideal.rays.direction[rows, 0]))
        assert azimuth.mean() == pytest.approx(azimuth_deg(point), abs=1e-9)
        assert np.ptp(azimuth) == pytest.approx(0.125 * 7 / 8, abs=1e-9)
        elevation = np.rad2deg(np.arcsin(ideal.rays.direction[rows, 2]))
        assert np.ptp(elevation) == pytest.approx(0.05 * 7 / 8, abs=1e-9)
        assert np.all(np.diff(ideal.distance_m[rows]) >= 0.0)
    assert np.all(np.diff(ideal.point) >= 0)
    hit = ideal.distance_m > 0.0
    assert np.allclose(ideal.distance_m[hit], 20.0 / ideal.rays.direction[hit, 0])


def test_sub_beams_of_a_pane_have_their_part_of_the_shares():
    pane, target = placed(wall(40.0, 40.0, 1), (10.0, 0.0, 0.0)), placed(wall(90.0, 90.0, 2), (20.0, 0.0, 0.0))
    ideal = scene_of(pane, target, optics={1: Optics(transmission=0.8)}).ideal(**SMALL, sub_beams=2)
    assert len(ideal) == 200 * 8
    assert np.allclose(ideal.share[ideal.material_id == 1], 0.25)
    assert np.allclose(ideal.share[ideal.material_id == 2], 0.25 * 0.64)
    assert len(ideal.rays) == len(ideal)


def test_a_frame_in_parts_is_the_whole_frame():
    ground, car = placed(floor(400.0, 400.0, 7), (0.0, 0.0, -1.8)), placed(BUILDERS["car"](PAINT), (12.0, 0.0, -1.8))
    scene = scene_of(ground, car)
    whole = scene.ideal(layers=(0, 299))
    part = scene.ideal(layers=(100, 110), points=(400, 600))
    rows = (whole.layer >= 100) & (whole.layer <= 110) & (whole.point >= 400) & (whole.point <= 600)
    for name in ("layer", "point", "distance_m", "material_id", "object_id", "incidence_deg"):
        assert np.array_equal(getattr(whole, name)[rows], getattr(part, name))


def test_a_scene_is_pickled_without_what_it_built():
    scene = scene_of(placed(wall(4.0, 4.0, 2), (20.0, 0.0, 0.0)), optics={2: Optics(mirror=0.5)})
    small = len(pickle.dumps(scene))
    before = scene.ideal(**SMALL)
    assert len(pickle.dumps(scene)) == small
    again = pickle.loads(pickle.dumps(scene))
    assert np.array_equal(again.ideal(**SMALL).distance_m, before.distance_m)
    assert again.optics == scene.optics
    assert again.digest() == scene.digest()


def test_the_digest_knows_places_materials_velocities_and_optics():
    panel = placed(wall(4.0, 4.0, 2), (20.0, 0.0, 0.0))
    variants = [
        Scene((thing(panel),)),
        Scene((thing(placed(wall(4.0, 4.0, 2), (20.001, 0.0, 0.0))),)),
        Scene((thing(placed(wall(4.0, 4.0, 3), (20.0, 0.0, 0.0))),)),
        Scene((thing(panel, 2),)),
        Scene((thing(panel, 1, (1.0, 0.0, 0.0)),)),
        Scene((thing(panel),), {2: Optics(0.5)}),
        Scene((thing(panel),), {2: Optics(0.0, 0.5)}),
    ]
    assert len({scene.digest() for scene in variants}) == len(variants)
    named = Scene((SceneObject(panel.triangles_m, panel.material_id, 1, name="wall"),))
    assert named.digest() == variants[0].digest()


def test_no_rays_meet_nothing():
    hits = scene_of(wall(1.0, 1.0, 1)).cast(rays_of((0, 0, 0), np.empty((0, 3))))
    assert len(hits.distance_m) == 0
    assert hits.normal.shape == (0, 3)


PAINT = Paint(body=1, glass=2, plate=3, lamp=4, tyre=5, interior=6, marking=7)


@pytest.mark.parametrize(("name", "size"), [("car", CAR_M), ("van", VAN_M), ("truck", TRUCK_M)])
def test_a_vehicle_has_its_size_and_its_parts(name, size):
    vehicle = BUILDERS[name](PAINT)
    corners = vehicle.triangles_m.reshape(-1, 3)
    # Plates and lamps stand a centimetre out in front and at the back.
    assert np.allclose(np.ptp(corners, axis=0), size, atol=0.021)
    assert corners[:, 2].min() == pytest.approx(0.0, abs=1e-9)
    assert set(vehicle.material_id) == ({1, 2, 3, 4, 5, 6} | ({7} if name == "truck" else set()))
    rear, front = (scene_of(placed(vehicle, (15.0, 0.0, -1.2), yaw_deg=yaw)).ideal(**SOME) for yaw in (0.0, 180.0))
    assert {1, 3, 4, 5} <= set(rear.material_id[rear.distance_m > 0])
    assert {1, 2, 3, 4, 5} <= set(front.material_id[front.distance_m > 0])


def test_a_car_can_be_looked_through():
    car = placed(BUILDERS["car"](PAINT), (12.0, 0.0, -1.5))
    ideal = scene_of(car, optics={2: Optics(transmission=0.9)}).ideal(**SOME)
    assert 6 in ideal.material_id[ideal.distance_m > 0]
    twice = np.isclose(ideal.share, 0.9**4)
    assert twice.any()


def test_people_and_trees_stand_on_the_ground():
    for facets, height in ((person(1, 2), 1.75), (tree(8.0, 4.0, 1, 2), 8.0)):
        z = facets.triangles_m[..., 2]
        assert z.min() == pytest.approx(0.0, abs=1e-9)
        assert z.max() == pytest.approx(height, rel=0.01)
        assert set(facets.material_id) == {1, 2}


def test_slivers_are_no_surface_and_alone_no_object():
    sliver = Facets(np.array([[[1.0, 0, 0], [2.0, 0, 0], [3.0, 0, 0]]]), np.zeros(1, dtype=np.int32))
    assert len(thing(joined(sliver, wall(1.0, 1.0, 1))).triangles_m) == 2
    with pytest.raises(UsageError, match="no triangle with an area"):
        thing(sliver)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Scene(()), "no objects"),
        (lambda: Scene((thing(wall(1, 1, 1), 3), thing(wall(1, 1, 1), 3, (1.0, 0, 0)))), "two velocities"),
        (lambda: thing(wall(np.nan, 1, 1)), "not finite"),
        (lambda: thing(wall(1, 1, 1), 1, (np.inf, 0.0, 0.0)), "not finite"),
        (lambda: thing(wall(1, 1, -4)), "material -4"),
        (lambda: SceneObject(np.zeros((2, 3)), np.zeros(2), 1), "shape"),
        (lambda: Optics(mirror=1.5), "out of range"),
        (lambda: Optics(transmission=float("nan")), "out of range"),
        (lambda: Optics(0.6, 0.6), "more than the light"),
        (lambda: scene_of(wall(1, 1, 1)).ideal(layers=(0, 520)), "layers"),
        (lambda: scene_of(wall(1, 1, 1)).ideal(points=(5, 4)), "points"),
        (lambda: scene_of(wall(1, 1, 1)).ideal(sub_beams=0), "sub_beams"),
        (lambda: scene_of(wall(1, 1, 1)).ideal(max_range_m=0.0), "max_range_m"),
        (lambda: scene_of(wall(1, 1, 1)).ideal(swept=True, yaw_deg_s=np.nan), "not finite"),
    ],
)
def test_what_cannot_be_is_refused(make, says):
    with pytest.raises(UsageError, match=says):
        make()


def both_ways(scene, origin):
    return scene.cast(rays_of(origin, [(1, 0, 0), (-1, 0, 0)]))


@pytest.mark.parametrize("x", [0.0, 5e-7, -5e-7])
def test_a_surface_that_a_ray_begins_on_is_passed_over(x):
    """A face of a box through the sensor: ahead lies the box's other face, behind it another wall."""
    scene = scene_of(box((x, -1.0, -1.0), (2.0, 1.0, 1.0), 7), placed(wall(9.0, 9.0, 8), (-3.0, 0.0, 0.0)))
    hits = both_ways(scene, (0.0, 0.0, 0.0))
    assert hits.distance_m == pytest.approx([2.0, 3.0], rel=1e-9)
    assert hits.material_id.tolist() == [7, 8]
    assert hits.object_id.tolist() == [1, 2]
    # Two micrometres ahead it is a surface like any other.
    assert both_ways(scene, (x - 2e-6, 0.0, 0.0)).distance_m[0] == pytest.approx(2e-6, rel=1e-6)


def test_a_ray_from_the_only_surface_meets_nothing():
    hits = both_ways(scene_of(wall(4.0, 4.0, 7)), (0.0, 0.0, 0.0))
    assert not hits.distance_m.any()
    assert not hits.material_id.any()
    assert not hits.object_id.any()
    assert not hits.incidence_deg.any()
    assert not hits.normal.any()


def test_every_beam_of_a_sensor_in_a_face_sees_past_it():
    scene = scene_of(box((0.0, -50.0, -50.0), (2.0, 50.0, 50.0), 7))
    ideal = scene.ideal(**SOME)
    assert np.allclose(ideal.distance_m, 2.0 / beam_directions(ideal.layer, ideal.point)[:, 0], rtol=1e-9)
    assert set(ideal.material_id) == {7}


def test_grazing_rays_leave_the_surface_that_they_begin_on():
    """At 0.001 degrees to a floor through the origin, of which embree's precision cannot tell the sides."""
    angle = np.deg2rad(np.array([1e-3, -1e-3, 0.1, -0.1]))
    direction = np.stack([np.cos(angle), np.zeros(4), np.sin(angle)], axis=1)
    scene = scene_of(floor(200.0, 200.0, 7), placed(wall(9.0, 9.0, 8), (20.0, 0.0, 0.0)))
    hits = scene.cast(rays_of((0.0, 0.0, 0.0), direction))
    assert np.allclose(hits.distance_m, 20.0 / direction[:, 0], rtol=1e-9)
    assert set(hits.material_id) == {8}


OBJ = b"v 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 2 3\n"
STL = b"solid ball\n" + b"".join(
    b"facet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 0 2 0\nvertex 0 0 3\nendloop\nendfacet\n" for _ in range(4)
) + b"endsolid ball\n"  # fmt: skip
PLY = (
    b"ply\nformat ascii 1.0\ncomment B\xe4r\ncomment TextureFile gone.png\nelement vertex 3\nproperty float x\n"
    b"property float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    b"1 0 0\n0 2 0\n0 0 3\n3 0 1 2\n"
)


def binary_stl(announced, faces, header=b"ball"):
    corners = np.diag([1, 2, 3]).astype("<f4").tobytes()
    face = b"\0" * 12 + corners + b"\0\0"
    return header.ljust(80) + np.uint32(announced).astype("<u4").tobytes() + face * faces


READABLE_MESHES = {
    "latin-1 comment.obj": b"# B\xe4r\n" + OBJ,
    "latin-1 group.obj": OBJ.replace(b"f", b"g B\xe4r\nf"),
    "byte order mark.obj": b"\xef\xbb\xbf" + OBJ,
    "mark and comment.obj": b"\xef\xbb\xbf# B\xc3\xa4r\n" + OBJ,
    "tabs.obj": OBJ.replace(b" ", b"\t"),
    "indented.obj": b"  " + OBJ.replace(b"\n", b" \n\t"),
    "remark.obj": OBJ.replace(b"0\n", b"0 # a corner 7\n").replace(b"3\n", b"3 # f 1 1 1\n"),
    "windows.obj": OBJ.replace(b"\n", b"\r\n"),
    "old mac.obj": OBJ.replace(b"\n", b"\r"),
    "continued.obj": OBJ.replace(b"f 1 ", b"f 1 \\\n "),
    "no library.obj": b"mtllib gone.mtl\nusemtl B\xe4r\n" + OBJ,
    "latin-1 name.stl": STL.replace(b"ball", b"B\xe4r"),
    "name of words.stl": STL.replace(b"ball", b"facet vertex normal"),
    "capitals.stl": STL.upper(),
    "windows.stl": STL.replace(b"\n", b"\r\n"),
    "mark.stl": b"\xef\xbb\xbf" + STL,
    "binary.stl": binary_stl(4, 4),
    "solid binary.stl": binary_stl(4, 4, b"solid B\xe4r"),
    "latin-1.ply": PLY,
    "mark.ply": b"\xef\xbb\xbf" + PLY,
}


@pytest.mark.parametrize(("name", "content"), READABLE_MESHES.items(), ids=READABLE_MESHES)
def test_a_mesh_with_odd_text_is_read(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    triangles = load_mesh(tmp_path / name, 1).triangles_m
    assert len(triangles) == (4 if name.endswith(".stl") else 1)
    assert np.allclose(triangles, np.diag([1, 2, 3]))


BROKEN_MESHES = {
    "empty.stl": b"",
    "noise.stl": b"\x00\x01\x02" * 50,
    "text.ply": b"ply\nformat ascii 1.0\nelement vertex x\nend_header\n",
    "short.glb": b"glTF\x02\x00\x00\x00\xff\xff\x00\x00",
    "points.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\n",
    "nan.obj": b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "far.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 30\n",
    "letters.obj": b"v a b c\nf 1 2 3\n",
    "wall.step": b"ISO-10303-21;",
    "latin-1.stl": b"B\xe4r",
    "cut.stl": binary_stl(4, 4)[:-20],
    "count.stl": binary_stl(3, 4),
    "huge count.stl": binary_stl(2**32 - 1, 4),
    "cut solid.stl": binary_stl(4, 4, b"solid ball")[:-20],
    "cut text.stl": STL[:-60],
    "no end.stl": STL[:-14],
    "letters.stl": STL.replace(b"vertex 1", b"vertex x"),
    "stl.obj": binary_stl(4, 4),
    "stl text.obj": STL,
    "obj.stl": OBJ,
    "obj.ply": OBJ,
    "half letters.obj": OBJ.replace(b"0 2 0", b"0 2 x"),
    "nothing.obj": b"# B\xe4r\n",
    "cut.ply": PLY[:-8],
    "cut header.ply": PLY[:60],
    "latin-1 data.ply": PLY.replace(b"1 0 0", b"\xe4 0 0"),
}


@pytest.mark.parametrize(("name", "content"), BROKEN_MESHES.items(), ids=BROKEN_MESHES)
def test_a_broken_mesh_is_named(tmp_path, name, content):
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(InputError) as caught:
        load_mesh(file, 1)
    assert caught.value.file == str(file)
    assert caught.value.fix
    assert len(str(caught.value).splitlines()) == 1


def test_whatever_the_reader_raises_names_the_mesh(tmp_path, monkeypatch):
    trimesh = pytest.importorskip("trimesh")

    def fails(*_, **__):
        raise ModuleNotFoundError("No module named 'charset_normalizer'")

    monkeypatch.setattr(trimesh, "load_mesh", fails)
    (tmp_path / "a.glb").write_bytes(b"glTF")
    with pytest.raises(InputError, match=r"a\.glb: not a readable GLB mesh: No module named"):
        load_mesh(tmp_path / "a.glb", 1)


def test_a_mesh_says_what_is_wrong_with_its_size(tmp_path):
    (tmp_path / "a.stl").write_bytes(binary_stl(3, 4))
    with pytest.raises(InputError, match="its header says 3 triangles, there is room for 4; was it written completely"):
        load_mesh(tmp_path / "a.stl", 1)


def test_a_missing_mesh_and_the_upward_axis(tmp_path):
    with pytest.raises(InputError, match="no such mesh"):
        load_mesh(tmp_path / "gone.stl", 1)
    file = tmp_path / "one.obj"
    file.write_text("v 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 2 3\n")
    assert np.allclose(load_mesh(file, 1).triangles_m[0], np.diag([1, 2, 3]))
    # With Y up the file's Z looks ahead and its X to the left.
    assert np.allclose(load_mesh(file, 1, up="y").triangles_m[0], [[0, 1, 0], [0, 0, 2], [3, 0, 0]])
