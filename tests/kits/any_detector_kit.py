"""Sensors and light for tests of the detectors that a file describes, made without any file."""

from __future__ import annotations

import numpy as np

from lidarcheck.scan import Light
from lidarcheck.sensor.grid import Axis, GridBeams
from lidarcheck.sensor.linear import Linear
from lidarcheck.sensor.photon_histogram import PhotonHistogram
from lidarcheck.sensor.sweep import Sweep

LIGHT_SPEED = 0.299792458
SIDE = 1000


def sensor(kind=Linear, **numbers):
    """A sensor of `kind` with these numbers, on a grid of 1000 x 1000 beams."""
    sweep = Sweep()
    beams = GridBeams(sweep, Axis(SIDE, -5.0, 0.01), Axis(SIDE, -5.0, 0.01))
    plain = {
        "frame_rate_hz": 10.0,
        "max_echoes": 1,
        "min_range_m": 0.0,
        "max_range_m": 300.0,
        "range_resolution_m": 0.01,
    }
    plain |= {"signal_at_1m": 1e5, "pulse_fwhm_ns": 5.0, "variant": "test", "sweep": sweep, "beams": beams} | numbers
    return kind(**plain)


def chip(**numbers):
    """A histogram chip: 128 bins of 0.1 ns, a million trials, a pulse of 0.6 ns."""
    plain = {"spads": 10, "shots": 100_000, "bins": 128, "bin_ns": 0.1, "first_bin_ns": -1.0, "pulse_fwhm_ns": 0.6}
    plain |= {"signal_at_1m": 1e-3, "background_per_ns": 1e-5, "threshold_sigma": 6.0, "range_resolution_m": 0.0}
    return sensor(PhotonHistogram, **(plain | {"max_range_m": 1.7} | numbers))


def light(range_m, signal, background=0.0, haze=None, shape=None):
    """Beams with as many pulses as the rows of `range_m` (n, pulses) have columns; `signal` broadcasts to it."""
    range_m = np.atleast_2d(np.asarray(range_m, dtype=float))
    n, pulses = range_m.shape
    beam = np.arange(n)
    return Light(
        layer=beam // SIDE,
        point=beam % SIDE,
        background_per_ns=np.broadcast_to(np.asarray(background, dtype=float), n).copy(),
        first_pulse=np.arange(n + 1) * pulses,
        pulse_range_m=range_m.ravel(),
        pulse_signal=np.broadcast_to(signal, range_m.shape).ravel().copy(),
        haze=haze,
        shape=shape,
    )


def same(n, range_m, signal, **more):
    """`n` beams that all have these pulses."""
    row = np.atleast_1d(np.asarray(range_m, dtype=float))
    return light(np.tile(row, (n, 1)), np.atleast_1d(signal), **more)


def z_of_share(hits, n, share):
    """By how many standard deviations a count lies beside what a share makes expect."""
    return (hits - n * share) / np.sqrt(n * share * (1.0 - share))
