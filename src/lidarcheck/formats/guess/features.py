"""What the columns beside X, Y, Z may report of an echo, by their values: a supposition that is said as one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.formats.returns import no_returns
from lidarcheck.formats.table import Table

__all__ = ["NAMES", "guess_features", "guess_returns"]

NAMES = ("INTENSITY", "SIGNAL", "REFLECTIVITY")
"""What a sensor without PEAK and AREA calls the strength of an echo."""
_BYTE, _WORD = 255, 65_535


def guess_features(tables: Sequence[Table]) -> tuple[Mapping[str, Mapping[str, Any]], tuple[str, ...]]:
    """`[features]` of a sensor file for the columns of strength that all tables have, and a remark on each.

    Whole numbers up to 255 are what vendors make of a reflectivity; larger ones, and others, are taken for counts or
    for an amplitude.
    """
    features: dict[str, Mapping[str, Any]] = {}
    remarks = []
    for name in NAMES:
        values = [_values(table, name) for table in tables]
        if any(value is None for value in values):
            continue
        every = np.concatenate([value for value in values if value is not None])
        if not len(every) or every.min() < 0.0 or every.max() == every.min():
            continue
        if not np.array_equal(every, np.round(every)):
            features[name] = {"law": "affine"}
            what = "an amplitude, since its values are no whole numbers"
        elif every.max() <= _BYTE:
            features[name] = {"law": "calibrated_reflectivity", "bits": 8}
            what = f"a calibrated reflectivity, since its values are whole numbers up to {every.max():.0f}"
        else:
            bits = {"bits": 16} if every.max() <= _WORD else {"step": 1.0}
            features[name] = {"law": "affine", **bits}
            what = f"counts of light, since its values are whole numbers up to {every.max():.0f}"
        remarks.append(f"{name} is supposed to be {what}: look up what the sensor reports")
    if features:
        remarks.append("no echo is supposed to come of noise alone: false_rate_hz is 0")
    return features, tuple(remarks)


def guess_returns(tables: Sequence[Table]) -> int:
    """How many echoes a beam has at most, by the numbers that the scans give them; 1 where they give none."""
    found = [1]
    for table in tables:
        number = table.get("EchoNumber")
        if number is not None and number.dtype.kind in "iu" and len(number):
            found.append(int(number.max()) - min(int(number.min()), 1) + 1)
    return max(found)


def _values(table: Table, name: str) -> FloatArray | None:
    """The finite values of a column's rows with an echo; None where there is no such column."""
    column = table.get(name)
    if column is None or column.dtype.kind not in "iuf":
        return None
    empty = no_returns(table)
    values = np.asarray(column if empty is None else column[~empty], dtype=np.float64)
    return values[np.isfinite(values)]
