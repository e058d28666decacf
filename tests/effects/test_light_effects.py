"""Sunlight, incidence, dirt, foreign light and sensitive layers: what they do to the light of each beam."""

import dataclasses
import math

import numpy as np
import pytest
from scipy import stats

from effect_kit import MATERIALS, Around, empty, lit, plain, rows, wall
from lidarcheck import effects
from lidarcheck.effects.base import LightEffect
from lidarcheck.effects.geometry.beam_rows import BeamRows, by_material
from lidarcheck.effects.shared.draws import normals, poisson_struck, strikes
from lidarcheck.errors import UsageError
from lidarcheck.model import Model, simulate
from lidarcheck.scan import Haze, Light
from lidarcheck.sensor import Material, Sensor

NEUTRAL = {
    "ambient_light": {"rate_per_ns": 0.0},
    "incidence_falloff": {"exponent": 1.0},
    "blockage": {"transmission": 1.0},
    "interference": {"share": 0.0},
    "layer_gain": {"gain": 1.0},
}


@pytest.mark.parametrize("name", NEUTRAL)
def test_no_strength_gives_back_the_same_object(name: str) -> None:
    around = Around(wall(5))
    light = plain(around)
    effect = effects.make(name, NEUTRAL[name])
    assert isinstance(effect, LightEffect)
    assert effect.light(light, around) is light


@pytest.mark.parametrize("name", NEUTRAL)
def test_no_beams_and_beams_that_meet_nothing_are_no_trouble(name: str) -> None:
    assert len(lit(effects.make(name, {}), Around(empty()))) == 0
    nothing = lit(effects.make(name, {}), Around(wall(2000, 0.0), materials={}))
    assert len(nothing) == 2000
    assert not nothing.pulse_signal[nothing.rows() >= 0].any()
    assert np.isfinite(nothing.background_per_ns).all()


# ambient light


def test_background_follows_the_reflectance_of_what_the_beam_meets() -> None:
    table = rows((0, 0, 50.0, 0, 0), (0, 1, 5.0, 1, 80.0), (0, 2, 200.0, 2, 0), (0, 3, 9.0, 3, 0), (0, 4, 0.0, 1, 0))
    light = lit(effects.make("ambient_light", {"rate_per_ns": 0.01, "sky": 0.25}), Around(table))
    assert light.background_per_ns == pytest.approx([0.0003, 0.0043, 0.0103, 0.0053, 0.0028])
    assert np.array_equal(light.pulse_signal, plain(Around(table)).pulse_signal)


def test_sub_beams_mix_their_surfaces_by_their_shares() -> None:
    table = rows((1, 1, 9.0, 2, 0), (0, 5, 7.0, 1, 0), (1, 1, 5.0, 1, 0), (1, 1, 0.0, 0, 0), (1, 1, 9.0, 0, 0))
    effect = effects.make("ambient_light", {"rate_per_ns": 0.01, "sky": 0.2})
    assert lit(effect, Around(table)).background_per_ns == pytest.approx([0.0043, 0.0003 + 0.01 * 1.6 / 4])
    shared = dataclasses.replace(table, share=[0.5, 1.0, 0.1, 0.2, 0.2])
    mixed = 0.5 * 1.0 + 0.1 * 0.4 + 0.2 * 0.2
    assert lit(effect, Around(shared)).background_per_ns == pytest.approx([0.0043, 0.0003 + 0.01 * mixed])


def test_equal_mixtures_are_equal_numbers_whatever_their_order() -> None:
    materials = {i: Material(f"m{i}", rho) for i, rho in enumerate((0.1, 0.2, 0.3))}
    beams = [
        (0, point, 10.0 + place, material, 0)
        for point in range(6)
        for place, material in enumerate(np.roll([0, 1, 2], point))
    ]
    light = lit(effects.make("ambient_light", {}), Around(rows(*beams), materials=materials))
    assert len(set(light.background_per_ns.tolist())) == 1


def test_sunlight_raises_noise_and_costs_echoes() -> None:
    model = Model(Sensor.of("SMART"), MATERIALS)
    sunny = model.with_(effects.make("ambient_light", {"rate_per_ns": 0.006}))
    ideal = wall(3000, 170.0)
    dark, bright = simulate(ideal, model, seed=1), simulate(ideal, sunny, seed=1)
    false = [np.sum(np.abs(scan.range_m - 170.0) > 2.0) for scan in (dark, bright)]
    assert false[0] < 5
    assert false[1] > 200
    assert len(simulate(wall(3000, 170.0, material=0), sunny, seed=1)) < 5


# incidence


