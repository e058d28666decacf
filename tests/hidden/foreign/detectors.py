"""From light to echoes: a threshold on one amplitude a surface, a histogram of photons, an array of SPADs."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from hidden import kernel
from hidden import sensor as spads

from .device import LIGHT_M_NS, Device

F = NDArray[np.float64]
N = NDArray[np.int64]
AIR_STEP_M = 0.05


@dataclass
class Shine:
    """Light at the receiver, a row a surface (of a part of a beam), and what reaches each beam besides.

    `background`: of a `linear` detector variance of the amplitude, else counts per SPAD and ns; `threshold` in the
    detector's own unit; `stretch` of the pulse and `jitter_ns` of every shot; `haze_per_m`: signal that air gives per
    metre over steps of AIR_STEP_M, (steps,) or nothing.
    """

    beam: N
    range_m: F
    signal: F
    material: N
    incidence_deg: F
    background: F
    threshold: F
    surface_m: F
    stretch: float = 1.0
    jitter_ns: float = 0.0
    haze_per_m: F | None = None

    def added(self, beam: N, range_m: F, signal: F) -> None:
        """More pulses, of no material."""
        none = np.zeros(len(beam))
        for name, values in (
            ("beam", beam), ("range_m", range_m), ("signal", signal), ("material", none.astype(np.int64)),
            ("incidence_deg", none),
        ):  # fmt: skip
            setattr(self, name, np.concatenate([getattr(self, name), values]))


@dataclass
class Echoes:
    """Echoes of a frame, (n,) each: beam, path from the beam's origin [m], what the detector counts; and by beam."""

    beam: N
    path_m: F
    amplitude: F
    more: dict[str, F] = field(default_factory=dict)  # of echoes: peak, width_ns, snr
    of_beams: dict[str, F] = field(default_factory=dict)  # counts (beams, bins), ambient (beams,)

    def kept(self, rows: NDArray[np.bool_] | N) -> "Echoes":
        more = {name: values[rows] for name, values in self.more.items()}
        return Echoes(self.beam[rows], self.path_m[rows], self.amplitude[rows], more, self.of_beams)


def detect(shine: Shine, device: Device, rng: np.random.Generator) -> Echoes:
    """All echoes of a frame, before the sensor chooses among them."""
    kinds = {"linear": _linear, "photon_histogram": _histogram, "spad_array": _spads}
    return kinds[device.detector](shine, device, rng)


# --- one amplitude a surface ----------------------------------------------------------------------------------------


def _merged(beam: N, range_m: F, signal: F, apart_m: float) -> tuple[N, F, F]:
    """Surfaces of a beam nearer to the next than that are one: signals added, the range weighted by them."""
    order = np.lexsort((range_m, beam))
    beam, range_m, signal = beam[order], range_m[order], signal[order]
    new = np.ones(len(beam), bool)
    new[1:] = (np.diff(beam) != 0) | (np.diff(range_m) >= apart_m)
    group = np.cumsum(new) - 1
    total = np.bincount(group, signal)
    return beam[new], np.bincount(group, signal * range_m) / np.maximum(total, 1e-300), total


def _air(shine: Shine, sigma_m: float, beams: int) -> tuple[N, F, F]:
    """What the air of each beam answers with: the largest value of its profile, blurred by the pulse."""
    assert shine.haze_per_m is not None
    at = AIR_STEP_M * (np.arange(len(shine.haze_per_m)) + 0.5)
    offset = AIR_STEP_M * np.arange(-60, 61)
    answer = np.exp(-0.5 * (offset / sigma_m) ** 2)
    ends = np.where(shine.surface_m > 0, shine.surface_m, at[-1])
    where, strength = np.zeros(beams), np.zeros(beams)
    for end in np.unique(np.round(np.minimum(ends, 30.0), 1)):  # the maximum lies near: far surfaces change nothing
        cut = np.where(at < end, shine.haze_per_m, 0.0) * AIR_STEP_M
        blurred = np.convolve(cut, answer, mode="same")
        best = int(np.argmax(blurred))
        rows = np.round(np.minimum(ends, 30.0), 1) == end
        where[rows], strength[rows] = at[best], blurred[best]
    return np.arange(beams), where, strength


