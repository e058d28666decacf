"""The surfaces that an ideal scan shows: exact on planes, sane elsewhere."""

import numpy as np
import pytest

from analytic_scene import GROUND, WALL_AHEAD, Patch, PatchScene
from lidarcheck.effects.geometry.aiming import rank_in_beam, rays_of, turned
from lidarcheck.effects.geometry.surfaces import LocalSurfaces
from lidarcheck.rays import Rays
from lidarcheck.scan import IdealScan
from reference_grid import beam_directions

LAYERS, POINTS = np.arange(240, 281), np.arange(430, 500)


def tilted(normal, height):
    """A plane normal . x = height as a scene."""
    normal = np.asarray(normal, float) / np.linalg.norm(normal)
    one = np.cross(normal, [0, 0, 1.0])
    one /= np.linalg.norm(one)
    two = np.cross(normal, one)
    return PatchScene([Patch(tuple(normal * height), tuple(900 * one), tuple(900 * two))])


def shaken(ideal, degrees, seed=0, origin=0.0):
    """The scan's rays, each turned by its own random angles, and begun elsewhere."""
    rng = np.random.default_rng(seed)
    rays = rays_of(ideal)
    yaw, pitch = rng.uniform(-degrees, degrees, (2, len(ideal)))
    start = origin * rng.uniform(-1, 1, (len(ideal), 3))
    return Rays(start, turned(rays.direction, yaw, pitch), rays.time_s, rays.slot)


@pytest.mark.parametrize("objects", [True, False])
@pytest.mark.parametrize(
    ("normal", "height"), [((1, 0, 0), 20), ((1, 0.7, 0.2), 35), ((0.2, -1, 0.4), 4), ((0.03, 0, 1), 0.9)]
)
def test_planes_are_met_where_they_are(normal, height, objects):
    scene = tilted(normal, height)
    ideal = scene.ideal(LAYERS + (120 if normal[2] == 1 else 0), POINTS, objects=objects)
    assert (ideal.distance_m > 0).all()
    rays = shaken(ideal, 0.3, origin=0.3)
    hits, truth = LocalSurfaces.of(ideal).cast(rays), scene.cast(rays)
    assert hits.distance_m == pytest.approx(truth.distance_m, rel=1e-8)
    assert hits.incidence_deg == pytest.approx(truth.incidence_deg, abs=2e-5)
    assert hits.normal == pytest.approx(truth.normal, abs=1e-8)
    assert (hits.material_id == 1).all()


def test_own_rays_get_the_own_numbers_to_the_last_bit():
    rng = np.random.default_rng(4)
    n = 3000
    ideal = IdealScan(
        rng.integers(0, 40, n),
        rng.integers(0, 40, n),
        rng.choice([0.0, 3.3, 7.77, 120.1], n) + rng.uniform(0, 1e-3, n) * rng.integers(0, 2),
        rng.integers(1, 4, n),
        rng.uniform(0, 90, n),
        object_id=rng.integers(0, 3, n),
    )
    hits = LocalSurfaces.of(ideal).cast(rays_of(ideal))
    met = ideal.distance_m > 0
    assert np.array_equal(hits.distance_m, ideal.distance_m)
    for name in ("material_id", "object_id", "incidence_deg"):
        assert np.array_equal(getattr(hits, name)[met], getattr(ideal, name)[met]), name


def test_the_order_of_rows_does_not_matter():
    ideal = tilted((1, 0.3, 0.1), 25).ideal(LAYERS, POINTS)
    order = np.random.default_rng(0).permutation(len(ideal))
    rays = shaken(ideal, 0.4)
    one = LocalSurfaces.of(ideal).cast(rays)
    other = LocalSurfaces.of(ideal.take(order)).cast(rays)
    assert np.array_equal(one.distance_m, other.distance_m)


def test_sub_beams_keep_to_their_own_surfaces():
    near, far = tilted((1, 0, 0), 10).ideal(LAYERS, POINTS), tilted((1, 0.5, 0), 30).ideal(LAYERS, POINTS)
    both = IdealScan(*(np.concatenate([getattr(t, c) for t in (near, far)]) for c in COLUMNS))
    assert rank_in_beam(both).tolist() == [0] * len(near) + [1] * len(far)
    rays = shaken(both, 0.2)
    hits = LocalSurfaces.of(both).cast(rays)
    truth = [tilted(n, h).cast(rays).distance_m for n, h in (((1, 0, 0), 10), ((1, 0.5, 0), 30))]
    assert hits.distance_m == pytest.approx(np.where(rays.slot == 0, *truth), rel=1e-8)


