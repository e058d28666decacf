"""Which beams were fired: without that, a missing echo says nothing, and no KPI of detection can be given."""

from __future__ import annotations

import numpy as np

from lidarcheck.kpi.pairing import beam_keys
from lidarcheck.scan import Fired, IdealScan, Scan
from lidarcheck.sensor import LAYERS, POINTS

__all__ = ["FIRED_UNKNOWN", "fired_beams", "judged_beams"]

FIRED_UNKNOWN = (
    "which beams were fired is not known: the scan has rows for its echoes alone, and its beams are no grid's"
)
"""Why a scan has no KPI of detection, where `fired_beams` gives None."""


def fired_beams(scan: Scan, ideal: IdealScan | None = None) -> Fired | None:
    """The beams that were fired, or None where nobody knows; of a scan of several frames, in any of them.

    The first that knows: the scan, where its source has a row for each beam whether it had an echo or not; the ideal
    scan, which has every fired beam; the sensor's grid within the layers and points of the scan's echoes, where the
    source itself names their beams. Never what echoes are there alone.
    """
    if scan.fired is not None:
        return scan.fired
    if ideal is not None:
        keys = np.unique(beam_keys(ideal.layer, ideal.point))
        return Fired(keys >> 32, keys & 0xFFFFFFFF, None, "ideal")
    if {"Layer", "Point"} & set(scan.defaulted) or not len(scan):
        return None
    low, high = ((int(f(scan.layer)), int(f(scan.point))) for f in (np.min, np.max))
    if min(low) < 0 or high[0] >= LAYERS or high[1] >= POINTS:
        return None
    layer, point = np.mgrid[low[0] : high[0] + 1, low[1] : high[1] + 1]
    return Fired(layer.ravel(), point.ravel(), None, "sensor")


def judged_beams(ideal: IdealScan, scan: Scan) -> tuple[IdealScan, Scan]:
    """Both without the beams of which a missing echo, or one too many, says nothing.

    Those are beams that the scan's source says were not fired, and beams of which nobody knows all that they meet.
    """
    unknown = np.isnan(ideal.distance_m)
    keys = beam_keys(ideal.layer, ideal.point)
    out = np.isin(keys, keys[unknown]) if unknown.any() else unknown
    if scan.fired is not None:
        out = out | ~scan.fired.has(ideal.layer, ideal.point)
    if not out.any():
        return ideal, scan
    left = np.isin(beam_keys(scan.layer, scan.point), keys[out])
    return ideal.take(~out), scan.take(~left)
