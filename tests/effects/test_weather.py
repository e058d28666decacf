"""Fog and rain: extinction, backscatter and drops against closed forms, slow sums and what a scan shows of them."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy import integrate, stats

from any_detector_kit import sensor
from effect_kit import MATERIALS, Around, empty, lit, plain, rows, wall
from lidarcheck import effects
from lidarcheck.errors import UsageError
from lidarcheck.model import Model, simulate
from lidarcheck.scan import Haze, Light
from lidarcheck.sensor import Sensor


def haze_of(light: Light) -> Haze:
    assert light.haze is not None
    return light.haze


def drops_of(light: Light, first: Light) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Beam, range and signal of the pulses that no surface returned."""
    new = light.rows() == -1
    assert new.sum() == len(light.pulse_signal) - len(first.pulse_signal)
    return light.pulse_beam[new], light.pulse_range_m[new], light.pulse_signal[new]


@pytest.mark.parametrize(("name", "clear"), [("fog", {"mor_m": 1e6}), ("rain", {"rate_mm_h": 0.0})])
def test_clear_air_gives_back_the_same_object(name: str, clear: dict[str, float]) -> None:
    around = Around(wall(5))
    light = plain(around)
    assert effects.make(name, clear).light(light, around) is light


@pytest.mark.parametrize("name", ["fog", "rain"])
def test_no_beams_and_beams_that_meet_nothing_are_no_trouble(name: str) -> None:
    assert len(lit(effects.make(name, {}), Around(empty()))) == 0
    nothing = lit(effects.make(name, {}), Around(wall(3000, 0.0)))
    surface = nothing.rows() >= 0
    assert not nothing.pulse_signal[surface].any()
    assert nothing.haze is not None or nothing.pulse_signal.any()


# fog


@pytest.mark.parametrize("mor_m", [5.0, 50.0, 1000.0])
def test_fog_takes_beer_s_share_of_every_pulse(mor_m: float) -> None:
    distance = np.array([1.0, 10.0, 40.0, 200.0])
    around = Around(wall(4, distance))
    ratio = lit(effects.make("fog", {"mor_m": mor_m}), around).pulse_signal / plain(around).pulse_signal
    # Contrast 5 % over the meteorological optical range, there and back.
    assert ratio == pytest.approx(0.05 ** (2 * distance / mor_m), rel=1e-12)


@pytest.mark.parametrize(
    "setting",
    [
        {},
        {"mor_m": 5.0},
        {"mor_m": 3000.0, "overlap_start_m": 0.1, "overlap_full_m": 0.1},
        {"overlap_start_m": 0.93, "overlap_full_m": 7.21},
        {"overlap_start_m": 2.03, "overlap_full_m": 2.04},
    ],
)
def test_each_cell_of_the_haze_holds_the_soft_target_s_integral(setting: dict[str, float]) -> None:
    fog = effects.make("fog", setting)
    haze = haze_of(lit(fog, Around(wall(1))))
    value = {"mor_m": 100.0, "overlap_start_m": 0.9, "overlap_full_m": 1.0} | setting
    start, full, mor = value["overlap_start_m"], value["overlap_full_m"], value["mor_m"]

    def density(range_m: float) -> float:
        if range_m < start:
            return 0.0
        overlap = min((range_m - start) / (full - start), 1.0) if full > start and range_m < full else 1.0
        return 6000 * math.pi * 0.046 / mor * math.exp(-2 * math.log(20) / mor * range_m) / range_m**2 * overlap

    for cell in [0, 1, *range(10, min(220, len(haze.density_per_m)), 7), len(haze.density_per_m) - 1]:
        low, high = cell * haze.step_m, (cell + 1) * haze.step_m
        kinks = [low, *(at for at in (start, full) if low < at < high), high]
        slow = sum(integrate.quad(density, a, b, epsabs=0)[0] for a, b in itertools.pairwise(kinks))
        assert haze.density_per_m[cell] * haze.step_m == pytest.approx(slow, rel=1e-6, abs=1e-12)
    assert (haze.density_per_m >= 0).all()
    end = len(haze.density_per_m) * haze.step_m
    assert density(end + 2 * haze.step_m) < 1e-5 <= density(end)
    assert integrate.quad(density, end, np.inf)[0] < 1e-3


