"""Empirical terms: functions of covariates that describe what no effect of the catalogue explains."""

import dataclasses
import inspect
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from budget import examples
from effect_kit import MATERIALS, Around, echoes, empty, lit, plain, rows, wall
from lidarcheck import effects
from lidarcheck.cli import main
from lidarcheck.effects.empirical.covariates import COVARIATES, ECHO_COVARIATES, nearest_rows
from lidarcheck.effects.empirical.terms import Additive, Term
from lidarcheck.errors import ConfigError, UsageError
from lidarcheck.model import Model, load_model, save_model, simulate
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor

NAMES = list(effects.empirical_terms())
OF_LIGHT = ("empirical_signal", "empirical_flicker")
COLUMNS = ("x_m", "y_m", "z_m", "layer", "point", "echo_number", "width_ns", "area", "peak")
ANYWHERE = {"range_from": "sensor", "range_knots": [0, 300], "range_density": [1]}
STRENGTH = {"peak_quantiles": [10, 30], "area_quantiles": [20, 300], "width_quantiles": [2, 14]}


def zero(name: str) -> effects.Effect:
    example = effects.find(name).example()
    return effects.make(name, example | {"values": [0.0] * len(example["values"])})


def scan_of(around: Around, seed: int = 1) -> Scan:
    return simulate(around.ideal, Model(around.sensor, MATERIALS), seed=seed)


def out(name: str, around: Around, scan: Scan, **settings: object) -> Scan:
    return effects.make(name, settings).readout(scan, around)  # type: ignore[attr-defined, no-any-return]


def test_they_stand_apart_from_the_catalogue_and_are_known_to_models() -> None:
    assert len(effects.catalogue()) == 28
    assert not set(NAMES) & set(effects.catalogue())
    assert sorted(NAMES) == [
        f"empirical_{word}" for word in ("amplitude", "extra", "flicker", "loss", "range", "signal", "spread")
    ]
    for name in NAMES:
        assert effects.find(name).empirical
        assert not effects.find(name).parameters()
        text = inspect.getdoc(effects.find(name)) or ""
        assert "Identity at" in text
        assert "does not explain" in " ".join(text.split())
    assert not any(effect.empirical for effect in effects.catalogue().values())


@pytest.mark.parametrize("name", NAMES)
def test_zero_values_return_the_very_same_table(name: str) -> None:
    around = Around(wall(100))
    for effect in (zero(name), effects.make(name, {})):
        if name in OF_LIGHT:
            light = plain(around)
            assert effect.light(light, around) is light  # type: ignore[attr-defined]
        else:
            scan = scan_of(around)
            assert effect.readout(scan, around) is scan  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", NAMES)
def test_their_examples_change_something_and_work_on_any_table(name: str) -> None:
    effect = effects.make(name, effects.find(name).example())
    tables = [
        wall(400, np.linspace(5, 90, 400)),
        wall(1),
        wall(50, 0.0),
        empty(),
        rows((5, 5, 30.0, 1, 0.0), (3, 9, 80.0, 2, 40.0), (5, 5, 50.0, 0, 10.0), (3, 9, 0.0, 1, 0.0)),
    ]
    for number, ideal in enumerate(tables):
        found = simulate(ideal, Model(Sensor.of("SMART"), MATERIALS, (effect,)), seed=3)
        assert all(np.isfinite(getattr(found, column)).all() for column in COLUMNS)
        assert (found.area > 0).all()
        assert (found.peak <= 135).all()
        if number == 0:
            without = simulate(ideal, Model(Sensor.of("SMART"), MATERIALS), seed=3)
            assert any(getattr(found, column).tobytes() != getattr(without, column).tobytes() for column in COLUMNS)


def test_a_term_is_linear_between_its_knots_and_constant_outside() -> None:
    term = Term("range_m", (10.0, 20.0, 40.0), (1.0, 3.0, -1.0))
    assert term.at(np.array([0.0, 10.0, 15.0, 20.0, 30.0, 40.0, 1e9, np.nan])).tolist() == [1, 1, 2, 3, 1, -1, -1, 0]
    one = Term("layer", (100.0,), (0.5,))
    assert one.at(np.array([0.0, 100.0, 519.0])).tolist() == [0.5, 0.5, 0.5]


