"""Two-sample tests of the fast path against the exact chain, and changes planted in its library."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy import special, stats

from lidarcheck.model import echoes_of
from lidarcheck.model.fast import disturbed, library, run, store
from lidarcheck.model.fast import words as w
from lidarcheck.model.fast.grid import Grid
from lidarcheck.scan import Light, Scan
from lidarcheck.sensor import Sensor
from reference_grid import LAYERS, POINTS

SMALL = Grid(sample_bits=6)
"""The nodes of the default grid with an eighth of its samples, so that filling it takes a second."""
SMALL_LEVEL = Grid(sample_bits=4)
"""The same for each level of background."""
FRAME = LAYERS * POINTS
BACKGROUNDS = 512
"""Steps of a background that varies: the exact chain makes a table for each, and runs beams of one side by side."""
OCTAVES = range(-8, 14)
"""From S far below what any sensor sees to all detectors in saturation."""
MEANS = ("detected", "echoes", "width", "area", "peak", "range")


@contextlib.contextmanager
def small_library(directory: Path, grid: Grid = SMALL) -> Iterator[None]:
    """A library of few samples and dark beams, kept in that directory, and none in memory yet."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "DEFAULT_GRID", grid)
        patch.setattr(run, "LEVEL_GRID", SMALL_LEVEL)
        patch.setattr(store, "base_directory", lambda: directory)
        patch.setattr(disturbed, "_LEAST_BEAMS", 1 << 17)
        patch.setattr(disturbed, "_MOST_BEAMS", 1 << 19)
        patch.setattr(library, "_libraries", type(library._libraries)())
        yield


def frame_light(seed: int, background: float | tuple[float, float], octaves: range = OCTAVES) -> Light:
    """A frame of beams with one pulse each: S even in its logarithm, ranges anywhere between 10 and 200 m.

    `background`: of all beams, or the least and the most, between which it is even in its logarithm, in
    `BACKGROUNDS` steps.
    """
    rng = np.random.default_rng(seed)
    least, most = np.broadcast_to(background, 2)
    layer, point = np.divmod(np.arange(FRAME), POINTS)
    steps = np.random.default_rng([seed, 1]).integers(0, BACKGROUNDS, FRAME) / (BACKGROUNDS - 1)
    return Light(
        layer=layer,
        point=point,
        first_pulse=np.arange(FRAME + 1),
        pulse_range_m=rng.uniform(10.0, 200.0, FRAME),
        pulse_signal=2.0 ** rng.uniform(octaves.start, octaves.stop, FRAME),
        background_per_ns=least * (most / least) ** steps if least > 0.0 else np.zeros(FRAME),
    )


class Sample(NamedTuple):
    """What came of the beams, by beam: octave of S, echoes; of the first echo width, area, peak and range residual.

    `pool`: samples that the beams of an octave draw from.
    """

    octave: np.ndarray
    echoes: np.ndarray
    width: np.ndarray
    area: np.ndarray
    peak: np.ndarray
    range: np.ndarray
    pool: float = float(np.prod(SMALL.shape))

    @property
    def detected(self) -> np.ndarray:
        return self.echoes > 0


def sample(
    sensor: Sensor, background: float | tuple[float, float], fidelity: str, seed: int, frames: int = 2
) -> Sample:
    """Half a million beams a frame; the same light for both fidelities."""
    parts = []
    for frame in range(frames):
        light = frame_light(frame, background)
        scan = echoes_of(light, sensor, seed=seed, frame=frame, rounded=False, fidelity=fidelity)
        parts.append(by_beam(light, scan))
    whole = Sample(*(np.concatenate(columns) for columns in list(zip(*parts, strict=True))[:-1]))
    levels = sum(1 for source in library._libraries if source.grid == SMALL_LEVEL)
    return whole._replace(pool=levels * float(np.prod(SMALL_LEVEL.shape))) if levels else whole


def by_beam(light: Light, scan: Scan) -> Sample:
    beam = scan.layer.astype(np.int64) * POINTS + scan.point
    first = scan.echo_number == 1
    columns = []
    residual = scan.range_m - light.pulse_range_m[beam]
    for column in (scan.width_ns, scan.area, scan.peak, residual):
        values = np.full(len(light), np.nan)
        values[beam[first]] = column[first]
        columns.append(values)
    octave = np.floor(np.log2(light.pulse_signal)).astype(int)
    return Sample(octave, np.bincount(beam, minlength=len(light)), *columns)


def mean_p_values(ours: Sample, exact: Sample, names: tuple[str, ...] = MEANS) -> dict[str, float]:
    """p-value of the difference of each mean, octave by octave and then over all octaves together."""
    return {name: _p_of_means(getattr(ours, name), getattr(exact, name), ours, exact) for name in names}


def _p_of_means(one: np.ndarray, other: np.ndarray, ours: Sample, exact: Sample) -> float:
    a, b = _moments(one, ours), _moments(other, exact)
    used = np.minimum(a[0], b[0]) > 500
    difference = (b[0] * (a[1] - b[1]))[used].sum()
    fewer = effective(a[0][used], _moments(np.zeros(len(one)), ours)[0][used], ours.pool)
    variance = (b[0][used] ** 2 * (a[2][used] / fewer + b[2][used] / b[0][used])).sum()
    return float(2.0 * special.ndtr(-abs(difference) / np.sqrt(variance)))


