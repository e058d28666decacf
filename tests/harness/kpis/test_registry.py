"""The kinds of KPI, each on echoes made by hand against a closed form, and on nothing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lidarcheck.effects import make
from lidarcheck.harness.kpis.base import slope, spread_between
from lidarcheck.harness.kpis.fired import FiredBeams
from lidarcheck.harness.kpis.registry import KINDS
from lidarcheck.harness.kpis.selection import KpiSelection, SelectedEchoes
from lidarcheck.kpi.pairing import pair_with_ideal
from lidarcheck.model import simulate
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Material, Sensor
from reference_grid import beam_directions


def ideal_of(distance_m: np.ndarray, *, first: tuple[int, int] = (100, 400), incidence_deg=None) -> IdealScan:
    """One row a beam, from distances over (layer, point)."""
    layers, points = distance_m.shape
    layer, point = np.indices(distance_m.shape)
    flat = np.zeros(distance_m.size) if incidence_deg is None else np.ravel(incidence_deg)
    return IdealScan(
        layer.ravel() + first[0], point.ravel() + first[1], distance_m.ravel(), np.ones(layers * points), flat
    )


def scan_of(ideal: IdealScan, rows, range_m, *, area=50.0, peak=10.0, width_ns=7.0) -> Scan:
    """Echoes on the beams of those rows of the ideal scan."""
    rows = np.asarray(rows, dtype=np.int64)
    columns = (np.broadcast_to(np.asarray(x, dtype=float), len(rows)).copy() for x in (area, peak, width_ns))
    area, peak, width_ns = columns
    at = np.broadcast_to(np.asarray(range_m, dtype=float), len(rows))
    return Scan.from_beams(ideal.layer[rows], ideal.point[rows], at, area=area, peak=peak, width_ns=width_ns)


def value(kind: str, ideal: IdealScan, *scans: Scan, rows=None, window_m=0.5, zone_m=None, number=None) -> float:
    """The KPI of one seed whose frames are `scans`."""
    mask = np.ones(len(ideal), dtype=bool) if rows is None else np.asarray(rows)
    selection = KpiSelection(FiredBeams.of(ideal), mask, window_m, zone_m, number)
    parts = [SelectedEchoes.of(scan, pair_with_ideal(ideal, scan), frame) for frame, scan in enumerate(scans)]
    compute = KINDS[kind].value
    assert compute is not None
    return compute(selection.seen(SelectedEchoes.joined(parts), len(scans)))


WALL = ideal_of(np.full((4, 5), 20.0))
ALL = np.arange(len(WALL))


# All echoes, and those in a zone


def test_a_zone_hides_echoes_elsewhere_whether_on_a_surface_or_not():
    scan = scan_of(WALL, [0, 0, 1, 2, 3], [20.0, 8.0, 20.0, 12.0, 7.0], area=[90, 10, 90, 20, 30])
    zone = {"zone_m": (5.0, 10.0)}
    assert value("echo_share", WALL, scan) == 4 / 20
    assert value("echo_share", WALL, scan, **zone) == 2 / 20
    assert value("echoes_per_beam", WALL, scan, **zone) == 2 / 20
    assert value("false_alarm_probability", WALL, scan) == 3 / 20
    assert value("false_alarm_probability", WALL, scan, **zone) == 2 / 20
    assert value("detection_probability", WALL, scan) == 2 / 20
    assert value("detection_probability", WALL, scan, **zone) == 0.0
    assert value("echo_area_mean", WALL, scan, **zone) == 20.0
    assert math.isnan(value("area_mean", WALL, scan, **zone))
    # Both ends belong to the zone.
    assert value("echo_share", WALL, scan, zone_m=(7.0, 8.0)) == 2 / 20


def test_the_echoes_of_a_zone_have_means():
    scan = scan_of(WALL, [3, 4, 10], [6.0, 8.0, 10.0], area=[30, 40, 80], peak=[4, 5, 9], width_ns=[3, 4, 5])
    for kind, expected in (
        ("echo_area_mean", 50.0),
        ("echo_peak_mean", 6.0),
        ("echo_width_mean", 4.0),
        ("echo_range_mean", 8.0),
        ("echo_layer_mean", (100 + 100 + 102) / 3),
        ("echo_point_mean", (403 + 404 + 400) / 3),
        ("echo_layer_spread", np.std([0, 0, 2], ddof=1)),
        ("echo_point_spread", np.std([3, 4, 0], ddof=1)),
    ):
        assert value(kind, WALL, scan) == pytest.approx(expected), kind


def test_beams_with_several_echoes_are_counted_in_each_frame():
    first = scan_of(WALL, [0, 0, 0, 1, 2], [20.0, 22.0, 24.0, 20.0, 20.0])
    second = scan_of(WALL, [0, 1, 1], [20.0, 20.0, 23.0])
    assert value("multi_echo_share", WALL, first) == 1 / 20
    assert value("multi_echo_share", WALL, first, second) == 2 / 40
    # One echo in each of two frames is not two.
    assert value("multi_echo_share", WALL, second, second, zone_m=(22.0, 25.0)) == 0.0
    assert value("multi_echo_share", WALL, first, rows=WALL.point > 400) == 0.0


def test_backscatter_begins_where_a_twentieth_of_it_lies():
    near = 1.0 + 0.1 * np.arange(101)
    beams = np.resize(ALL, 101)
    scan = scan_of(WALL, np.concatenate([beams, ALL]), np.concatenate([near, np.full(20, 20.0)]))
    assert value("stray_range_onset", WALL, scan) == pytest.approx(1.5)


def test_a_halo_is_the_echoes_at_the_targets_range_beside_it():
    distance = np.zeros((9, 9))
    distance[4, 4] = 30.0
    ideal = ideal_of(distance)
    beside = ideal.distance_m == 0.0
    halo = np.flatnonzero((np.abs(ideal.layer - 104) <= 2) & (ideal.point == 404))
    scan = scan_of(ideal, halo, 30.1, area=[5, 10, 900, 10, 5])
    zone = (29.0, 31.0)
    assert value("echo_share", ideal, scan, rows=beside, zone_m=zone) == 4 / 80
    assert value("echo_area_mean", ideal, scan, rows=beside, zone_m=zone) == 7.5
    assert value("echo_layer_spread", ideal, scan, zone_m=zone) == pytest.approx(np.std([-2, -1, 0, 1, 2], ddof=1))
    assert value("echo_point_spread", ideal, scan, zone_m=zone) == 0.0


# Mixed pixels


def edge() -> IdealScan:
    """Points 400-403 meet 20 m, 404-407 30 m, 408 nothing; 10 layers."""
    distance = np.repeat([[20.0] * 4 + [30.0] * 4 + [0.0]], 10, axis=0)
    return ideal_of(distance)


def test_only_beams_beside_both_surfaces_are_at_an_edge():
    selection = KpiSelection(FiredBeams.of(edge()), np.ones(90, dtype=bool), 0.5)
    points = np.unique(edge().point[np.flatnonzero(selection.at_edge)])
    assert points.tolist() == [403, 404]
    assert np.count_nonzero(selection.at_edge) == 20
    # Where the windows of the two surfaces meet, nothing fits between them.
    assert not KpiSelection(FiredBeams.of(edge()), np.ones(90, dtype=bool), 5.0).at_edge.any()


def test_mixed_pixels_lie_between_the_surfaces_of_an_edge():
    ideal = edge()
    at = {point: np.flatnonzero(ideal.point == point) for point in range(400, 409)}
    rows = [at[403][0], at[403][1], at[403][2], at[403][3], at[404][0], at[404][1], at[401][0], at[403][4]]
    #       between     on the other  behind both  before both  between   its own     no edge     its own
    range_m = [25.0, 29.7, 33.0, 15.0, 24.0, 30.2, 25.0, 20.0]
    scan = scan_of(ideal, rows, range_m)
    assert value("mixed_pixel_share", ideal, scan) == 2 / 20
    assert value("mixed_pixel_share", ideal, scan, window_m=0.1) == 3 / 20
    trials = KINDS["mixed_pixel_share"].trials
    assert trials is not None
    seen = KpiSelection(FiredBeams.of(ideal), ideal.layer == 100, 0.5).seen(
        SelectedEchoes.of(scan, pair_with_ideal(ideal, scan)), 3
    )
    assert trials(seen) == 6


def test_sub_beams_make_an_edge_of_their_own():
    zeros = np.zeros(4)
    ideal = IdealScan(zeros, np.array([5, 5, 9, 9]), np.array([20.0, 24.0, 20.0, 20.2]), zeros, zeros)
    scan = scan_of(ideal, [0, 0, 2], [22.0, 24.0, 22.0])
    assert value("mixed_pixel_share", ideal, scan) == 1.0
    assert value("mixed_pixel_share", ideal, scan_of(ideal, [0, 2], [20.1, 22.0])) == 0.0


# Trends


def test_walk_is_a_slope_over_decades_of_area():
    area = np.logspace(1.0, 3.0, 20)
    scan = scan_of(WALL, ALL, 20.0 + 0.05 - 0.08 * np.log10(area / 100.0), area=area)
    assert value("range_residual_per_decade", WALL, scan) == pytest.approx(-0.08, abs=1e-4)
    assert value("range_residual_mean", WALL, scan) == pytest.approx(0.05, abs=1e-4)


def test_a_wrong_scale_is_a_slope_over_range():
    ideal = ideal_of(np.linspace(20.0, 200.0, 50).reshape(1, 50))
    scan = scan_of(ideal, np.arange(50), 0.03 + 1.001 * ideal.distance_m)
    assert value("range_residual_per_metre", ideal, scan) == pytest.approx(1e-3, abs=1e-6)


def test_motion_is_a_slope_over_points_and_pitch_over_layers():
    scan = scan_of(WALL, ALL, 20.0 + 0.01 * (WALL.point - 402) - 0.02 * (WALL.layer - 101))
    assert value("range_residual_per_point", WALL, scan) == pytest.approx(0.01, abs=1e-5)
    assert value("range_residual_per_layer", WALL, scan) == pytest.approx(-0.02, abs=1e-5)
    assert value("range_residual_per_point", WALL, scan, rows=WALL.layer == 101) == pytest.approx(0.01, abs=1e-5)


def noisy_wall(seed: int, *, points: float = 0.0, layers: float = 0.0, noise: float = 0.04) -> Scan:
    """A wall of 120 x 150 beams whose columns and layers are off by normal numbers of these spreads."""
    rng = np.random.default_rng(seed)
    off = rng.normal(0.0, 1.0, 150) * points + rng.normal(0.0, 1.0, (120, 1)) * layers
    off = off + rng.normal(0.0, noise, (120, 150))
    return scan_of(BIG_WALL, np.arange(len(BIG_WALL)), 20.0 + off.ravel(), area=300.0 + 1000.0 * off.ravel())


BIG_WALL = ideal_of(np.full((120, 150), 20.0))


def test_spread_between_lines_is_found_below_the_noise():
    shaken = noisy_wall(1, points=0.01, noise=0.05)
    assert value("range_residual_point_spread", BIG_WALL, shaken) == pytest.approx(0.01, rel=0.15)
    assert value("range_residual_layer_spread", BIG_WALL, shaken) < 0.002
    uneven = noisy_wall(2, layers=0.02)
    assert value("range_residual_layer_spread", BIG_WALL, uneven) == pytest.approx(0.02, rel=0.2)
    assert value("area_layer_spread", BIG_WALL, uneven) == pytest.approx(20.0, rel=0.2)
    assert value("area_point_spread", BIG_WALL, uneven) < 2.0
    assert value("area_point_spread", BIG_WALL, noisy_wall(3, points=0.01)) == pytest.approx(10.0, rel=0.2)


def test_what_shakes_anew_in_every_frame_does_not_average_out():
    frames = [noisy_wall(seed, points=0.03) for seed in range(4, 8)]
    assert value("range_residual_point_spread", BIG_WALL, *frames) == pytest.approx(0.03, rel=0.1)


def test_extinction_is_the_fall_of_the_logarithm():
    ideal = ideal_of(np.linspace(50.0, 150.0, 60).reshape(2, 30))
    area = 4e6 / ideal.distance_m**2 * np.exp(-2.0 * 0.004 * ideal.distance_m)
    scan = scan_of(ideal, np.arange(60), ideal.distance_m, area=area)
    assert value("area_loss_per_metre", ideal, scan) == pytest.approx(0.008)
    clear = scan_of(ideal, np.arange(60), ideal.distance_m, area=4e6 / ideal.distance_m**2)
    assert value("area_loss_per_metre", ideal, clear) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("exponent", [0.0, 1.0, 2.5])
def test_the_exponent_of_the_cosine(exponent):
    incidence = np.linspace(0.0, 80.0, 40).reshape(1, 40)
    ideal = ideal_of(np.linspace(20.0, 60.0, 40).reshape(1, 40), incidence_deg=incidence)
    area = 1e6 / ideal.distance_m**2 * np.cos(np.deg2rad(incidence.ravel())) ** exponent
    scan = scan_of(ideal, np.arange(40), ideal.distance_m, area=area)
    assert value("area_incidence_exponent", ideal, scan) == pytest.approx(exponent, abs=1e-9)


def test_no_logarithm_of_nothing():
    """AREA 0 and grazing incidence have no logarithm; they take no part."""
    ideal = ideal_of(np.full((1, 6), 20.0), incidence_deg=[0.0, 20.0, 40.0, 60.0, 90.0, 30.0])
    area = np.cos(np.deg2rad(ideal.incidence_deg)) ** 2 * 100.0
    area[5] = 0.0
    scan = scan_of(ideal, np.arange(6), 20.0, area=area)
    assert value("area_incidence_exponent", ideal, scan) == pytest.approx(2.0)
    assert math.isnan(value("range_residual_per_decade", ideal, scan_of(ideal, np.arange(6), 20.0, area=0.0)))
    assert math.isnan(value("area_loss_per_metre", ideal, scan_of(ideal, np.arange(6), 20.0, area=0.0)))


# Ghosts


def test_ghosts_stand_at_twice_the_range():
    target = np.flatnonzero(WALL.layer < 102)
    ghost_rows = target[:4]
    rows = np.concatenate([target, ghost_rows, [15]])
    range_m = np.concatenate([np.full(10, 20.0), [40.1, 40.2, 40.3, 40.2], [40.0]])
    area = np.concatenate([np.full(10, 800.0), np.full(4, 80.0), [10.0]])
    peak = np.concatenate([np.full(10, 100.0), np.full(4, 25.0), [1.0]])
    scan = scan_of(WALL, rows, range_m, area=area, peak=peak)
    only = {"rows": WALL.layer < 102}
    assert value("ghost_count_ratio", WALL, scan, **only) == pytest.approx(0.4)
    assert value("ghost_area_ratio", WALL, scan, **only) == pytest.approx(0.1)
    assert value("ghost_peak_ratio", WALL, scan, **only) == pytest.approx(0.25)
    assert value("ghost_range_excess", WALL, scan, **only) == pytest.approx(0.2)
    assert value("ghost_count_ratio", WALL, scan) == pytest.approx(5 / 10)
    assert value("ghost_count_ratio", WALL, scan, window_m=0.25, **only) == pytest.approx(0.3)


def test_a_whole_ghost_is_twice_as_large():
    scan = scan_of(WALL, np.tile(ALL, 2), np.repeat([20.0, 40.0], 20))
    assert value("ghost_size_ratio", WALL, scan) == pytest.approx(2.0)
    xyz = beam_directions(WALL.layer, WALL.point) * 20.0
    size = np.sqrt(np.mean(np.sum((xyz - xyz.mean(axis=0)) ** 2, axis=1)))
    assert size > 0.0
    smaller = scan_of(WALL, np.concatenate([ALL, [6, 7]]), np.repeat([20.0, 40.0], [20, 2]))
    pair = beam_directions(WALL.layer[6:8], WALL.point[6:8]) * 40.0
    expected = 0.5 * np.linalg.norm(pair[1] - pair[0]) / size
    assert value("ghost_size_ratio", WALL, smaller) == pytest.approx(expected, rel=1e-3)


def test_a_surface_at_twice_the_range_is_no_ghost():
    zeros = np.zeros(2)
    ideal = IdealScan(zeros, zeros, np.array([20.0, 40.1]), np.array([4, 1]), zeros)
    scan = scan_of(ideal, [0, 1], [20.0, 40.2])
    assert value("ghost_count_ratio", ideal, scan, rows=ideal.material_id == 4) == 0.0
    assert math.isnan(value("ghost_range_excess", ideal, scan, rows=ideal.material_id == 4))


def test_only_selected_surfaces_have_ghosts():
    zeros = np.zeros(2)
    ideal = IdealScan(zeros, zeros, np.array([20.0, 60.0]), np.array([4, 1]), zeros)
    scan = scan_of(ideal, [0, 0, 0], [20.0, 40.1, 120.0])
    assert value("ghost_count_ratio", ideal, scan, rows=ideal.material_id == 4) == 1.0
    assert value("ghost_range_excess", ideal, scan, rows=ideal.material_id == 4) == pytest.approx(0.1)
    assert value("ghost_count_ratio", ideal, scan) == 2.0


# What the readout writes


def test_directions_and_positions_are_of_the_echoes_own_places():
    scan = scan_of(WALL, ALL, 20.1)
    for kind in ("direction_bias_azimuth", "direction_bias_elevation", "direction_scatter_elevation"):
        assert value(kind, WALL, scan) == 0.0
    along = beam_directions(WALL.layer, WALL.point).mean(axis=0)
    for axis, component in zip("xyz", along, strict=True):
        assert value(f"position_bias_{axis}", WALL, scan) == pytest.approx(0.1 * component)
    # An echo far from its surface has a direction, but no surface point.
    far = scan_of(WALL, ALL, np.where(ALL < 10, 20.1, 25.0))
    assert value("position_bias_x", WALL, far) == pytest.approx(
        0.1 * beam_directions(WALL.layer[:10], WALL.point[:10])[:, 0].mean()
    )
    raised = replace(scan, layer=scan.layer + np.int32(1))
    below = WALL.layer < 103
    assert value("direction_bias_elevation", WALL, raised.take(below)) == pytest.approx(-0.05)
    assert value("direction_bias_azimuth", WALL, raised.take(below)) == 0.0


def test_positions_are_held_against_the_surface_points_of_the_file():
    place = 20.0 * beam_directions(WALL.layer, WALL.point) + [0.0, 0.5, -0.25]
    own = replace(WALL, extra=dict(zip("XYZ", place.T, strict=True)))
    scan = scan_of(own, ALL, 20.0)
    for axis, off_m in (("x", 0.0), ("y", -0.5), ("z", 0.25)):
        assert value(f"position_bias_{axis}", own, scan) == pytest.approx(off_m)


def test_numbers_are_those_that_the_file_has():
    scan = scan_of(WALL, [0, 0, 1, 1, 2], [20.0, 23.0, 20.0, 23.0, 20.0])
    scan = replace(scan, echo_number=np.array([1, 2, 1, 2, 1]))
    assert value("echo_order", WALL, scan) == 1.0
    assert value("echo_number_share", WALL, scan, number=1) == 3 / 5
    raw = replace(scan, extra={"EchoNumberRaw": np.array([1, 0, 0, 1, 0])})
    assert value("echo_order", WALL, raw) == 0.5
    assert [value("echo_number_share", WALL, raw, number=n) for n in (0, 1, 2)] == [3 / 5, 2 / 5, 0.0]
    assert math.isnan(value("echo_order", WALL, scan_of(WALL, ALL, 20.0)))
    # A number in one frame does not meet that of another.
    assert value("echo_order", WALL, scan.take(scan.echo_number == 1), scan) == 1.0


def test_percentiles_and_steps_of_a_feature():
    area = 2.0 * np.arange(20)
    scan = scan_of(WALL, ALL, 20.0 + 0.02 * ALL, area=area, peak=3.0 * (ALL % 4), width_ns=0.5 * ALL)
    assert value("area_percentile_50", WALL, scan) == 19.0
    assert value("range_residual_percentile_95", WALL, scan) == pytest.approx(0.02 * 18.5)
    assert value("peak_percentile_5", WALL, scan) == 0.0
    for feature, step in (("range", 0.02), ("area", 2.0), ("peak", 3.0), ("width", 0.5)):
        assert value(f"{feature}_quantisation_step", WALL, scan) == pytest.approx(step), feature


# Of simulated echoes


def simulated(ideal: IdealScan, *effects: tuple[str, dict[str, float]], kind: str, seed: int = 5, **more) -> float:
    """The KPI of a simulation with those effects, of a surface that is far from saturation."""
    model = Model(Sensor.of("SLIM"), {1: Material("grey", 0.3)}, tuple(make(*effect) for effect in effects))
    return value(kind, ideal, simulate(ideal, model, seed=seed, threads=2), **more)


SWEPT = ideal_of(np.tile(np.linspace(90.0, 140.0, 60), (40, 1)))
FAR = ideal_of(np.full((60, 40), 100.0))


def test_a_stretched_scale_is_measured_on_the_simulation():
    kind = "range_residual_per_metre"
    plain, stretched = simulated(SWEPT, kind=kind), simulated(SWEPT, ("range_scale", {"fraction": 1e-3}), kind=kind)
    assert stretched - plain == pytest.approx(1e-3, abs=1e-4)


def test_uneven_layers_stand_out_of_the_photons_noise():
    kind = "area_layer_spread"
    whole = simulated(FAR, kind="area_mean")
    assert simulated(FAR, kind=kind) < 0.015 * whole
    # Every other layer has 0.8 of the light: half the difference either side of the mean.
    every_other = ("layer_gain", {"gain": 0.8, "first_layer": 100, "last_layer": 159, "every": 2})
    dimmed = simulated(FAR, every_other, kind="area_mean", rows=FAR.layer % 2 == 0)
    assert dimmed < 0.9 * whole
    assert simulated(FAR, every_other, kind=kind) == pytest.approx((whole - dimmed) / 2.0, rel=0.05)


def test_lost_beams_are_a_share():
    kept = simulated(FAR, ("dropout", {"share": 0.2}), kind="echo_share")
    assert kept == pytest.approx(0.8, abs=0.03)


# Nothing


NO_ECHO_BUT_A_NUMBER = {
    "detection_probability",
    "echoes_per_beam",
    "echo_share",
    "multi_echo_share",
    "false_alarm_probability",
    "false_alarms_per_beam",
}


@pytest.mark.parametrize("kind", [name for name, kind in KINDS.items() if kind.value is not None])
def test_no_echo_has_no_value_but_a_share(kind):
    ideal = edge()
    for echoes in (scan_of(ideal, [], []), scan_of(ideal, [89], 10.0)):
        found = value(kind, ideal, echoes, rows=ideal.point < 406)
        if kind in NO_ECHO_BUT_A_NUMBER | {"mixed_pixel_share"}:
            assert found == 0.0
        elif kind.startswith("lost_run"):
            assert found > 1.0  # where no beam has an echo, all of them are one run
        else:
            assert math.isnan(found)


@pytest.mark.parametrize("kind", [name for name, kind in KINDS.items() if kind.value is not None])
def test_one_echo_is_no_error(kind):
    found = value(kind, WALL, scan_of(WALL, [7], 20.1))
    assert isinstance(found, float)
    assert not math.isinf(found)


def test_a_slope_needs_a_spread():
    assert math.isnan(slope(np.array([1.0, 2.0]), np.array([1.0, 2.0])))
    assert math.isnan(slope(np.full(5, 3.0), np.arange(5.0)))
    assert slope(np.array([1, 2, 4]), np.array([3.0, 5.0, 9.0])) == pytest.approx(2.0)


def test_spread_between_needs_groups_and_scatter():
    assert math.isnan(spread_between(np.arange(4.0), np.zeros(4)))
    assert math.isnan(spread_between(np.arange(4.0), np.arange(4)))
    assert spread_between(np.array([1.0, 3.0, 1.0, 3.0]), np.array([0, 0, 1, 1])) == 0.0
    # Balanced, by hand: means 1 and 5, within 2, between 2 * 8 = 16, so (16 - 2) / 2 = 7.
    assert spread_between(np.array([0.0, 2.0, 4.0, 6.0]), np.array([0, 0, 1, 1])) == pytest.approx(math.sqrt(7.0))


def test_every_proportion_is_a_count_of_its_trials():
    scan = scan_of(edge(), [0, 3, 3, 4, 40], [20.0, 25.0, 20.1, 30.0, 26.0])
    seen = KpiSelection(FiredBeams.of(edge()), np.ones(90, dtype=bool), 0.5).seen(
        SelectedEchoes.of(scan, pair_with_ideal(edge(), scan))
    )
    for kind in (kind for kind in KINDS.values() if kind.gate == "proportion"):
        assert kind.value is not None
        assert kind.trials is not None
        successes = kind.value(seen) * kind.trials(seen)
        assert successes == pytest.approx(round(successes))
        assert 0 <= successes <= kind.trials(seen)