def test_materials_are_looked_up_exactly() -> None:
    term = Term("material_id", (1.0, 3.0, 2147483647.0), (0.1, 0.3, 0.7))
    found = term.at(np.array([0.0, 1.0, 2.0, 3.0, 4.0, 2147483647.0, np.nan]))
    assert found.tolist() == [0, 0.1, 0, 0.3, 0, 0.7, 0]


def test_the_signal_follows_each_covariate_of_the_surface_it_comes_from() -> None:
    ideal = rows((10, 20, 25.0, 1, 0.0), (11, 20, 50.0, 2, 60.0), (12, 20, 0.0, 1, 0.0))
    around = Around(ideal)
    before = plain(around).pulse_signal
    s = np.log10(6000 * np.array([0.4 / 25**2, 1.0 * 0.5 / 50**2]))
    for covariate, at in {
        "range_m": (25, 50),
        "layer": (10, 11),
        "point": (20, 20),
        "incidence_deg": (0, 60),
        "material_id": (1, 2),
        "signal_log10": s,
    }.items():
        first, second = at
        knots = sorted({first, second})
        values = [0.5, -0.25] if len(knots) == 2 and first < second else [-0.25, 0.5] if len(knots) == 2 else [0.5]
        effect = effects.make("empirical_signal", {"covariate": covariate, "knots": knots, "values": values})
        ratio = lit(effect, around).pulse_signal[:2] / before[:2]
        assert ratio == pytest.approx(np.exp([0.5, -0.25 if len(knots) == 2 else 0.5])), covariate


def test_two_functions_add_up() -> None:
    around = Around(rows((10, 20, 25.0, 1, 0.0), (11, 20, 50.0, 2, 60.0)))
    both = {"covariate": "range_m", "knots": [25, 50], "values": [0.1, 0.2]}
    both |= {"covariate_2": "material_id", "knots_2": [2], "values_2": [1.0]}
    ratio = lit(effects.make("empirical_signal", both), around).pulse_signal / plain(around).pulse_signal
    assert ratio == pytest.approx(np.exp([0.1, 1.2]))


def test_light_that_comes_from_no_surface_has_no_material_but_a_range() -> None:
    around = Around(wall(2, 40.0))
    light = plain(around).with_pulses([0], [80.0], [5.0])
    by_material = effects.make("empirical_signal", {"covariate": "material_id", "knots": [1], "values": [1.0]}).light(
        light, around
    )  # type: ignore[attr-defined]
    assert (by_material.pulse_signal / light.pulse_signal).tolist() == pytest.approx([np.e, 1.0, np.e])
    by_range = effects.make(
        "empirical_signal", {"covariate": "range_m", "knots": [40, 80], "values": [0.0, 1.0]}
    ).light(light, around)  # type: ignore[attr-defined]
    assert (by_range.pulse_signal / light.pulse_signal).tolist() == pytest.approx([1.0, np.e, 1.0])


def test_an_echo_takes_the_surface_of_its_beam_that_is_nearest_in_range() -> None:
    generator = np.random.default_rng(4)
    n = 300
    ideal = dataclasses.replace(
        wall(n),
        layer=generator.integers(0, 12, n),
        point=generator.integers(0, 8, n),
        distance_m=np.where(generator.random(n) < 0.2, 0.0, generator.uniform(5, 90, n)),
    )
    beams = [(int(a), int(b)) for a, b in zip(generator.integers(0, 14, 80), generator.integers(0, 8, 80), strict=True)]
    scan = echoes(beams, [1] * 80, generator.uniform(1, 100, 80).tolist())
    found = nearest_rows(scan, ideal)
    for echo, (layer, point) in enumerate(beams):
        mine = [i for i in range(n) if (ideal.layer[i], ideal.point[i]) == (layer, point) and ideal.distance_m[i] > 0]
        best = min((abs(ideal.distance_m[i] - scan.range_m[echo]) for i in mine), default=None)
        if best is None:
            assert found[echo] == -1
        else:
            assert abs(ideal.distance_m[found[echo]] - scan.range_m[echo]) == pytest.approx(best)
            assert found[echo] in mine
    assert (found == -1).any()


