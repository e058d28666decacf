"""Pulses that are not the sensor's own Gaussian: longer ones, and such with a tail."""

import numpy as np
import pytest
from scipy import integrate, stats

from lidarcheck.model import echoes_of, expected_trace, reference
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.model.exact.pulse_form import PulseForm
from lidarcheck.model.exact.pulses import pulses_of
from lidarcheck.model.trace import bin_rates, draw_traces, on_probability
from lidarcheck.scan import Light, PulseShape, Scan
from lidarcheck.sensor import FWHM_PER_SIGMA, Sensor
from reference_kit import simulate_detectors

COLUMNS = ("x_m", "y_m", "z_m", "layer", "point", "echo_number", "width_ns", "area", "peak")


def light(signal: float, n: int, shape: PulseShape | None, *, range_m: float = 12.3, background: float = 3e-4) -> Light:
    """`n` beams with one pulse each."""
    beams = np.zeros(n, dtype=np.int32), np.arange(n), np.full(n, background)
    return Light(*beams, np.arange(n + 1), np.full(n, range_m), np.full(n, signal), shape=shape)


def same(one: Scan, other: Scan) -> bool:
    return all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in COLUMNS)


@pytest.mark.parametrize(("sigma", "tail"), [(2.0, 5.0), (2.0, 0.02), (0.05, 40.0), (80.0, 0.5), (1.0, 1.0)])
def test_the_tail_is_the_gaussian_convolved_with_an_exponential(sigma: float, tail: float) -> None:
    """Against quadrature, and against scipy's exponentially modified Gaussian where that does not give out."""
    form = PulseForm(sigma, 1.0, tail)
    at = np.linspace(-6.0 * sigma, 6.0 * sigma + 8.0 * tail, 41)

    def there(x: float, t: float) -> float:
        return float(np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi) * -np.expm1(-(t - sigma * x) / tail))

    expected = [integrate.quad(there, -9.0, min(t / sigma, 9.0), args=(t,), limit=200)[0] for t in at]
    assert form.before(at) == pytest.approx(expected, abs=1e-8)
    if sigma / tail < 10:
        assert form.before(at) == pytest.approx(stats.exponnorm.cdf(at, tail / sigma, scale=sigma), abs=1e-12)
    assert form.before(at[7]) == form.before(at)[7]


@pytest.mark.parametrize("tail", [1e-9, 1e-4, 1.0, 1e4])
def test_shares_are_shares_for_any_tail(tail: float) -> None:
    shares = PulseForm(2.1, 0.4, tail).shares(30, 60)
    assert np.all(np.isfinite(shares))
    assert np.all(shares >= 0.0)
    assert np.all(shares.sum(axis=1) <= 1.0 + 1e-12)


def test_a_delayed_tail_is_the_tail_later() -> None:
    """Of the light that comes at once and of that which comes late, each is where its own pulse has it."""
    at = np.linspace(-12.0, 60.0, 145)
    early, tail = PulseForm(2.1, 0.0, 1.0), PulseForm(2.1, 1.0, 4.0)
    both = 0.7 * early.before(at) + 0.3 * tail.before(at - 9.5)
    assert PulseForm(2.1, 0.3, 4.0, 9.5).before(at) == pytest.approx(both, abs=1e-14)
    twin = 0.7 * early.before(at) + 0.3 * early.before(at - 9.5)
    assert PulseForm(2.1, 0.3, 1e-9, 9.5).before(at) == pytest.approx(twin, abs=1e-9)


@pytest.mark.parametrize(
    "form",
    [PulseForm(2.1, 0.0, 1.0), PulseForm(2.1, 0.3, 4.0), PulseForm(0.1, 0.8, 3.0), PulseForm(2.1, 0.3, 0.5, 9.3)],
)
def test_ramps_are_shares_summed_over_the_position(form: PulseForm) -> None:
    """W_k(x): unit pulses, one a bin, up to x; here by the midpoint rule, 512 pulses a bin."""
    before, behind = 20, 60
    centres = 0.5 * (form.shares(before, behind)[1:] + form.shares(before, behind)[:-1]) / 512.0
    whole_bins = np.cumsum(centres.sum(axis=0)[::-1])[::-1]
    ramps = form.ramps(before, behind)
    for phase in (0, 100, 511):
        part = centres[:phase].sum(axis=0)
        earlier = np.append(whole_bins[1:], 0.0)
        assert ramps[phase][:-1] == pytest.approx((part + earlier)[:-1], abs=3e-5)