def _moments(values: np.ndarray, of: Sample) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How many values there are in each octave, their mean and their variance."""
    known = ~np.isnan(values)
    octave, values = of.octave[known] - OCTAVES.start, values[known].astype(float)
    n, total, squares = (np.bincount(octave, values**power, len(OCTAVES)) for power in (0, 1, 2))
    mean = total / np.maximum(n, 1)
    return n, mean, squares / np.maximum(n, 1) - mean**2


def effective(n: np.ndarray, beams: np.ndarray, pool: float) -> np.ndarray:
    """The size of an independent sample as uncertain as `n` values of `beams` that draw from `pool` samples."""
    return 1.0 / (1.0 / n + beams / (n * pool))


def feature_p_values(ours: Sample, exact: Sample) -> dict[tuple[int, str], float]:
    """Kolmogorov-Smirnov p-values of each feature in each octave, and of detection a normal one."""
    p_values = {}
    for octave in OCTAVES:
        here, there = ours.octave == octave, exact.octave == octave
        for name in ("echoes", "width", "area", "peak", "range"):
            a, b = getattr(ours, name)[here], getattr(exact, name)[there]
            a, b = a[~np.isnan(a)], b[~np.isnan(b)]
            if min(len(a), len(b)) > 200:
                n = effective(len(a), here.sum(), ours.pool)
                distance = stats.ks_2samp(a, b, method="asymp").statistic
                p_values[octave, name] = float(special.kolmogorov(distance * np.sqrt(n * len(b) / (n + len(b)))))
    return p_values


def joint_p_value(ours: Sample, exact: Sample) -> float:
    """Chi-square over cells of all features together: thirds of each, for every octave and number of echoes."""
    statistic, freedom = 0.0, 0
    for octave in OCTAVES:
        here, there = ours.octave == octave, exact.octave == octave
        cells = [np.minimum(s.echoes[rows], 2) for s, rows in ((ours, here), (exact, there))]
        for name in ("width", "area", "peak", "range"):
            column, known = getattr(ours, name)[here], getattr(exact, name)[there]
            if np.isnan(known).all():
                continue
            thirds = np.nanquantile(known, [1 / 3, 2 / 3])
            for k, values in enumerate((column, known)):
                cells[k] = 3 * cells[k] + np.searchsorted(thirds, np.nan_to_num(values, nan=np.inf))
        n = effective(here.sum(), here.sum(), ours.pool), there.sum()
        size = max(c.max() for c in cells) + 1
        shares = [np.bincount(c, minlength=size) / len(c) for c in cells]
        pooled = (n[0] * shares[0] + n[1] * shares[1]) / (n[0] + n[1])
        large = pooled * min(n) >= 10
        merged = [np.append(s[large], s[~large].sum()) for s in (*shares, pooled)]
        used = merged[2] * min(n) >= 10
        statistic += float(((merged[0] - merged[1])[used] ** 2 / (merged[2][used] * (1 / n[0] + 1 / n[1]))).sum())
        freedom += int(used.sum()) - 1
    return float(stats.chi2.sf(statistic, freedom))


def plant(feature: str) -> None:
    """Read the libraries again and change a mean by 1 % in every sample that is filled, in memory alone."""
    rng = np.random.default_rng(1)
    for source, before in [*library._libraries.items()]:
        del library._libraries[source]
        changed = library.library_of(source)
        assert changed is not None
        changed.fill(before.filled)
        whole = changed._words
        for block in np.flatnonzero(changed.filled):
            part = slice(block * changed._size, (block + 1) * changed._size)
            whole[part] = _planted_words(whole[part], feature, rng)
        changed.samples = _planted_samples(changed.samples, feature, rng)


def _more(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """1 % more on average, in whole numbers."""
    return np.floor(values * 1.01 + rng.random(values.shape)).astype(values.dtype)


def _planted_words(words: np.ndarray, feature: str, rng: np.random.Generator) -> np.ndarray:
    words = words.copy()
    one = (words & np.uint64(w.KIND)) == w.ONE
    if feature == "detected":
        words[one & (rng.random(len(words)) < 0.01)] = w.NONE
        return words
    at, bits = {
        "width": (w.WIDTH_AT, w.WIDTH_BITS),
        "area": (w.AREA_AT, w.AREA_BITS),
        "peak": (w.PEAK_AT, w.PEAK_BITS),
        "range": (w.CENTRE_AT, w.CENTRE_BITS),
    }[feature]
    mask = np.uint64((1 << bits) - 1)
    values = (words >> np.uint64(at) & mask).astype(np.int64)
    moved = values + np.int64(BIAS_BINS / w.CENTRE_STEP) if feature == "range" else _more(values, rng)
    replaced = (words & ~(mask << np.uint64(at))) | moved.astype(np.uint64) << np.uint64(at)
    return np.where(one, replaced, words)


BIAS_BINS = 0.02
"""3 mm of range: 1 % of the 0.3 m by which pile-up moves a bright echo."""


def _planted_samples(samples: library.Samples, feature: str, rng: np.random.Generator) -> library.Samples:
    if feature == "detected":
        held = np.where(rng.random(len(samples.held)) < 0.01, 0, samples.held).astype(np.int32)
        return samples._replace(held=held)
    if feature == "range":
        return samples._replace(centre=samples.centre + BIAS_BINS)
    return samples._replace(**{feature: _more(getattr(samples, feature), rng)})
