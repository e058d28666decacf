"""The fast path in haze: histories joined to the exact chain, against the exact chain from the first bin on."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import special, stats

from fast_kit import small_library
from lidarcheck.cli.bench.scene import lab_model, signs_frame
from lidarcheck.effects import make
from lidarcheck.model import Model, echoes_of, light_of, simulate
from lidarcheck.model.fast import hazy, histories
from lidarcheck.model.fast.histories import HISTORIES, LEAST
from lidarcheck.model.stages import run_and_light
from lidarcheck.scan import IdealScan, Light, Scan
from lidarcheck.sensor import Sensor, SpadArray
from reference_grid import LAYERS, POINTS

LEVEL = 1e-4
"""Chance that a true agreement is called none, for each case."""


@pytest.fixture(scope="module", autouse=True)
def _library(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with small_library(tmp_path_factory.mktemp("library")):
        yield


@pytest.fixture(scope="module")
def frame() -> IdealScan:
    """Some beams of the hall with signs, of which a few meet nothing."""
    few = signs_frame().take(np.arange(0, LAYERS * POINTS, 11))
    return replace(few, distance_m=np.where(np.arange(len(few)) % 17 == 0, 0.0, few.distance_m))


def model_with(variant: str, **effects: dict[str, Any]) -> Model:
    model = lab_model(variant)
    for name, settings in effects.items():
        model = model.with_(make(name, settings))
    return model


def echoes_a_beam(scan: Scan, frame: IdealScan) -> np.ndarray:
    """How many beams of the frame have no echo, one, two, three."""
    beam = frame.layer.astype(np.int64) * POINTS + frame.point
    of_beam = np.bincount(scan.layer.astype(np.int64) * POINTS + scan.point, minlength=LAYERS * POINTS)
    return np.bincount(of_beam[beam], minlength=4)


def p_values(ours: Scan, exact: Scan, frame: IdealScan, histories: int = HISTORIES) -> dict[str, float]:
    """Of the numbers of echoes, and of each feature of first, second and third echoes; beams share histories."""
    found = {}
    numbers = echoes_a_beam(ours, frame), echoes_a_beam(exact, frame)
    shares = [n / n.sum() for n in numbers]
    size = 1.0 / (1.0 / numbers[0].sum() + 1.0 / histories + 1.0 / numbers[1].sum())
    pooled = 0.5 * (shares[0] + shares[1])
    used = pooled * size > 10
    statistic = size * np.sum((shares[0] - shares[1])[used] ** 2 / pooled[used])
    found["echoes"] = float(stats.chi2.sf(statistic, used.sum() - 1))
    for echo in (1, 2, 3):
        for name in ("range_m", "width_ns", "area", "peak"):
            a, b = (getattr(scan, name)[scan.echo_number == echo] for scan in (ours, exact))
            if min(len(a), len(b)) > 200:
                distance = stats.ks_2samp(a, b, method="asymp").statistic
                n = 1.0 / (1.0 / len(a) + 1.0 / (histories * len(a) / len(frame)) + 1.0 / len(b))
                found[f"{name} of echo {echo}"] = float(special.kolmogorov(distance * np.sqrt(n)))
    return found


@pytest.mark.parametrize(
    ("variant", "effects"),
    [
        ("SMART", {"fog": {"mor_m": 200.0}}),
        ("SMART", {"fog": {"mor_m": 60.0}, "ambient_light": {}, "retro_ghost": {}, "rain": {}}),
        ("SMART", {"fog": {"mor_m": 100.0, "patchiness": 0.3}, "beam_divergence": {}}),
        pytest.param(
            "SLIM",
            {"fog": {"mor_m": 60.0, "patchiness": 0.6}, "beam_divergence": {}, "ambient_light": {}, "blockage": {}},
            marks=pytest.mark.long,
        ),
        pytest.param(
            "SLIM", {"fog": {"mor_m": 100.0}, "ambient_light": {"rate_per_ns": 0.0003}}, marks=pytest.mark.long
        ),
        pytest.param("SLIM", {"fog": {"mor_m": 20.0}}, marks=pytest.mark.long),
    ],
)
def test_beams_in_haze_are_those_of_the_exact_chain(
    variant: str, effects: dict[str, dict[str, Any]], frame: IdealScan
) -> None:
    """And air that scatters 4 % more is told from it."""
    light, sensor = light_in(frame, variant, effects)
    exact = echoes_of(light, sensor, seed=1)
    ours = echoes_of(light, sensor, seed=2, fidelity="fast")
    assert not np.array_equal(ours.area, exact.area)
    found = p_values(ours, exact, frame)
    assert len(found) > 8
    assert min(found.values()) > LEVEL / len(found), found
    thicker, _ = light_in(frame, variant, {**effects, "fog": {**effects["fog"], "backscatter": 0.048}})
    other = p_values(echoes_of(thicker, sensor, seed=2, fidelity="fast"), exact, frame)
    assert min(other.values()) < LEVEL / len(found), other


def light_in(frame: IdealScan, variant: str, effects: dict[str, dict[str, Any]]) -> tuple[Light, Sensor]:
    """What comes back to the beams, with what chance does to the air and the glass drawn once, and who sees it."""
    run, light = run_and_light(frame, model_with(variant, **effects), 1, 0, None, None, None)
    return light, run.sensor


DISTURBED = {"crosstalk": {}, "afterpulsing": {}}


@pytest.mark.parametrize(
    ("variant", "effects"),
    [
        ("SMART", {"fog": {"mor_m": 200.0}, "crosstalk": {}}),
        ("SMART", {"fog": {"mor_m": 200.0}, "ambient_light": {}, "afterpulsing": {}, "threshold": {"shift": 0.5}}),
        pytest.param("SMART", {"fog": {"mor_m": 60.0}, **DISTURBED, "beam_divergence": {}}, marks=pytest.mark.long),
        pytest.param("SLIM", {"fog": {"mor_m": 100.0}, "ambient_light": {}, **DISTURBED}, marks=pytest.mark.long),
    ],
)
def test_disturbed_detectors_in_haze_are_those_of_the_exact_chain(
    variant: str, effects: dict[str, dict[str, Any]], frame: IdealScan
) -> None:
    """And what avalanches set off, made half as frequent, is told from it."""
    light, sensor = light_in(frame, variant, effects)
    exact = echoes_of(light, sensor, seed=1)
    found = p_values(echoes_of(light, sensor, seed=2, fidelity="fast"), exact, frame)
    assert len(found) > 8
    assert min(found.values()) > LEVEL / len(found), found
    real = SpadArray.narrow(sensor).nonideal
    half = {name: 0.5 * getattr(real, name) for name in ("crosstalk_sides", "crosstalk_corners", "afterpulse")}
    fewer = replace(SpadArray.narrow(sensor), nonideal=replace(real, **half))
    other = p_values(echoes_of(light, fewer, seed=2, fidelity="fast"), exact, frame)
    assert min(other.values()) < LEVEL / len(other), other


def hazy_light(frame: IdealScan, mor_m: float = 200.0) -> tuple[Light, Sensor]:
    return light_in(frame, "SMART", {"fog": {"mor_m": mor_m}, "ambient_light": {}})


def test_the_same_bytes_for_any_threads_and_order_and_histories_are_kept(
    frame: IdealScan, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = model_with("SMART", fog={"mor_m": 200.0}, ambient_light={})
    first = simulate(frame, model, seed=1, threads=1, fidelity="fast")
    monkeypatch.setattr(histories, "_simulated", lambda *_: pytest.fail("drawn again"))
    turned = frame.take(np.random.default_rng(0).permutation(len(frame)))
    monkeypatch.setattr(hazy, "CHUNK", 1000)
    for again in (
        simulate(frame, model, seed=1, threads=3, fidelity="fast"),
        simulate(turned, model, seed=1, fidelity="fast"),
    ):
        np.testing.assert_array_equal(first.area, again.area)
        np.testing.assert_array_equal(first.x_m, again.x_m)
    assert not np.array_equal(first.area, simulate(frame, model, seed=1, frame=1, fidelity="fast").area)


def test_beams_that_see_other_parts_of_the_haze_draw_histories_of_those(frame: IdealScan) -> None:
    """Ever less of it from beam to beam, some none; only beams that see next to none go through the exact chain."""
    light, sensor = hazy_light(frame)
    assert light.haze is not None
    share = np.linspace(1.5, 0.02, len(light))
    share[::7] = 0.0
    light = replace(light, haze=replace(light.haze, row_share=share))
    ours, exact = (echoes_of(light, sensor, seed=1, fidelity=kind) for kind in ("fast", "exact"))
    found = p_values(ours, exact, frame, LEAST)
    assert min(found.values()) > LEVEL / len(found), found
    rows = {beam: row for row, beam in enumerate(light.layer.astype(np.int64) * POINTS + light.point)}
    seen = [share[[rows[beam] for beam in scan.layer.astype(np.int64) * POINTS + scan.point]] for scan in (ours, exact)]
    few = [scan.take((part > 0.0) & (part < 0.0625)) for scan, part in zip((ours, exact), seen, strict=True)]
    np.testing.assert_array_equal(few[0].area, few[1].area)
    assert len(few[0]) > 100
    # Each quarter of the parts by itself: a level too far off would hide among the others.
    for low in (0.1, 0.4, 0.8, 1.2):
        areas = [
            scan.area[(part > low) & (part < low + 0.3) & (scan.echo_number == 1)]
            for scan, part in zip((ours, exact), seen, strict=True)
        ]
        assert stats.ks_2samp(*areas).pvalue > LEVEL / 4, low


def test_haze_without_light_is_no_haze(frame: IdealScan) -> None:
    light, sensor = hazy_light(frame)
    assert light.haze is not None
    dark = replace(light, haze=replace(light.haze, row_share=np.zeros(len(light.haze.row_share))))
    ours, clear = (echoes_of(one, sensor, seed=1, fidelity="fast") for one in (dark, replace(light, haze=None)))
    np.testing.assert_array_equal(ours.area, clear.area)


@pytest.mark.parametrize("effects", [{"dead_time": {}}, {"crosstalk": {"sides": 0.2}}])
def test_dead_times_that_vary_and_strong_disturbances_in_haze_go_through_the_exact_chain(
    effects: dict[str, dict[str, Any]], frame: IdealScan
) -> None:
    model = model_with("SMART", fog={"mor_m": 200.0}, **effects)
    few = frame.take(np.arange(0, len(frame), 40))
    ours, exact = (simulate(few, model, seed=1, fidelity=kind) for kind in ("fast", "exact"))
    np.testing.assert_array_equal(ours.area, exact.area)
    assert light_of(few, model).haze is None
