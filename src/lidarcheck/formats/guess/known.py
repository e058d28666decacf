"""Which of the sensors that come with lidarcheck made a scan: the one on whose beams its rows lie."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.assign.cloud import Cloud, clouds_of
from lidarcheck.formats.guess.check import ScanCheck, check_scan
from lidarcheck.formats.names import with_known_names
from lidarcheck.formats.table import Table
from lidarcheck.sensor import Sensor, SpadArray, shipped, shipped_names

__all__ = ["known_sensors"]

_FITS = ("fits", "warning", "elevations fit")
_LEAST_DEG, _SAME, _STEP = 0.01, 0.3, 0.05
"""By so much of it another sensor's columns differ from the sensor's, at least."""


def known_sensors(table: Table) -> Sequence[tuple[str, ScanCheck]]:
    """The shipped sensors that a scan fits, those first of which more rows lie on their beams.

    The scan must have one of the sensor's features, too: many a sensor has even angles. Of two with the same beams the
    one counts at whose saturation the scan's PEAK ends.
    """
    table = with_known_names(table)
    try:
        clouds = clouds_of(table)
    except InputError:
        return ()
    found = []
    for name in shipped_names():
        sensor = shipped(name)
        if not sensor.beams.lattice or not _has_features(sensor, table):
            continue
        try:
            if not _may_fit(clouds[0], sensor):
                continue
            check = check_scan(clouds[0], sensor)
        except UsageError:
            continue
        if check.verdict in _FITS:
            found.append((name, check))
    found.sort(key=lambda one: (_FITS.index(one[1].verdict), -one[1].share))
    return [one for one in found if one[0] in _by_saturation([name for name, _ in found], table)]


def _by_saturation(names: Sequence[str], table: Table) -> Sequence[str]:
    """Of sensors with the same beams those whose PEAK ends where the scan's does; all where none does."""
    peak = table.get("PEAK")
    most = 0.0 if peak is None or not len(peak) else float(np.nanmax(peak))
    ends = {name: own.peak_saturation for name in names if isinstance(own := shipped(name), SpadArray)}
    same = [name for name, end in ends.items() if end == most]
    return same or [name for name in names if ends.get(name, most) >= most]


def _may_fit(cloud: Cloud, sensor: Sensor) -> bool:
    """Whether elevations and columns are about the sensor's: to look for what would make others fit takes seconds, and
    elevations alone fit many a sensor."""
    line = cloud.layer if cloud.layer is not None else cloud.ring
    if line is None:
        return True
    if int(line.max()) - min(int(line.min()), 0) >= sensor.beams.layers:
        return False
    x, y, z = cloud.position.T
    if cloud.layer is not None:
        elevation = np.rad2deg(np.arctan2(z, np.hypot(x, y)))
        layer, first = line.astype(np.int64), np.zeros(len(line), dtype=np.int64)
        own, spacing = sensor.beams.angles_deg(layer, first)[0], sensor.beams.spacing_deg(layer, first)[0]
        if float(np.median(np.abs(elevation - own) / np.maximum(spacing, _LEAST_DEG))) > 1.0:
            return False
    own_step = float(np.abs(sensor.beams.spacing_deg(np.zeros(1, dtype=int), np.zeros(1, dtype=int))[1][0]))
    step = _step_deg(np.rad2deg(np.arctan2(y, x)), line, cloud.point, _SAME * own_step)
    return step is None or abs(step / own_step - 1.0) <= _STEP


def _step_deg(
    azimuth_deg: FloatArray, line: npt.NDArray[Any], point: npt.NDArray[Any] | None, same_deg: float
) -> float | None:
    """From column to column by neighbouring rays of one line, those nearer than `same_deg` being one ray's echoes; None
    where none are beside each other."""
    order = np.lexsort((azimuth_deg, line))
    apart, beside = np.diff(azimuth_deg[order]), np.diff(line[order]) == 0
    columns = np.ones(len(apart)) if point is None else np.abs(np.diff(point[order].astype(np.int64)))
    beside &= (apart > same_deg) & (columns > 0)
    return float(np.median(apart[beside] / columns[beside])) if beside.any() else None


def _has_features(sensor: Sensor, table: Table) -> bool:
    names = [{feature.name, *feature.aliases} for feature in sensor.features]
    return not names or any(table.spelling(name) for own in names for name in own)
