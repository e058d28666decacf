"""Histograms of photon counts, measured against simulated: bin by bin, and by what must be moved where."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.kpi.pairing import beam_keys
from lidarcheck.scan import Scan

__all__ = [
    "HistogramGap",
    "bin_residuals",
    "earth_movers_distance",
    "histogram_gap",
    "histogram_quantiles",
    "histograms_of",
]

_BIN = re.compile(r"h(\d+)", re.IGNORECASE)


class HistogramGap(NamedTuple):
    """Histograms of the zones that both scans have.

    `residual`: root mean square over zones and bins of (measured − simulated)/√(their sum): 1 where counting alone
    parts them. `distance_bins`: mean over the zones of the earth mover's distance. `worst_bin`: where the zones' sums
    lie farthest apart.
    """

    zones: int
    bins: int
    residual: float
    distance_bins: float
    worst_bin: int

    @property
    def of(self) -> str:
        """What it is of, in a table."""
        return f"{self.bins} bins"


def histograms_of(scan: Scan) -> tuple[IndexArray, FloatArray]:
    """One histogram a beam that has one: the beams' keys, ascending (n,), and the counts (n, bins).

    Where the reader knew of none, those in the columns h0, h1, ..., which several echoes of a beam repeat; a row that
    lacks some (NaN) has none.
    """
    if (own := scan.histograms) is not None:
        keys = beam_keys(own.layer, own.point)
        order = np.argsort(keys, kind="stable")
        return keys[order], own.counts[order]
    names = _bin_columns(scan)
    if not names:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 0))
    counts = np.stack([np.asarray(scan.extra[name], dtype=np.float64) for name in names], axis=1)
    rows = np.flatnonzero(np.isfinite(counts).all(axis=1))
    keys, first = np.unique(beam_keys(scan.layer, scan.point)[rows], return_index=True)
    return keys, counts[rows[first]]


def _bin_columns(scan: Scan) -> list[str]:
    """The names of a histogram's columns, h0, h1, ... in their order; none where the scan has no histogram."""
    known = {int(found[1]): name for name in scan.extra if (found := _BIN.fullmatch(name))}
    return [known[k] for k in range(len(known))] if known and max(known) == len(known) - 1 else []


def bin_residuals(measured: npt.ArrayLike, simulated: npt.ArrayLike) -> FloatArray:
    """(measured − simulated)/√(measured + simulated) of counts of one shape, 0 where both are 0.

    About a standard normal number where both are Poisson counts of one mean.
    """
    m, s = (np.asarray(counts, dtype=np.float64) for counts in (measured, simulated))
    if m.shape != s.shape:
        raise UsageError(f"histograms of shapes {m.shape} and {s.shape}", fix="compare histograms of one shape")
    return np.asarray((m - s) / np.sqrt(np.maximum(m + s, 1.0)))


def earth_movers_distance(measured: npt.ArrayLike, simulated: npt.ArrayLike) -> FloatArray:
    """By how many bins the counts of one must be moved, on average, to be distributed as the other's; shape (...).

    Histograms (..., bins); each is taken as a distribution, whatever its counts. NaN where one has none.
    """
    m, s = (np.asarray(counts, dtype=np.float64) for counts in (measured, simulated))
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = (side / side.sum(axis=-1, keepdims=True) for side in (m, s))
        apart = np.subtract(*shares)
    return np.asarray(np.abs(np.cumsum(apart, axis=-1)[..., :-1]).sum(axis=-1))


def histogram_quantiles(counts: npt.ArrayLike, number: int = 256) -> FloatArray:
    """Places in bins, (number,), that cut a histogram (bins,) into equal parts: counts lie evenly in their bin.

    The 1-Wasserstein distance of two such samples is the earth mover's distance. Empty where there are no counts.
    """
    h = np.asarray(counts, dtype=np.float64)
    upto = np.append(0.0, np.cumsum(h))
    if not h.size or not upto[-1] > 0.0:
        return np.zeros(0)
    asked = (np.arange(number) + 0.5) / number * upto[-1]
    return np.asarray(np.interp(asked, upto, np.arange(upto.size, dtype=np.float64)))


def histogram_gap(measured: Scan, simulated: Scan) -> HistogramGap | None:
    """The histograms of the beams that both scans have; None where one has none, or other bins."""
    (m_key, m), (s_key, s) = histograms_of(measured), histograms_of(simulated)
    if not m.shape[1] or m.shape[1] != s.shape[1]:
        return None
    _, of_m, of_s = np.intersect1d(m_key, s_key, assume_unique=True, return_indices=True)
    if not of_m.size:
        return None
    m, s = m[of_m], s[of_s]
    apart = earth_movers_distance(m, s)
    whole = bin_residuals(m.sum(axis=0), s.sum(axis=0))
    return HistogramGap(
        zones=len(m),
        bins=m.shape[1],
        residual=float(np.sqrt(np.mean(bin_residuals(m, s) ** 2))),
        distance_bins=float(np.nanmean(apart)) if np.isfinite(apart).any() else float("nan"),
        worst_bin=int(np.argmax(np.abs(whole))),
    )
