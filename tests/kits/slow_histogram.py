"""The histogram chip as the contract on sensors (6.2) states it, in plain numpy, written without the package."""

import math

import numpy as np
from scipy.stats import norm

C = 0.299792458


def rates(sensor, ranges_m, signals, background_per_ns, glass=None):
    """lambda_k: avalanches per armed SPAD and shot in each bin."""
    sigma = sensor.pulse_fwhm_ns / 2.3548
    edges = sensor.first_bin_ns + np.arange(sensor.bins + 1) * sensor.bin_ns
    found = np.full(sensor.bins, background_per_ns * sensor.bin_ns)
    found += (sensor.cover_glass if glass is None else glass) * np.diff(norm.cdf(edges / sigma))
    for range_m, signal in zip(ranges_m, signals, strict=True):
        found += signal * np.diff(norm.cdf((edges - 2.0 * range_m / C) / sigma))
    return found


def chances(sensor, rate):
    """q_k, one bin after the other."""
    q = []
    for k, r in enumerate(rate):
        if sensor.readout == "first":
            q.append(math.exp(-sum(rate[:k])) * -math.expm1(-r))
        else:
            q.append(-math.expm1(-r) * (1.0 - sum(q[max(0, k - sensor.dead_bins + 1) : k])))
    return np.array(q)


def counts(sensor, rate, rng):
    """One histogram."""
    q = chances(sensor, rate)
    if sensor.readout == "first":
        return rng.multinomial(sensor.trials, [*q, 1.0 - q.sum()])[:-1]
    return rng.binomial(sensor.trials, q)


def single_spads(sensor, rate, trials, rng):
    """Counts of SPADs that are followed one by one from bin to bin, each dead for `dead_bins` after an avalanche."""
    free_from = np.zeros(trials, dtype=int)
    found = np.zeros(len(rate), dtype=int)
    for k, r in enumerate(rate):
        fires = (free_from <= k) & (rng.random(trials) < -math.expm1(-r))
        free_from[fires] = k + (len(rate) if sensor.readout == "first" else sensor.dead_bins)
        found[k] = fires.sum()
    return found


def background(histogram):
    quarter = np.sort(histogram[len(histogram) - len(histogram) // 4 :])
    median = quarter[(len(quarter) - 1) // 2]
    return quarter[np.abs(quarter - median) <= 3.0 * math.sqrt(max(median, 1.0))].mean()


def corrected(sensor, histogram):
    """Coates: N times the rates that the first photons' counts speak of."""
    left = sensor.trials - np.concatenate([[0], np.cumsum(histogram)[:-1]])
    return -sensor.trials * np.log1p(-histogram / left)


def echoes(sensor, histogram):
    """(t [bins], N_s, B_w, score) of the echoes, the best score first."""
    histogram = histogram.astype(float)
    h = corrected(sensor, histogram) if sensor.coates and sensor.readout == "first" else histogram
    b = background(h)
    fwhm = sensor.pulse_fwhm_ns / sensor.bin_ns
    zero = sensor.first_bin_ns + (np.arange(sensor.bins) + 0.5) * sensor.bin_ns
    glass = rates(sensor, [], [], 0.0)
    q = glass if sensor.coates and sensor.readout == "first" else chances(sensor, glass)
    e = np.where(np.abs(zero) <= 2.0 * sensor.pulse_fwhm_ns, sensor.trials * q, 0.0)
    near = np.abs(zero) <= 0.5 * sensor.pulse_fwhm_ns
    e *= max((h - b)[near].sum() / e[near].sum(), 0.0) if e[near].sum() > 0 else 0.0
    half = math.ceil(4.0 * fwhm / 2.3548)
    j = np.arange(-half, half + 1)
    p = np.diff(norm.cdf(np.append(j, half + 1) - 0.5, scale=fwhm / 2.3548))
    p /= p.sum()
    signal, floor = (np.pad(x, half) for x in (h - b - e, np.maximum(b + e, 1.0)))
    score = np.array([signal[k : k + len(p)] @ p / math.sqrt(floor[k : k + len(p)] @ p**2) for k in range(sensor.bins)])
    around = np.pad(score, 1, constant_values=-np.inf)
    peaks = np.flatnonzero((score >= around[:-2]) & (score > around[2:]) & (score > sensor.threshold_sigma))
    chosen = []
    for k in peaks[np.argsort(-score[peaks], kind="stable")]:
        if all(abs(k - other) > fwhm for other in chosen):
            chosen.append(k)
    return [(*centroid(h - b - e, k + 0.5, fwhm, b), score[k]) for k in chosen]


def centroid(net, t, fwhm, b):
    """As the contract says; a window without signal is no echo, and a centroid of noise does not leave its window."""
    edges = np.arange(len(net) + 1)
    for _ in range(10):
        part = np.clip(np.minimum(edges[1:], t + fwhm) - np.maximum(edges[:-1], t - fwhm), 0.0, 1.0)
        if (part * net).sum() <= 0.0:
            break
        new = (part * net * (edges[:-1] + 0.5)).sum() / (part * net).sum()
        new = np.clip(new, max(t - fwhm, 0.0), min(t + fwhm, len(net)))
        moved, t = abs(new - t), new
        if moved < 0.01:
            break
    return t, (part * net).sum(), b * part.sum()
