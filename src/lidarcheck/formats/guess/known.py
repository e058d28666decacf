"""Which of the sensors that come with lidarcheck made a scan: the one on whose beams its rows lie."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.assign.cloud import Cloud, clouds_of
from lidarcheck.formats.guess.check import ScanCheck, check_scan
from lidarcheck.formats.names import with_known_names
from lidarcheck.formats.table import Table
from lidarcheck.sensor import Sensor, SpadArray, shipped, shipped_names

__all__ = ["known_sensors"]

_FITS = ("fits", "warning", "elevations fit")
_LEAST_DEG, _STEP = 0.01, 0.05
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
    """Whether elevations and columns are about the sensor's: to look for what would make others fit takes seconds."""
    if cloud.layer is None or cloud.point is None:
        return True
    layer, point = cloud.layer.astype(np.int64), cloud.point.astype(np.int64)
    if not sensor.beams.has(layer, point).all():
        return False
    x, y, z = cloud.position.T
    elevation = np.rad2deg(np.arctan2(z, np.hypot(x, y)))
    own, spacing = sensor.beams.angles_deg(layer, point)[0], sensor.beams.spacing_deg(layer, point)
    if float(np.median(np.abs(elevation - own) / np.maximum(spacing[0], _LEAST_DEG))) > 1.0:
        return False
    order = np.lexsort((point, layer))
    turned = np.diff(np.rad2deg(np.arctan2(y, x))[order])
    columns = np.diff(point[order])
    beside = (np.diff(layer[order]) == 0) & (columns == 1) & (np.abs(turned) < 90.0)
    if not beside.any():
        return True
    step = float(np.median(np.abs(turned[beside])))
    return abs(step / float(np.median(spacing[1])) - 1.0) <= _STEP


def _has_features(sensor: Sensor, table: Table) -> bool:
    names = [{feature.name, *feature.aliases} for feature in sensor.features]
    return not names or any(table.spelling(name) for own in names for name in own)
