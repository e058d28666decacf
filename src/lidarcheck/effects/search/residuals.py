"""Reading numbers off residuals: of ranges, over a quantity, as factors of columns, and as a table over knots."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.effects.search.base import Probe, search_spec
from lidarcheck.effects.search.evidence import RANGE, Evidence

__all__ = ["NOISE_M", "at_knots", "best_factors", "medians", "of_echoes_and_light", "range_residuals"]


_BINS = 24
_FEWEST = 60
"""Fewer beams than this do not show a curve."""
_LEAST_KNOWN_M = 0.5
_TRIMMED, NOISE_M = 3, 0.01
_RIDGE, _BENT = 0.5, 20.0
"""A knot is held at 0 as firmly as by so many beams, and on a straight line between its neighbours as by so many: other
frames have beams where these have none."""


def range_residuals(evidence: Evidence) -> tuple[BoolArray, FloatArray] | None:
    """The beams whose range the model knows well, (n_beams,), and their residuals [m]; None where they are few."""
    expected, measured = evidence.expected, evidence.measured
    used = measured.detected & expected.known & ~expected.at_edge & (expected.spread[:, RANGE] < _LEAST_KNOWN_M)
    residual = measured.feature[used, RANGE] - expected.mean[used, RANGE]
    return None if len(residual) < _FEWEST else (used, residual)


def medians(over: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Medians of the residuals and of what they are looked at over, in bins of as many beams; shapes (n_bins,)."""
    parts = np.array_split(np.argsort(over, kind="stable"), _BINS)
    return np.array([np.median(residual[p]) for p in parts]), np.array([np.median(over[p]) for p in parts])


def best_factors(per_unit: FloatArray, residual: FloatArray, usual: Sequence[float]) -> FloatArray:
    """The factors of the columns that explain the residuals best, without those that none explains; (n_columns,).

    `usual`: sizes that are no surprise, to which the data must add what goes beyond.
    """
    kept = np.ones(len(residual), dtype=bool)
    noise = NOISE_M
    for _ in range(_TRIMMED):
        rows = np.concatenate([per_unit[kept], np.diag(noise / np.asarray(usual))])
        factors = np.asarray(np.linalg.lstsq(rows, np.append(residual[kept], np.zeros(len(usual))), rcond=None)[0])
        off = np.abs(residual - per_unit @ factors)
        noise = max(1.5 * float(np.median(off)), NOISE_M)
        kept = off <= 2.0 * noise
    return factors


def of_echoes_and_light(name: str, settings: dict[str, float]) -> list[Probe]:
    """Ranges may be off because echoes are moved or because the light is, before it is counted in bins."""
    free = search_spec(name).free
    return [Probe(name, settings, free), Probe(name, settings, free, {"moves": "light"}, "light")]


def at_knots(place: FloatArray, value: FloatArray, weight: FloatArray, knots: int) -> FloatArray:
    """The numbers at the places 0, 1, ... between which straight lines come nearest to values, shape (knots,)."""
    hats = np.maximum(1.0 - np.abs(place[:, None] - np.arange(knots)), 0.0)
    one = float(np.median(weight)) if len(weight) else 1.0
    bends = np.diff(np.eye(knots), 2, axis=0)
    curvature = hats.T @ (weight[:, None] * hats) + one * (_RIDGE * np.eye(knots) + _BENT * bends.T @ bends)
    return np.asarray(np.linalg.solve(curvature, hats.T @ (weight * value)))
