"""A target that is cut out of scans: its form is found, its errors hold, and every beam on it has a row."""

import numpy as np
import pytest

from lidarcheck.errors import UsageError
from lidarcheck.formats.geometry.placement import rotation
from lidarcheck.ideals.snippet import Region, ideal_of_snippet
from lidarcheck.ideals.surfaces import Cylinder, Mesh, Plane, posed
from lidarcheck.model.spec import Model
from lidarcheck.scan import Scan
from lidarcheck.scenes.bvh import Bvh
from lidarcheck.scenes.facets import box
from lidarcheck.sensor import Material, shipped

NOISE_M = 0.01
XT32 = shipped("XT32")
LAYER, POINT = XT32.beams.every()
REGION = Region((8.0, 12.0, -1.5, 1.5, -1.0, 1.0))


def rays():
    return np.zeros((len(LAYER), 3)), XT32.beams.directions(LAYER, POINT)


def panel_distance(pose, width_m, height_m):
    """The way of every beam to a panel, by the panel's own plane equation; NaN for those that pass it."""
    _origin, u = rays()
    turn, place = rotation(*pose[3:]), np.array(pose[:3])
    normal = turn[:, 0]
    distance = (normal @ place) / (u @ normal)
    own = (u * distance[:, None] - place) @ turn
    on = (distance > 0.0) & (np.abs(own[:, 1]) <= width_m / 2.0) & (np.abs(own[:, 2]) <= height_m / 2.0)
    return np.where(on, distance, np.nan)


def scan_of(distance, seed, *, wall_m=14.0, lost=0.0, stray=0.0):
    """Echoes of the target with noise, a wall behind it, some lost, some of the target's from somebody before it."""
    draw = np.random.default_rng(seed)
    _, u = rays()
    wall = np.where(u[:, 0] > 0.5, wall_m / np.maximum(u[:, 0], 1e-9), np.nan)
    met = np.where(np.isfinite(distance), distance, wall)
    met = np.where(np.isfinite(distance) & (draw.random(len(met)) < stray), met - draw.uniform(0.3, 1.5, len(met)), met)
    seen = np.isfinite(met) & (draw.random(len(met)) >= lost)
    ranges = met[seen] + NOISE_M * draw.standard_normal(np.count_nonzero(seen))
    return Scan.from_beams(LAYER[seen], POINT[seen], ranges, beams=XT32.beams)


POSE = (10.0, 0.1, -0.1, 4.0, -6.0, 25.0)


def test_a_plane_is_found_among_what_does_not_lie_on_it():
    true = panel_distance(POSE, 1.6, 1.2)
    scans = [scan_of(true, seed, lost=0.1, stray=0.15) for seed in range(4)]
    found = ideal_of_snippet(scans, XT32, REGION, material=7)
    on = found.on_target
    assert found.fitted
    assert np.abs(found.ideal.distance_m - true)[on & np.isfinite(true)].max() < NOISE_M
    cosine = np.abs(rays()[1] @ rotation(*POSE[3:])[:, 0])
    expected = np.rad2deg(np.arccos(cosine))
    assert np.abs(found.ideal.incidence_deg - expected)[on].max() < 0.5
    assert set(found.ideal.material_id[on]) == {7}
    # every beam of the panel but those in the last row at its border, lost echoes or not
    assert np.count_nonzero(on & np.isfinite(true)) > 0.9 * np.count_nonzero(np.isfinite(true))
    assert not (on & ~np.isfinite(true)).any()
    assert found.fit.scatter_m == pytest.approx(NOISE_M, rel=0.25)


def test_the_standard_error_is_what_repeats_scatter_by():
    true = panel_distance(POSE, 1.6, 1.2)
    beam = np.flatnonzero(np.isfinite(true))
    inner = beam[np.argsort(np.abs(POINT[beam] - np.median(POINT[beam])))[:20]]
    z = []
    for seed in range(16):
        found = ideal_of_snippet([scan_of(true, 100 + seed)], XT32, REGION)
        z.append((found.ideal.distance_m - true)[inner] / found.ideal.extra["DistanceError"][inner])
    assert np.sqrt(np.nanmean(np.square(z))) == pytest.approx(1.0, abs=0.3)
    assert found.ideal.extra["DistanceError"][inner].max() < NOISE_M / 3.0


def test_beams_at_the_edge_are_marked_and_others_unknown():
    true = panel_distance(POSE, 1.6, 1.2)
    ideal = ideal_of_snippet([scan_of(true, 1)], XT32, REGION).ideal
    on, edge = ideal.distance_m > 0.0, ideal.extra["Edge"] == 1
    grid = np.zeros((34, XT32.beams.points + 2), dtype=bool)
    grid[LAYER[on] + 1, POINT[on] + 1] = True
    whole = grid[:-2, 1:-1] & grid[2:, 1:-1] & grid[1:-1, :-2] & grid[1:-1, 2:]
    assert np.array_equal(edge, on & ~whole[LAYER, POINT])
    assert np.isnan(ideal.distance_m[~on]).all()
    assert len(ideal) == len(LAYER)


