"""What scans show of beams beside a target: whether an echo comes from its range, and how strong the largest is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.calibration.number.beside import Beside
from lidarcheck.calibration.number.light import keys_of
from lidarcheck.inference.observed.echo_view import Slot
from lidarcheck.scan import Scan

__all__ = ["Seen", "seen_in"]


@dataclass(frozen=True)
class Seen:
    """`hit` (n,): whether there is an echo; `value` (n, features): of the largest, 0 where there is none."""

    hit: BoolArray
    value: FloatArray


def seen_in(scans: Sequence[Scan], beside: Beside, slots: Sequence[Slot], reach_m: float) -> Seen:
    """What the scans of all frames show of the beams beside the targets."""
    hit, value = np.zeros(len(beside), dtype=bool), np.zeros((len(beside), len(slots)))
    for i, scan in enumerate(scans):
        keys, way_m = keys_of(scan.layer, scan.point), _way_m(scan)
        for target in np.unique(beside.target):
            rows = np.flatnonzero((beside.frame == i) & (beside.target == target))
            if not len(rows) or not len(scan):
                continue
            at = np.minimum(np.searchsorted(beside.key[rows], keys), len(rows) - 1)
            mine = (beside.key[rows][at] == keys) & (np.abs(way_m - beside.at_m[rows][at]) <= reach_m)
            echo = np.flatnonzero(mine)
            columns = np.column_stack([slot.of([scan.take(echo)]) for slot in slots] or [way_m[echo]])
            # The largest is written last; without a feature the last one.
            order = np.argsort(columns[:, 0], kind="stable")
            beam = rows[at[echo]][order]
            hit[beam] = True
            value[beam] = columns[order][:, : len(slots)]
    return Seen(hit, value)


def _way_m(scan: Scan) -> FloatArray:
    """From the beam to each echo, as its range is reported without the sensor's offset."""
    return np.asarray(scan.range_m - scan.beams.range_offset_m(scan.layer))