COLUMNS = ("layer", "point", "distance_m", "material_id", "incidence_deg")


def test_scans_that_leave_out_beams_evenly_know_their_slopes_too():
    scene = tilted((1, 0.7, 0.2), 35)
    rays = shaken(scene.ideal(LAYERS, POINTS), 0.1)
    hits = LocalSurfaces.of(scene.ideal(LAYERS[::3], POINTS[::4])).cast(rays)
    assert hits.distance_m == pytest.approx(scene.cast(rays).distance_m, rel=1e-8)


def test_an_edge_lies_between_its_beams_elsewhere_in_each_layer():
    scene = PatchScene([Patch((10, -500, 0), **WALL_AHEAD, number=1), Patch((20, 0, 0), **WALL_AHEAD, number=2)])
    ideal = scene.ideal(LAYERS, np.arange(440, 520))
    assert set(ideal.object_id[ideal.point <= 479]) == {1}
    surfaces, azimuth = LocalSurfaces.of(ideal), np.linspace(-0.3, 0.3, 1001)
    borders = []
    for layer in range(242, 279):
        directions = beam_directions(np.full(1001, layer), 479.5 + azimuth / 0.125)
        rays = Rays(np.zeros((1001, 3)), directions, *np.zeros((2, 1001)))
        hits = surfaces.cast(rays)
        near = hits.object_id == 1
        borders.append(azimuth[near].max())
        assert np.array_equal(near, azimuth <= borders[-1])
        assert hits.distance_m == pytest.approx(np.where(near, 10, 20) / rays.direction[:, 0], rel=1e-9)
    assert -0.0625 <= min(borders) < -0.04
    assert 0.04 < max(borders) <= 0.0625
    assert abs(np.mean(borders)) < 3.0 * 0.125 / np.sqrt(12 * len(borders))


def test_a_view_turned_by_a_third_of_a_beam_moves_a_third_of_the_edges():
    scene = PatchScene([Patch((10, -500, 0), **WALL_AHEAD, number=1), Patch((20, 0, 0), **WALL_AHEAD, number=2)])
    ideal = scene.ideal(range(520), np.arange(478, 484))
    turned = beam_directions(ideal.layer, ideal.point + 1 / 3)
    hits = LocalSurfaces.of(ideal).cast(Rays(np.zeros((len(ideal), 3)), turned, *np.zeros((2, len(ideal)))))
    moved = (hits.object_id != ideal.object_id)[ideal.point == 479]
    assert not (hits.object_id != ideal.object_id)[ideal.point != 479].any()
    assert abs(moved.mean() - 1 / 3) < 3.0 * np.sqrt(2 / 9 / 520)


def test_a_lone_beam_faces_the_sensor():
    ideal = IdealScan([260], [480], [20.0], [3], [35.0])
    surfaces = LocalSurfaces.of(ideal)
    rays = shaken(ideal, 0.3)
    hits = surfaces.cast(rays)
    angle = np.arccos((rays.direction * rays_of(ideal).direction).sum())
    assert hits.distance_m == pytest.approx([20 / np.cos(angle)])
    assert hits.incidence_deg == pytest.approx([35 + np.rad2deg(angle)], abs=1e-6)
    assert not hits.normal.any()


def test_a_pole_before_a_wall_of_one_material_is_not_a_ramp():
    scene = PatchScene([Patch((20, 0, 0), **WALL_AHEAD), Patch((10, 0, 0), (0, 0.02, 0), (0, 0, 500))])
    ideal = scene.ideal(LAYERS, POINTS, objects=False)
    columns = ideal.point[ideal.distance_m < 11]
    assert len(set(columns)) == 2
    normal = LocalSurfaces.of(ideal).cast(rays_of(ideal)).normal
    known = normal.any(axis=1)
    assert known.mean() > 0.9
    assert normal[known][:, 0] == pytest.approx(-1.0, abs=1e-3)


def test_nothing_stays_nothing_and_far_is_cut():
    ideal = IdealScan([260, 261], [480, 480], [0.0, 80.0], [1, 1], [0.0, 0.0])
    surfaces = LocalSurfaces.of(ideal)
    assert surfaces.cast(shaken(ideal, 0.005)).distance_m[0] == 0
    assert surfaces.cast(rays_of(ideal), max_range_m=79).distance_m.tolist() == [0, 0]


