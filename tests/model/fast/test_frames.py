"""Frames through the fast path: the same bytes however they are run, and beams that only the exact chain can do."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fast_kit import small_library
from lidarcheck.cli.bench.scene import MATERIALS, lab_frame, lab_model
from lidarcheck.effects import make
from lidarcheck.errors import InputError, UsageError
from lidarcheck.model import External, Model, echoes_of, light_of, simulate
from lidarcheck.model.fast import run
from lidarcheck.model.fast.grid import Grid
from lidarcheck.scan import IdealScan, Light, Scan
from lidarcheck.sensor import Sensor
from reference_grid import POINTS, beam_directions

COLUMNS = ("x_m", "y_m", "z_m", "layer", "point", "echo_number", "width_ns", "area", "peak")


@pytest.fixture(scope="module", autouse=True)
def _library(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with small_library(tmp_path_factory.mktemp("library"), Grid(sample_bits=4)):
        yield


def same(one: Scan, other: Scan) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in COLUMNS)


@pytest.fixture(scope="module")
def frame() -> IdealScan:
    """A tenth of the lab's beams, some of which meet nothing."""
    few = lab_frame().take(np.arange(0, 520 * POINTS, 10))
    return replace(few, distance_m=np.where(np.arange(len(few)) % 17 == 0, 0.0, few.distance_m))


def fast(ideal: IdealScan, model: Model, seed: int = 1, **options: int) -> Scan:
    return simulate(ideal, model, seed=seed, fidelity="fast", **options)


def test_the_same_bytes_for_any_threads_chunks_and_order(frame: IdealScan, monkeypatch: pytest.MonkeyPatch) -> None:
    model = lab_model("SMART")
    first = fast(frame, model)
    assert same(first, fast(frame, model, threads=1))
    assert same(first, fast(frame, model, threads=3))
    assert same(first, fast(frame.take(np.random.default_rng(0).permutation(len(frame))), model))
    assert same(first, echoes_of(light_of(frame, model), model.sensor, seed=1, fidelity="fast"))
    monkeypatch.setattr(run, "CHUNK", 1000)
    monkeypatch.setattr("lidarcheck.model.fast.beams.CHUNK", 1000)
    assert same(first, fast(frame, model, threads=2))


def test_a_beam_draws_the_same_whatever_other_beams_there_are(frame: IdealScan) -> None:
    model = lab_model("SLIM")
    half = np.arange(len(frame)) % 2 == 0
    whole, part = fast(frame, model), fast(frame.take(half), model)
    keys = frame.layer[half].astype(np.int64) * POINTS + frame.point[half]
    kept = np.isin(whole.layer.astype(np.int64) * POINTS + whole.point, keys)
    assert same(whole.take(kept), part)


def test_another_seed_or_frame_draws_anew(frame: IdealScan) -> None:
    model = lab_model("SMART")
    first = fast(frame, model)
    assert not same(first, fast(frame, model, seed=2))
    assert not same(first, fast(frame, model, frame=1))


def test_rows_are_beams_in_order_at_multiples_of_the_resolution(frame: IdealScan) -> None:
    model = lab_model("SMART")
    scan = fast(frame, model)
    range_m = np.rint(scan.range_m / 0.01) * 0.01
    xyz = beam_directions(scan.layer, scan.point) * range_m[:, None]
    assert all(np.array_equal(xyz[:, k], getattr(scan, "xyz"[k] + "_m")) for k in range(3))
    key = (scan.layer.astype(np.int64) * POINTS + scan.point) * 4 + scan.echo_number
    assert np.all(np.diff(key) > 0)
    assert scan.x_m.dtype == scan.peak.dtype == np.float64
    assert scan.layer.dtype == scan.echo_number.dtype == np.int32
    assert scan.peak.max() <= 135


