"""Which variant measured, told by where PEAK ends."""

import numpy as np
import pytest

from lidarcheck.errors import InputError
from lidarcheck.kpi.variant import check_variant, other_variant, variant_of
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor

SLIM, SMART = Sensor.of("SLIM"), Sensor.of("SMART")


def scan_of(peak):
    n = len(peak)
    return Scan.from_beams(np.arange(n) % 500, np.arange(n) // 500, np.full(n, 20.0), peak=np.asarray(peak, float))


def strong(rng, mean, n=20_000):
    """PEAK of strong echoes: many detectors of 135 that fire with a probability near 1 each."""
    return rng.binomial(135, mean / 135, n)


def test_a_frame_of_many_brightnesses_still_ends_at_its_saturation():
    """A whole street: no gap below the saturation, and yet nothing above it."""
    rng = np.random.default_rng(1)
    peak = np.concatenate([strong(rng, mean) for mean in (90, 120, 128, 132, 134.9)])
    assert "no PEAK is above 135" in other_variant([scan_of(peak)], SLIM)
    assert variant_of(scan_of(peak)) == "SMART"
    with pytest.raises(InputError, match="that is how SMART saturates, not SLIM at 236"):
        check_variant(scan_of(peak), SLIM, "frame.pcd")


def test_a_few_echoes_of_a_far_sign_are_enough():
    peak = [135] * 12 + list(range(10, 60))
    assert other_variant([scan_of(peak)], SLIM)


@pytest.mark.parametrize("mean", [60, 90, 115])
def test_a_tail_that_happens_to_end_there_tells_nothing(mean):
    """SLIM sees a grey wall: where its strongest echo has the other's saturation, it is one of few."""
    rng = np.random.default_rng(mean)
    for _ in range(20):
        peak = rng.binomial(315, mean / 315, 20_000)
        assert not other_variant([scan_of(peak + 135 - peak.max())], SLIM)
    assert not other_variant([scan_of(strong(rng, 60))], SMART)