def test_grazing_planes_stay_finite():
    scene = PatchScene([Patch((0, 0, -1.8), **GROUND)])
    ideal = scene.ideal(np.arange(230, 261), POINTS)
    hits = LocalSurfaces.of(ideal).cast(shaken(ideal, 2.0), max_range_m=1e9)
    assert np.isfinite(hits.distance_m).all()
    assert hits.distance_m.max() <= 2 * ideal.distance_m.max()
    assert (hits.incidence_deg >= 0).all()
    assert (hits.incidence_deg <= 90).all()


def test_a_sensor_that_has_passed_a_surface_does_not_see_it():
    ideal = tilted((1, 0, 0), 2).ideal(LAYERS, POINTS)
    rays = rays_of(ideal)
    beyond = Rays(rays.origin_m + np.array([3.0, 0, 0]), rays.direction, rays.time_s, rays.slot)
    assert not LocalSurfaces.of(ideal).cast(beyond).distance_m.any()


def test_empty_and_tiny_tables():
    none = IdealScan(*(np.empty(0) for _ in range(5)))
    assert len(LocalSurfaces.of(none).cast(rays_of(none), moving={1: (1, 0, 0)}).distance_m) == 0
    misses = IdealScan([1, 2], [3, 4], [0.0, 0.0], [0, 0], [0.0, 0.0], object_id=[1, 1])
    assert LocalSurfaces.of(misses).cast(rays_of(misses), moving={1: (1, 0, 0)}).distance_m.tolist() == [0, 0]


PLATE = Patch((20, 0.5, 0), (0, 0.6, 0), (0, 0, 0.25), 2, 7)
BACK = Patch((40, 0, 0), **WALL_AHEAD, material=1, number=1)


@pytest.mark.parametrize("velocity", [(0.0, 15.0, 0.0), (-40.0, -20.0, 3.0), (30.0, 5.0, 0.0)])
def test_an_object_moves_before_its_background(velocity):
    scene = PatchScene([BACK, PLATE])
    ideal = scene.ideal(LAYERS, np.arange(400, 560))
    rays = rays_of(ideal)
    rays = Rays(rays.origin_m, rays.direction, np.full(len(rays), 0.03), rays.slot)
    hits = LocalSurfaces.of(ideal).cast(rays, moving={7: velocity})
    truth = scene.cast(rays, moving={7: velocity})
    same = hits.object_id == truth.object_id
    edge = 2 * (len(set(ideal.layer[truth.object_id == 7])) + len(set(ideal.point[truth.object_id == 7])))
    assert (truth.object_id == 7).sum() > 300
    assert (~same).sum() <= edge
    assert hits.distance_m[same] == pytest.approx(truth.distance_m[same], rel=1e-7)
    assert hits.incidence_deg[same] == pytest.approx(truth.incidence_deg[same], abs=1e-4)


def test_an_object_that_stands_is_seen_as_before():
    ideal = PatchScene([BACK, PLATE]).ideal(LAYERS, POINTS)
    rays = rays_of(ideal)
    for time in (0.0, 0.03):
        later = Rays(rays.origin_m, rays.direction, np.full(len(rays), time), rays.slot)
        hits = LocalSurfaces.of(ideal).cast(later, moving={7: (0.0, 0.0, 0.0), 99: (5.0, 0.0, 0.0)})
        assert np.array_equal(hits.distance_m, ideal.distance_m)
        assert np.array_equal(hits.object_id, ideal.object_id)


def test_what_an_object_uncovers_is_not_the_pole_before_it():
    pole = Patch((10, -0.06, 0), (0, 0.03, 0), (0, 0, 100), 3, 3)
    ideal = PatchScene([BACK, PLATE, pole]).ideal(LAYERS, POINTS)
    rays = rays_of(ideal)
    later = Rays(rays.origin_m, rays.direction, np.full(len(rays), 0.03), rays.slot)
    hits = LocalSurfaces.of(ideal).cast(later, moving={7: (0.0, 40.0, 0.0)})
    assert np.array_equal(hits.object_id == 3, ideal.object_id == 3)
    assert ((hits.object_id == 7) != (ideal.object_id == 7)).sum() > 50
    uncovered = (ideal.object_id == 7) & (hits.object_id != 7)
    assert hits.distance_m[uncovered] == pytest.approx(40 / rays.direction[uncovered, 0], rel=1e-7)
