"""Effects: the catalogue, what each one does, and what it must leave alone."""

import dataclasses
import inspect
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from lidarcheck import effects
from lidarcheck.effects.base import STAGES
from lidarcheck.effects.shared.ranges import moved_light
from lidarcheck.errors import UsageError
from lidarcheck.model import Model, simulate
from lidarcheck.scan import Haze, IdealScan, Light, Scan
from lidarcheck.sensor import Material, Sensor
from reference_grid import beam_directions

FloatArray = npt.NDArray[np.float64]

IDENTITY: dict[str, dict[str, float]] = {
    "beam_divergence": {"vertical_deg": 0.0, "horizontal_deg": 0.0},
    "boresight": {"yaw_deg": 0.0, "pitch_deg": 0.0, "roll_deg": 0.0},
    "motion": {"forward_m_s": 0.0, "left_m_s": 0.0, "up_m_s": 0.0, "yaw_deg_s": 0.0, "objects": 0.0},
    "vibration": {"pitch_deg": 0.0, "yaw_deg": 0.0, "random_deg": 0.0},
    "ambient_light": {"rate_per_ns": 0.0},
    "blockage": {"transmission": 1.0},
    "blooming_horizontal": {"strength": 0.0},
    "blooming_vertical": {"strength": 0.0},
    "dark_counts": {"rate_per_ns": 0.0},
    "fog": {"mor_m": 1e6},
    "incidence_falloff": {"exponent": 1.0},
    "interference": {"share": 0.0},
    "layer_gain": {"gain": 1.0},
    "material_reflectance": {"factor": 1.0},
    "mirror_multipath": {"reflectivity": 0.0, "grazing": 0.0},
    "pulse_shape": {"stretch": 1.0, "tail_share": 0.0},
    "rain": {"rate_mm_h": 0.0},
    "retro_ghost": {"strength": 0.0},
    "signal_gain": {"gain": 1.0},
    "afterpulsing": {"probability": 0.0},
    "crosstalk": {"sides": 0.0, "corners": 0.0},
    "dead_time": {"shift_ns": 0.0, "spread_ns": 0.0},
    "threshold": {"shift": 0},
    "dropout": {"share": 0.0},
    "range_offset": {"offset_m": 0.0},
    "range_scale": {"fraction": 0.0},
    "timing_jitter": {"sigma_ns": 0.0, "uniform_ns": 0.0},
    "walk_error": {"per_decade_m": 0.0, "bend_m": 0.0},
}
COLUMNS = ("x_m", "y_m", "z_m", "layer", "point", "echo_number", "width_ns", "area", "peak")


@pytest.fixture(scope="module")
def ideal() -> IdealScan:
    layer, point = np.divmod(np.arange(5000), 100)
    distance = np.random.default_rng(0).uniform(20, 120, 5000)
    return IdealScan(layer + 240, point + 400, distance, np.ones(5000), np.zeros(5000))


@pytest.fixture(scope="module")
def street() -> IdealScan:
    """Something for every effect: a wall that turns away before level ground, a traffic sign, and sky."""
    layer, point = (grid.ravel() for grid in np.meshgrid(np.arange(200, 300), np.arange(440, 520), indexing="ij"))
    direction = beam_directions(layer, point)
    normal = np.array([-np.cos(0.6), -np.sin(0.6), 0.0])
    wall_m = 25.0 * np.cos(0.6) / -(direction @ normal)
    ground_m = np.where(direction[:, 2] < 0.0, 0.7 / -direction[:, 2].clip(max=-1e-9), np.inf)
    ground = ground_m < wall_m
    distance = np.where(layer < 290, np.minimum(ground_m, wall_m), 0.0)
    cosine = np.where(ground, -direction[:, 2], -(direction @ normal))
    sign = (abs(layer - 265) < 4) & (abs(point - 480) < 4)
    incidence = np.rad2deg(np.arccos(cosine.clip(0.0, 1.0)))
    return IdealScan(layer, point, distance, np.where(sign, 2, 1), incidence, object_id=np.where(ground, 1, 2))