def _linear(shine: Shine, device: Device, rng: np.random.Generator) -> Echoes:
    own = device.numbers
    noise, excess = float(own.get("noise", 1.0)), float(own.get("excess", 0.0))
    fwhm = device.fwhm_ns * shine.stretch
    sigma_m = LIGHT_M_NS / 2 * fwhm / 2.3548
    apart = float(device.document["range"].get("min_separation_m", LIGHT_M_NS * device.fwhm_ns / 2))
    beam, range_m, signal = shine.beam, shine.range_m, shine.signal
    if shine.haze_per_m is not None:
        air = _air(shine, sigma_m, len(shine.background))
        beam, range_m, signal = (np.concatenate([a, b]) for a, b in zip((beam, range_m, signal), air, strict=True))
    beam, range_m, signal = _merged(beam, range_m, signal, apart)
    dark = noise**2 + shine.background
    sigma = np.sqrt(dark[beam] + excess * signal + (float(own.get("relative", 0.0)) * signal) ** 2)
    a = signal + sigma * rng.standard_normal(len(beam))
    heard = a > shine.threshold[beam]
    edge = float(own.get("edge_factor", 1.0))
    floor = float(own.get("range_floor_m", 0.01))
    spread = np.sqrt(floor**2 + (edge * sigma_m * sigma / np.maximum(signal, 1e-9)) ** 2)
    path = range_m + spread * rng.standard_normal(len(beam))
    path = path + LIGHT_M_NS / 2 * shine.jitter_ns * rng.standard_normal(len(beam))
    beam, path, a = beam[heard], path[heard], a[heard]
    false = _false(shine, device, dark, (beam, path), apart, rng)
    ambient = rng.poisson(dark).astype(float)
    parts = [np.concatenate([x, y]) for x, y in zip((beam, path, a), false, strict=True)]
    return Echoes(*parts, of_beams={"ambient": ambient})


def _false(
    shine: Shine, device: Device, dark: F, heard: tuple[N, F], apart: float, rng: np.random.Generator
) -> tuple[N, F, F]:
    """Rice's false echoes: at most one a shot, none near a true one."""
    low, high = device.gate_m
    bandwidth_hz = 0.44 / (device.fwhm_ns * 1e-9)
    rate_hz = bandwidth_hz / math.sqrt(3.0) * np.exp(-(shine.threshold**2) / (2.0 * dark))
    chance = -np.expm1(-2.0 * rate_hz * (high - low) / (LIGHT_M_NS * 1e9))
    beam = np.flatnonzero(rng.random(len(dark)) < chance)
    path = rng.uniform(low, high, len(beam))
    a = np.sqrt(shine.threshold[beam] ** 2 + 2.0 * dark[beam] * rng.exponential(size=len(beam)))
    near = [np.abs(heard[1][heard[0] == b] - r) < apart for b, r in zip(beam, path, strict=True)]
    alone = np.array([not one.any() for one in near], bool)
    return beam[alone], path[alone], a[alone]


# --- a histogram of photons -----------------------------------------------------------------------------------------


def _bins(device: Device) -> F:
    own = device.numbers
    return float(own.get("first_bin_ns", 0.0)) + float(own["bin_ns"]) * np.arange(int(own["bins"]) + 1)


def _share(edges: F, time_ns: F, sigma_ns: float) -> F:
    """Share of Gaussian pulses at times (n,) in each bin: (n, bins)."""
    summed = 0.5 * (1.0 + erf((edges[None] - time_ns[:, None]) / (sigma_ns * math.sqrt(2.0))))
    return np.diff(summed, axis=1)


def _trials(rate: F, own: dict[str, object], rng: np.random.Generator) -> F:
    """Counts (zones, bins) of first photons."""
    assert own.get("readout", "all") == "first"
    before = np.concatenate([np.zeros((len(rate), 1)), np.cumsum(rate, axis=1)[:, :-1]], axis=1)
    chance = np.exp(-before) * -np.expm1(-rate)
    trials = int(own["spads"]) * int(own["shots"])  # type: ignore[call-overload]
    rest = np.maximum(1.0 - chance.sum(axis=1, keepdims=True), 0.0)
    return np.stack([rng.multinomial(trials, q)[:-1] for q in np.concatenate([chance, rest], axis=1)]).astype(float)


def _histogram(shine: Shine, device: Device, rng: np.random.Generator) -> Echoes:
    own, edges = device.numbers, _bins(device)
    sigma = math.hypot(device.fwhm_ns / 2.3548 * shine.stretch, shine.jitter_ns)
    rate = np.zeros((len(shine.background), len(edges) - 1))
    np.add.at(rate, shine.beam, shine.signal[:, None] * _share(edges, 2 * shine.range_m / LIGHT_M_NS, sigma))
    glass = _share(edges, np.zeros(1), sigma)[0] * float(own.get("cover_glass", 0.0))
    rate = rate + glass + shine.background[:, None] * float(own["bin_ns"])
    counts = _trials(rate, own, rng)
    clean = -np.diff(np.exp(-np.concatenate([[0.0], np.cumsum(glass)])))
    found = [_peaks(row, clean, edges, device, float(t)) for row, t in zip(counts, shine.threshold, strict=True)]
    rows = [(zone, *echo) for zone, echoes in enumerate(found) for echo in echoes]
    table = np.array(rows, np.float64).reshape(-1, 5)
    snr = table[:, 2] / np.sqrt(np.maximum(table[:, 2] + table[:, 3], 1.0))
    more = {"snr": snr, "width_ns": table[:, 4]}
    return Echoes(table[:, 0].astype(np.int64), table[:, 1] * LIGHT_M_NS / 2, table[:, 2], more, {"counts": counts})