def test_a_slab_of_fog_is_as_bright_as_a_hard_target_of_its_backscatter() -> None:
    """What a metre of air at 20 m returns, a board of rho = pi beta at 20 m returns as well, both behind the fog."""
    fog = effects.make("fog", {"mor_m": 400.0, "backscatter": 0.09})
    haze = haze_of(lit(fog, Around(wall(1))))
    cells = slice(round(19.5 / haze.step_m), round(20.5 / haze.step_m))
    board = 6000 * (math.pi * 0.09 / 400.0) / 20.0**2 * math.exp(-2 * math.log(20) / 400 * 20)
    assert haze.density_per_m[cells].sum() * haze.step_m == pytest.approx(board, rel=2e-3)


def test_the_haze_ends_at_what_each_row_of_a_beam_meets() -> None:
    # Out of order, two sub-beams on (3, 7), and one beam that meets nothing.
    ideal = rows((3, 7, 30.0, 1, 0), (2, 9, 0.0, 0, 0), (3, 7, 4.0, 2, 0), (2, 4, 12.0, 1, 0))
    haze = haze_of(lit(effects.make("fog", {}), Around(ideal)))
    assert haze.first_row.tolist() == [0, 1, 2, 4]
    assert haze.row_end_m.tolist() == [12.0, len(haze.density_per_m) * haze.step_m, 30.0, 4.0]
    assert haze.row_share.tolist() == [1.0, 1.0, 0.5, 0.5]
    shared = dataclasses.replace(ideal, share=[0.8, 1.0, 0.1, 0.9])
    assert haze_of(lit(effects.make("fog", {}), Around(shared))).row_share.tolist() == [0.9, 1.0, 0.8, 0.1]


def test_fog_without_backscatter_only_dims() -> None:
    assert lit(effects.make("fog", {"backscatter": 0.0}), Around(wall(2))).haze is None
    assert lit(effects.make("fog", {}), Around(wall(2), sensor=Sensor.of("SMART", signal_at_1m=0.0))).haze is None


def test_two_fogs_add_their_backscatter_and_dim_each_other() -> None:
    around = Around(rows((0, 1, 20.0, 1, 0), (0, 2, 0.0, 0, 0)))
    thin, thick = effects.make("fog", {"mor_m": 500.0}), effects.make("fog", {"mor_m": 60.0})
    first, second = haze_of(lit(thin, around)).density_per_m, haze_of(lit(thick, around)).density_per_m
    both = thick.light(lit(thin, around), around)
    haze = haze_of(both)
    middle = (np.arange(len(first)) + 0.5) * haze.step_m
    n = min(len(first), len(second))
    expected = first[:n] * 0.05 ** (2 * middle[:n] / 60.0) + second[:n] * 0.05 ** (2 * middle[:n] / 500.0)
    assert haze.density_per_m[:n] == pytest.approx(expected, rel=1e-3, abs=1e-5)
    assert haze.row_end_m[1] == pytest.approx(len(haze.density_per_m) * haze.step_m)
    other_way = thin.light(lit(thick, around), around)
    assert haze_of(other_way).density_per_m[:n] == pytest.approx(haze.density_per_m[:n], rel=1e-3, abs=1e-5)
    assert both.pulse_signal == pytest.approx(other_way.pulse_signal, rel=1e-12)
    alpha = math.log(20) * (1 / 60 + 1 / 500)
    assert both.pulse_signal[0] == pytest.approx(6000 * 0.4 / 400 * math.exp(-2 * alpha * 20), rel=1e-12)


def test_a_second_fog_s_light_is_dimmed_like_the_first_one_s() -> None:
    around = Around(wall(2))
    fog = effects.make("fog", {})
    dimmed = lit(fog, around).dimmed(np.array([0.5, 1.0]))
    assert haze_of(fog.light(dimmed, around)).row_share.tolist() == [0.5, 1.0]


