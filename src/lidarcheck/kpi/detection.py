"""How often a surface is seen, and how often something is seen where there is none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.kpi.pairing import Pairing

__all__ = ["Detection", "FalseAlarms", "detection_probability", "false_alarms", "range_edges", "wilson"]

Z_95 = 1.959963984540054
BIN_M = 10.0
MOST_BINS = 1000


@dataclass(frozen=True)
class Detection:
    """Detection probability per range bin [`edges_m[i]`, `edges_m[i + 1]`).

    Shapes: (k + 1,) for `edges_m`, (k,) for the others. `beams`: those that meet a surface in the bin; `detected`:
    those of them with an echo on it; `probability`: their ratio, NaN in a bin without beams; `low`, `high`: its
    Wilson interval (95 %).
    """

    edges_m: FloatArray
    beams: IndexArray
    detected: IndexArray
    probability: FloatArray
    low: FloatArray
    high: FloatArray

    @property
    def overall(self) -> float:
        """Detected share of all beams that meet a surface; NaN where none does."""
        total = int(self.beams.sum())
        return int(self.detected.sum()) / total if total else float("nan")


@dataclass(frozen=True)
class FalseAlarms:
    """Echoes away from every surface of their beam; `per_beam`: their number over that of the fired beams."""

    echoes: int
    beams: int
    per_beam: float


def wilson(successes: npt.ArrayLike, trials: npt.ArrayLike, *, z: float = Z_95) -> tuple[FloatArray, FloatArray]:
    """Wilson's score interval of a share, 0 … 1, same shape as the counts; [0, 1] without trials.

    `z`: half its width in standard deviations; the default gives 95 %. E. B. Wilson, J. Am. Stat. Assoc. 22 (1927).
    """
    k, n = np.asarray(successes, dtype=np.float64), np.asarray(trials, dtype=np.float64)
    safe = np.maximum(n, 1.0)
    share = k / safe
    centre = (share + z**2 / (2.0 * safe)) / (1.0 + z**2 / safe)
    half = z * np.sqrt(share * (1.0 - share) / safe + z**2 / (4.0 * safe**2)) / (1.0 + z**2 / safe)
    # Rounding must not let the interval miss a share of exactly 0 or 1.
    low = np.where(k <= 0.0, 0.0, np.maximum(centre - half, 0.0))
    high = np.where(k >= n, 1.0, np.minimum(centre + half, 1.0))
    return np.where(n > 0, low, 0.0), np.where(n > 0, high, 1.0)


def range_edges(distance_m: npt.ArrayLike, *, width_m: float = BIN_M) -> FloatArray:
    """Edges of equal range bins that hold every distance above 0, at multiples of the width; shape (k + 1,).

    Where that would be more than 1000 bins, they are ten times as wide, or a hundred times, and so on.
    """
    some = np.asarray(distance_m, dtype=np.float64)
    some = some[some > 0.0]
    if not some.size:
        return np.array([0.0, width_m])
    while some.max() - some.min() > MOST_BINS * width_m:
        width_m *= 10.0
    first, last = np.floor(some.min() / width_m), np.floor(some.max() / width_m)
    return np.arange(first, last + 2.0) * width_m


def detection_probability(
    distance_m: npt.ArrayLike, detected: npt.ArrayLike, *, edges_m: npt.ArrayLike | None = None
) -> Detection:
    """Beams with an echo on their surface over beams that meet one, per range bin.

    `distance_m`, `detected`: a beam each, of those that were fired, shapes (n_beams,), from `pair_with_ideal`, so from
    geometry and not from what was detected; a beam with several surfaces counts once, in the bin of the nearest.
    Distance 0: meets nothing, NaN: nobody knows; neither is counted. `edges_m`: ascending, shape (k + 1,); default
    every 10 m. Beams outside of them are not counted.
    """
    distance = np.asarray(distance_m, dtype=np.float64)
    seen = np.asarray(detected, dtype=np.bool_)
    edges = range_edges(distance) if edges_m is None else np.asarray(edges_m, dtype=np.float64)
    if distance.shape != seen.shape:
        raise UsageError(f"{distance.size} distances and {seen.size} detections", fix="give one of each a beam")
    if edges.ndim != 1 or edges.size < 2 or np.any(np.diff(edges) <= 0.0):
        raise UsageError("range edges do not ascend", fix="give at least two ascending edges in metres")
    where = np.searchsorted(edges, distance, "right") - 1
    counted = (distance > 0.0) & (where >= 0) & (where < edges.size - 1)
    beams = np.bincount(where[counted], minlength=edges.size - 1).astype(np.int64)
    found = np.bincount(where[counted & seen], minlength=edges.size - 1).astype(np.int64)
    probability = np.where(beams > 0, found / np.maximum(beams, 1), np.nan)
    low, high = wilson(found, beams)
    return Detection(edges, beams, found, probability, low, high)


def false_alarms(pairing: Pairing) -> FalseAlarms:
    """Echoes outside the window of every surface of their beam (`pairing.surface_window_m`), per fired beam.

    Counts every echo of a beam that meets nothing, and none where nobody knows what it meets. NaN per beam where no
    beam was fired.
    """
    away = int(np.count_nonzero(~pairing.on_surface & pairing.judged[pairing.echo_beam]))
    beams = int(np.count_nonzero(pairing.judged))
    return FalseAlarms(away, beams, away / beams if beams else float("nan"))
