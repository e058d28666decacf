"""The echoes of a scenario's seed, all frames together, and what else its scans hold of beams."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.formats.scans import numbers_as_written
from lidarcheck.kpi.features import feature_column
from lidarcheck.kpi.histogram import histograms_of
from lidarcheck.kpi.pairing import Pairing, beam_keys, paths, ranges
from lidarcheck.scan import COUNTED, Scan
from lidarcheck.sensor import Sensor

__all__ = ["SelectedEchoes"]

Histograms = tuple[IndexArray, IndexArray, FloatArray]


@dataclass(frozen=True)
class SelectedEchoes:
    """The echoes of a seed beside the surfaces of their beams, all frames together; shape (n,) each.

    `beam`: of the scenario, counted from 0 in ascending (layer, point); `frame`, from 0; `surface`: the row of the
    ideal scan that is nearest in range on that beam, -1 where the beam meets nothing; `residual_m`: range minus that
    row's, NaN where there is none; `number`: as written, before a reader counts from 1; `xyz_m`: shape (n, 3);
    `path_m`: the range without the beam's range offset; `features`: of sensors that report others than a SPAD array;
    `histograms`: of beams, with an echo or without, shape (k, bins), and the beam and the frame of each, (k,).
    """

    beam: IndexArray
    frame: IndexArray
    surface: IndexArray
    residual_m: FloatArray
    range_m: FloatArray
    area: FloatArray
    peak: FloatArray
    width_ns: FloatArray
    number: npt.NDArray[Any]
    xyz_m: FloatArray
    path_m: FloatArray
    features: Mapping[str, FloatArray] = field(default_factory=dict)
    histograms: Histograms | None = None

    @classmethod
    def of(cls, scan: Scan, pairing: Pairing, frame: int = 0, sensor: Sensor | None = None) -> SelectedEchoes:
        """The echoes of one frame. `sensor`: whose features a file may have under other names."""
        frames = np.full(len(scan), frame, dtype=np.int64)
        xyz_m = np.stack([scan.x_m, scan.y_m, scan.z_m], axis=1)
        columns = (ranges(scan), scan.area, scan.peak, scan.width_ns, numbers_as_written(scan), xyz_m, paths(scan))
        named = {name: np.asarray(column, dtype=np.float64) for name, column in _features(scan, sensor).items()}
        counted = _histograms(scan, pairing, frame)
        return cls(pairing.echo_beam, frames, pairing.surface, pairing.residual_m, *columns, named, counted)

    @classmethod
    def joined(cls, parts: list[SelectedEchoes]) -> SelectedEchoes:
        """The echoes of several frames."""
        if len(parts) == 1:
            return parts[0]
        columns: dict[str, Any] = {
            name: np.concatenate([getattr(part, name) for part in parts]) for name in _names(cls)
        }
        named = {name: np.concatenate([part.features[name] for part in parts]) for name in parts[0].features}
        return cls(**columns, features=named, histograms=_joined([part.histograms for part in parts]))

    def feature(self, name: str) -> FloatArray:
        """A feature of the echoes by its name, shape (n,); NaN where the scan has none of it."""
        if name in self.features:
            return self.features[name]
        own: FloatArray = getattr(self, COUNTED[name]) if name in COUNTED else np.full(len(self.beam), np.nan)
        return own


def _names(table: type[SelectedEchoes]) -> list[str]:
    return [column.name for column in fields(table) if column.name not in ("features", "histograms")]


def _features(scan: Scan, sensor: Sensor | None) -> Mapping[str, npt.NDArray[Any]]:
    """What the scan reports besides what a SPAD array counts, by the sensor's names."""
    if sensor is None:
        return scan.features
    found = {f.name: feature_column(scan, f.name, f.aliases) for f in sensor.features if f.law != "histogram"}
    own = {name: column for name, column in found.items() if column is not None and name not in COUNTED}
    return {**scan.features, **own}


def _joined(parts: list[Histograms | None]) -> Histograms | None:
    counted = [part for part in parts if part is not None]
    if not counted:
        return None
    beam, frame, counts = ([part[k] for part in counted] for k in range(3))
    return np.concatenate(beam), np.concatenate(frame), np.concatenate(counts)


def _histograms(scan: Scan, pairing: Pairing, frame: int) -> Histograms | None:
    """The histograms of a frame's beams, those that the scenario has; None where the scan has none."""
    keys, counts = histograms_of(scan)
    if not counts.shape[1]:
        return None
    beams = beam_keys(pairing.layer, pairing.point)
    at = np.minimum(np.searchsorted(beams, keys), len(beams) - 1)
    known = beams[at] == keys
    return at[known], np.full(int(known.sum()), frame, dtype=np.int64), counts[known]