@pytest.mark.parametrize("exponent", [0.0, 0.5, 2.0, 7.5])
def test_the_signal_goes_with_that_power_of_the_cosine(exponent: float) -> None:
    angle = np.array([0.0, 30.0, 60.0, 85.0])
    table = dataclasses.replace(wall(4, 20.0), incidence_deg=angle)
    light = lit(effects.make("incidence_falloff", {"exponent": exponent}), Around(table))
    assert light.pulse_signal == pytest.approx(6000 * 0.4 / 400 * np.cos(np.deg2rad(angle)) ** exponent)


def test_a_falloff_that_levels_off_keeps_the_factor_that_it_has_there() -> None:
    angle = np.array([0.0, 30.0, 60.0, 70.0, 85.0, 89.9])
    table = dataclasses.replace(wall(6), incidence_deg=angle)
    level = lit(effects.make("incidence_falloff", {"exponent": 1.8, "level_from_deg": 60.0}), Around(table))
    factor = level.pulse_signal / plain(Around(table)).pulse_signal
    assert factor == pytest.approx(np.cos(np.deg2rad(np.minimum(angle, 60.0))) ** 0.8, rel=1e-9)


def test_a_table_of_factors_stands_on_top_of_the_power() -> None:
    """At whole tens of degrees its own numbers, linear in the angle between, the last one beyond its end."""
    table = dataclasses.replace(wall(5, 20.0), incidence_deg=np.array([0.0, 10.0, 15.0, 20.0, 70.0]))
    given = {"exponent": 2.0, "factors": (1.2, 1.0, 0.8)}
    light = lit(effects.make("incidence_falloff", given), Around(table))
    plain = lit(effects.make("incidence_falloff", {"exponent": 2.0}), Around(table))
    assert light.pulse_signal / plain.pulse_signal == pytest.approx([1.2, 1.0, 0.9, 0.8, 0.8])
    alone = lit(effects.make("incidence_falloff", {"exponent": 1.0, "factors": (0.5,)}), Around(table))
    nothing = lit(effects.make("incidence_falloff", {"exponent": 1.0}), Around(table))
    assert alone.pulse_signal == pytest.approx(0.5 * nothing.pulse_signal)


@pytest.mark.parametrize("exponent", [0.0, 0.3, 3.0])
def test_grazing_light_stays_finite(exponent: float) -> None:
    table = dataclasses.replace(wall(3, 20.0), incidence_deg=np.array([89.999999, 90.0, 91.0]))
    signal = lit(effects.make("incidence_falloff", {"exponent": exponent}), Around(table)).pulse_signal
    assert np.isfinite(signal).all()
    assert (signal >= 0).all()
    assert (signal <= 6.0000001).all()


def test_retro_reflectors_and_light_of_no_surface_keep_their_signal() -> None:
    table = rows(
        (0, 0, 20.0, 3, 60.0), (0, 1, 20.0, 1, 60.0), (0, 1, 30.0, 3, 60.0), (0, 2, 0.0, 1, 60.0), (0, 3, 9, 1, 60)
    )
    around = Around(table)
    # Beam 2 also sees light that came from beam 1's wall, and a pulse of no surface.
    before = plain(around).with_pulses([2, 2], [20.0, 25.0], [4.0, 5.0], [1, -1])
    after = effects.make("incidence_falloff", {"exponent": 3.0}).light(before, around)  # type: ignore[attr-defined]
    assert after.pulse_signal / np.maximum(before.pulse_signal, 1e-9) == pytest.approx([1, 0.25, 1, 0, 0.25, 1, 0.25])
    assert np.array_equal(after.background_per_ns, before.background_per_ns)


# blockage


def grid(layers: slice, points: slice) -> Around:
    layer, point = (axis.ravel() for axis in np.mgrid[layers, points])
    one = np.ones(len(layer))
    return Around(dataclasses.replace(wall(len(layer)), layer=layer, point=point, material_id=one))


HARD = {
    "transmission": 0.3,
    "first_layer": 200,
    "last_layer": 205,
    "first_point": 50,
    "last_point": 52,
    "soft_edge_deg": 0.0,
}


def test_a_hard_patch_dims_its_rectangle_and_nothing_else() -> None:
    around = grid(slice(195, 211), slice(45, 58))
    light, before = lit(effects.make("blockage", HARD), around), plain(around)
    inside = (light.layer >= 200) & (light.layer <= 205) & (light.point >= 50) & (light.point <= 52)
    assert inside.sum() == 18
    assert light.pulse_signal / before.pulse_signal == pytest.approx(np.where(inside, 0.3, 1.0))
    assert light.background_per_ns / 0.0003 == pytest.approx(np.where(inside, math.sqrt(0.3), 1.0))


