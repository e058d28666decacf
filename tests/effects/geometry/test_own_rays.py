"""Sub-beams, panes, swept scans and movers, where effects meet."""

from dataclasses import replace

import numpy as np
import pytest

from analytic_scene import GROUND, WALL_AHEAD, Patch, PatchScene, around
from effect_kit import sweep_time_s
from lidarcheck import effects
from lidarcheck.effects.geometry.beam_grid import _stride, nearest_marked
from lidarcheck.effects.geometry.own_rays import rays_of, second_rows, shares_that_end
from lidarcheck.effects.geometry.surfaces import LocalSurfaces
from lidarcheck.harness.kpis.fired import FiredBeams
from lidarcheck.harness.kpis.selection import KpiSelection, SelectedEchoes
from lidarcheck.kpi.pairing import pair_with_ideal
from lidarcheck.model import Model, light_of, simulate
from lidarcheck.model.stages import aimed
from lidarcheck.rays import Rays
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Material, Sensor

LAYERS, POINTS = np.arange(240, 281), np.arange(400, 560)
MATERIALS = {i: Material(f"m{i}", 0.3) for i in range(10)}


def test_an_echo_of_a_beam_that_meets_nothing_is_no_ghost_of_another_beam_s_surface():
    ideal = IdealScan([100, 100], [10, 400], [0.0, 25.0], [1, 1], [0.0, 0.0])
    scan = Scan.from_beams(np.array([100]), np.array([10]), np.array([50.2]))
    fired = FiredBeams.of(ideal)
    seen = KpiSelection(fired, np.ones(2, bool), 0.5).seen(SelectedEchoes.of(scan, pair_with_ideal(ideal, scan)))
    assert seen.stray.tolist() == [0]
    assert seen.ghosts.tolist() == []
    assert fired.off_surfaces_around_m(np.array([0]), np.array([25.0])).tolist() == [np.inf]


@pytest.mark.parametrize("name", ["boresight", "vibration", "motion", "beam_divergence"])
def test_the_order_of_sub_beams_does_not_matter_to_effects_that_aim(name):
    rng = np.random.default_rng(2)
    n = 400
    table = IdealScan(
        rng.integers(250, 270, n), rng.integers(470, 490, n), rng.choice([0.0, 10.0, 25.0, 40.0], n),
        rng.integers(1, 4, n), rng.uniform(0, 80, n), object_id=rng.integers(0, 4, n),
    )  # fmt: skip
    model = Model(Sensor.of("SMART"), MATERIALS, (effects.make(name, {}),))
    one, other = simulate(table, model, seed=1), simulate(table.take(rng.permutation(n)), model, seed=1)
    assert np.array_equal(one.x_m, other.x_m)
    assert np.array_equal(one.area, other.area)


def test_sub_beams_with_rays_of_their_own_get_their_own_numbers_back():
    wall, pole = Patch((20, 0, 0), (0, 500, 0), (0, 0, 500), 1, 1), Patch((10, 0, 0), (0, 0.03, 0), (0, 0, 9), 2, 2)
    first = PatchScene([wall, pole]).ideal(LAYERS, POINTS)
    # Two sub-beams, a quarter of a column to either side, listed by range as ray casters do.
    from reference_grid import beam_directions

    parts = []
    for slot, aside in enumerate((-0.25, 0.25)):
        rays = Rays(np.zeros((len(first), 3)), beam_directions(first.layer, first.point + aside),
                    np.zeros(len(first)), np.full(len(first), slot))  # fmt: skip
        parts.append((rays, PatchScene([wall, pole]).cast(rays)))
    rays = Rays(
        *(np.concatenate([getattr(r, c) for r, _ in parts]) for c in ("origin_m", "direction", "time_s", "slot"))
    )
    columns = {
        c: np.concatenate([getattr(h, c) for _, h in parts]) for c in ("distance_m", "material_id", "incidence_deg")
    }
    table = IdealScan(np.tile(first.layer, 2), np.tile(first.point, 2), **columns, rays=rays)
    table = table.take(np.lexsort((table.distance_m, table.point, table.layer)))
    hits = LocalSurfaces.of(table).cast(rays_of(table))
    assert np.array_equal(hits.distance_m, table.distance_m)


def test_light_passes_the_air_before_a_pane_once():
    table = IdealScan([1] * 4, [5] * 4, [10.0, 20.0, 30.0, 40.0], [1] * 4, [0.0] * 4, share=[1.0, 0.01, 0.64, 0.41])
    # A mirror image, and a second pane with something behind it: what ends at each adds up to the whole.
    assert shares_that_end(table) == pytest.approx([0.35, 0.01, 0.23, 0.41])
    facts = around(table, sensor=Sensor.of("SMART"))
    haze = effects.make("fog", {}).light(light_of(table, Model(facts.sensor, MATERIALS)), facts).haze
    assert haze.row_share.sum() == pytest.approx(1.0)
    # Sub-beams of a file that kept no rays: equal shares are no second rows.
    quarters = replace(table, share=[0.25, 0.25, 0.25, 0.16])
    assert shares_that_end(quarters) == pytest.approx([0.25, 0.25, 0.09, 0.16])
    assert second_rows(quarters, rays_of(quarters)).tolist() == [False, False, False, True]
    alone = table.take(np.array([0]))
    assert shares_that_end(replace(alone, share=None)).tolist() == [1.0]