def _floor(counts: F) -> float:
    """Background counts per bin, of the last quarter."""
    last = counts[-(len(counts) // 4) :]
    middle = float(np.sort(last)[(len(last) - 1) // 2])
    return float(last[np.abs(last - middle) <= 3.0 * math.sqrt(max(middle, 1.0))].mean())


def _peaks(counts: F, clean: F, edges: F, device: Device, threshold: float) -> list[tuple[float, ...]]:
    """Echoes of a histogram as (time [ns], counts, background counts in the window, its counts' spread [ns])."""
    width, fwhm = edges[1] - edges[0], device.fwhm_ns
    centre = (edges[1:] + edges[:-1]) / 2
    floor = _floor(counts)
    inner = np.abs(centre) <= fwhm / 2
    near = np.abs(centre) <= 2 * fwhm
    scale = float((counts[inner] - floor).sum() / max(clean[inner].sum(), 1e-300))
    glass = np.where(near, clean * max(scale, 0.0), 0.0)
    half = math.ceil(2 * fwhm / width)
    pulse = _share(width * (np.arange(-half, half + 2) - 0.5), np.zeros(1), fwhm / 2.3548)[0]
    pulse = pulse / pulse.sum()
    left = counts - floor - glass
    score = np.correlate(left, pulse, "same") / np.sqrt(np.correlate(np.maximum(floor + glass, 1.0), pulse**2, "same"))
    padded = np.concatenate([[-np.inf], score, [-np.inf]])
    tops = np.flatnonzero((score >= padded[:-2]) & (score > padded[2:]) & (score > threshold))
    taken: list[int] = []
    for k in tops[np.argsort(-score[tops], kind="stable")]:
        if all(abs(centre[k] - centre[j]) >= fwhm for j in taken):
            taken.append(int(k))
    return [_centroid(left, floor, edges, float(centre[k]), fwhm) for k in taken]


def _centroid(left: F, floor: float, edges: F, at: float, fwhm: float) -> tuple[float, ...]:
    width, centre = edges[1] - edges[0], (edges[1:] + edges[:-1]) / 2
    total, inside = 0.0, np.zeros(len(left))
    for _ in range(10):
        inside = np.clip((np.minimum(edges[1:], at + fwhm) - np.maximum(edges[:-1], at - fwhm)) / width, 0.0, 1.0)
        total = float((left * inside).sum())
        if total <= 0:
            break
        new = float((left * inside * centre).sum()) / total
        done, at = abs(new - at) < 0.01 * width, new
        if done:
            break
    spread = math.sqrt(max(float((left * inside * (centre - at) ** 2).sum()) / max(total, 1.0), 0.0))
    return at, total, floor * float(inside.sum()), spread


# --- an array of SPADs ----------------------------------------------------------------------------------------------


def _spads(shine: Shine, device: Device, rng: np.random.Generator) -> Echoes:
    """The generator's own detectors of SLIM; light rows and thresholds by beam are all they need to know."""
    n = len(shine.background)
    rows = len(shine.beam)
    light = spads.Light(
        shine.beam, shine.range_m, shine.signal, shine.material, shine.incidence_deg, np.ones(rows, bool),
        np.full(rows, spads.ALL_SHOTS, np.int64), shine.background, shine.surface_m,
    )  # fmt: skip
    if shine.haze_per_m is not None:
        at = AIR_STEP_M * (np.arange(len(shine.haze_per_m)) + 0.5)
        part = shine.haze_per_m * AIR_STEP_M
        fine = np.histogram(2 * at / LIGHT_M_NS, np.arange(0, kernel.BINS, 0.5), weights=part)[0]
        pulse = np.exp(-0.5 * (0.5 * np.arange(-24, 25) / (device.fwhm_ns / 2.3548)) ** 2)
        smooth = np.convolve(fine, pulse / pulse.sum(), mode="same")
        light.haze = np.zeros((1, kernel.BINS))
        light.haze[0, : len(smooth) // 2] = smooth[: len(smooth) // 2 * 2].reshape(-1, 2).sum(axis=1)
        light.haze_of, light.haze_gain = np.zeros(n, np.int64), np.ones(n)
    own = spads.Detectors(shine.threshold, spads.gaussian_shape(device.fwhm_ns * shine.stretch))
    found = spads.detect(light, own, "SLIM", int(rng.integers(2**31)))
    path = found.range_m + LIGHT_M_NS / 2 * shine.jitter_ns * rng.standard_normal(len(found.beam))
    return Echoes(found.beam, path, found.area, {"peak": found.peak, "width_ns": found.width_ns})
