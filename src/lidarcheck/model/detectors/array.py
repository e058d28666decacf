"""The SPADs of a point as an array, and what they do to each other, as kernels see it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.model.exact.numbers import Numbers
from lidarcheck.sensor import NonIdeal, SpadArray

__all__ = ["Detectors", "array_shape", "detectors_of"]

_ROWS = 3
"""Rows of SPADs a point has; a number of SPADs that they do not divide stands in one row."""
_GUIDE = 256
"""Entry points into the distribution function of dead times."""
_WARM_UP_DEAD_TIMES = 4
_WARM_UP_DELAYS = 5
_WARM_UP_NS = 1000.0
_SPREADS = 9.0
"""Standard deviations beyond which a dead time does not vary: 1e-19."""
_RECOVERIES = 28.0
"""Mean times of recovery beyond which a SPAD is ready: 1e-12."""
_ROOM = 1 << 22
"""Most afterpulses of a beam that can wait at the same time."""
_LIMITS: dict[str, tuple[float, float]] = {
    "crosstalk_sides": (0.0, 4.0),
    "crosstalk_corners": (0.0, 4.0),
    "afterpulse": (0.0, 0.95),
    "afterpulse_ns": (0.0, 1e6),
    "afterpulse_slow_share": (0.0, 1.0),
    "afterpulse_slow_ns": (0.0, 1e6),
    "dead_spread_ns": (0.0, 1000.0),
    "dead_recovery_ns": (0.0, 1000.0),
}


class Detectors(NamedTuple):
    """What an avalanche may set off, and how long it leaves its detector dead; times in bins.

    Nine things can happen: crosstalk to the four sides (0 ... 3) and the four corners (4 ... 7), and an afterpulse (8).
    `chance` (9,): of each; `quiet` (10,): that none happens from the j-th on. `neighbour` (detectors, 8): the detector
    on each side and corner, -1 where the array ends. `delay`, `slow_delay`: means; `slow_share` of the afterpulses are
    slow. `dead_up_to` (n,): probability that the dead time is at most `dead_least` + j; n = 1 where it is fixed;
    `dead_guide[g]`: where to begin looking for a uniform number from g / 256 on. `warm_up`: bins before bin 0. `room`:
    afterpulses that may wait at a time.
    """

    chance: FloatArray
    quiet: FloatArray
    neighbour: npt.NDArray[np.int32]
    delay: float
    slow_delay: float
    slow_share: float
    dead_least: int
    dead_up_to: FloatArray
    dead_guide: IndexArray
    warm_up: int
    room: int


def array_shape(spads: int) -> tuple[int, int]:
    """Rows and columns of the SPADs of a point."""
    return (_ROWS, spads // _ROWS) if spads % _ROWS == 0 else (1, spads)


def detectors_of(sensor: SpadArray, numbers: Numbers) -> Detectors:
    """The sensor's SPADs as kernels see them; `UsageError` names a number of `sensor.nonideal` that is out of range."""
    real = sensor.nonideal
    _check(real)
    chance = np.array([real.crosstalk_sides / 4.0] * 4 + [real.crosstalk_corners / 4.0] * 4 + [real.afterpulse])
    least, up_to = _dead_times(sensor)
    longest = least + len(up_to) - 1
    warm_up = _warm_up(sensor, longest)
    avalanches = numbers.detectors * ((warm_up + numbers.bins) // least + 1)
    return Detectors(
        chance=chance,
        # In the order in which a kernel multiplies them, so that both round alike.
        quiet=np.array([math.prod(1.0 - chance[j:]) for j in range(10)]),
        neighbour=_neighbours(sensor),
        delay=real.afterpulse_ns / sensor.bin_ns,
        slow_delay=real.afterpulse_slow_ns / sensor.bin_ns,
        slow_share=real.afterpulse_slow_share,
        dead_least=least,
        dead_up_to=up_to,
        dead_guide=np.searchsorted(up_to, np.arange(_GUIDE) / _GUIDE, side="right"),
        warm_up=warm_up,
        room=min(avalanches, _ROOM) if real.afterpulse > 0.0 else 1,
    )


def _warm_up(sensor: SpadArray, longest: int) -> int:
    """Bins before bin 0 after which the state at their beginning is forgotten; `longest`: the longest dead time."""
    real, settled = sensor.nonideal, _WARM_UP_DEAD_TIMES * longest
    if real.afterpulse == 0.0:
        return settled
    delay_ns = max(real.afterpulse_ns, real.afterpulse_slow_ns if real.afterpulse_slow_share > 0.0 else 0.0)
    chain = (settled + _WARM_UP_DELAYS * delay_ns / sensor.bin_ns) / (1.0 - real.afterpulse)
    return math.ceil(min(chain, settled + _WARM_UP_NS / sensor.bin_ns))


def _check(real: NonIdeal) -> None:
    for name, (low, high) in _LIMITS.items():
        value = getattr(real, name)
        if not low <= value <= high:
            raise UsageError(f"{name} = {value} is out of range", fix=f"use a number from {low:g} to {high:g}")


def _neighbours(sensor: SpadArray) -> npt.NDArray[np.int32]:
    """The detector at each side and corner of each, shape (detectors, 8), -1 where there is none; shots are apart."""
    rows, columns = array_shape(sensor.spads)
    shot, row, column = np.indices((sensor.shots, rows, columns)).reshape(3, -1)
    steps = [(0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]
    found = np.full((sensor.detectors, len(steps)), -1, dtype=np.int32)
    for j, (down, right) in enumerate(steps):
        r, c = row + down, column + right
        inside = (r >= 0) & (r < rows) & (c >= 0) & (c < columns)
        found[inside, j] = ((shot * rows + r) * columns + c)[inside]
    return found


def _dead_times(sensor: SpadArray) -> tuple[int, FloatArray]:
    """The least dead time and the distribution function from there on: rounded numbers, `on_bins` at least."""
    real = sensor.nonideal
    spread, recovery = real.dead_spread_ns / sensor.bin_ns, real.dead_recovery_ns / sensor.bin_ns
    least = max(sensor.on_bins, math.floor(sensor.dead_bins - _SPREADS * spread))
    most = max(math.ceil(sensor.dead_bins + _SPREADS * spread + _RECOVERIES * recovery), least)
    if spread == recovery == 0.0 or most == least:
        return sensor.dead_bins, np.ones(1)
    longer = np.arange(least, most + 1, dtype=np.float64) + 0.5 - sensor.dead_bins
    up_to = _distribution(longer, spread, recovery)
    up_to[-1] = 1.0
    return least, up_to


def _distribution(longer: FloatArray, spread: float, recovery: float) -> FloatArray:
    """The probability that a normal number and an exponential one, of mean 0 and `recovery`, are not `longer` together;
    all in bins."""
    if recovery == 0.0:
        from scipy.special import ndtr

        return np.asarray(ndtr(longer / spread))
    if spread == 0.0:
        return np.asarray(-elementary.expm1(-np.maximum(longer, 0.0) / recovery))
    from scipy.stats import exponnorm

    return np.asarray(exponnorm.cdf(longer, recovery / spread, scale=spread))