def test_beyond_its_reach_next_to_nothing_is_left() -> None:
    for form in (
        PulseForm(2.1, 0.0, 1.0),
        PulseForm(2.1, 0.3, 6.0),
        PulseForm(0.2, 1e-4, 20.0),
        PulseForm(2.1, 1.0, 0.01),
        PulseForm(2.1, 0.3, 4.0, 20.0),
        PulseForm(2.1, 1e-4, 0.1, 40.0),
    ):
        for expected in (1e-8, 1e-3, 50.0, 1e7):
            before, behind = (int(reach) for reach in form.reach(expected))
            lost = form.before(-before) + 1.0 - form.before(behind + 1)
            assert expected * lost <= 1.01e-6 * max(1.0, expected * 1e-6)
            if expected == 50.0 and form.tail > 1.0 and form.tail_share > 0.1:
                assert expected * (1.0 - form.before(0.6 * behind)) > 1e-6, "not much farther than it must be"


def test_without_a_tail_and_of_the_same_length_it_is_the_sensors_own_pulse_bit_by_bit() -> None:
    for variant in ("SMART", "SLIM"):
        sensor = Sensor.of(variant, max_range_m=60.0)
        own = echoes_of(light(0.2, 3000, None), sensor, seed=3)
        assert len(own) > 1000
        for shape in (PulseShape(sensor.pulse_fwhm_ns), PulseShape(sensor.pulse_fwhm_ns, 0.0, 20.0)):
            assert same(own, echoes_of(light(0.2, 3000, shape), sensor, seed=3))
            assert np.array_equal(bin_rates(light(0.2, 1, None), sensor), bin_rates(light(0.2, 1, shape), sensor))
        assert not same(own, echoes_of(light(0.2, 3000, PulseShape(6.0)), sensor, seed=3))


def test_another_length_is_what_a_sensor_of_that_length_sees() -> None:
    wide = Sensor.of("SMART", pulse_fwhm_ns=9.0, max_range_m=60.0)
    usual = Sensor.of("SMART", max_range_m=60.0)
    assert same(echoes_of(light(0.4, 2000, None), wide), echoes_of(light(0.4, 2000, PulseShape(9.0)), usual))


@pytest.mark.parametrize(
    "shape",
    [PulseShape(5.0, 0.25, 8.0), PulseShape(2.0, 0.6, 3.0), PulseShape(5.0, 0.5, 0.05), PulseShape(5.0, 0.2, 2.0, 9.5)],
)
def test_light_is_neither_lost_nor_made_and_late_by_share_times_tail(shape: PulseShape) -> None:
    sensor = Sensor.of("SMART", bin_ns=0.25, background_per_ns=0.0, max_range_m=60.0)
    time = (np.arange(sensor.bins) + 0.5) * sensor.bin_ns
    rates = bin_rates(light(1.0, 1, shape, background=0.0), sensor)[0]
    centre = 2.0 * 12.3 / 0.299792458
    mean = (rates * time).sum() / rates.sum()
    variance = (rates * time**2).sum() / rates.sum() - mean**2 - sensor.bin_ns**2 / 12.0
    sigma, share, tail = shape.fwhm_ns / FWHM_PER_SIGMA, shape.tail_share, shape.tail_ns
    late = tail + shape.tail_delay_ns
    assert rates.sum() == pytest.approx(1.0, abs=1e-6)
    assert mean - centre == pytest.approx(share * late, abs=1e-3)
    assert variance == pytest.approx(sigma**2 + share * (late**2 + tail**2) - (share * late) ** 2, rel=1e-3)


