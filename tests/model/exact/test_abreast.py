"""Beams side by side: the same draws and the same echoes, to the last bit, as for each beam on its own."""

from collections.abc import Callable
from decimal import Decimal, localcontext

import numba
import numpy as np
import pytest

from exact_kit import on_their_own, side_by_side
from lidarcheck.model import lane_math, simulate, streams
from lidarcheck.model.exact import listing
from lidarcheck.model.exact.binomial import binomial, inverses
from lidarcheck.model.exact.quick_sums import ROWS, settle
from lidarcheck.model.lane_math import LANES
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Light, Scan
from lidarcheck.sensor import Material, Sensor
from reference_grid import beam_directions

RNG = np.random.default_rng(20)
FUNCTIONS: dict[str, tuple[Callable[[float], float], Callable[[Decimal], Decimal], np.ndarray]] = {
    "exp": (lane_math.exp, lambda x: x.exp(), np.append(RNG.uniform(-700.0, 50.0, 300), [0.0, -0.3, -1e-9])),
    "expm1": (lane_math.expm1, lambda x: x.exp() - 1, np.append(10.0 ** RNG.uniform(-12.0, 0.0, 300), [1.0, 0.6931])),
    "log": (
        lane_math.log,
        lambda x: x.ln(),
        np.append(10.0 ** RNG.uniform(-16.0, 3.0, 300), [0.5, 0.7072, 1.5, 1 - 2**-53]),
    ),
    "log1m": (lane_math.log1m, lambda x: (1 - x).ln(), np.append(10.0 ** RNG.uniform(-12.0, -0.302, 300), [0.5])),
}


@numba.njit
def apply(function, x, out):  # type: ignore[no-untyped-def]
    for k in range(len(x)):
        out[k] = function(x[k])


@numba.njit
def apply_fill(function, stream, beams, blocks, words, draws):  # type: ignore[no-untyped-def]
    function(stream, beams, blocks, words, draws)


@numba.njit
def apply_settle(rates, draws, armed, detectors, inverse, found, open_):  # type: ignore[no-untyped-def]
    lanes, sums = np.zeros(2 * LANES, dtype=np.int16), np.zeros(ROWS * LANES, dtype=np.float32)
    single = inverse.astype(np.float32)
    for first in range(0, len(rates), LANES):
        row = np.uint64(first)
        lanes[:LANES] = armed[first : first + LANES]
        mask = settle(rates, row, draws, row, single, lanes, sums, detectors)
        for lane in range(LANES):
            found[first + lane] = lanes[LANES + lane]
            open_[first + lane] = (mask >> np.uint64(lane)) & np.uint64(1) != 0


@pytest.mark.parametrize("name", FUNCTIONS)
def test_exponentials_and_logarithms_are_right_to_the_last_digits(name: str) -> None:
    function, exact, x = FUNCTIONS[name]
    out = np.empty(len(x))
    apply(function, x, out)
    with localcontext() as context:
        context.prec = 50
        truth = [exact(Decimal(value)) for value in x.tolist()]
        errors = [abs((Decimal(got) - true) / true) for got, true in zip(out.tolist(), truth, strict=True)]
    assert max(errors) < 1e-15


@pytest.mark.parametrize("twice", [False, True])
def test_draws_side_by_side_are_those_of_each_beam(twice: bool) -> None:
    stream = streams.new_stream(2**63 + 5, "spads", 2**64 - 7)
    beams = np.random.default_rng(1).integers(0, 2**63, LANES, dtype=np.uint64)
    blocks, a_block = 5, 8 if twice else 4
    together, alone = np.empty(blocks * a_block * LANES), np.empty(blocks * a_block)
    fill_abreast = streams.fill_twice_abreast if twice else streams.fill_abreast
    apply_fill(fill_abreast, stream, beams, blocks, np.zeros(4 * LANES, dtype=np.uint64), together)
    for lane, beam in enumerate(beams):
        streams.rewind(stream, beam)
        (streams.fill_twice if twice else streams.fill)(stream, alone, len(alone))
        assert np.array_equal(together[lane::LANES], alone)
    if twice:
        streams.rewind(stream, beams[-1])
        streams.fill(stream, alone, blocks * 4)
        assert np.array_equal(alone[: blocks * 4], together[LANES - 1 :: 2 * LANES])
        halves = np.floor(2.0**32 * together[LANES - 1 :: LANES]).reshape(-1, 2)
        # The second draw of a word begins with what the first ends with.
        assert np.array_equal(halves[:, 1] // 2**11, np.floor(2.0**53 * alone[: blocks * 4]) % 2**21)


def test_sums_in_single_precision_settle_numbers_as_binomial_finds_them() -> None:
    """Over all brightness, with uniform numbers that crowd at both ends; next to all of the others are settled."""
    rng, rows = np.random.default_rng(7), 1500
    for detectors in (1, 9, 135, 315, 800):
        n = rows * LANES
        rates = 10.0 ** np.where(rng.random(n) < 0.5, rng.uniform(-5.0, 0.5, n), rng.uniform(-1.0, 4.0, n))
        rates[::50] = np.log(2.0) * rng.choice([1.0, 1 - 1e-12, 1 + 1e-12, 1 - 1e-6, 1 + 1e-6], len(rates[::50]))
        draws, crowded = rng.random(n), rng.random(n) < 0.2
        draws[crowded] = 10.0 ** rng.uniform(-15.0, 0.0, crowded.sum())
        draws[crowded] = np.where(rng.random(crowded.sum()) < 0.5, draws[crowded], 1.0 - draws[crowded])
        armed = rng.integers(0, detectors + 1, n)
        found, open_ = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.bool_)
        apply_settle(rates, draws, armed, detectors, inverses(detectors), found, open_)
        truth = np.array(
            [binomial(*row, inverses(detectors)) for row in zip(draws, armed.tolist(), rates, strict=True)]
        )
        assert np.array_equal(found[~open_], truth[~open_])
        faint = ~crowded & (rates * detectors < 100.0) & (rates < 0.6)
        assert open_[faint].mean() < 0.02