def test_a_profile_in_other_cells_keeps_its_light() -> None:
    around = Around(wall(1))
    coarse = Haze(0.33, np.array([0.0, 3.0, 1.0]), np.array([0, 1]), np.array([50.0]), np.array([1.0]))
    fog = effects.make("fog", {})
    alone = haze_of(lit(fog, around))
    both = haze_of(fog.light(dataclasses.replace(plain(around), haze=coarse), around))
    attenuated = np.array([0.0, 3.0, 1.0]) * 0.05 ** (2 * (np.arange(3) + 0.5) * 0.33 / 100.0)
    gain = (both.density_per_m - alone.density_per_m[: len(both.density_per_m)]).sum() * both.step_m
    assert gain == pytest.approx(attenuated.sum() * 0.33, rel=1e-9)


def test_fields_of_view_that_overlap_fully_before_they_begin_to_are_refused() -> None:
    with pytest.raises(
        UsageError, match="fog: overlap_start_m = 3 is above overlap_full_m = 2; use overlap_start_m <="
    ):
        effects.make("fog", {"overlap_start_m": 3.0, "overlap_full_m": 2.0})


def test_a_scan_in_fog_shows_the_air_near_by_and_loses_what_is_far() -> None:
    ideal = wall(4000, np.repeat([0.0, 20.0, 60.0, 100.0], 1000))
    model = Model(Sensor.of("SMART"), MATERIALS)
    clear = simulate(ideal, model, seed=1)
    foggy = simulate(ideal, model.with_(effects.make("fog", {"mor_m": 60.0})), seed=1)
    surface = ideal.distance_m[foggy.layer * 960 + foggy.point]
    air = foggy.range_m < 12.0
    assert len(np.unique(foggy.layer[air] * 960 + foggy.point[air])) > 3900
    assert not np.any(clear.range_m < 12.0)
    at_20 = np.sum((surface == 20.0) & (np.abs(foggy.range_m - 20.0) < 1.0))
    assert at_20 > 900
    assert not np.any((surface == 100.0) & (np.abs(foggy.range_m - 100.0) < 1.0))
    late = simulate(
        ideal, model.with_(effects.make("fog", {"overlap_start_m": 6.0, "overlap_full_m": 8.0, "mor_m": 60.0})), seed=1
    )
    assert late.range_m.min() > 5.0
    assert np.any(late.range_m < 10.0)


def test_a_scan_shows_no_fog_behind_the_wall() -> None:
    setting = {"mor_m": 60.0, "overlap_start_m": 6.0, "overlap_full_m": 8.0, "backscatter": 0.09}
    model = Model(Sensor.of("SMART"), MATERIALS).with_(effects.make("fog", setting))
    black = simulate(wall(500, 5.0, material=0), model, seed=1)
    assert len(black) == 0
    assert len(simulate(wall(500, 30.0, material=0), model, seed=1)) > 400


# rain


def test_rain_takes_its_share_of_every_pulse() -> None:
    distance = np.linspace(10.0, 200.0, 4)
    around = Around(wall(4, distance))
    rain = effects.make("rain", {"rate_mm_h": 10.0, "drop_density": 0.0})
    ratio = lit(rain, around).pulse_signal / plain(around).pulse_signal
    assert ratio == pytest.approx(np.exp(-2 * 3.65e-4 * 10**0.63 * distance), rel=1e-12)
    fixed = effects.make(
        "rain", {"rate_mm_h": 50.0, "extinction_coefficient": 0.002, "extinction_exponent": 0.0, "drop_echo": 0.0}
    )
    assert lit(fixed, around).pulse_signal / plain(around).pulse_signal == pytest.approx(np.exp(-0.004 * distance))


