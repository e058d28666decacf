"""A scan's columns as its sensor calls them: features, histograms, and the hand of its coordinates."""

from __future__ import annotations

import re

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.beams import BeamHistograms
from lidarcheck.formats.columns import missing, real_column, whole_column
from lidarcheck.formats.table import Column, Table
from lidarcheck.scan import COUNTED
from lidarcheck.sensor import Feature, Sensor

__all__ = [
    "features_of",
    "histogram_columns",
    "histogram_feature",
    "histogram_names",
    "histograms_of",
    "numbered_beams",
    "right_handed",
    "spellings",
]

_BIN = re.compile(r"h(\d+)", re.IGNORECASE)


def right_handed(table: Table, sensor: Sensor | None) -> Table:
    """The table with Y negated where the sensor's files are left-handed."""
    y = table.get("Y")
    if sensor is None or sensor.handedness == "right" or y is None:
        return table
    return table.with_column(table.spelling("Y") or "Y", -y)


def numbered_beams(table: Table, sensor: Sensor | None) -> Table:
    """The table with Layer and Point out of OSI's `beam_id`, a row of the sensor's table of beams, layer by layer."""
    if sensor is None or table.spelling("beam_id") is None or len(missing(table, ("Layer", "Point"))) < 2:
        return table
    beams = sensor.beams
    layer, point = np.divmod(whole_column(table, "beam_id", 0, beams.layers * beams.points - 1), beams.points)
    return table.with_column("Layer", layer).with_column("Point", point)


def spellings(table: Table, sensor: Sensor | None) -> dict[str, str]:
    """The table's own name of each feature of the sensor that it has: the feature's name, else one of its aliases."""
    found: dict[str, str] = {}
    for feature in () if sensor is None else sensor.features:
        if feature.law == "histogram" or feature.name in COUNTED:
            continue
        own = next((own for name in (feature.name, *feature.aliases) if (own := table.spelling(name))), None)
        if own is not None:
            found[feature.name] = own
    return found


def features_of(table: Table, sensor: Sensor | None, *, missing_ok: bool) -> dict[str, FloatArray]:
    """The sensor's features that the table has, by the sensor's names, (n,) each; NaN where a value is missing."""
    return {
        name: np.asarray(real_column(table, own, missing_ok=missing_ok), dtype=np.float64)
        for name, own in spellings(table, sensor).items()
    }


def histogram_feature(sensor: Sensor | None) -> Feature | None:
    """The feature that is a histogram of each beam, None where the sensor reports none."""
    return next((f for f in (() if sensor is None else sensor.features) if f.law == "histogram"), None)


def histogram_names(table: Table) -> list[str]:
    """The columns h0, h1, ... in order of their bins."""
    found = {int(match[1]): name for name in table.names if (match := _BIN.fullmatch(name))}
    return [found[number] for number in range(len(found))] if sorted(found) == list(range(len(found))) else []


def histograms_of(table: Table, sensor: Sensor | None) -> BeamHistograms | None:
    """The histogram of each beam that the table has one of; rows of one beam repeat it."""
    names = histogram_names(table)
    if histogram_feature(sensor) is None or not names or table.get("Layer") is None or table.get("Point") is None:
        return None
    layer, point = (np.asarray(table.get(name), dtype=np.int64) for name in ("Layer", "Point"))
    _, first = np.unique(layer << 32 | point, return_index=True)
    counts = np.column_stack([np.asarray(table.columns[name], dtype=np.float64)[first] for name in names])
    return BeamHistograms(layer[first].astype(np.int32), point[first].astype(np.int32), counts)


def histogram_columns(histograms: BeamHistograms, layer: Column, point: Column) -> dict[str, Column]:
    """Columns h0, h1, ... of the rows of these beams, (m,) each; 0 where a beam has no histogram."""
    keys = histograms.layer.astype(np.int64) << 32 | histograms.point
    asked = np.asarray(layer, dtype=np.int64) << 32 | np.asarray(point)
    order = np.argsort(keys, kind="stable")
    at = order[np.minimum(np.searchsorted(keys[order], asked), len(keys) - 1)]
    known = keys[at] == asked
    counts = np.where(known[:, None], histograms.counts[at], 0.0)
    return {f"h{k}": counts[:, k] for k in range(counts.shape[1])}
