"""The fast path against the exact chain: about a million beams, each feature and all together; closed forms; limits."""

from collections.abc import Iterator

import numpy as np
import pytest
from scipy import stats

from fast_kit import FRAME, SMALL, feature_p_values, joint_p_value, mean_p_values, plant, sample, small_library
from lidarcheck.model import echoes_of
from lidarcheck.model.fast.fill import Source
from lidarcheck.model.fast.library import affordable
from lidarcheck.scan import Light
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, Sensor
from reference_grid import POINTS

LEVEL = 1e-4
"""Chance that a true agreement is called none, for each case and kind of test."""


@pytest.fixture(scope="module", autouse=True)
def _library(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with small_library(tmp_path_factory.mktemp("library")):
        yield


def light(signal: float | np.ndarray, n: int, *, range_m: float | np.ndarray = 20.0, background: float = 3e-4) -> Light:
    """`n` beams with one pulse each."""
    layer, point = np.divmod(np.arange(n), POINTS)
    return Light(
        layer=layer,
        point=point,
        background_per_ns=np.full(n, background),
        first_pulse=np.arange(n + 1),
        pulse_range_m=np.broadcast_to(range_m, n),
        pulse_signal=np.broadcast_to(signal, n),
    )


@pytest.mark.parametrize(
    ("variant", "background", "frames", "planted"),
    [
        ("SMART", 3e-4, 2, ("detected", "width", "area", "peak", "range")),
        ("SLIM", 3e-4, 2, ()),
        ("SMART", 1.2e-3, 1, ()),
        ("SLIM", 0.0, 1, ()),
    ],
)
def test_a_million_beams_are_those_of_the_exact_chain(
    variant: str, background: float, frames: int, planted: tuple[str, ...]
) -> None:
    """And a change of any mean by 1 %, planted in the library, is called one."""
    sensor = Sensor.of(variant)
    exact = sample(sensor, background, "exact", 5, frames)
    ours = sample(sensor, background, "fast", 6, frames)
    means, features = mean_p_values(ours, exact), feature_p_values(ours, exact)
    assert len(features) > 60
    assert min(means.values()) > LEVEL / len(means), means
    assert min(features.values()) > LEVEL / len(features), min(features.items(), key=lambda item: item[1])
    assert joint_p_value(ours, exact) > LEVEL
    for feature in planted:
        plant(feature)
        wrong = sample(sensor, background, "fast", 6, frames)
        assert mean_p_values(wrong, exact, (feature,))[feature] < LEVEL / len(means), feature


@pytest.mark.parametrize(("variant", "background"), [("SMART", 1.3e-3), ("SLIM", 5.5e-4)])
def test_what_background_alone_makes_is_as_frequent_and_looks_alike(variant: str, background: float) -> None:
    """Some thousandths of all beams have such an echo; half of these get a pulse too, one that is hardly seen."""
    sensor = Sensor.of(variant)
    n = 300_000
    signal = np.where(np.arange(n) % 2 == 0, 0.0, 1e-3)
    beams = light(signal, n, range_m=60.0, background=background)
    ours, exact = (echoes_of(beams, sensor, seed=3, rounded=False, fidelity=fidelity) for fidelity in ("fast", "exact"))
    assert min(len(ours), len(exact)) > 800
    assert stats.binomtest(len(ours), len(ours) + len(exact)).pvalue > LEVEL
    names = ("range_m", "width_ns", "area", "peak", "echo_number")
    p_values = {name: stats.ks_2samp(getattr(ours, name), getattr(exact, name)).pvalue for name in names}
    assert min(p_values.values()) > LEVEL / len(p_values), p_values


def test_bright_beams_keep_their_echoes_beside_those_of_background() -> None:
    sensor = Sensor.of("SMART", background_per_ns=1.3e-3)
    n = 200_000
    beams = light(1.0, n, range_m=60.0, background=1.3e-3)
    ours = echoes_of(beams, sensor, seed=1, fidelity="fast")
    several, expected = (np.count_nonzero(scan.echo_number == 2) for scan in (ours, echoes_of(beams, sensor, seed=1)))
    assert several > 400
    assert stats.binomtest(several, several + expected).pvalue > LEVEL
    key = ours.layer.astype(np.int64) * POINTS + ours.point
    assert np.all(np.diff(key) >= 0)
    assert np.all(np.diff(ours.range_m)[np.diff(key) == 0] >= 0.0)
    assert np.unique(key).size == n


def test_no_light_no_echo() -> None:
    quiet = Sensor.of("SLIM", background_per_ns=0.0)
    for signal in (0.0, 1e-300, 1e-9, 1e-5):
        assert len(echoes_of(light(signal, FRAME, background=0.0), quiet, fidelity="fast")) == 0


@pytest.mark.parametrize(("variant", "peak"), [("SMART", 135), ("SLIM", 236)])
def test_endless_light_in_one_bin_fires_all_detectors_at_once(variant: str, peak: int) -> None:
    """Every detector fires in the pulse's bin and is ON for 9: nothing is left to chance."""
    sensor = Sensor.of(variant, background_per_ns=0.0, pulse_fwhm_ns=0.05)
    range_m = 669.5 * LIGHT_SPEED_M_PER_NS / 2
    scan = echoes_of(light(2.0**19, 500, range_m=range_m, background=0.0), sensor, fidelity="fast")
    assert len(scan) == 500
    assert np.all(scan.width_ns == 9)
    assert np.all(scan.area == 9 * sensor.detectors)
    assert np.all(scan.peak == peak)
    assert scan.range_m == pytest.approx(np.full(500, round(range_m, 2)))


@pytest.mark.parametrize(
    ("change", "background"),
    [
        ({"dead_bins": 9}, 3e-4),
        ({"threshold": 200}, 3e-4),
        ({"spads": 1000}, 3e-4),
        ({"pulse_fwhm_ns": 100.0}, 3e-4),
        ({}, 5e-3),
    ],
)
def test_sensors_beyond_the_library_go_through_the_exact_chain(change: dict[str, float], background: float) -> None:
    sensor = Sensor.of("SMART", max_range_m=60.0, **change)
    assert not affordable(Source.of(sensor, None, background, SMALL))
    beams = light(0.5, 300, background=background)
    exact, ours = (echoes_of(beams, sensor, seed=2, fidelity=fidelity) for fidelity in ("exact", "fast"))
    assert np.array_equal(ours.x_m, exact.x_m)
    assert np.array_equal(ours.area, exact.area)


def test_a_gate_that_opens_late_is_the_readout_s_and_no_pulse_s() -> None:
    """Its library is that of a sensor without the gate, so that its echoes are these but for the ones before it."""
    near = np.where(np.arange(4000) % 2, 20.0, 50.0)
    open_, late = (
        echoes_of(light(5.0, 4000, range_m=near), Sensor.of("SLIM", min_range_m=low), seed=4, fidelity="fast")
        for low in (0.0, 30.0)
    )
    behind = open_.take(open_.range_m > 30.0)
    assert len(behind) > 1500
    assert len(open_) > len(behind) + 1500
    np.testing.assert_array_equal(late.range_m, behind.range_m)
    np.testing.assert_array_equal(late.area, behind.area)