def test_second_rows_need_shares_and_may_meet_nothing():
    table = IdealScan([1, 1, 1], [5, 5, 6], [0.0, 10.0, 9.0], [1] * 3, [0.0] * 3)
    assert not second_rows(table, rays_of(table)).any()
    shared = replace(table, share=[0.6, 1.0, 1.0])
    assert second_rows(shared, rays_of(shared)).tolist() == [True, False, False]


def test_strides_and_nearest_beams_are_in_degrees():
    assert _stride(np.array([0, 4, 10])) == 2
    mark = np.zeros((5, 5), dtype=bool)
    mark[0, 2] = mark[2, 1] = True  # 0.10 deg above, 0.125 deg aside
    assert nearest_marked(mark, (0.05, 0.125))[2, 2] == 2


def car_and_wall(velocity):
    return PatchScene(
        [Patch((40, 0, 0), **WALL_AHEAD), Patch((20, 0.5, 0), (0, 1, 0), (0, 0, 0.4), 2, 7)], {7: velocity}
    )


def swept(scene, part=1.0):
    still = scene.ideal(LAYERS, POINTS)
    time = part * sweep_time_s(still.point)
    hits = scene.cast(replace(rays_of(still), time_s=time), moving=scene.velocities_m_s)
    return replace(
        still, distance_m=hits.distance_m, object_id=hits.object_id, material_id=hits.material_id, time_s=time
    )


def test_a_swept_scan_that_came_from_a_file_keeps_its_objects_where_they_were():
    scene = car_and_wall((-60.0, 0.0, 0.0))
    table = swept(scene)
    out = effects.make("boresight", {"yaw_deg": 1e-9, "pitch_deg": 0.0}).aim(table, around(table, scene))
    assert out.distance_m == pytest.approx(table.distance_m, rel=1e-6)


@pytest.mark.parametrize("with_scene", [True, False])
def test_motion_brings_objects_from_their_scan_s_time_to_their_column_s(with_scene):
    scene = car_and_wall((-60.0, 0.0, 0.0))
    table, full = swept(scene, 0.5), swept(scene)
    given = {"forward_m_s": 0.0} if with_scene else {"forward_m_s": -60.0, "object_id": 7}
    out = effects.make("motion", given).aim(table, around(table, scene if with_scene else None))
    both = (out.object_id == 7) & (full.object_id == 7)
    assert both.sum() > 200
    assert out.distance_m[both] == pytest.approx(full.distance_m[both], rel=1e-6 if with_scene else 1e-4)


def test_object_zero_can_move_too():
    scene = PatchScene([Patch((40, 0, 0), **WALL_AHEAD, number=1), Patch((20, 0.5, 0), (0, 1, 0), (0, 0, 0.4), 2, 0)])
    table = scene.ideal(LAYERS, POINTS)
    out = effects.make("motion", {"forward_m_s": -60.0, "object_id": 0}).aim(table, around(table, scene))
    assert not np.array_equal(out.distance_m, table.distance_m)


def test_two_turns_turn_the_way_as_well():
    scene = PatchScene([Patch((25, 0, 0), **WALL_AHEAD)])
    table = scene.ideal([260], np.arange(960))
    known, once = around(table, scene), {"forward_m_s": 50.0, "yaw_deg_s": 300.0}
    out = table
    for _ in range(2):
        out = effects.make("motion", once).aim(out, known.after(out))
    t = sweep_time_s(table.point)
    turn = np.deg2rad(300.0 * t)
    way = np.stack([50 * t * (1 + np.cos(turn)), 50 * t * np.sin(turn), 0 * t], axis=1)
    assert out.rays.origin_m == pytest.approx(way, abs=1e-12)


def test_yaw_leads_pitch_by_its_phase_and_shakes_on_its_own():
    facts = around(PatchScene([Patch((25, 0, 0), **WALL_AHEAD)]).ideal([260], np.arange(960)))
    columns = np.arange(960)
    shake = {"pitch_deg": 0.3, "yaw_deg": 0.2, "frequency_hz": 70.0, "yaw_phase_deg": 40.0, "random_deg": 0.0}
    yaw, pitch = effects.make("vibration", shake).angles_deg(np.full(960, 260), columns, facts)
    swing = 2 * np.pi * 70.0 * columns * 0.030 / 959
    assert pitch == pytest.approx(0.3 * np.sin(swing))
    assert yaw == pytest.approx(0.2 * np.sin(swing + np.deg2rad(40.0)))
    alone = {"pitch_deg": 0.0, "yaw_deg": 0.0, "random_deg": 0.1}
    yaw, pitch = effects.make("vibration", alone).angles_deg(np.full(960, 260), columns, facts)
    assert yaw.std() == pytest.approx(0.1, rel=0.1)
    assert abs(np.corrcoef(yaw, pitch)[0, 1]) < 4 / np.sqrt(960)


