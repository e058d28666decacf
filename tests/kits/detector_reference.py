"""A slow, independent simulator of SPADs that disturb each other: every bin, every SPAD, plain numpy.

Written from the sensor's documentation, with its own random numbers: a coin per SPAD and bin, a map of the afterpulses
that are due, and a start with all SPADs armed that settles over many dead times and delays of background.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from lidarcheck.model.reference import echoes_of_trace
from lidarcheck.scan import Light
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, Sensor

SETTLING_DEAD_TIMES = 15
SETTLING_DEAD_TIMES_IN_THE_DARK = 4
"""Where hardly any detector avalanches within a dead time: by then what they do before it is of the fourth order."""
DARK = 0.01
"""Avalanches of background per detector and dead time."""
SETTLING_DELAYS = 6
SIDES = [(0, 1), (0, -1), (1, 0), (-1, 0)]
CORNERS = [(1, 1), (1, -1), (-1, 1), (-1, -1)]


def rates_of(light: Light, sensor: Sensor) -> np.ndarray:
    """Avalanches per armed SPAD in each bin, shape (beams, bins)."""
    edges_ns = np.arange(sensor.bins + 1) * sensor.bin_ns
    rates = np.repeat(light.background_per_ns[:, None] * sensor.bin_ns, sensor.bins, axis=1)
    for beam in range(len(light)):
        for j in range(light.first_pulse[beam], light.first_pulse[beam + 1]):
            after_ns = edges_ns - 2.0 * light.pulse_range_m[j] / LIGHT_SPEED_M_PER_NS
            rates[beam] += light.pulse_signal[j] * np.diff(ndtr(after_ns / sensor.sigma_ns))
    return rates


def neighbours_of(rows: int, columns: int, steps: list[tuple[int, int]]) -> np.ndarray:
    """The SPAD that lies so far down and to the right of each, shape (steps, SPADs); -1 where the array ends."""
    row, column = np.divmod(np.arange(rows * columns), columns)
    to = [(row + down, column + right) for down, right in steps]
    return np.array([np.where((r >= 0) & (r < rows) & (c >= 0) & (c < columns), r * columns + c, -1) for r, c in to])


def set_off(fresh: np.ndarray, neighbours: np.ndarray, chances: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """What the SPADs that avalanche reach, shape (shots, SPADs) as they; each tries each neighbour once."""
    shot, spad = np.divmod(np.flatnonzero(fresh), fresh.shape[1])
    step, one = np.nonzero(rng.random((len(neighbours), len(spad))) < chances[:, None])
    to = neighbours[step, spad[one]]
    hit = np.zeros_like(fresh)
    hit[shot[one][to >= 0], to[to >= 0]] = True
    return hit


def avalanches(
    rates: np.ndarray, background: np.ndarray, sensor: Sensor, rng: np.random.Generator, settling: int | None = None
) -> np.ndarray:
    """Which SPADs avalanche in which bin: shape (bins, beams, shots, rows, columns), booleans.

    `rates` (beams, bins), `background` (beams,): avalanches per armed SPAD and bin, the latter before bin 0.
    """
    real = sensor.nonideal
    rows = 3 if sensor.spads % 3 == 0 else 1
    columns = sensor.spads // rows
    shots = (len(rates) * sensor.shots, sensor.spads)
    if settling is None:
        delay = max(real.afterpulse_ns, real.afterpulse_slow_ns) if real.afterpulse else 0.0
        dark = background.max() * sensor.dead_bins < DARK
        dead_times = SETTLING_DEAD_TIMES_IN_THE_DARK if dark else SETTLING_DEAD_TIMES
        settling = dead_times * sensor.dead_bins + int(SETTLING_DELAYS * delay / sensor.bin_ns)
    rates = np.concatenate([np.repeat(background[:, None], settling, axis=1), rates], axis=1)
    chances = np.repeat(-np.expm1(-rates.T), sensor.shots, axis=1)
    bins = len(chances)
    armed_from, due = np.zeros(shots, dtype=int), np.zeros((bins, *shots), dtype=bool)
    out = np.zeros((bins, *shots), dtype=bool)
    neighbours = neighbours_of(rows, columns, SIDES + CORNERS)
    reaches = np.repeat([real.crosstalk_sides / 4, real.crosstalk_corners / 4], 4)
    for k in range(bins):
        armed = armed_from <= k
        fired = armed & ((rng.random(shots) < chances[k][:, None]) | due[k])
        fresh = fired
        while reaches.any() and fresh.any():
            fresh = set_off(fresh, neighbours, reaches, rng) & armed & ~fired
            fired = fired | fresh
        out[k] = fired
        where = np.flatnonzero(fired)
        n = len(where)
        dead = np.full(n, sensor.dead_bins)
        if max(real.dead_spread_ns, real.dead_recovery_ns) > 0.0:
            drawn = rng.normal(sensor.dead_bins, real.dead_spread_ns / sensor.bin_ns, n)
            drawn = np.round(drawn + rng.exponential(real.dead_recovery_ns / sensor.bin_ns, n))
            dead = np.maximum(drawn, sensor.on_bins).astype(int)
        armed_from.flat[where] = k + dead
        mean_ns = np.where(rng.random(n) < real.afterpulse_slow_share, real.afterpulse_slow_ns, real.afterpulse_ns)
        later = k + dead + np.floor(rng.exponential(1.0, n) * mean_ns / sensor.bin_ns).astype(int)
        comes = (rng.random(n) < real.afterpulse) & (later < bins)
        due.reshape(bins, -1)[later[comes], where[comes]] = True
    return out[settling:].reshape(-1, len(rates), sensor.shots, rows, columns)


def traces_of(light: Light, sensor: Sensor, rng: np.random.Generator) -> np.ndarray:
    """SPADs ON in each bin, shape (beams, bins), with `sensor.on_bins` of history before bin 0."""
    background = light.background_per_ns * sensor.bin_ns
    history = np.repeat(background[:, None], sensor.on_bins, axis=1)
    counts = avalanches(np.concatenate([history, rates_of(light, sensor)], axis=1), background, sensor, rng)
    per_bin = counts.sum(axis=(2, 3, 4)).T
    total = np.cumsum(np.pad(per_bin, ((0, 0), (1, 0))), axis=1)
    ends = np.arange(sensor.on_bins, per_bin.shape[1])
    return np.asarray(total[:, ends + 1] - total[:, ends + 1 - sensor.on_bins])


def echoes(light: Light, sensor: Sensor, rng: np.random.Generator, chunk: int = 100) -> np.ndarray:
    """All echoes of all beams, a row each: beam, range [m], width [ns], area, peak."""
    found = []
    for start in range(0, len(light), chunk):
        beams = slice(start, min(start + chunk, len(light)))
        first = light.first_pulse[start : beams.stop + 1]
        part = Light(
            layer=light.layer[beams],
            point=light.point[beams],
            background_per_ns=light.background_per_ns[beams],
            first_pulse=first - first[0],
            pulse_range_m=light.pulse_range_m[first[0] : first[-1]],
            pulse_signal=light.pulse_signal[first[0] : first[-1]],
        )
        for i, trace in enumerate(traces_of(part, sensor, rng)):
            found += [(start + i, *echo) for echo in echoes_of_trace(trace, sensor)]
    return np.array(found, dtype=np.float64).reshape(-1, 5)