def test_a_known_pose_moves_by_nothing_and_has_no_error():
    true = panel_distance(POSE, 1.6, 1.2)
    target = Plane(*posed(POSE), (1.6, 1.2))
    found = ideal_of_snippet([scan_of(true, 1, wall_m=14.0)], XT32, REGION, target)
    assert np.array_equal(found.on_target, np.isfinite(true))
    assert np.nanmax(np.abs(found.ideal.distance_m - true)) < 1e-9
    assert "DistanceError" not in found.ideal.extra
    assert not found.fitted


def test_a_cylinder_and_its_diameter_are_found():
    axis, radius = np.array([9.5, 0.3]), 0.4
    _origin, u = rays()
    level = np.linalg.norm(u[:, :2], axis=1)
    along = (u[:, :2] @ axis) / level
    across2 = axis @ axis - along**2
    distance = np.where(across2 < radius**2, along - np.sqrt(np.maximum(radius**2 - across2, 0.0)), np.nan) / level
    distance = np.where((along > 0.0) & (np.abs(distance * u[:, 2]) < 0.9), distance, np.nan)
    found = ideal_of_snippet([scan_of(distance, 3, stray=0.1)], XT32, REGION, form="cylinder")
    assert isinstance(found.fit.surface, Cylinder)
    assert found.fit.surface.radius_m == pytest.approx(radius, abs=0.02)
    on = found.on_target & np.isfinite(distance) & (found.ideal.extra["Edge"] == 0)
    assert np.abs(found.ideal.distance_m - distance)[on].max() < NOISE_M
    given = ideal_of_snippet([scan_of(distance, 3)], XT32, REGION, form="cylinder", radius_m=radius)
    assert given.fit.surface.radius_m == radius


def test_a_mesh_is_fitted_from_a_pose_that_is_near():
    turn, place = posed((10.0, 0.0, -0.5, 0.0, 0.0, 30.0))
    bvh = Bvh(box((-0.5, -0.5, -0.4), (0.5, 0.5, 0.4), 0).triangles_m)
    origin, u = rays()
    true = Mesh(turn, place, bvh).met(origin, u).distance_m
    near = Mesh(*posed((10.06, -0.05, -0.47, 1.0, 0.0, 27.0)), bvh)
    found = ideal_of_snippet([scan_of(true, 5), scan_of(true, 6)], XT32, REGION, near, fit=True)
    both = found.on_target & np.isfinite(true) & (found.ideal.extra["Edge"] == 0)
    assert np.count_nonzero(both) > 100
    assert np.quantile(np.abs(found.ideal.distance_m - true)[both], 0.95) < 0.015


def test_what_the_model_adds_to_ranges_is_taken_off_a_fitted_target():
    """A SPAD array sees strong echoes too near; its own simulation adds that again."""
    from lidarcheck.model.chain import simulate
    from lidarcheck.scan import IdealScan

    sensor = shipped("SLIM")
    layer, point = (a.ravel() for a in np.mgrid[250:290, 440:500])
    u = sensor.beams.directions(layer, point)
    true = 10.0 / u[:, 0]
    ideal = IdealScan(layer, point, true, np.ones(len(layer), int), np.rad2deg(np.arccos(u[:, 0])))
    model = Model(sensor, {1: Material("panel", 0.8)})
    scan = simulate(ideal, model, seed=77)
    region = Region(None, (250, 289), (440, 499))
    plain = ideal_of_snippet([scan], sensor, region).ideal
    ours = ideal_of_snippet([scan], sensor, region, model=model).ideal
    off = [np.nanmedian(one.distance_m[sensor.beams.index(layer, point)] - true) for one in (plain, ours)]
    assert abs(off[0]) > 0.05
    assert abs(off[1]) < 0.01


@pytest.mark.parametrize(
    ("region", "said"),
    [
        (Region((50.0, 51.0, 0.0, 1.0, 0.0, 1.0)), "0 echoes lie in the region"),
        (Region(None, (3, 3), (500, 509)), "needed"),
    ],
)
def test_a_region_without_enough_echoes_is_refused(region, said):
    with pytest.raises(UsageError, match=said):
        ideal_of_snippet([scan_of(panel_distance(POSE, 1.6, 1.2), 1)], XT32, region)


def test_a_target_in_a_line_is_no_plane():
    """One layer of a scan fits any plane that holds its line: nothing can be cast onto it."""
    true = panel_distance(POSE, 1.6, 1.2)
    with pytest.raises(UsageError, match="target"):
        ideal_of_snippet([scan_of(true, 1)], XT32, Region(REGION.box_m, (15, 15), None))