def light(n: int, background: float | np.ndarray, pulses: int, spread_m: float, brightest: float) -> Light:
    """Beams with pulses of all strengths at all ranges, `spread_m` apart, some of them without any light."""
    rng = np.random.default_rng(6)
    first = np.append(0, np.cumsum(rng.integers(0, pulses + 1, n)))
    beam = np.repeat(np.arange(n), np.diff(first))
    signal = brightest * 10.0 ** rng.uniform(-6.0, 0.0, len(beam))
    signal[::17] = 0.0
    range_m = rng.uniform(-1.0, 43.0, n).clip(0.0)[beam] + rng.uniform(0.0, spread_m, len(beam))
    return Light(*np.divmod(np.arange(n), 960), np.broadcast_to(background, n), first, range_m, signal)


CASES = {
    "SMART": (Sensor.of("SMART", max_range_m=40.0), light(3000, 3e-4, 1, 0.0, 1e4)),
    "SLIM, several pulses": (Sensor.of("SLIM", max_range_m=40.0), light(3000, 3e-4, 3, 4.0, 1e3)),
    "pulses too far apart for some": (Sensor.of("SMART", max_range_m=40.0), light(2000, 3e-4, 2, 30.0, 10.0)),
    "many dead on entry, many alarms": (Sensor.of("SLIM", max_range_m=40.0), light(3000, 1e-3, 1, 0.0, 3.0)),
    "several backgrounds": (
        Sensor.of("SMART", max_range_m=40.0),
        light(2000, np.resize(np.repeat([2e-4, 1e-3, 3e-2], [21, 6, 10]), 2000), 1, 0.0, 30.0),
    ),
    "no background": (Sensor.of("SMART", max_range_m=40.0, threshold=0), light(2000, 0.0, 2, 3.0, 1e9)),
    "several runs in a window": (
        Sensor.of("SMART", max_range_m=40.0, threshold=2, max_echoes=2, on_bins=3),
        light(3000, 5e-4, 3, 6.0, 5.0),
    ),
    "short times": (Sensor.of("SLIM", max_range_m=40.0, on_bins=1, dead_bins=1), light(2000, 3e-4, 1, 0.0, 300.0)),
    "one detector": (
        Sensor.of("SMART", spads=1, shots=1, threshold=0, max_range_m=40.0),
        light(2000, 0.01, 1, 0.0, 1e4),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_echoes_side_by_side_are_those_of_beams_on_their_own(case: str) -> None:
    sensor, beams = CASES[case]
    alone = on_their_own(beams, sensor)
    assert alone.held.sum() > 100
    for chunk in (1 << 20, 5):
        for one, other in zip(side_by_side(beams, sensor, chunk), alone, strict=True):
            assert np.array_equal(one, other)


def test_chunks_of_the_table_do_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    n = 1000
    ideal = IdealScan(*np.divmod(np.arange(n), 960), np.full(n, 30.0), np.ones(n), np.zeros(n))
    model = Model(Sensor.of("SMART"), {1: Material("wall", 0.3)})

    def columns(scan: Scan) -> list[np.ndarray]:
        return [scan.x_m, scan.layer, scan.point, scan.echo_number, scan.width_ns, scan.area, scan.peak]

    whole = columns(simulate(ideal, model, seed=3))
    monkeypatch.setattr(listing, "_CHUNK", 77)
    assert all(
        np.array_equal(one, other) for one, other in zip(whole, columns(simulate(ideal, model, seed=3)), strict=True)
    )


def test_beams_that_the_sensor_has_not_are_listed_along_their_directions() -> None:
    n = 400
    layer, point = np.repeat([-7, 3, 519, 640], 100), np.tile(np.arange(900, 1000), 4)
    model = Model(Sensor.of("SMART"), {1: Material("wall", 0.3)})
    scan = simulate(IdealScan(layer, point, np.full(n, 30.0), np.ones(n), np.zeros(n)), model, seed=3)
    assert set(scan.layer) == {-7, 3, 519, 640}
    expected = beam_directions(scan.layer, scan.point) * scan.range_m[:, None]
    assert np.allclose(np.column_stack([scan.x_m, scan.y_m, scan.z_m]), expected, atol=1e-9)
    own = (layer >= 0) & (layer < 520) & (point < 960)
    alone = simulate(
        IdealScan(layer[own], point[own], np.full(own.sum(), 30.0), np.ones(own.sum()), np.zeros(own.sum())),
        model,
        seed=3,
    )
    among = scan.take((scan.layer >= 0) & (scan.layer < 520) & (scan.point < 960))
    assert np.array_equal(alone.x_m, among.x_m)
    assert np.array_equal(alone.z_m, among.z_m)