@pytest.mark.parametrize(("power", "expected"), [(0.0, 1.0), (1.0, 0.0), (0.5, 0.0)])
def test_a_dark_patch_is_dark_and_its_background_as_asked(power: float, expected: float) -> None:
    around = grid(slice(200, 206), slice(50, 53))
    light = lit(effects.make("blockage", HARD | {"transmission": 0.0, "background_power": power}), around)
    assert not light.pulse_signal.any()
    assert light.background_per_ns == pytest.approx(0.0003 * expected)


def test_dirt_fades_out_linearly_with_the_angle() -> None:
    around = grid(slice(190, 240), slice(51, 52))
    light = lit(effects.make("blockage", HARD | {"soft_edge_deg": 0.5}), around)
    factor = light.pulse_signal / plain(around).pulse_signal
    # The patch's edge lies half a layer, 0.025 deg, above layer 205; the dirt ends 0.5 deg further up.
    above = (np.arange(206, 240) - 205.5) * 0.05
    assert factor[16:] == pytest.approx(np.minimum(0.3 + 0.7 * above / 0.5, 1.0))
    assert factor[10:16] == pytest.approx(0.3)
    assert np.all(np.diff(factor[:11]) < 0)


def test_a_round_patch_is_a_disc() -> None:
    # 60 layers are 3 deg, 24 points are 3 deg: fully rounded, a disc of 1.5 deg.
    around = grid(slice(180, 280), slice(80, 130))
    setting = HARD | {"first_layer": 200, "last_layer": 259, "first_point": 90, "last_point": 113, "roundness": 1.0}
    light = lit(effects.make("blockage", setting), around)
    dimmed = light.pulse_signal < plain(around).pulse_signal
    radius = np.hypot((light.layer - 229.5) * 0.05, (light.point - 101.5) * 0.125)
    assert np.array_equal(dimmed, radius <= 1.5)
    square = lit(effects.make("blockage", setting | {"roundness": 0.0}), around)
    assert (square.pulse_signal < plain(around).pulse_signal).sum() == 60 * 24


def test_dirt_dims_the_air_s_light_as_well() -> None:
    around = grid(slice(200, 201), slice(50, 52))
    haze = Haze(0.5, np.ones(3), np.arange(3), np.full(2, 9.0), np.ones(2))
    light = dataclasses.replace(plain(around), haze=haze)
    dimmed = effects.make("blockage", HARD | {"last_point": 50}).light(light, around)  # type: ignore[attr-defined]
    assert dimmed.haze.row_share.tolist() == pytest.approx([0.3, 1.0])


@pytest.mark.parametrize(
    ("name", "first", "last"),
    [
        ("blockage", "first_layer", "last_layer"),
        ("blockage", "first_point", "last_point"),
        ("layer_gain", "first_layer", "last_layer"),
        ("interference", "nearest_m", "farthest_m"),
    ],
)
def test_an_interval_that_ends_before_it_begins_is_refused(name: str, first: str, last: str) -> None:
    with pytest.raises(UsageError, match=f"{name}: {first} = 40 is above {last} = 39; use {first} <= {last}"):
        effects.make(name, {first: 40, last: 39})
    effects.make(name, {first: 40, last: 40})


# layers


def test_every_nth_layer_of_a_block_can_be_weak() -> None:
    around = grid(slice(0, 520), slice(7, 8))
    setting = {"gain": 0.5, "first_layer": 10, "last_layer": 21, "every": 3}
    light = lit(effects.make("layer_gain", setting), around)
    weak = light.pulse_signal < plain(around).pulse_signal
    assert np.flatnonzero(weak).tolist() == [10, 13, 16, 19]
    assert light.background_per_ns[weak] == pytest.approx(0.00015)
    block = lit(effects.make("layer_gain", setting | {"every": 1}), around)
    assert np.flatnonzero(block.pulse_signal < plain(around).pulse_signal).tolist() == list(range(10, 22))


# interference


def foreign(around: Around, **setting: float) -> tuple[Light, np.ndarray, np.ndarray, np.ndarray]:
    light = lit(effects.make("interference", setting), around)
    new = light.rows() == -1
    return light, light.pulse_beam[new], light.pulse_range_m[new], light.pulse_signal[new]