def expected_drops(setting: dict[str, float], floor: float, near_m: float, far_m: float) -> float:
    """Drops of S >= floor between two ranges of a beam, summed over diameters and ranges one by one."""
    value = {"rate_mm_h": 25.0, "drop_echo": 60.0, "drop_density": 0.01, "beam_diameter_m": 0.01} | setting
    divergence = value.get("divergence_mrad", 1.4)
    alpha = 3.65e-4 * value["rate_mm_h"] ** 0.63
    diameter = (np.arange(6000) + 0.5) * 1e-3
    per_m3 = 8000 * diameter ** value.get("drop_shape", 0.0) * 1e-3
    per_m3 *= np.exp(-4.1 * value["rate_mm_h"] ** -0.21 * diameter)
    ranges = near_m + (np.arange(4000) + 0.5) * (far_m - near_m) / 4000
    total = 0.0
    for range_m in ranges:
        beam_mm = 1e3 * value["beam_diameter_m"] + divergence * range_m
        strength = value["drop_echo"] * 6000 * (0.33 / 2.33) ** 2 * math.exp(-2 * alpha * range_m) / range_m**2
        seen = strength * np.minimum((diameter / beam_mm) ** 2, 1.0) >= floor
        total += per_m3[seen].sum() * math.pi / 4 * (beam_mm * 1e-3) ** 2 * (far_m - near_m) / 4000
    return total * value["drop_density"]


@pytest.mark.parametrize(
    "setting",
    [
        {},
        {"rate_mm_h": 80.0, "drop_echo": 1.0, "drop_density": 0.1},
        {"beam_diameter_m": 0.001, "divergence_mrad": 0.0, "drop_density": 1.0},
        {"drop_shape": 1.0},
        {"drop_shape": 2.5, "drop_echo": 8.0, "drop_density": 0.03},
    ],
)
def test_drops_are_poisson_of_the_mean_that_their_sizes_give(setting: dict[str, float]) -> None:
    beams = 40_000
    around = Around(wall(beams, 0.0))
    beam, range_m, signal = drops_of(lit(effects.make("rain", setting), around), plain(around))
    floor = 0.1 * 10 / 135
    assert signal.min() >= floor * (1 - 1e-9)
    mean = expected_drops(setting, floor, 1.0, 300.0 if "beam_diameter_m" in setting else 60.0)
    count = np.bincount(beam, minlength=beams)
    assert count.mean() == pytest.approx(mean, abs=4 * math.sqrt(mean / beams) + 0.005 * mean)
    # The variance of a sample variance of Poisson counts is (mean + 2 mean^2) / n.
    assert count.var() == pytest.approx(count.mean(), abs=4.5 * math.sqrt((mean + 2 * mean**2) / beams))
    for low, high in ((1.0, 4.0), (4.0, 12.0)):
        part = expected_drops(setting, floor, low, high)
        found = np.sum((range_m >= low) & (range_m < high)) / beams
        assert found == pytest.approx(part, abs=4 * math.sqrt(part / beams) + 0.005 * part + 1e-12)


@pytest.mark.parametrize("shape", [0.0, 1.0, 3.5])
def test_a_drop_s_size_is_its_distribution_s_at_its_range(shape: float) -> None:
    setting = {"divergence_mrad": 0.0, "beam_diameter_m": 0.02, "extinction_coefficient": 0.0, "drop_density": 0.02}
    around = Around(wall(60_000, 0.0))
    _, range_m, signal = drops_of(lit(effects.make("rain", setting | {"drop_shape": shape}), around), plain(around))
    diameter = 20.0 * np.sqrt(signal * range_m**2 / (60 * 6000 * (0.33 / 2.33) ** 2))
    smallest = 20.0 * np.sqrt(0.1 * 10 / 135 * range_m**2 / (60 * 6000 * (0.33 / 2.33) ** 2))
    # The distribution function by a sum over small steps of the diameter.
    step = np.linspace(0.0, 6.0, 60_001)
    number = step**shape * np.exp(-4.1 * 25.0**-0.21 * step)
    below = np.concatenate([[0.0], np.cumsum(0.5 * (number[1:] + number[:-1]))])
    near, at = (np.interp(d, step, below) for d in (smallest, diameter))
    assert len(signal) > 3000
    assert stats.kstest((at - near) / (below[-1] - near), "uniform").pvalue > 1e-3


