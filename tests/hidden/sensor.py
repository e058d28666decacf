"""The sensor of the written contract, in numbers, and the frame of detectors around the compiled kernel."""

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from . import kernel

F = NDArray[np.float64]
N = NDArray[np.int64]

LIGHT_M_NS = 0.299792458
SIGNAL_AT_1M = 6000.0
BACKGROUND_PER_NS = 3e-4
THRESHOLD = 9
ON_BINS = 9
DEAD_BINS = 12
FWHM_NS = 5.0
SHOTS = 5
ALL_SHOTS = (1 << SHOTS) - 1
SPADS = {"SMART": 27, "SLIM": 63}
SPAD_ROWS = 3
PEAK_SATURATION = {"SMART": 135.0, "SLIM": 236.0}
ECHO_DELAY_NS = 4.0
SWEEP_S = 0.030
POINTS = 960
LAYERS = 520

TABLE_START_NS, TABLE_STEP_NS = -30.0, 0.05
TABLE_NS = TABLE_START_NS + TABLE_STEP_NS * np.arange(int(180.0 / TABLE_STEP_NS))


def gaussian_shape(fwhm_ns: float) -> F:
    """Summed share of a Gaussian pulse's light over TABLE_NS."""
    sigma_ns = fwhm_ns / 2.3548
    return np.asarray(0.5 * (1.0 + erf(TABLE_NS / (sigma_ns * math.sqrt(2.0)))))


def summed_shape(power: F) -> F:
    """Summed share of the light of a pulse whose power over TABLE_NS is given, in any unit."""
    summed = np.cumsum(power)
    return np.asarray(summed / summed[-1])


@dataclass
class Detectors:
    """What an effect may change about the detectors and the threshold."""

    threshold: F  # (beams,)
    shape: F = field(default_factory=lambda: gaussian_shape(FWHM_NS))
    dead: tuple[int, int, float] = (DEAD_BINS, kernel.DEAD_FIXED, 0.0)
    after: tuple[int, float, float, float] = (kernel.AFTER_NONE, 0.0, 1.0, 1.0)
    cross: tuple[int, float, bool] = (kernel.CROSS_NONE, 0.0, False)
    cross_by_offset: dict[tuple[int, int], float] = field(default_factory=dict)  # (row, column) offset -> chance


@lru_cache(maxsize=64)
def _neighbours(spads: int, offsets: tuple[tuple[int, int, float], ...]) -> tuple[N, N, F]:
    """CSR lists of each SPAD's neighbours and their chances, within 3 rows."""
    columns = spads // SPAD_ROWS
    first, neighbour, chance = [0], [], []
    for i in range(spads):
        for down, right, p in offsets:
            row, column = i // columns + down, i % columns + right
            if 0 <= row < SPAD_ROWS and 0 <= column < columns:
                neighbour.append(row * columns + column)
                chance.append(p)
        first.append(len(neighbour))
    return np.array(first, np.int64), np.array(neighbour, np.int64), np.array(chance, np.float64)


@dataclass
class Echoes:
    """Echoes of a frame, sorted by beam and range: row of the beam, range [m], PEAK, AREA, WIDTH [ns]."""

    beam: N
    range_m: F
    peak: F
    area: F
    width_ns: F

    def kept(self, keep: NDArray[np.bool_] | N) -> "Echoes":
        """The chosen rows, sorted by beam and range again."""
        part = Echoes(self.beam[keep], self.range_m[keep], self.peak[keep], self.area[keep], self.width_ns[keep])
        o = np.lexsort((part.range_m, part.beam))
        return Echoes(part.beam[o], part.range_m[o], part.peak[o], part.area[o], part.width_ns[o])


@dataclass
class Light:
    """Pulses at the receiver, a row each, and what reaches each beam besides."""

    beam: N
    range_m: F
    signal: F
    material: N
    incidence_deg: F
    direct: NDArray[np.bool_]  # comes straight from the surface that its beam meets
    mask: N  # bit per shot
    background: F  # (beams,) avalanches per armed SPAD and ns
    surface_m: F  # (beams,) what the beam meets first; 0 for nothing
    haze: F = field(default_factory=lambda: np.zeros((1, kernel.BINS)))  # (profiles, bins) rate
    haze_of: N | None = None  # (beams,) profile of each beam
    haze_gain: F | None = None  # (beams,)

    def added(self, beam: N, range_m: F, signal: F, material: N | None = None, mask: N | None = None) -> None:
        """Appends pulses that come by another way than straight from the beam's own surface."""
        new = len(beam)
        self.beam = np.concatenate([self.beam, beam.astype(np.int64)])
        self.range_m = np.concatenate([self.range_m, range_m])
        self.signal = np.concatenate([self.signal, signal])
        self.material = np.concatenate([self.material, np.zeros(new, np.int64) if material is None else material])
        self.incidence_deg = np.concatenate([self.incidence_deg, np.zeros(new)])
        self.direct = np.concatenate([self.direct, np.zeros(new, bool)])
        self.mask = np.concatenate([self.mask, np.full(new, ALL_SHOTS, np.int64) if mask is None else mask])

    def scale_beams(self, factor: F, background: F) -> None:
        """Scales all light of each beam, and its background: both (beams,)."""
        self.signal = self.signal * factor[self.beam]
        self.background = self.background * background
        if self.haze_gain is not None:
            self.haze_gain = self.haze_gain * factor


def detect(light: Light, detectors: Detectors, variant: str, seed: int) -> Echoes:
    """Follows every detector of every beam and takes the echoes out of their sum."""
    strong = (light.signal > 1e-6) & (light.range_m > 0) & (light.range_m < 310.0)
    order = np.flatnonzero(strong)[np.argsort(light.beam[strong], kind="stable")]
    beams = len(light.background)
    first_row = np.concatenate([[0], np.cumsum(np.bincount(light.beam[order], minlength=beams))]).astype(np.int64)
    offsets = tuple((down, right, p) for (down, right), p in sorted(detectors.cross_by_offset.items()))
    first, neighbour, chance = _neighbours(SPADS[variant], offsets)
    none = light.haze_of is None or light.haze_gain is None
    cut_bin = np.where(light.surface_m > 0, light.surface_m, 400.0) * 2.0 / LIGHT_M_NS
    rows = kernel.follow(
        seed, first_row, 2.0 * light.range_m[order] / LIGHT_M_NS, light.signal[order],
        np.zeros(len(order), np.int64), light.mask[order], detectors.shape[None], TABLE_START_NS, TABLE_STEP_NS,
        light.background, detectors.threshold, light.haze,
        np.full(beams, -1, np.int64) if none else light.haze_of, np.zeros(beams) if none else light.haze_gain,
        cut_bin, FWHM_NS / 2.3548, SPADS[variant], SHOTS, ON_BINS, detectors.dead, detectors.after, detectors.cross,
        first, neighbour, chance, PEAK_SATURATION[variant], ECHO_DELAY_NS,
    )  # fmt: skip
    return Echoes(rows[:, 0].astype(np.int64), rows[:, 1] * LIGHT_M_NS / 2.0, rows[:, 2], rows[:, 3], rows[:, 4])
