"""A sign as it was found, with its ghost: where it stands, what its beams span, and ghost over sign."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.calibration.ghosts.returns import Brightness, SearchEchoes
from lidarcheck.calibration.ghosts.search import GhostEchoes
from lidarcheck.calibration.ghosts.targets import Patch
from lidarcheck.kpi.detection import wilson
from lidarcheck.kpi.ghost import Ghost, ghost
from lidarcheck.kpi.lattice import lattice_of
from lidarcheck.kpi.pairing import beam_keys
from lidarcheck.scan import Scan

__all__ = ["Sign", "sign_of"]

PART_OF_FRAME = 3


@dataclass(frozen=True)
class Sign:
    """A sign, and its ghost if it has one.

    `rows`, `ghost_rows`: their echoes in the scan. `range_m`: the sign's own range at its middle; `azimuth_deg`,
    `elevation_deg` of that; `width_m`, `height_m`: what its beams span. `pulled`: beams of the sign whose echo
    noise drew away from its plane by more than 0.15 m. `offset_m`: the ghost's range beyond twice the sign's. `beams`,
    `seen`: the beams in the sign's core and those of them that show something at twice its range; `fraction`: their
    share, with its 95 % interval. `chance`: how probable that is by chance. `why`: why there is no ghost, empty for
    one. `cut`: edges of the field of view that it touches. `ratio`: ghost over sign. `searched`: the echoes on its
    beams that stand where a ghost may; `clusters`: those of them that lie densely, the largest first.
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
    searched: IndexArray
    clusters: tuple[IndexArray, ...]

    @property
    def has_ghost(self) -> bool:
        """Whether a ghost was found."""
        return len(self.ghost_rows) > 0


def sign_of(
    scan: Scan,
    place: SearchEchoes,
    bright: Brightness,
    patch: Patch,
    target: IndexArray,
    found: GhostEchoes,
    pulled: int,
    view: tuple[int, int, int, int] | None,
) -> Sign:
    """The sign whose echoes are the rows `target`; `place`: the scan's echoes as they stand.

    `pulled`: its beams whose echo noise drew away.
    """
    low, high = wilson(found.seen, found.beams)
    azimuth = _unwrapped(np.arctan2(scan.y_m[target], scan.x_m[target]))
    elevation = np.arctan2(scan.z_m[target], np.hypot(scan.x_m[target], scan.y_m[target]))
    steps = scan.beams.spacing_deg(scan.layer[target], scan.point[target])
    high_deg, wide_deg = (float(np.median(step)) for step in steps)
    row, column = place.layer[target], place.point[target]
    return Sign(
        rows=target,
        ghost_rows=found.rows,
        range_m=patch.range_m,
        azimuth_deg=_half_turn(float(np.rad2deg(np.median(azimuth)))),
        elevation_deg=float(np.rad2deg(np.median(elevation))),
        width_m=patch.range_m * _span(azimuth, column, patch.step[1], wide_deg),
        height_m=patch.range_m * _span(elevation, row, patch.step[0], high_deg),
        pulled=pulled,
        offset_m=found.offset_m,
        beams=found.beams,
        seen=found.seen,
        fraction=found.seen / found.beams if found.beams else float("nan"),
        fraction_low=float(low),
        fraction_high=float(high),
        chance=found.chance,
        why=found.why,
        cut=_cut(scan, place, target, view),
        ratio=_ratio(scan, place, bright.values, patch, target, found.rows),
        searched=found.searched,
        clusters=found.clusters,
    )


def _span(angle: FloatArray, index: npt.NDArray[np.int32], step: int, one_deg: float) -> float:
    """What beams with their footprints span [rad]; `one_deg`: between neighbouring indices."""
    beams = int(np.ptp(index)) // step
    return float(np.ptp(angle)) * (beams + 1) / beams if beams else float(np.deg2rad(one_deg)) * step


def _unwrapped(azimuth: FloatArray) -> FloatArray:
    """Azimuths [rad] of neighbours, also where they lie to either side of straight behind."""
    return np.mod(azimuth, 2.0 * np.pi) if np.ptp(azimuth) > np.pi else azimuth


def _half_turn(angle_deg: float) -> float:
    return angle_deg - 360.0 if angle_deg > 180.0 else angle_deg


def _ratio(
    scan: Scan, place: SearchEchoes, values: FloatArray, patch: Patch, target: IndexArray, ghosts: IndexArray
) -> Ghost:
    """Ghost over sign; range and size of the sign go by its own plane, from which noise may have drawn its echoes."""
    i, j = patch.place(place.layer[target], place.point[target])
    xyz, ghosts_xyz = (
        np.column_stack([axis[rows] for axis in (scan.x_m, scan.y_m, scan.z_m)]) for rows in (target, ghosts)
    )
    xyz *= (patch.own_range_m(i, j) / place.range_m[target])[:, None]
    keys, ghosts_keys = (beam_keys(scan.layer[rows], scan.point[rows]) for rows in (target, ghosts))
    order = np.argsort(keys, kind="stable")
    partner = order[np.minimum(np.searchsorted(keys, ghosts_keys, sorter=order), len(target) - 1)]
    return ghost(
        *(xyz, values[target], scan.peak[target]),
        *(ghosts_xyz, values[ghosts], scan.peak[ghosts]),
        partner=partner,
    )


def _cut(
    scan: Scan, place: SearchEchoes, target: IndexArray, view: tuple[int, int, int, int] | None
) -> tuple[str, ...]:
    """Edges of the field of view that the target touches; of a part of a frame, the edges of what else is in it."""
    beams = scan.beams
    lattice = lattice_of(beams)
    edges = [0, beams.layers - 1, 0, beams.points - 1]
    if view is not None:
        edges = list(view)
    elif len(scan) > PART_OF_FRAME * len(target):
        edges = [int(f(index)) for index in (place.layer, place.point) for f in (np.min, np.max)]
    ends = [
        index[target].min() if first else index[target].max()
        for index in (place.layer, place.point)
        for first in (1, 0)
    ]
    layers = [int(np.flatnonzero(lattice.rank == row)[0]) if lattice and 0 <= row < beams.layers else row
              for row in edges[:2]]  # fmt: skip
    names = (f"layer {layers[0]}", f"layer {layers[1]}", f"point {edges[2]}", f"point {edges[3]}")
    touches = [ends[0] <= edges[0], ends[1] >= edges[1], ends[2] <= edges[2], ends[3] >= edges[3]]
    if lattice is not None and lattice.around and (edges[2], edges[3]) == (0, beams.points - 1):
        touches[2:] = [False, False]
    return tuple(name for name, touch in zip(names, touches, strict=True) if touch)
