"""Hazy light for tests of the haze."""

import numpy as np

from lidarcheck.scan import Haze, Light, PulseShape, Scan

COLUMNS = ("x_m", "y_m", "z_m", "layer", "point", "echo_number", "width_ns", "area", "peak")
TAIL = PulseShape(5.0, 0.3, 8.0)


def light(
    n: int,
    density: np.ndarray,
    ends: list[float],
    shares: list[float] | None = None,
    *,
    step_m: float = 0.05,
    pulse: tuple[float, float] = (10.0, 0.0),
    background: float = 3e-4,
    shape: PulseShape | None = None,
) -> Light:
    """`n` beams alike, with a pulse (range, signal) each, and haze of a row for each of `ends`."""
    rows = len(ends)
    factors = np.ones(rows) if shares is None else np.array(shares)
    haze = Haze(step_m, density, np.arange(n + 1) * rows, np.tile(ends, n), np.tile(factors, n))
    beams = np.zeros(n), np.arange(n), np.full(n, background)
    return Light(*beams, np.arange(n + 1), np.full(n, pulse[0]), np.full(n, pulse[1]), shape=shape, haze=haze)


def fog(mor_m: float, length_m: float, *, step_m: float = 0.05, start_m: float = 2.0) -> np.ndarray:
    """Backscatter of homogeneous fog, S per metre, of the reference sensor."""
    range_m = (np.arange(int(length_m / step_m)) + 0.5) * step_m
    alpha = np.log(20.0) / mor_m
    density = 6000.0 * np.pi * 0.046 / mor_m * np.exp(-2.0 * alpha * range_m) / range_m**2
    return np.where(range_m > start_m, density, 0.0)


def same(one: Scan, other: Scan) -> bool:
    return all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in COLUMNS)