def test_foreign_pulses_are_poisson_uniform_and_log_normal() -> None:
    beams = 40_000
    setting = {"share": 0.4, "signal": 2.0, "spread_decades": 0.5, "nearest_m": 30.0, "farthest_m": 90.0}
    light, beam, range_m, signal = foreign(Around(wall(beams, 50.0)), **setting)
    count = np.bincount(beam, minlength=beams)
    expected = beams * stats.poisson.pmf(np.arange(4), 0.4)
    seen = np.array([np.sum(count == k) for k in range(4)])
    assert stats.chisquare([*seen, beams - seen.sum()], [*expected, beams - expected.sum()]).pvalue > 1e-3
    assert stats.kstest(range_m, stats.uniform(30, 60).cdf).pvalue > 1e-3
    assert stats.kstest(np.log10(signal), stats.norm(math.log10(2.0), 0.5).cdf).pvalue > 1e-3
    assert abs(np.corrcoef(range_m, np.log(signal))[0, 1]) < 4 / math.sqrt(len(signal))
    surface = light.rows() >= 0
    assert np.array_equal(light.pulse_signal[surface], plain(Around(wall(beams, 50.0))).pulse_signal)


def test_pulses_of_one_strength_have_that_strength() -> None:
    _, _, _, signal = foreign(Around(wall(2000)), share=1.0, signal=3.0, spread_decades=0.0)
    assert len(signal) > 1500
    assert signal == pytest.approx(3.0)