def test_drops_lie_in_front_of_what_the_beam_meets() -> None:
    around = Around(wall(20_000, 6.0))
    free = Around(wall(20_000, 0.0))
    beam, range_m, signal = drops_of(lit(effects.make("rain", {}), around), plain(around))
    free_beam, free_range_m, free_signal = drops_of(lit(effects.make("rain", {}), free), plain(free))
    before = free_range_m < 6.0
    assert 0 < before.sum() < len(before)
    assert np.array_equal(beam, free_beam[before])
    assert np.array_equal(range_m, free_range_m[before])
    assert np.array_equal(signal, free_signal[before])


def test_a_drop_gets_the_part_of_the_beam_that_comes_so_far() -> None:
    n = 20_000
    free = wall(n, 0.0)
    half = dataclasses.replace(
        free, **{f.name: np.repeat(getattr(free, f.name), 2) for f in dataclasses.fields(free)[:5]}
    )
    half = dataclasses.replace(half, distance_m=np.tile([6.0, 0.0], n))
    _, range_m, alone = drops_of(lit(effects.make("rain", {}), Around(free)), plain(Around(free)))
    _, same_m, signal = drops_of(lit(effects.make("rain", {}), Around(half)), plain(Around(half)))
    assert np.array_equal(range_m, same_m)
    assert signal == pytest.approx(alone * np.where(range_m < 6.0, 1.0, 0.5))


def test_drops_of_a_beam_do_not_depend_on_other_beams() -> None:
    ideal = wall(9600, 0.0)
    picked = np.arange(0, 9600, 3)[::-1]
    around, fewer = Around(ideal), Around(ideal.take(picked))
    light, part = lit(effects.make("rain", {}), around), lit(effects.make("rain", {}), fewer)
    beam, range_m, signal = drops_of(light, plain(around))
    part_beam, part_range_m, part_signal = drops_of(part, plain(fewer))
    kept = beam % 3 == 0
    assert kept.any()
    assert np.array_equal(beam[kept], 3 * part_beam)
    assert np.array_equal(range_m[kept], part_range_m)
    assert np.array_equal(signal[kept], part_signal)


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_a_cloudburst_of_bright_drops_stays_bounded(variant: str) -> None:
    around = Around(wall(2000, 0.0), sensor=Sensor.of(variant, threshold=0))
    setting = {"rate_mm_h": 300.0, "drop_echo": 1e4, "drop_density": 1e3, "divergence_mrad": 100.0, "nearest_m": 0.1}
    beam, _, signal = drops_of(lit(effects.make("rain", setting), around), plain(around))
    assert np.isfinite(signal).all()
    assert len(beam) / 2000 == pytest.approx(4.0, abs=0.25)


def test_a_scan_in_typical_rain_shows_single_echoes_of_drops() -> None:
    ideal = wall(9600, 60.0)
    model = Model(Sensor.of("SMART"), MATERIALS)
    wet = simulate(ideal, model.with_(effects.make("rain", {})), seed=2)
    false = wet.range_m < 50.0
    assert not np.any(simulate(ideal, model, seed=2).range_m < 50.0)
    assert 0.02 < false.sum() / 9600 < 0.12
    assert np.quantile(wet.range_m[false], 0.9) > 10.0


def test_a_sensor_without_a_threshold_sees_as_many_drops_as_are_followed() -> None:
    """Every drop would reach a threshold of 0: the search for the faintest one that counts must end."""
    keen = sensor(threshold=0.0, noise=2.0, excess=0.0)
    rain = effects.make("rain", {"rate_mm_h": 20.0})
    floor = rain._floor(keen)
    assert 0.0 < floor < keen.signal_at_1m
    assert rain._expected(keen, floor)[1][-1] <= 4.0