@pytest.mark.parametrize(
    "shape",
    [
        PulseShape(5.0, 0.25, 8.0),
        PulseShape(0.4, 0.6, 20.0),
        PulseShape(30.0, 0.9, 0.1),
        PulseShape(5.0, 0.2, 0.5, 9.5),
    ],
)
def test_three_ways_to_the_rates_agree(shape: PulseShape) -> None:
    """Closed form, the kernels' table, and one numerically delayed Gaussian after another."""
    sensor = Sensor.of("SLIM", max_range_m=30.0)
    for signal in (0.01, 2.0, 500.0):
        beam = light(signal, 1, shape)
        closed = bin_rates(beam, sensor)[0]
        assert reference._rates(beam, 0, sensor) == pytest.approx(closed, abs=1e-4 * signal)
        traces = np.empty((1, sensor.bins))
        traces[:] = 3e-4
        add_kernel_rates(beam, sensor, traces[0])
        assert traces[0] == pytest.approx(closed, abs=1e-6 * signal + 1e-8)


def add_kernel_rates(beam: Light, sensor: Sensor, rates: np.ndarray) -> None:
    from lidarcheck.jit import kernel
    from lidarcheck.model.exact.pulses import add_rates

    @kernel
    def run(pulses, rates):  # type: ignore[no-untyped-def]
        add_rates(pulses, 0, 0, len(rates), rates)

    run(pulses_of(beam, sensor, numbers_of(sensor)), rates)


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_draws_have_the_expected_trace(variant: str) -> None:
    sensor = Sensor.of(variant, max_range_m=40.0)
    shape = PulseShape(5.0, 0.4, 10.0)
    mean = draw_traces(light(0.8, 4000, shape), sensor, seed=1).mean(axis=0)
    expected = expected_trace(light(0.8, 1, shape), sensor)[0]
    q = on_probability(bin_rates(light(0.8, 1, shape), sensor), [3e-4], sensor)[0]
    spread = np.sqrt(sensor.detectors * q * (1 - q) / 4000)
    assert np.abs((mean - expected) / spread).max() < 5.0


@pytest.mark.parametrize("shape", [PulseShape(5.0, 0.3, 8.0), PulseShape(3.0, 0.7, 15.0), PulseShape(12.0)])
def test_echoes_agree_with_every_detector_followed_on_its_own(shape: PulseShape) -> None:
    sensor = Sensor.of("SMART", max_range_m=30.0)
    n, rng = 300, np.random.default_rng(7)
    p_values = {}
    for signal in (0.12, 0.4, 3.0, 60.0):
        theirs = simulate_detectors(light(signal, n, shape), sensor, rng)
        ours = echoes_of(light(signal, 20 * n, shape), sensor, seed=2)
        for name in ("peak", "area", "width_ns", "range_m"):
            one, other = np.round(getattr(ours, name), 3), np.round(getattr(theirs, name), 3)
            p_values[signal, name] = stats.ks_2samp(one, other).pvalue
        counts = [
            np.bincount(np.bincount(scan.point, minlength=m), minlength=4) for scan, m in ((ours, 20 * n), (theirs, n))
        ]
        kept = (counts[0] + counts[1]) > 20
        if kept.sum() > 1:
            p_values[signal, "echoes"] = stats.chi2_contingency([c[kept] for c in counts]).pvalue
    assert min(p_values.values()) > 1e-3 / len(p_values), min(p_values.items(), key=lambda item: item[1])


def test_a_tail_longer_than_the_trace_is_cut_with_it() -> None:
    sensor = Sensor.of("SMART", max_range_m=20.0)
    shape = PulseShape(5.0, 0.5, 500.0)
    scan = echoes_of(light(50.0, 200, shape), sensor, seed=1)
    assert len(scan) >= 200
    assert expected_trace(light(50.0, 1, shape), sensor)[0, -1] > 1.0


def test_no_pulses_and_dark_pulses_do_nothing() -> None:
    sensor = Sensor.of("SMART", background_per_ns=0.0)
    shape = PulseShape(5.0, 0.5, 10.0)
    none = Light(np.zeros(3), np.arange(3), np.zeros(3), np.zeros(4), np.zeros(0), np.zeros(0), shape=shape)
    assert len(echoes_of(none, sensor)) == 0
    assert len(echoes_of(light(0.0, 5, shape, background=0.0), sensor)) == 0
    assert len(echoes_of(none.with_pulses([], [], []), sensor)) == 0
    empty = Light(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(1), np.zeros(0), np.zeros(0), shape=shape)
    assert len(echoes_of(empty, sensor)) == 0
