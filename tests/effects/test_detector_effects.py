"""Crosstalk, afterpulsing and dead time as effects: what they set, what they show in the data, what they refuse."""

import numpy as np
import pytest
from scipy import stats

from detector_kit import dark_flash, features, follow, light
from lidarcheck import effects
from lidarcheck.errors import UsageError
from lidarcheck.model import chain, detection
from lidarcheck.model.detectors.simulate import draw_avalanches
from lidarcheck.scan import Scan
from lidarcheck.sensor import NonIdeal, Sensor

IDENTITY: dict[str, dict[str, float]] = {
    "crosstalk": {"sides": 0.0, "corners": 0.0},
    "afterpulsing": {"probability": 0.0},
    "dead_time": {"shift_ns": 0.0, "spread_ns": 0.0},
}
COLUMNS = ("x_m", "y_m", "z_m", "layer", "point", "echo_number", "width_ns", "area", "peak")
"""The surroundings: these effects ask for nothing."""


def behind(sensor: Sensor, name: str, **parameters: float) -> Sensor:
    return effects.make(name, parameters).detector(sensor)  # type: ignore[attr-defined, no-any-return]


@pytest.mark.parametrize("name", IDENTITY)
def test_zero_strength_is_the_same_sensor(name: str) -> None:
    sensor = Sensor.of("SMART")
    assert behind(sensor, name, **IDENTITY[name]) is sensor
    assert behind(sensor, name) != sensor


def test_the_effects_keep_each_other_s_numbers() -> None:
    sensor = Sensor.of("SLIM")
    sensor = behind(sensor, "crosstalk", sides=0.1, corners=0.05)
    sensor = behind(sensor, "afterpulsing", probability=0.02, delay_ns=7, slow_share=0.4, slow_delay_ns=50)
    sensor = behind(sensor, "dead_time", shift_ns=3, spread_ns=1.5)
    assert sensor.nonideal == NonIdeal(0.1, 0.05, 0.02, 7.0, 0.4, 50.0, 1.5)
    assert sensor.dead_bins == 15
    assert sensor == behind(behind(behind(sensor, "afterpulsing", probability=0), "crosstalk", sides=0, corners=0),
                            "dead_time", shift_ns=0, spread_ns=0)  # fmt: skip


def test_a_shift_of_the_dead_time_alone_leaves_the_exact_chain() -> None:
    sensor = behind(Sensor.of("SMART"), "dead_time", shift_ns=4, spread_ns=0)
    assert sensor.dead_bins == 16
    assert not sensor.nonideal.any


def test_a_shift_is_rounded_to_whole_bins() -> None:
    fine = Sensor.of("SMART", bin_ns=0.5, on_bins=18, dead_bins=24)
    for shift_ns, bins in [(0.24, 0), (0.26, 1), (-0.26, -1), (1.0, 2), (-3.0, -6), (0.75, 2)]:
        assert behind(fine, "dead_time", shift_ns=shift_ns, spread_ns=0).dead_bins == 24 + bins
    assert behind(fine, "dead_time", shift_ns=0.2, spread_ns=0) is fine


@pytest.mark.parametrize("shift_ns", [-4.0, 989.0])
def test_a_dead_time_that_cannot_be_is_refused_with_the_effect_s_own_range(shift_ns: float) -> None:
    with pytest.raises(UsageError, match=r"dead_time: shift_ns = .* makes a dead time of .* ns") as caught:
        behind(Sensor.of("SMART"), "dead_time", shift_ns=shift_ns)
    assert "from -3 to 988 ns" in str(caught.value.fix)


@pytest.mark.parametrize(
    ("name", "parameter", "outside"),
    [
        ("crosstalk", "sides", 0.61),
        ("crosstalk", "corners", -0.01),
        ("afterpulsing", "probability", 1.0),
        ("afterpulsing", "slow_share", 1.1),
        ("afterpulsing", "delay_ns", float("nan")),
        ("dead_time", "spread_ns", -1.0),
    ],
)
def test_parameters_out_of_range_are_named(name: str, parameter: str, outside: float) -> None:
    with pytest.raises(UsageError, match=f"{name}: {parameter} = .* is out of range"):
        effects.make(name, {parameter: outside})


def test_typical_crosstalk_lifts_weak_echoes_by_what_neighbours_add() -> None:
    """3 x 21 SPADs have 3.0 sides and 2.5 corners on average, of 4 each: AREA and the rate of detection grow."""
    sensor = Sensor.of("SLIM", max_range_m=40.0)
    beams = light(0.12, 6000, range_m=20.0)
    plain, joined = (features(follow(beams, s), s) for s in (sensor, behind(sensor, "crosstalk")))
    per_avalanche = 0.035 * (2 * 3 * 20 + 2 * 2 * 21) / 63 / 4 + 0.017 * (2 * 4 * 20) / 63 / 4
    counts = [draw_avalanches(beams, s).sum() for s in (sensor, behind(sensor, "crosstalk"))]
    assert counts[1] / counts[0] - 1.0 == pytest.approx(per_avalanche, rel=0.15)
    assert stats.ttest_ind(joined[:, 3], plain[:, 3], alternative="greater").pvalue < 1e-6


def test_typical_afterpulsing_gives_bright_echoes_a_second_one() -> None:
    sensor = Sensor.of("SLIM", max_range_m=40.0)
    beams = light(8.0, 2000, range_m=20.0)
    plain, later = (follow(beams, s).held for s in (sensor, behind(sensor, "afterpulsing")))
    assert (plain > 1).mean() < 0.01
    assert (later > 1).mean() > 0.1


def test_the_typical_dead_time_widens_bright_echoes_and_not_weak_ones() -> None:
    sensor = Sensor.of("SMART", max_range_m=40.0)
    changed = behind(sensor, "dead_time")
    bright, weak = (
        [features(follow(light(signal, 4000, range_m=20.0), s), s)[:, 3].mean() for s in (sensor, changed)]
        for signal in (40.0, 0.3)
    )
    assert bright[1] > 1.05 * bright[0]
    assert weak[1] == pytest.approx(weak[0], rel=0.02)


@pytest.mark.parametrize("name", ["crosstalk", "afterpulsing", "dead_time"])
def test_no_light_and_no_beams_are_no_trouble(name: str) -> None:
    sensor = behind(Sensor.of("SMART"), name)
    assert follow(light(0.0, 50, background=0.0), sensor).held.sum() == 0
    assert len(chain.echoes_of(light(0.0, 0), sensor)) == 0
    assert np.isfinite(features(follow(dark_flash(50), sensor), sensor)).all()


@pytest.mark.parametrize("names", [("dead_time",), ("crosstalk", "afterpulsing")])
def test_the_chain_follows_such_detectors_one_by_one(names: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    sensor = Sensor.of("SMART")
    for name in names:
        sensor = behind(sensor, name)
    beams = light(2.0, 400, range_m=30.0)
    ours = features(follow(beams, sensor, seed=17), sensor)
    scan = chain.echoes_of(beams, sensor, seed=17, threads=1)
    assert np.array_equal(ours[:, 3], scan.area)
    assert np.array_equal(ours[:, 4], scan.peak)
    monkeypatch.setattr(detection, "_CHUNK", 37)
    again = chain.echoes_of(beams, sensor, seed=17, threads=2)
    assert all(same_column(scan, again, column) for column in COLUMNS)


def same_column(one: Scan, other: Scan, column: str) -> bool:
    return bool(getattr(one, column).tobytes() == getattr(other, column).tobytes())