def model(*chosen: effects.Effect, variant: str = "SMART") -> Model:
    materials = {1: Material("wall", 0.4), 2: Material("sign", 0.8, "retro", 1000.0)}
    return Model(Sensor.of(variant), materials, tuple(chosen))


def same(one: Scan, other: Scan) -> bool:
    return all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in COLUMNS)


def test_the_catalogue_finds_every_file() -> None:
    assert set(effects.catalogue()) == set(IDENTITY)
    stages = [STAGES.index(effect.stage) for effect in effects.catalogue().values()]
    assert stages == sorted(stages)


@pytest.mark.parametrize("name", IDENTITY)
def test_every_effect_is_documented_and_bounded(name: str) -> None:
    effect = effects.find(name)
    text = inspect.getdoc(effect) or ""
    assert len(text.splitlines()) > 2
    assert "Identity" in text
    assert dataclasses.is_dataclass(effect)
    for parameter in effect.parameters():
        assert parameter.low <= parameter.typical <= parameter.high
        assert parameter.meaning
        for outside in (parameter.low - 1, parameter.high + 1, float("nan"), True, "1"):
            with pytest.raises(UsageError, match=rf"{name}: {parameter.name} = .* is (out of range|no number)"):
                effects.make(name, {parameter.name: outside})


@pytest.mark.parametrize("name", IDENTITY)
@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_zero_strength_is_the_identity_and_a_typical_one_is_not(name: str, variant: str, street: IdealScan) -> None:
    plain = simulate(street, model(variant=variant), seed=3)
    assert same(plain, simulate(street, model(effects.make(name, IDENTITY[name]), variant=variant), seed=3))
    changed = simulate(street, model(effects.make(name, {}), variant=variant), seed=3)
    assert not same(plain, changed)
    assert np.isfinite(changed.x_m).all()


def test_taking_one_out_leaves_all_other_draws(ideal: IdealScan) -> None:
    both = model(effects.make("dropout", {"share": 0.3}), effects.make("range_offset", {"offset_m": 0.5}))
    one = simulate(ideal, both.without("range_offset"), seed=5)
    two = simulate(ideal, both, seed=5)
    assert np.array_equal(one.layer * 960 + one.point, two.layer * 960 + two.point)
    assert np.array_equal(one.area, two.area)


def test_signal_gain_is_a_factor_on_the_range_equation(ideal: IdealScan) -> None:
    louder = dataclasses.replace(model(), materials={1: Material("wall", 0.6)})
    assert same(
        simulate(ideal, model(effects.make("signal_gain", {"gain": 1.5})), seed=1), simulate(ideal, louder, seed=1)
    )


def test_dark_counts_add_to_the_background(ideal: IdealScan) -> None:
    noisy = model().with_sensor(background_per_ns=0.0013)
    dark = model(effects.make("dark_counts", {"rate_per_ns": 0.001}))
    assert same(simulate(ideal, dark, seed=1), simulate(ideal, noisy, seed=1))


def test_threshold_shifts_the_sensor_s_own(ideal: IdealScan) -> None:
    shifted = simulate(ideal, model(effects.make("threshold", {"shift": 4})), seed=1)
    assert same(shifted, simulate(ideal, model().with_sensor(threshold=13), seed=1))
    assert shifted.peak.min() == 14


def test_a_dead_layer_is_silent_and_its_neighbours_are_not(ideal: IdealScan) -> None:
    dead = simulate(
        ideal, model(effects.make("layer_gain", {"gain": 0, "first_layer": 250, "last_layer": 251})), seed=1
    )
    plain = simulate(ideal, model(), seed=1)
    silent = (plain.layer == 250) | (plain.layer == 251)
    assert silent.sum() > 100
    assert same(dead, plain.take(~silent))