def test_runs_hit_whole_columns_and_keep_the_mean() -> None:
    beams = 96_000
    _, beam, _, _ = foreign(Around(wall(beams)), share=0.1, columns=0.2)
    per_column = np.bincount(beam % 960, minlength=960)
    hit = per_column > 0
    assert hit.sum() == pytest.approx(960 * 0.2, abs=4 * math.sqrt(960 * 0.2 * 0.8))
    # 100 beams a column, 0.5 pulses each where it is hit.
    assert per_column[hit].mean() == pytest.approx(50.0, abs=4 * math.sqrt(50 / hit.sum()))
    assert per_column[hit].var() == pytest.approx(50.0, rel=0.5)
    # Whether a column is hit says nothing about the draws of any one of its beams.
    for layer in (0, 1, 99):
        mean = np.bincount(beam[beam // 960 == layer] % 960, minlength=960)[hit].mean()
        assert mean == pytest.approx(0.5, abs=4.5 * math.sqrt(0.5 / hit.sum()))
    other = Around(wall(beams), seed=2)
    assert not np.array_equal(hit, np.bincount(foreign(other, share=0.1, columns=0.2)[1] % 960, minlength=960) > 0)


def test_pulses_of_a_column_lie_together_and_columns_anywhere() -> None:
    beams = 96_000
    setting = {"share": 0.5, "columns": 0.5, "nearest_m": 20.0, "farthest_m": 220.0}
    _, beam, range_m, _ = foreign(Around(wall(beams)), **setting, column_span_m=8.0)
    column = beam % 960
    first, last = np.full(960, np.inf), np.full(960, -np.inf)
    np.minimum.at(first, column, range_m)
    np.maximum.at(last, column, range_m)
    hit = np.isfinite(first)
    # Some hundred pulses a column: their range is nearly the whole span.
    assert np.all(last[hit] - first[hit] <= 8.0)
    assert np.mean(last[hit] - first[hit]) > 7.5
    assert stats.kstest(first[hit], stats.uniform(20.0, 192.0).cdf).pvalue > 1e-3
    within = (range_m - first[column]) / (last - first)[column]
    assert stats.kstest(within[(within > 0.0) & (within < 1.0)], stats.uniform(0, 1).cdf).pvalue > 1e-3
    # Neither which columns nor how many pulses.
    assert np.array_equal(beam, foreign(Around(wall(beams)), **setting)[1])


def test_a_span_as_wide_as_the_ranges_is_none() -> None:
    setting = {"share": 0.3, "columns": 0.5, "farthest_m": 150.0}
    _, _, plain_m, _ = foreign(Around(wall(9600)), **setting)
    assert np.array_equal(foreign(Around(wall(9600)), **setting, column_span_m=150.0)[2], plain_m)
    assert not np.array_equal(foreign(Around(wall(9600)), **setting, column_span_m=149.0)[2], plain_m)


@pytest.mark.parametrize(("columns", "column_span_m"), [(1.0, 1000.0), (0.3, 1000.0), (1.0, 10.0)])
def test_foreign_pulses_of_a_beam_do_not_depend_on_other_beams(columns: float, column_span_m: float) -> None:
    ideal = wall(9600)
    picked = np.arange(0, 9600, 7)[::-1]
    setting = {"share": 0.5, "columns": columns, "column_span_m": column_span_m}
    _, beam, range_m, signal = foreign(Around(ideal), **setting)
    _, part_beam, part_range_m, part_signal = foreign(Around(ideal.take(picked)), **setting)
    kept = beam % 7 == 0
    assert np.array_equal(beam[kept], 7 * part_beam)
    assert np.array_equal(range_m[kept], part_range_m)
    assert np.array_equal(signal[kept], part_signal)


def test_a_scan_shows_foreign_light_as_echoes_in_the_air_and_behind_walls() -> None:
    model = Model(Sensor.of("SMART"), MATERIALS).with_(effects.make("interference", {"share": 0.2}))
    scan = simulate(wall(4800, 50.0), model, seed=3)
    away = np.abs(scan.range_m - 50.0) > 2.0
    assert away.sum() / 4800 == pytest.approx(0.2, abs=0.04)
    assert np.sum(scan.range_m[away] > 52.0) > 3 * np.sum(scan.range_m[away] < 48.0)


# what they share


def test_rows_are_found_behind_the_beams_of_any_table() -> None:
    table = rows((3, 1, 9.0, 1, 0), (0, 2, 7.0, 1, 0), (3, 1, 5.0, 2, 0), (1, 1, 4.0, 0, 0))
    light = plain(Around(table))
    found = BeamRows.of(light, table)
    assert found.first.tolist() == [0, 1, 2, 4]
    assert found.row.tolist() == [1, 3, 0, 2]
    assert found.total(np.array([1.0, 2.0, 3.0, 4.0])).tolist() == [1.0, 2.0, 7.0]
    some = table.take(np.array([0, 2, 3]))
    for other, ideal in ((light, some), (plain(Around(some)), table)):
        with pytest.raises(UsageError, match="other beams than the ideal scan"):
            BeamRows.of(other, ideal)


def test_values_of_materials_are_found_by_number() -> None:
    table = rows(
        (0, 0, 5.0, 1, 0), (0, 1, 5.0, 2_000_000_000, 0), (0, 2, 5.0, -7, 0), (0, 3, 0.0, 1, 0), (0, 4, 5, 4, 0)
    )
    far = {1: Material("a", 0.1), 2_000_000_000: Material("b", 0.2), -7: Material("c", 0.3), 2**40: Material("d", 1)}
    near = {1: Material("a", 0.1), -7: Material("c", 0.3)}
    assert by_material(table, far, lambda m: m.reflectance, 0.9).tolist() == [0.1, 0.2, 0.3, 0.9, 0.9]
    assert by_material(table, near, lambda m: m.reflectance, 0.9).tolist() == [0.1, 0.9, 0.3, 0.9, 0.9]
    assert by_material(table, {}, lambda m: m.reflectance, 0.9).tolist() == [0.9] * 5


def test_draws_are_inverse_distribution_functions() -> None:
    grid_u = (np.arange(100_000) + 0.5) / 100_000
    for mean in (0.0, 0.3, 4.0, 150.0):
        count = np.zeros(len(grid_u), dtype=int)
        struck, counts = poisson_struck(grid_u, mean)
        count[struck] = counts
        assert np.all(counts > 0)
        assert np.array_equal(count, stats.poisson.ppf(grid_u, mean).astype(int))
    edge = np.array([0.0, 1.0 - 2.0**-53])
    assert np.isfinite(normals(edge)).all()
    assert normals(np.array([0.5, stats.norm.cdf(1.5)])) == pytest.approx([0.0, 1.5])
    struck, counts = poisson_struck(edge, 2.0)
    assert struck.tolist() == [1]
    assert counts[0] < 40


def test_events_that_strike_beams_have_numbers_of_their_own() -> None:
    """Of a beam's draws the first says how many events there are, and two each of the next belong to one of them."""

    class Drawing:
        def uniforms(self, layer, point, draws=1):
            assert len(layer) == len(point)
            return np.array(
                [np.append((0.37 * p + 0.1) % 1.0, 1e-3 * p + np.arange(30))[:draws] for p in point]
            ).reshape(-1, draws)

    point = np.arange(50, dtype=np.int32)
    beam, numbers = strikes(Drawing(), point, point, 1.5)
    counts = stats.poisson.ppf((0.37 * point + 0.1) % 1.0, 1.5).astype(int)
    assert counts.max() > 2
    assert np.array_equal(beam, np.repeat(point, counts))
    expected = [[1e-3 * p + 2 * k, 1e-3 * p + 2 * k + 1] for p in point for k in range(counts[p])]
    assert numbers == pytest.approx(np.array(expected))
    none, empty = strikes(Drawing(), point[:0], point[:0], 1.5)
    assert (len(none), empty.shape) == (0, (0, 2))