def test_a_rough_mirror_tilts_about_both_axes():
    """A beam straight down the X axis onto a mirror across it: what comes back leaves by twice the tilt either way."""
    table = IdealScan(np.repeat(np.arange(250, 270), 100), np.tile(np.arange(430, 530), 20), np.full(2000, 20.0),
                      np.full(2000, 5), np.zeros(2000))  # fmt: skip
    effect, facts = effects.make("mirror_multipath", {"material_id": 5, "roughness_deg": 1.0}), around(table)
    from lidarcheck.effects.mirror_multipath import _Mirror

    normal = -rays_of(table).direction
    onward, _ = effect._onward(table, rays_of(table), _Mirror(np.arange(2000), normal), facts)
    across = np.cross(normal, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    for axis in (across, np.cross(normal, across)):
        tilt = np.rad2deg(np.arcsin((onward.direction * axis).sum(axis=1))) / 2
        assert tilt.std() == pytest.approx(1.0, rel=0.07)


@pytest.mark.parametrize("name", ["mirror_multipath", "retro_ghost"])
def test_air_that_came_before_dims_what_stands_behind(name):
    scene = PatchScene([Patch((0, 0, -1.8), **GROUND), Patch((30, 0, 0), (0, 500, 0), (0, 0, 12), 2, 2)])
    table = scene.ideal(np.arange(100, 330), np.arange(470, 490))
    facts = around(table, scene)
    plain = light_of(table, Model(facts.sensor, MATERIALS))
    other = {"mirror_multipath": {}, "retro_ghost": {"retro_only": 0, "min_signal": 0.0}}[name]
    fog, shown = effects.make("fog", {"mor_m": 100.0}), effects.make(name, other)
    before, after = shown.light(fog.light(plain, facts), facts), fog.light(shown.light(plain, facts), facts)
    assert len(after.pulse_signal) > len(plain.pulse_signal)
    assert before.pulse_signal == pytest.approx(after.pulse_signal, rel=1e-9)


def test_a_scene_that_is_given_is_asked_instead_of_the_scan_s_own_surfaces() -> None:
    layer, point = (grid.ravel() for grid in np.meshgrid(np.arange(255, 265), np.arange(470, 490), indexing="ij"))
    ideal = IdealScan(layer, point, np.full(200, 25.0), np.ones(200), np.zeros(200))
    wall = PatchScene([Patch(centre=(40.0, 0.0, 0.0), **WALL_AHEAD)])
    model = Model(Sensor.of("SMART"), MATERIALS, (effects.make("boresight", {}),))
    without, with_scene = simulate(ideal, model, seed=1), simulate(ideal, model, seed=1, scene=wall)
    assert abs(np.median(without.range_m) - 25.0) < 0.5
    seen = wall.cast(rays_of(ideal)).distance_m
    assert abs(np.median(with_scene.range_m) - np.median(seen)) < 0.5
    assert abs(np.median(seen) - 25.0) > 1.0


def test_extinctions_add_up() -> None:
    ideal = IdealScan([3], [1], [5.0], [1], [0.0])
    light = light_of(ideal, Model(Sensor.of("SMART"), MATERIALS)).attenuated(0.01).attenuated(0.02)
    assert light.extinction_per_m == pytest.approx(0.03)
    assert light.pulse_signal[0] == pytest.approx(6000.0 * 0.3 / 25.0 * np.exp(-2 * 0.03 * 5.0))


def test_in_a_scene_rows_keep_a_reflectance_of_their_own_on_their_material_and_objects_are_told():
    post = Patch((10, 0, 0), (0, 0.5, 0), (0, 0, 9), material=2, number=2)
    scene = PatchScene([Patch((20, 0, 0), **WALL_AHEAD, material=1, number=1), post])
    seen = scene.ideal(LAYERS, POINTS)
    own = replace(seen, object_id=None, extra={"Reflectance": np.full(len(seen), 0.7)})
    turned = aimed(
        own, Model(Sensor.of("SMART"), MATERIALS, (effects.make("boresight", {"yaw_deg": 1.0}),)), scene=scene
    )
    stays = turned.material_id == seen.material_id
    assert 0 < stays.sum() < len(seen)
    assert np.array_equal(np.isnan(turned.extra["Reflectance"]), ~stays)
    assert np.nanmin(turned.extra["Reflectance"]) == 0.7
    wide = aimed(own, Model(Sensor.of("SMART"), MATERIALS, (effects.make("beam_divergence", {}),)), scene=scene)
    assert len(wide) > len(own)
    both = (wide.distance_m > 0.0) & (wide.object_id > 0)
    assert np.array_equal(wide.object_id[both], wide.material_id[both])
    assert set(wide.object_id[both]) == {1, 2}
