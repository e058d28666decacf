"""The laws of features, by hand-worked values: units, knees, steps, limits."""

import numpy as np
import pytest

from any_detector_kit import chip, sensor
from lidarcheck.errors import UsageError
from lidarcheck.sensor.feature import Feature
from lidarcheck.sensor.laws import EchoNumbers, coded, value

DETECTOR = sensor(signal_at_1m=1e5, threshold=10.0, noise=2.0)


def of(law, amplitude, range_m=10.0, *, detector=DETECTOR, echo=None, **words):
    own = {"gain", "offset", "knee", "above", "top_percent", "per_m", "snr_full"}
    numbers = {key: words.pop(key) for key in list(words) if key in own}
    amplitude = np.atleast_1d(np.asarray(amplitude, dtype=float))
    echoes = EchoNumbers(amplitude, np.broadcast_to(range_m, amplitude.shape).astype(float), **(echo or {}))
    return value(Feature("F", law, numbers=numbers, **words), echoes, detector)


def test_amplitudes_plain_scaled_and_as_logarithms():
    assert of("photons", [3.0, 7.5]).tolist() == [3.0, 7.5]
    assert of("affine", [3.0], gain=2.0, offset=1.0).tolist() == [7.0]
    assert of("log", [1000.0], gain=10.0, offset=-5.0) == pytest.approx([25.0])
    assert of("range_corrected", [3.0], 4.0, gain=0.5).tolist() == [24.0]


def test_attenuation_knows_no_reflectance():
    assert of("attenuation", [1.0, 99.0], 50.0, per_m=0.004) == pytest.approx([np.exp(-0.2)] * 2)


@pytest.mark.parametrize(
    ("words", "percent", "expected"),
    [
        ({}, [10.0, 100.0], [10.0, 100.0]),
        ({}, [1000.0, 10_000.0, 1e6], [177.5, 255.0, 255.0]),
        ({"knee": 110.0}, [10.0, 100.0, 10_000.0], [11.0, 110.0, 255.0]),
        ({"knee": 110.0, "high": 200.0, "top_percent": 1000.0}, [1000.0, 316.22776601683796], [200.0, 155.0]),
        ({"above": "linear", "knee": 50.0}, [50.0, 300.0, 900.0], [25.0, 150.0, 255.0]),
        ({"above": "clip"}, [50.0, 100.0, 300.0], [50.0, 100.0, 100.0]),
    ],
)
def test_calibrated_reflectivity(words, percent, expected):
    amplitude = np.array(percent) / 100.0 * 1e5 / 10.0**2
    assert of("calibrated_reflectivity", amplitude, **words) == pytest.approx(expected)


def test_calibration_undoes_what_optics_lose_close_by():
    near = sensor(signal_at_1m=1e5, near_m=5.0)
    assert of("calibrated_reflectivity", [0.3 * 1e5 / 29.0], 2.0, detector=near) == pytest.approx([30.0])


def test_eight_bits_hold_255():
    amplitude = np.array([0.0, 0.1049, 0.105, 1.0, 1e6]) * 1e3
    assert of("calibrated_reflectivity", amplitude, bits=8, step=1.0).tolist() == [0.0, 10.0, 10.0, 100.0, 255.0]


def test_background_counts_scale():
    assert of(
        "background", [1.0, 1.0], echo={"background": np.array([12.0, 700.0])}, gain=0.5, bits=8, step=1.0
    ).tolist() == [6.0, 255.0]
    with pytest.raises(UsageError, match="no background"):
        of("background", [1.0])


def test_width_above_threshold_in_its_units():
    amplitude = [10.0 * np.exp(2.0), 10.0]
    width_ns = 2.0 * 5.0 / 2.3548 * 2.0
    assert of("width_above_threshold", amplitude, unit="ns") == pytest.approx([width_ns, 0.0])
    assert of("width_above_threshold", amplitude, unit="m") == pytest.approx([width_ns * 0.149896229, 0.0])
    assert of("width_above_threshold", amplitude, unit="cm") == pytest.approx([width_ns * 14.9896229, 0.0])
    longer = {"longer_ns": np.array([3.0, 0.0]), "fwhm_ns": 10.0}
    assert of("width_above_threshold", amplitude, echo=longer) == pytest.approx([2.0 * width_ns + 3.0, 0.0])
    with pytest.raises(UsageError, match="threshold above 0"):
        of("width_above_threshold", [1.0], detector=sensor(threshold=0.0))
    with pytest.raises(UsageError, match="linear detector"):
        of("width_above_threshold", [1.0], detector=chip())


def test_confidence_is_a_share_of_full_signal_over_noise():
    assert of("confidence", [10.0, 400.0], bits=8, step=1.0).tolist() == [64.0, 255.0]
    assert of("confidence", [10.0], high=1.0, snr_full=10.0) == pytest.approx([0.5])
    counts = {"floor_counts": np.array([44.0])}
    assert of("confidence", [100.0], detector=chip(), echo=counts, high=60.0) == pytest.approx(
        [60.0 * 100.0 / 12.0 / 20.0]
    )
    assert of("confidence", [10.0], high=9.0, detector=sensor(noise=0.0)).tolist() == [9.0]
    with pytest.raises(UsageError, match="no maximum"):
        of("confidence", [10.0])


def test_a_table_is_linear_in_the_logarithm_of_the_amplitude():
    table = ((1.0, 10.0, 1000.0), (0.0, 50.0, 250.0))
    assert of("table", [0.1, 1.0, np.sqrt(10.0), 100.0, 1e9], table=table) == pytest.approx(
        [0.0, 0.0, 25.0, 150.0, 250.0]
    )
    with pytest.raises(UsageError, match="no table"):
        of("table", [1.0])


def test_laws_of_other_detectors_are_refused():
    with pytest.raises(UsageError, match="peak_counts"):
        of("peak_counts", [1.0])


def test_steps_are_rounded_halves_to_even_and_then_cut():
    plain = np.array([-1.0, 0.25, 0.75, 1.25, 9.9])
    assert coded(Feature("F", "affine", step=0.5), plain).tolist() == [-1.0, 0.0, 1.0, 1.0, 10.0]
    assert coded(Feature("F", "affine", step=0.5, low=-0.3, high=3.2), plain).tolist() == [-0.3, 0.0, 1.0, 1.0, 3.2]
    assert coded(Feature("F", "affine", bits=3), plain).tolist() == [0.0, 0.25, 0.75, 1.25, 7.0]
    assert coded(Feature("F", "affine"), plain).tolist() == plain.tolist()