def test_ranges_move_along_the_beam(ideal: IdealScan) -> None:
    plain = simulate(ideal, model(), seed=1)
    moved = simulate(ideal, model(effects.make("range_offset", {"offset_m": -0.25})), seed=1)
    assert moved.range_m == pytest.approx(plain.range_m - 0.25, abs=0.01001)
    assert np.mean(moved.range_m - plain.range_m) == pytest.approx(-0.25, abs=2e-4)
    assert moved.y_m / moved.x_m == pytest.approx(plain.y_m / plain.x_m)
    scaled = simulate(ideal, model(effects.make("range_scale", {"fraction": 0.01})), seed=1)
    assert scaled.range_m == pytest.approx(plain.range_m * 1.01, abs=0.01001)


@pytest.mark.parametrize(("name", "settings", "error_m"), [
    ("range_offset", {"offset_m": -0.25}, lambda r: np.full(len(r), -0.25)),
    ("range_scale", {"fraction": 0.01}, lambda r: 0.01 * r),
])  # fmt: skip
def test_moving_the_light_moves_ranges_by_as_much_on_average_and_counts_it_anew(
    ideal: IdealScan, name: str, settings: dict[str, float], error_m: Callable[[FloatArray], FloatArray]
) -> None:
    plain = simulate(ideal, model(), seed=1)
    moved = simulate(ideal, model(effects.make(name, {**settings, "moves": "light"})), seed=1)
    keys = [scan.layer * 960 + scan.point for scan in (plain, moved)]
    (one, other), lone = zip(*(np.unique(k, return_index=True) for k in keys), strict=True)
    _, mine, theirs = np.intersect1d(one, other, return_indices=True)
    before, after = plain.take(lone[0][mine]), moved.take(lone[1][theirs])
    assert len(mine) > 0.9 * len(one)
    off = after.range_m - before.range_m - error_m(before.range_m)
    assert np.median(off) == pytest.approx(0.0, abs=0.02)
    assert not np.array_equal(after.area, before.area)  # other photons fall into a bin
    assert np.median(np.log(after.area / before.area)) == pytest.approx(0.0, abs=0.02)


def test_what_moves_decides_the_stage() -> None:
    light, echoes = (effects.make("range_offset", {"offset_m": 0.1, "moves": one}) for one in ("light", "echoes"))
    assert [one.stage for one in (light, echoes, effects.make("range_offset", {}))] == ["light", "readout", "readout"]
    assert effects.find("range_offset").stage == "readout"
    built = model(effects.make("threshold", {})).with_(light)
    assert [effect.name for effect in built.effects] == ["range_offset", "threshold"]
    with pytest.raises(UsageError, match=r"range_offset \(stage light\) stands behind threshold \(stage detector\)"):
        effects.check_order([effects.make("threshold", {}), light])
    with pytest.raises(UsageError, match="use one of echoes, light"):
        effects.make("range_offset", {"moves": "sensors"})


@pytest.mark.parametrize(("factor", "offset_m"), [(1.0, 2.0), (1.0, -1.3), (1.02, 0.0), (0.97, 0.4)])
def test_moved_haze_keeps_its_light_and_moves_its_middle(factor: float, offset_m: float) -> None:
    step_m, cells = 0.1, 900
    middle_m = (np.arange(cells) + 0.5) * step_m
    density = np.exp(-(((middle_m - 40.0) / 8.0) ** 2))
    one = np.array([0.5])
    haze = Haze(step_m, density, np.array([0, 1]), np.array([60.0]), one)
    beam = Light(np.array([250]), np.array([480]), 1e-4 * one, np.array([0, 2]), np.array([1.0, 50.0]), np.ones(2))
    moved = moved_light(replace(beam, haze=haze), factor, offset_m)
    assert moved.pulse_range_m == pytest.approx(np.maximum(factor * beam.pulse_range_m + offset_m, 0.0))
    assert moved.pulse_signal.tolist() == [float(factor + offset_m >= 0.0), 1.0]
    assert moved.haze is not None
    there_m = (np.arange(len(moved.haze.density_per_m)) + 0.5) * step_m
    total, after = density.sum(), moved.haze.density_per_m.sum()
    assert after == pytest.approx(total, rel=1e-4)
    assert (there_m * moved.haze.density_per_m).sum() / after == pytest.approx(
        factor * (middle_m * density).sum() / total + offset_m, abs=1e-3
    )
    assert moved.haze.row_end_m == pytest.approx([factor * 60.0 + offset_m])