def test_ranges_shift_by_the_function_of_the_echo() -> None:
    around = Around(rows((10, 20, 30.0, 1, 0.0), (10, 21, 50.0, 2, 0.0), (10, 22, 0.0, 1, 0.0)))
    scan = echoes([(10, 20), (10, 21), (10, 22)], [1, 1, 1], [30.2, 49.0, 77.0], [100.0, 1000.0, 10.0])
    by_area = out("empirical_range", around, scan, covariate="area_log10", knots=[1, 3], values=[0.0, 0.4])
    assert by_area.range_m - scan.range_m == pytest.approx([0.2, 0.4, 0.0])
    by_material = out("empirical_range", around, scan, covariate="material_id", knots=[2], values=[-0.3])
    assert by_material.range_m - scan.range_m == pytest.approx([0.0, -0.3, 0.0])
    back = out("empirical_range", around, scan, covariate="layer", knots=[0], values=[-40.0])
    assert back.range_m == pytest.approx([0.0, 9.0, 37.0])


def test_range_scatter_has_the_function_s_standard_deviation() -> None:
    around = Around(wall(40_000, np.where(np.arange(40_000) < 20_000, 20.0, 60.0)))
    scan = echoes([divmod(i, 960) for i in range(40_000)], [1] * 40_000, around.ideal.distance_m.tolist())
    found = out("empirical_spread", around, scan, covariate="range_m", knots=[20, 60], values=[0.05, 0.3])
    moved = found.range_m - scan.range_m
    assert moved[:20_000].std() == pytest.approx(0.05, rel=0.02)
    assert moved[20_000:].std() == pytest.approx(0.3, rel=0.02)
    assert abs(moved[20_000:].mean()) < 4 * 0.3 / np.sqrt(20_000)
    below_zero = {"covariate_2": "layer", "knots_2": [0], "values_2": [-5.0]}
    still = out("empirical_spread", around, scan, covariate="range_m", knots=[20], values=[0.3], **below_zero)
    assert still.range_m == pytest.approx(scan.range_m)


