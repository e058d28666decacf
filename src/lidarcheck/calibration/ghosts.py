"""Find traffic signs and their ghosts in a scan, and leave nothing else.

The light goes sensor - sign - own car - sign - sensor: the ghost of a sign stands on the sign's own beams at twice its
range, is twice its size and fainter. `find_ghosts` looks for bright, compact clusters (DBSCAN over the beams), takes
each one's own range, and asks whether more echoes than chance gives stand behind it at twice that range.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lidarcheck.calibration.ghost_returns import (
    Brightness,
    Echoes,
    Returns,
    brightness,
    grid_steps,
    returns_of,
    sensor_of,
)
from lidarcheck.calibration.ghost_search import GhostEchoes, search_ghost
from lidarcheck.calibration.ghost_targets import ByLayer, Patch, clusters_of, patch_of
from lidarcheck.calibration.ghost_words import LARGEST_M, no_sign, notes_on, those_expected
from lidarcheck.kpi.detection import wilson
from lidarcheck.kpi.ghost import Ghost, ghost
from lidarcheck.kpi.pairing import beam_keys
from lidarcheck.scan import Scan
from lidarcheck.sensor import LAYERS, POINTS, Sensor, azimuth_deg, elevation_deg

__all__ = ["GHOST", "OTHER", "SIGN", "GhostScan", "Sign", "find_ghosts"]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]

OTHER, SIGN, GHOST = 0, 1, 2
"""The labels of echoes."""

OWN_RANGE_M = 0.5
PULLED_M = 0.15
FIRED_TWICE_SIGNAL = 60.0
"""Avalanches per SPAD and shot up to which SPADs hardly avalanche twice."""
BEYOND_ORDINARY = 1.5
MOST_CLUSTERS = 200
PART_OF_FRAME = 3


@dataclass(frozen=True)
class Sign:
    """A sign, and its ghost if it has one.

    `rows`, `ghost_rows`: their echoes in the scan. `range_m`: the sign's own range at its middle; `azimuth_deg`,
    `elevation_deg` of that; `width_m`, `height_m`: what its beams span. `pulled`: beams of the sign whose echo
    noise drew away from its plane by more than 0.15 m. `offset_m`: the ghost's range beyond twice the sign's. `beams`,
    `seen`: the beams in the sign's core and those of them that show something at twice its range; `fraction`: their
    share, with its 95 % interval. `chance`: how probable that is by chance. `why`: why there is no ghost, empty for
    one. `cut`: edges of the field of view that it touches. `ratio`: ghost over sign.
    """

    rows: IndexArray
    ghost_rows: IndexArray
    range_m: float
    azimuth_deg: float
    elevation_deg: float
    width_m: float
    height_m: float
    pulled: int
    offset_m: float
    beams: int
    seen: int
    fraction: float
    fraction_low: float
    fraction_high: float
    chance: float
    why: str
    cut: tuple[str, ...]
    ratio: Ghost

    @property
    def has_ghost(self) -> bool:
        """Whether a ghost was found."""
        return len(self.ghost_rows) > 0


@dataclass(frozen=True)
class GhostScan:
    """The signs of a scan, the brightest evidence of a ghost first.

    `label` (n,): OTHER, SIGN or GHOST for each echo; `sign_number` (n,): which sign it belongs to, from 1, 0 for
    none. `notes`: what a user should know of this scan.
    """

    name: str
    scan: Scan
    brightness: Brightness
    sensor: Sensor | None
    signs: tuple[Sign, ...]
    label: npt.NDArray[np.int32]
    sign_number: npt.NDArray[np.int32]
    notes: tuple[str, ...] = ()

    def stripped(self) -> Scan:
        """Signs and ghosts alone, with the extra columns Label (1 sign, 2 ghost) and SignNumber."""
        extra = {**self.scan.extra, "Label": self.label, "SignNumber": self.sign_number}
        return replace(self.scan, extra=extra).take(np.flatnonzero(self.label != OTHER))

    def values(self, label: int, column: str) -> FloatArray:
        """`area`, `peak`, `width_ns` or `amplitude` of the echoes with a label."""
        chosen = self.label == label
        return np.asarray((self.brightness.values if column == "amplitude" else getattr(self.scan, column))[chosen])


def find_ghosts(
    scan: Scan,
    *,
    name: str = "scan",
    sensor: Sensor | None = None,
    above: float | None = None,
    expected_m: Sequence[float] = (),
    view: tuple[int, int, int, int] | None = None,
) -> GhostScan:
    """The signs of a scan and their ghosts.

    `sensor`: what measured, else the variant that the PEAKs fit; `above`: the least AREA (or what stands in for it)
    of a sign's echo, else by the sensor's detectors; `expected_m`: ranges near which a sign must be; `view`: first and
    last layer, first and last point that were fired. `InputError` where there is no sign, or none where expected; it
    says what there is.
    """
    sensor = sensor or sensor_of(scan)
    range_m = scan.range_m
    bright = brightness(scan, sensor, above)
    signs, others = _signs(scan, range_m, bright, sensor, view)
    if not signs and not bright.relative and above is None:
        saturated = brightness(scan, sensor, once=True)
        signs = [sign for sign in _signs(scan, range_m, saturated, sensor, view)[0] if sign.has_ghost]
        bright = saturated if signs else bright
    signs = those_expected(signs, expected_m, name)
    if not signs:
        raise no_sign(scan, range_m, bright, others, name)
    label, number = np.zeros(len(scan), dtype=np.int32), np.zeros(len(scan), dtype=np.int32)
    for i, sign in reversed(list(enumerate(signs, start=1))):
        for value, rows in ((SIGN, sign.rows), (GHOST, sign.ghost_rows)):
            label[rows], number[rows] = value, i
    return GhostScan(name, scan, bright, sensor, tuple(signs), label, number, tuple(notes_on(signs, sensor)))


def _signs(
    scan: Scan,
    range_m: FloatArray,
    bright: Brightness,
    sensor: Sensor | None,
    view: tuple[int, int, int, int] | None,
) -> tuple[list[Sign], list[str]]:
    """Compact bright clusters that no ordinary surface explains, those with most ghosts first; words on the others."""
    step = grid_steps(scan.layer, scan.point)
    returns = returns_of(scan, range_m, bright)
    clusters = clusters_of(returns, returns.bright(bright), step)
    extents_m = [_extent_m(returns, rows) for rows in clusters]
    compact = [rows for rows, extent_m in zip(clusters, extents_m, strict=True) if extent_m <= LARGEST_M][
        :MOST_CLUSTERS
    ]
    large = [rows for rows, extent_m in zip(clusters, extents_m, strict=True) if extent_m > LARGEST_M]
    ordinary_m = _ordinary_m(returns, large, bright, sensor)
    echoes = Echoes(scan.layer, scan.point, range_m, bright.values, returns.of)
    echoes_at, returns_at = (ByLayer.of(table.layer, table.point) for table in (echoes, returns))
    view_m = float(range_m.max(initial=0.0))
    signs, others = [], []
    for rows in compact:
        patch = patch_of(returns, rows, step)
        rows = _with_gaps(returns, returns_at.around(patch), patch, rows)
        around = echoes_at.around(patch)
        here = echoes.take(around)
        target = np.flatnonzero(np.isin(here.of, rows))
        found = search_ghost(here, patch, target, view_m=view_m, trials=len(compact))
        if len(found.rows) or patch.range_m > ordinary_m:
            found, target = replace(found, rows=around[found.rows]), around[target]
            pulled, cut = _pulled(returns, patch, rows), _cut(scan, target, view)
            signs.append(_sign(scan, bright, patch, target, found, pulled, cut))
        else:
            others.append(f"{len(target)} echoes at {patch.range_m:.2f} m, {found.why}")
    signs.sort(key=lambda sign: (-len(sign.ghost_rows), -len(sign.rows)))
    if bright.relative:
        # Some echoes always are the brightest: without a ghost the largest cluster of them is all that can be a sign.
        signs = [sign for sign in signs if sign.has_ghost] or signs[:1]
    return signs, others


def _extent_m(returns: Returns, rows: IndexArray) -> float:
    """Length of the diagonal of what a cluster spans, at its range."""
    angles = np.ptp(azimuth_deg(returns.point[rows])), np.ptp(elevation_deg(returns.layer[rows]))
    return float(np.hypot(*np.deg2rad(angles)) * np.median(returns.range_m[rows]))


def _ordinary_m(returns: Returns, large: list[IndexArray], bright: Brightness, sensor: Sensor | None) -> float:
    """Up to what range a bright cluster may be an ordinary surface; beyond, it is a sign even without a ghost."""
    if bright.relative:
        return 0.0
    white_m = 0.0 if sensor is None else float(np.sqrt(sensor.signal_at_1m / FIRED_TWICE_SIGNAL))
    walls_m = [BEYOND_ORDINARY * float(np.quantile(returns.range_m[rows], 0.9)) for rows in large]
    return max([white_m, *walls_m])


def _with_gaps(returns: Returns, around: IndexArray, patch: Patch, target: IndexArray) -> IndexArray:
    """The target's returns and those of fainter beams amid them; `around`: the returns in the patch's frame."""
    i, j = patch.place(returns.layer[around], returns.point[around])
    own = (i >= 0) & patch.mask[i, j] & (np.abs(returns.range_m[around] - patch.own_range_m(i, j)) < OWN_RANGE_M)
    rows = around[own]
    keys, taken = (beam_keys(returns.layer[some], returns.point[some]) for some in (rows, target))
    return np.union1d(target, rows[~np.isin(keys, taken)])


def _pulled(returns: Returns, patch: Patch, target: IndexArray) -> int:
    """Returns of the target that noise drew away from its plane."""
    i, j = patch.place(returns.layer[target], returns.point[target])
    return int(np.count_nonzero(np.abs(returns.range_m[target] - patch.own_range_m(i, j)) > PULLED_M))


def _sign(
    scan: Scan,
    bright: Brightness,
    patch: Patch,
    target: IndexArray,
    found: GhostEchoes,
    pulled: int,
    cut: tuple[str, ...],
) -> Sign:
    low, high = wilson(found.seen, found.beams)
    azimuth = np.arctan2(scan.y_m[target], scan.x_m[target])
    elevation = np.arctan2(scan.z_m[target], np.hypot(scan.x_m[target], scan.y_m[target]))
    return Sign(
        rows=target,
        ghost_rows=found.rows,
        range_m=patch.range_m,
        azimuth_deg=float(np.rad2deg(np.median(azimuth))),
        elevation_deg=float(np.rad2deg(np.median(elevation))),
        width_m=patch.range_m * _span(azimuth, scan.point[target], patch.step[1], azimuth_deg(1) - azimuth_deg(0)),
        height_m=patch.range_m
        * _span(elevation, scan.layer[target], patch.step[0], elevation_deg(1) - elevation_deg(0)),
        pulled=pulled,
        offset_m=found.offset_m,
        beams=found.beams,
        seen=found.seen,
        fraction=found.seen / found.beams if found.beams else float("nan"),
        fraction_low=float(low),
        fraction_high=float(high),
        chance=found.chance,
        why=found.why,
        cut=cut,
        ratio=_ratio(scan, bright.values, patch, target, found.rows),
    )


def _span(angle: FloatArray, index: npt.NDArray[np.int32], step: int, one_deg: FloatArray) -> float:
    """What beams with their footprints span [rad]; `one_deg`: between neighbouring indices of the reference grid."""
    beams = int(np.ptp(index)) // step
    return float(np.ptp(angle)) * (beams + 1) / beams if beams else float(np.deg2rad(one_deg)) * step


def _ratio(scan: Scan, values: FloatArray, patch: Patch, target: IndexArray, ghosts: IndexArray) -> Ghost:
    """Ghost over sign; range and size of the sign go by its own plane, from which noise may have drawn its echoes."""
    i, j = patch.place(scan.layer[target], scan.point[target])
    xyz, ghosts_xyz = (
        np.column_stack([axis[rows] for axis in (scan.x_m, scan.y_m, scan.z_m)]) for rows in (target, ghosts)
    )
    xyz *= (patch.own_range_m(i, j) / scan.range_m[target])[:, None]
    keys, ghosts_keys = (beam_keys(scan.layer[rows], scan.point[rows]) for rows in (target, ghosts))
    order = np.argsort(keys, kind="stable")
    partner = order[np.minimum(np.searchsorted(keys, ghosts_keys, sorter=order), len(target) - 1)]
    return ghost(
        *(xyz, values[target], scan.peak[target]),
        *(ghosts_xyz, values[ghosts], scan.peak[ghosts]),
        partner=partner,
    )


def _cut(scan: Scan, target: IndexArray, view: tuple[int, int, int, int] | None) -> tuple[str, ...]:
    """Edges of the field of view that the target touches; of a part of a frame, the edges of what else is in it."""
    edges = [0, LAYERS - 1, 0, POINTS - 1]
    if view is not None:
        edges = list(view)
    elif len(scan) > PART_OF_FRAME * len(target):
        edges = [int(scan.layer.min()), int(scan.layer.max()), int(scan.point.min()), int(scan.point.max())]
    ends = [
        index[target].min() if first else index[target].max() for index in (scan.layer, scan.point) for first in (1, 0)
    ]
    names = (f"layer {edges[0]}", f"layer {edges[1]}", f"point {edges[2]}", f"point {edges[3]}")
    touches = (ends[0] <= edges[0], ends[1] >= edges[1], ends[2] <= edges[2], ends[3] >= edges[3])
    return tuple(name for name, touch in zip(names, touches, strict=True) if touch)