def test_beams_of_several_pulses_and_at_the_trace_s_ends_are_those_of_the_exact_chain() -> None:
    sensor = Sensor.of("SMART")
    n = 3000
    kind = np.arange(n) % 4
    counts = np.where(kind == 0, 2, 1)
    first = np.concatenate([[0], np.cumsum(counts)])
    near, far = np.array([50.0, 60.0, 1.0, 299.5])[kind], np.array([52.0])
    range_m = np.repeat(near, counts)
    range_m[first[:-1][kind == 0] + 1] = far
    beams = Light(
        np.arange(n) // POINTS, np.arange(n) % POINTS, np.full(n, 3e-4), first, range_m, np.full(len(range_m), 0.3)
    )
    exact, ours = (echoes_of(beams, sensor, seed=4, fidelity=fidelity) for fidelity in ("exact", "fast"))
    through_chain = [scan.take(kind[scan.layer * POINTS + scan.point] != 1) for scan in (exact, ours)]
    assert len(through_chain[0]) > 2000
    assert same(*through_chain)
    drawn = [scan.take(kind[scan.layer * POINTS + scan.point] == 1) for scan in (exact, ours)]
    assert not same(*drawn)
    assert len(drawn[1]) > 700


@pytest.mark.parametrize(
    "effect",
    [
        ("fog", {"mor_m": 200.0}),
        ("crosstalk", {}),
        ("ambient_light", {"rate_per_ns": 0.02}),
        ("ambient_light", {"rate_per_ns": 0.0005}),
        ("walk_error", {}),
        ("threshold", {}),
        ("pulse_shape", {}),
        ("signal_gain", {}),
        ("retro_ghost", {}),
    ],
)
def test_effects_stand_where_they_stood(effect: tuple[str, dict[str, float]], frame: IdealScan) -> None:
    """The mean range and the number of echoes of both ways agree; where the library cannot serve, their bytes do."""
    model = lab_model("SMART").with_(make(*effect))
    few = frame.take(np.arange(0, len(frame), 4))
    ours, exact = fast(few, model), simulate(few, model, seed=1)
    if effect[1] == {"rate_per_ns": 0.02}:
        assert same(ours, exact)
        return
    assert not same(ours, exact)
    assert len(ours) == pytest.approx(len(exact), abs=5.0 * np.sqrt(0.05 * len(exact)))
    assert ours.area.mean() == pytest.approx(exact.area.mean(), rel=0.02)
    assert ours.width_ns.mean() == pytest.approx(exact.width_ns.mean(), rel=0.02)
    assert ours.range_m.mean() == pytest.approx(exact.range_m.mean(), rel=0.02)


def test_mistakes_are_those_of_the_exact_chain(frame: IdealScan) -> None:
    model = lab_model("SMART")
    with pytest.raises(InputError, match="material 9 is not in the table"):
        fast(replace(frame, material_id=np.full(len(frame), 9, dtype=np.int32)), model)
    with pytest.raises(UsageError, match="not finite"):
        fast(replace(frame, distance_m=np.full(len(frame), np.nan)), model)
    with pytest.raises(UsageError, match="there is no fidelity 'quick'"):
        simulate(frame, model, fidelity="quick")
    external = Model(model.sensor, MATERIALS, external=External(("true",), Path()))
    with pytest.raises(UsageError, match="knows no fidelity 'fast'"):
        fast(frame, external)
    assert len(fast(frame.take(slice(0)), model)) == 0
    turned = replace(frame, incidence_deg=np.full(len(frame), 120.0))
    assert len(fast(turned, model)) < 10


def test_the_reference_is_a_fidelity_too(frame: IdealScan) -> None:
    model = lab_model("SMART").with_sensor(max_range_m=60.0).with_(make("walk_error", {}))
    few = frame.take(np.flatnonzero((frame.distance_m > 0.0) & (frame.distance_m < 50.0))[::800])
    one = simulate(few, model, seed=3, fidelity="reference")
    exact = simulate(few, model, seed=3)
    assert same(one, simulate(few, model, seed=3, fidelity="reference"))
    assert not same(one, simulate(few, model, seed=4, fidelity="reference"))
    assert len(one) == pytest.approx(len(exact), rel=0.1)
    assert one.area.mean() == pytest.approx(exact.area.mean(), rel=0.1)
    pairs = [scan.take(scan.echo_number == 1) for scan in (one, exact)]
    keys = [scan.layer.astype(np.int64) * POINTS + scan.point for scan in pairs]
    _, here, there = np.intersect1d(*keys, return_indices=True)
    assert np.mean(pairs[0].range_m[here] - pairs[1].range_m[there]) == pytest.approx(0.0, abs=0.1)
    turned = simulate(few.take(np.arange(len(few))[::-1]), model, seed=3, fidelity="reference")
    assert same(one, turned)
    with pytest.raises(UsageError, match="the reference knows no crosstalk"):
        simulate(few, model.with_(make("crosstalk", {})), fidelity="reference")