def test_dropout_takes_whole_beams_and_the_share_it_says(ideal: IdealScan) -> None:
    plain = simulate(ideal, model(), seed=1)
    assert len(simulate(ideal, model(effects.make("dropout", {"share": 1})), seed=1)) == 0
    left = simulate(ideal, model(effects.make("dropout", {"share": 0.25})), seed=1)
    kept, all_ = (np.unique(scan.layer * 960 + scan.point) for scan in (left, plain))
    assert same(left, plain.take(np.isin(plain.layer * 960 + plain.point, kept)))
    assert abs(len(kept) - 0.75 * len(all_)) < 4 * np.sqrt(0.25 * 0.75 * len(all_))


def test_unknown_names_and_orders_are_refused_with_the_nearest_valid_one() -> None:
    with pytest.raises(UsageError, match="no effect 'range_ofset'; did you mean range_offset"):
        effects.make("range_ofset", {})
    with pytest.raises(UsageError, match="dropout has no parameter 'shard'; did you mean share"):
        effects.make("dropout", {"shard": 0.1})
    with pytest.raises(UsageError, match=r"signal_gain \(stage light\) stands behind dropout \(stage readout\)"):
        effects.check_order([effects.make("dropout", {}), effects.make("signal_gain", {})])


def test_an_effect_takes_its_place_on_the_light_s_way() -> None:
    built = model()
    for name in ("dropout", "signal_gain", "threshold", "dark_counts"):
        built = built.with_(effects.make(name, {}))
    assert [effect.name for effect in built.effects] == ["signal_gain", "dark_counts", "threshold", "dropout"]
    effects.check_order(built.effects)
    other = built.without("threshold").without("fog").with_(effects.make("dropout", {"share": 0.5}))
    assert other.effects[-1].settings()["share"] == 0.5


def test_ranges_are_rounded_once_behind_all_readout_effects(ideal: IdealScan) -> None:
    plain = simulate(ideal, model().with_sensor(range_resolution_m=0.0), seed=2)
    twice = (effects.make("range_offset", {"offset_m": 0.004}), effects.make("range_scale", {"fraction": 1e-4}))
    moved = simulate(ideal, model(*twice), seed=2)
    exact = (plain.range_m + 0.004) * (1.0 + 1e-4)
    assert moved.range_m == pytest.approx(np.rint(exact / 0.01) * 0.01, abs=1e-9)
    half = simulate(ideal, model(*twice).with_sensor(range_resolution_m=0.5), seed=2)
    assert half.range_m == pytest.approx(np.rint(exact / 0.5) * 0.5, abs=1e-9)


def test_no_echo_is_reported_behind_the_sensor(ideal: IdealScan) -> None:
    noisy = model().with_sensor(background_per_ns=0.006)
    plain = simulate(ideal, noisy, seed=1)
    moved = simulate(
        ideal, dataclasses.replace(noisy, effects=(effects.make("range_offset", {"offset_m": 0.01}),)), seed=1
    )
    for scan in (plain, moved):
        assert scan.x_m.min() >= 0.0
        same_beam = (np.diff(scan.layer) == 0) & (np.diff(scan.point) == 0)
        assert (np.diff(scan.range_m)[same_beam] >= 0.0).all()
    assert (plain.range_m < 0.3).any()