def test_echoes_vanish_as_often_as_the_function_says_and_the_rest_is_numbered() -> None:
    n = 20_000
    around = Around(wall(n, 40.0))
    beams = [divmod(i // 2, 960) for i in range(2 * n)]
    scan = echoes(beams, [1, 2] * n, [40.0, 60.0] * n)
    left = out("empirical_loss", around, scan, covariate="range_m", knots=[40, 60], values=[0.25, 0.5])
    near = left.range_m < 50
    assert near.sum() == pytest.approx(0.75 * n, abs=4 * np.sqrt(n * 0.75 * 0.25))
    assert (~near).sum() == pytest.approx(0.5 * n, abs=4 * np.sqrt(n * 0.25))
    key = left.layer * 960 + left.point
    alone = np.isin(key, np.unique(key)[np.unique(key, return_counts=True)[1] == 1])
    assert (left.echo_number[alone] == 1).all()
    assert (left.echo_number[~alone] == np.where(near[~alone], 1, 2)).all()
    assert (alone & ~near).sum() > 1000
    assert len(out("empirical_loss", around, scan, covariate="layer", knots=[0], values=[1])) == 0


def test_amplitudes_scale_on_average_and_stay_what_a_sensor_reports() -> None:
    n = 20_000
    around = Around(wall(n, 40.0))
    scan = dataclasses.replace(
        echoes([divmod(i, 960) for i in range(n)], [1] * n, [40.0] * n, [101.0] * n),
        peak=np.full(n, 21.0),
        width_ns=np.full(n, 8.0),
    )
    settings = {"covariate": "layer", "knots": [0], "values": [np.log(1.13)]}
    wider = {"covariate_width": "range_m", "knots_width": [40], "values_width": [1.25]}
    found = out("empirical_amplitude", around, scan, **settings, **wider)
    for column, mean in (("area", 101 * 1.13), ("peak", 21 * 1.13), ("width_ns", 9.25)):
        values = getattr(found, column)
        assert np.array_equal(values, np.rint(values))
        assert values.max() - values.min() == 1
        assert values.mean() == pytest.approx(mean, abs=4 * 0.5 / np.sqrt(n))
    loud = out("empirical_amplitude", around, scan, covariate="layer", knots=[0], values=[10])
    assert (loud.peak == 135).all()
    faint = out("empirical_amplitude", around, scan, covariate="layer", knots=[0], values=[-10])
    assert (faint.peak == 10).all()
    assert (faint.area == 10).all()


def test_peak_area_and_width_have_functions_of_their_own() -> None:
    n = 20_000
    around = Around(wall(n, 40.0))
    beams = [divmod(i, 960) for i in range(n)]
    peaks = np.where(np.arange(n) % 2 == 0, 20.0, 60.0)
    scan = dataclasses.replace(echoes(beams, [1] * n, [40.0] * n, [400.0] * n), peak=peaks, width_ns=peaks / 10.0)
    low, high = np.log10([20.0, 60.0])
    by_peak = {"covariate_peak": "peak_log10", "knots_peak": [low, high], "values_peak": [np.log(1.5), 0.0]}
    found = out("empirical_amplitude", around, scan, **by_peak)
    assert np.array_equal(np.unique(found.peak), [30, 60])
    assert found.area.tobytes() == scan.area.tobytes()
    assert found.width_ns.tobytes() == scan.width_ns.tobytes()
    by_width = {"covariate_area": "width_ns", "knots_area": [2, 6], "values_area": [0.0, np.log(2.0)]}
    found = out("empirical_amplitude", around, scan, **by_width)
    assert np.array_equal(found.area, np.where(peaks == 20.0, 400.0, 800.0))
    assert found.peak.tobytes() == scan.peak.tobytes()


def test_a_function_may_repeat_beyond_its_knots() -> None:
    term = Term("range_m", (10.0, 12.0, 14.0), (0.0, 1.0, 0.0), repeats=True)
    assert term.at(np.array([10.0, 11.0, 12.0, 14.0, 15.0, 16.5, 2.0, 0.5, np.nan])) == pytest.approx(
        [0.0, 0.5, 1.0, 0.0, 0.5, 0.75, 0.0, 0.75, 0.0], abs=1e-12
    )
    steps = {"covariate": "range_m", "knots": [-0.25, 0.25], "values": [0.25, -0.25], "beyond": "repeats"}
    around = Around(wall(400, np.linspace(5, 90, 400)))
    found = out("empirical_range", around, scan_of(around), **steps).range_m
    assert found == pytest.approx(0.5 * np.round(found / 0.5), abs=1e-9)
    fixed = out("empirical_range", around, scan_of(around), **{**steps, "beyond": "constant"}).range_m
    assert fixed == pytest.approx(scan_of(around).range_m - 0.25)


@pytest.mark.parametrize(
    ("covariate", "knots", "says"),
    [("layer", [3], "a single knot has no"), ("material_id", [1, 2], "a material's number")],
)
def test_what_has_no_period_cannot_repeat(covariate: str, knots: list[int], says: str) -> None:
    settings = {"covariate": covariate, "knots": knots, "values": [0.1] * len(knots), "beyond": "repeats"}
    with pytest.raises(UsageError, match=says):
        effects.make("empirical_range", settings)


def test_the_signal_flickers_from_beam_to_beam_with_the_function_s_standard_deviation() -> None:
    n = 20_000
    around = Around(wall(n, np.where(np.arange(n) < n // 2, 20.0, 60.0)))
    settings = {"covariate": "range_m", "knots": [20, 60], "values": [0.1, 0.4]}
    ratio = np.log(lit(effects.make("empirical_flicker", settings), around).pulse_signal / plain(around).pulse_signal)
    near, far = ratio[: n // 2], ratio[n // 2 :]
    for some, sigma in ((near, 0.1), (far, 0.4)):
        assert some.mean() == pytest.approx(0.0, abs=4 * sigma / np.sqrt(len(some)))
        assert some.std() == pytest.approx(sigma, rel=4 / np.sqrt(2 * len(some)))
    assert np.corrcoef(near[:-1], near[1:])[0, 1] == pytest.approx(0.0, abs=4 / np.sqrt(len(near)))


@pytest.mark.parametrize(("covariate", "low", "high"), [("peak_log10", 1.3, 1.8), ("width_ns", 4, 9)])
def test_what_only_echoes_have_is_of_a_beam_s_largest(covariate: str, low: float, high: float) -> None:
    around = Around(wall(3, 40.0))
    scan = dataclasses.replace(
        echoes([(0, 0), (0, 0), (0, 1), (0, 1)], [1, 2, 1, 2], [10.0, 40.0, 10.0, 40.0], [90.0, 900.0, 900.0, 90.0]),
        peak=np.array([20.0, 63.0, 20.0, 63.0]),
        width_ns=np.array([4.0, 9.0, 4.0, 9.0]),
    )
    shape = {"covariate": covariate, "knots": [low, high], "values": [0, 1], **ANYWHERE, **STRENGTH}
    found = out("empirical_extra", around, scan, **shape)
    assert np.bincount(found.point, minlength=3).tolist() == [3, 2, 0]


def test_beams_may_gain_several_echoes_each_of_its_own_range_and_strength() -> None:
    n = 5_000
    around = Around(wall(n, 0.0))
    scan = scan_of(around).take(np.zeros(0, dtype=int))
    shape = {"covariate": "layer", "knots": [0], **ANYWHERE, **STRENGTH}
    found = out("empirical_extra", around, scan, **shape, values=[1.3])
    count = np.bincount(found.layer * 960 + found.point, minlength=n)
    assert set(count.tolist()) == {1, 2}
    assert (count == 2).mean() == pytest.approx(0.3, abs=4 * np.sqrt(0.21 / n))
    one = out("empirical_extra", around, scan, **shape, values=[1.0])
    assert np.isin(one.range_m.round(9), found.range_m.round(9)).all()
    two = found.range_m[np.repeat(count == 2, count)].reshape(-1, 2)
    assert (two[:, 0] < two[:, 1]).all()
    assert two.mean() == pytest.approx(150.0, abs=4 * 300 / np.sqrt(24 * len(two)))


def test_extra_echoes_come_as_often_and_from_where_they_should() -> None:
    n = 20_000
    around = Around(wall(n, np.where(np.arange(n) < n // 2, 20.0, 60.0)))
    scan = echoes([divmod(i, 960) for i in range(n)], [1] * n, around.ideal.distance_m.tolist(), [1e6] * n)
    where = {"range_from": "ratio", "range_knots": [1.5, 2.0, 3.0], "range_density": [3.0, 0.5]}
    found = out(
        "empirical_extra", around, scan, covariate="range_m", knots=[20, 60], values=[0.1, 0.4], **where, **STRENGTH
    )
    new = found.area < 1e6
    far = found.layer * 960 + found.point >= n // 2
    for part, share in ((~far, 0.1), (far, 0.4)):
        assert (new & part).sum() == pytest.approx(n / 2 * share, abs=4 * np.sqrt(n / 2 * share))
    ratio = found.range_m[new] / np.where(far[new], 60.0, 20.0)
    assert ratio.min() >= 1.5
    assert ratio.max() <= 3.0
    assert (ratio < 2.0).mean() == pytest.approx(1.5 / 2.0, abs=0.03)
    assert (found.echo_number[new] == 2).all()
    assert found.peak[new].min() >= 10
    assert found.peak[new].max() <= 30
    assert found.area[new].mean() == pytest.approx(160, abs=8)
    assert np.array_equal(found.width_ns[new], np.rint(found.width_ns[new]))


def test_extra_echoes_are_in_order_and_the_smallest_falls_out_of_a_full_beam() -> None:
    around = Around(wall(2, 40.0))
    scan = echoes(
        [(0, 0), (0, 0), (0, 0), (0, 1)], [1, 2, 3, 1], [10.0, 40.0, 250.0, 40.0], [100.0, 900.0, 11.0, 900.0]
    )
    certain = {"covariate": "layer", "knots": [0], "values": [1]}
    where = {"range_from": "sensor", "range_knots": [20, 30], "range_density": [1]}
    strong = {"peak_quantiles": [50], "area_quantiles": [500], "width_quantiles": [12]}
    found = out("empirical_extra", around, scan, **certain, **where, **strong)
    assert found.point.tolist() == [0, 0, 0, 1, 1]
    assert found.echo_number.tolist() == [1, 2, 3, 1, 2]
    assert found.area.tolist() == [100, 500, 900, 500, 900]
    assert found.extra["mark"].tolist() == [0, 0, 1, 0, 3]
    weak = {"peak_quantiles": [10], "area_quantiles": [10], "width_quantiles": [1]}
    found = out("empirical_extra", around, scan, **certain, **where, **weak)
    assert found.area.tolist() == [100, 900, 11, 10, 900]
    assert found.echo_number.tolist() == [1, 2, 3, 1, 2]


def test_a_beam_that_meets_nothing_gains_an_echo_only_where_no_surface_is_needed() -> None:
    around = Around(wall(500, 0.0))
    scan = scan_of(around).take(np.zeros(0, dtype=int))
    certain = {"covariate": "layer", "knots": [0], "values": [1]}
    assert len(out("empirical_extra", around, scan, **certain, **ANYWHERE, **STRENGTH)) == 500
    for behind in ("surface", "ratio"):
        where = ANYWHERE | {"range_from": behind}
        assert len(out("empirical_extra", around, scan, **certain, **where, **STRENGTH)) == 0
    beyond = ANYWHERE | {"range_knots": [301, 302]}
    assert len(out("empirical_extra", around, scan, **certain, **beyond, **STRENGTH)) == 0


def test_a_beam_s_draws_do_not_depend_on_the_others() -> None:
    around = Around(wall(300))
    scan = scan_of(around)
    some = scan.take(np.arange(len(scan)) % 3 == 0)
    for name in ("empirical_loss", "empirical_spread", "empirical_amplitude"):
        settings = {"covariate": "layer", "knots": [0], "values": [0.5]}
        whole, part = out(name, around, scan, **settings), out(name, around, some, **settings)
        rows = np.isin(whole.layer * 960 + whole.point, some.layer * 960 + some.point)
        assert all(np.array_equal(getattr(whole.take(rows), c), getattr(part, c)) for c in COLUMNS)


FAULTS = {
    'covariate = "rnge_m"\nknots = [1]\nvalues = [1]': (
        3,
        "empirical_range: covariate = 'rnge_m' is not a valid choice; did you mean range_m?",
    ),
    'covariate = "colour"\nknots = [1]\nvalues = [1]': (
        3,
        "empirical_range: covariate = 'colour' is not a valid choice; use one of range_m, layer, point, ",
    ),
    'covariate = "layer"\nknots = [1, 2]\nvalues = [1]': (
        5,
        "values has 1 numbers for 2 knots; give each knot a value",
    ),
    'covariate = "layer"\nknots = [1, 1]\nvalues = [1, 2]': (
        4,
        "knots[1] = 1 is not above the one before, 1; put them in ascending order, each once",
    ),
    'covariate = "layer"\nknots = [1]\nvalues = [101]': (
        5,
        "values[0] = 101 is out of range; use a list of numbers from -100 to 100 m",
    ),
    'covariate = "layer"\nknots = 3\nvalues = [1]': (4, "knots = 3 is no list; use a list of numbers from "),
    'covariate = "layer"\nknots = [1]\nvalues = [true]': (5, "values[0] = True is no number; use a list of numbers "),
    'covariate = "layer"\nknots = [1]\nvalues = [nan]': (5, "values[0] = nan is out of range; "),
    "knots_2 = [1]\nvalues_2 = [1]": (3, "knots_2 stands without covariate_2; give covariate_2, knots_2, values_2 "),
    'covariate = "layer"': (3, "covariate stands without knots and values; "),
    'covariat = "layer"': (3, "empirical_range has no parameter 'covariat'; did you mean covariate?"),
}


@pytest.mark.parametrize(("lines", "says"), FAULTS.items())
def test_what_is_wrong_in_a_model_file_is_said_with_its_line(lines: str, says: tuple[int, str], tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text(f'variant = "SMART"\n[[effects]]\n{lines}\nname = "empirical_range"\n', encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_model(path)
    (fault,) = caught.value.faults
    assert fault.line == says[0]
    assert says[1] in fault.lines()[0]
    assert fault.fix


def test_extra_echoes_that_cannot_be_drawn_are_refused() -> None:
    certain = {"covariate": "layer", "knots": [0], "values": [1]}
    good = certain | ANYWHERE | STRENGTH
    for wrong, says in (
        ({"range_from": None}, "range_from is missing"),
        ({"width_quantiles": []}, "width_quantiles is missing"),
        ({"area_quantiles": [5, 4]}, "area_quantiles decreases"),
        ({"range_density": [1, 2]}, "range_density has 2 numbers for 1 steps"),
        ({"range_density": [0]}, "range_density is 0 everywhere"),
    ):
        with pytest.raises(UsageError, match=says):
            effects.make("empirical_extra", good | wrong)


@st.composite
def terms(draw: st.DrawFn) -> effects.Effect:
    """Any empirical term that a file may hold."""
    name = draw(st.sampled_from(NAMES))
    kind = effects.find(name)
    assert issubclass(kind, Additive)
    values: dict[str, object] = {}
    for suffix in kind.suffixes:
        knots = draw(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=4, unique=True))
        if draw(st.booleans()):
            known = COVARIATES if name in OF_LIGHT else ECHO_COVARIATES
            values[f"covariate{suffix}"] = draw(st.sampled_from(known))
            values[f"knots{suffix}"] = sorted(knots)
            values[f"values{suffix}"] = draw(st.lists(st.floats(-1, 1), min_size=len(knots), max_size=len(knots)))
    return effects.make(name, (values | ANYWHERE | STRENGTH) if name == "empirical_extra" else values)


@settings(max_examples=examples(60), deadline=None)
@given(chosen=terms())
def test_what_is_saved_loads_as_the_same_term(tmp_path_factory: pytest.TempPathFactory, chosen: effects.Effect) -> None:
    path = tmp_path_factory.getbasetemp() / "terms.toml"
    model = Model(Sensor.of("SMART"), {}, (chosen,), file=path)
    save_model(model, path)
    assert load_model(path) == model


def test_arrays_and_lists_make_the_same_term() -> None:
    one = effects.make("empirical_range", {"covariate": "layer", "knots": np.array([1.0, 2.0]), "values": [0, 1]})
    other = effects.make("empirical_range", {"covariate": "layer", "knots": (1, 2), "values": np.array([0.0, 1.0])})
    assert one == other
    assert hash(one) == hash(other)
    assert one.settings() == {"covariate": "layer", "knots": (1.0, 2.0), "values": (0.0, 1.0)}


def test_the_commands_show_them_apart(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["effects"]) == 0
    listed, apart = capsys.readouterr().out.split("\nempirical: describes, does not explain\n")
    assert not any(name in listed for name in NAMES)
    assert [line.split()[0] for line in apart.splitlines()[1:]] == NAMES
    path = tmp_path / "model.toml"
    for name in NAMES:
        assert main(["effects", name, "--no-plot"]) == 0
        text = capsys.readouterr().out
        assert text.startswith(f"{name} (")
        assert "empirical: describes, does not explain)" in text.splitlines()[0]
        path.write_text(f'variant = "SMART"\n{text.split("In a model file:")[1]}', encoding="utf-8")
        (made,) = load_model(path).effects
        assert made == effects.make(name, effects.find(name).example())
        assert main(["info", str(path)]) == 0
        told = capsys.readouterr().out
        assert "effects          none" in told
        assert f"{name}: covariate: " in told
    assert main(["effects", "--json"]) == 0
    assert [entry["name"] for entry in json.loads(capsys.readouterr().out)] == list(effects.catalogue())
    assert main(["effects", "empirical_loss", "--json", "--no-plot"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["empirical"] is True
    assert facts["lists"]["values"]["high"] == 1.0
    assert "area_log10" in facts["choices"]["covariate"]["choices"]
    assert main(["effects", "empirical_loss", "--set", "values=1"]) == 2
    assert capsys.readouterr().err.startswith("error: --set values is a list; ")
