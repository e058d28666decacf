"""Corners of single effects: clipped thresholds, scatters added up, one-sided tables, drops behind fog."""

import numpy as np
import pytest

from effect_kit import Around, lit, wall
from lidarcheck import effects
from lidarcheck.effects.base import Curve
from lidarcheck.errors import UsageError
from lidarcheck.model import Model, simulate
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Material, Sensor

MATERIALS = {1: Material("wall", 0.4), 2: Material("sign", 0.8, "retro", 1000.0)}


def test_a_threshold_below_zero_is_zero() -> None:
    ideal = IdealScan(np.arange(300), np.full(300, 5), np.full(300, 90.0), np.ones(300), np.zeros(300))
    quiet = Sensor.of("SMART", background_per_ns=0.0)
    low = Model(quiet, MATERIALS, (effects.make("threshold", {"shift": -100}),))
    none = Model(Sensor.of("SMART", background_per_ns=0.0, threshold=0), MATERIALS)
    assert simulate(ideal, low, seed=1).area.tobytes() == simulate(ideal, none, seed=1).area.tobytes()


def test_normal_and_uniform_jitter_add_their_variances_and_echoes_scatter_apart() -> None:
    n = 20_000
    layer, point = np.divmod(np.arange(n), 900)
    double = IdealScan(
        np.repeat(layer, 2), np.repeat(point, 2), np.tile([20.0, 60.0], n), np.tile([1, 3], n), np.zeros(2 * n)
    )
    still = Model(Sensor.of("SLIM", range_resolution_m=0.0), {**MATERIALS, 3: Material("bright", 1.0)})
    shaken = still.with_(effects.make("timing_jitter", {"sigma_ns": 2.0, "uniform_ns": 4.0}))
    plain, moved = (simulate(double, model, seed=4) for model in (still, shaken))
    both = np.bincount(plain.layer * 960 + plain.point)[plain.layer * 960 + plain.point] == 2
    off_ns = ((moved.range_m - plain.range_m) / 0.149896229)[both].reshape(-1, 2)
    assert off_ns.var(axis=0) == pytest.approx(2.0**2 + 4.0**2 / 3.0, rel=0.05)
    assert abs(np.corrcoef(off_ns.T)[0, 1]) < 0.03


def test_a_vertical_table_without_negative_x_blooms_upward_only() -> None:
    layers = np.arange(200, 301)
    material = np.where(layers == 250, 2, 1)
    ideal = IdealScan(layers, np.full(101, 7), np.where(layers == 250, 50.0, 0.0), material, np.zeros(101))
    curve = Curve((0.0, 60.0), (1.0, 0.01), "lut.ini")
    bloom = effects.make("blooming_vertical", {"lut": curve})
    lightened = lit(bloom, Around(ideal, materials=MATERIALS))
    reached = lightened.layer[np.unique(lightened.pulse_beam[lightened.pulse_signal > 0.0])]
    assert reached.tolist() == list(range(250, 271))


def test_drops_behind_fog_are_dimmed_by_it() -> None:
    around = Around(wall(4000))
    rain = effects.make("rain", {"drop_echo": 300.0})
    clear = lit(rain, around)
    fog = effects.make("fog", {"mor_m": 60.0})
    foggy = rain.light(lit(fog, around), around)  # type: ignore[attr-defined]
    drops = [light.rows() < 0 for light in (clear, foggy)]
    assert np.array_equal(clear.pulse_range_m[drops[0]], foggy.pulse_range_m[drops[1]])
    dimmed = foggy.pulse_signal[drops[1]] / clear.pulse_signal[drops[0]]
    assert dimmed == pytest.approx(0.05 ** (2.0 * clear.pulse_range_m[drops[0]] / 60.0), rel=1e-9)


@pytest.mark.parametrize("name", ["crosstalk", "afterpulsing"])
def test_what_can_be_set_once_only_is_refused_twice(name: str) -> None:
    once = effects.make(name, {}).detector(Sensor.of("SMART"))  # type: ignore[attr-defined]
    with pytest.raises(UsageError, match=f"{name} stands in the model twice"):
        effects.make(name, {}).detector(once)  # type: ignore[attr-defined]


def test_two_spreads_of_the_dead_time_add_up_as_variances() -> None:
    sensor = Sensor.of("SMART")
    for spread_ns in (3.0, 4.0):
        settings = {"shift_ns": 1.0, "spread_ns": spread_ns, "recovery_ns": spread_ns}
        sensor = effects.make("dead_time", settings).detector(sensor)  # type: ignore[attr-defined]
    assert sensor.nonideal.dead_spread_ns == pytest.approx(5.0)
    assert sensor.nonideal.dead_recovery_ns == pytest.approx(7.0)
    assert sensor.dead_bins == 14
