"""Find traffic signs and their ghosts in a scan, and leave nothing else.

The light goes sensor - sign - own car - sign - sensor: the ghost of a sign stands on the sign's own beams at twice its
range, is twice its size and fainter. `find_ghosts` looks for bright, compact clusters (DBSCAN over the beams), takes
each one's own range, and asks whether more echoes than chance gives stand behind it at twice that range.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.calibration.echoes import place_of, ways
from lidarcheck.calibration.ghosts.returns import (
    Brightness,
    Returns,
    SearchEchoes,
    brightness,
    grid_steps,
    returns_of,
    sensor_of,
)
from lidarcheck.calibration.ghosts.search import search_ghost
from lidarcheck.calibration.ghosts.sign import Sign, sign_of
from lidarcheck.calibration.ghosts.targets import ByLayer, Patch, clusters_of, patch_of
from lidarcheck.calibration.ghosts.wording import LARGEST_M, no_sign, notes_on, those_expected
from lidarcheck.kpi.features import feature_column
from lidarcheck.kpi.pairing import beam_keys
from lidarcheck.scan import Scan
from lidarcheck.sensor import Beams, Sensor, SpadArray

__all__ = ["GHOST", "OTHER", "SIGN", "GhostScan", "Sign", "find_ghosts"]


OTHER, SIGN, GHOST = 0, 1, 2
"""The labels of echoes."""

OWN_RANGE_M = 0.5
PULLED_M = 0.15
FIRED_TWICE_SIGNAL = 60.0
"""Avalanches per SPAD and shot up to which SPADs hardly avalanche twice."""
BEYOND_ORDINARY = 1.5
MOST_CLUSTERS = 200


@dataclass(frozen=True)
class GhostScan:
    """The signs of a scan, the brightest evidence of a ghost first.

    `label` (n,): OTHER, SIGN or GHOST for each echo; `sign_number` (n,): which sign it belongs to, from 1, 0 for
    none. `bright` (n,): echoes of bright returns; `cluster` (n,): which cluster of these each belongs to, from 1, the
    largest first, 0 for none. `notes`: what a user should know of this scan.
    """

    name: str
    scan: Scan
    brightness: Brightness
    sensor: Sensor | None
    signs: tuple[Sign, ...]
    label: npt.NDArray[np.int32]
    sign_number: npt.NDArray[np.int32]
    bright: npt.NDArray[np.bool_]
    cluster: npt.NDArray[np.int32]
    notes: tuple[str, ...] = ()

    def stripped(self) -> Scan:
        """Signs and ghosts alone, with the extra columns Label (1 sign, 2 ghost) and SignNumber."""
        extra = {**self.scan.extra, "Label": self.label, "SignNumber": self.sign_number}
        return replace(self.scan, extra=extra).take(np.flatnonzero(self.label != OTHER))

    def values(self, label: int, column: str) -> FloatArray:
        """A feature of the echoes with a label, by its name; `amplitude`: what they are told bright by."""
        values = self.brightness.values if column == "amplitude" else feature_column(self.scan, column)
        assert values is not None
        return np.asarray(values[self.label == label])


class _Looked(NamedTuple):
    """What a look for signs finds: the signs, words on the other clusters, and which echoes are bright, clustered."""

    signs: list[Sign]
    others: list[str]
    bright: npt.NDArray[np.bool_]
    cluster: npt.NDArray[np.int32]


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
    of a sign's echo, else by the sensor; `expected_m`: ranges near which a sign must be; `view`: first and
    last layer, first and last point that were fired. `InputError` where there is no sign, or none where expected; it
    says what there is.
    """
    sensor = sensor or sensor_of(scan)
    range_m = ways(scan)
    bright = brightness(scan, sensor, above)
    looked = _signs(scan, range_m, bright, sensor, view)
    if not looked.signs and isinstance(sensor, SpadArray) and not bright.relative and above is None:
        saturated = brightness(scan, sensor, once=True)
        again = _signs(scan, range_m, saturated, sensor, view)
        if with_ghost := [sign for sign in again.signs if sign.has_ghost]:
            bright, looked = saturated, again._replace(signs=with_ghost)
    signs = those_expected(looked.signs, expected_m, name)
    if not signs:
        raise no_sign(scan, range_m, bright, looked.others, name)
    label, number = np.zeros(len(scan), dtype=np.int32), np.zeros(len(scan), dtype=np.int32)
    for i, sign in reversed(list(enumerate(signs, start=1))):
        for value, rows in ((SIGN, sign.rows), (GHOST, sign.ghost_rows)):
            label[rows], number[rows] = value, i
    notes = tuple(notes_on(signs, sensor))
    return GhostScan(name, scan, bright, sensor, tuple(signs), label, number, looked.bright, looked.cluster, notes)


def _signs(
    scan: Scan,
    range_m: FloatArray,
    bright: Brightness,
    sensor: Sensor | None,
    view: tuple[int, int, int, int] | None,
) -> _Looked:
    """Compact bright clusters that no ordinary surface explains, those with most ghosts first; words on the others."""
    row, column = place_of(scan.beams, scan.layer, scan.point)
    step = grid_steps(row, column)
    returns = returns_of(scan, range_m, bright)
    shining = returns.bright(bright)
    clusters = clusters_of(returns, shining, step)
    extents_m = [_extent_m(scan.beams, returns, rows) for rows in clusters]
    compact = [rows for rows, extent_m in zip(clusters, extents_m, strict=True) if extent_m <= LARGEST_M][
        :MOST_CLUSTERS
    ]
    large = [rows for rows, extent_m in zip(clusters, extents_m, strict=True) if extent_m > LARGEST_M]
    ordinary_m = _ordinary_m(returns, large, bright, sensor)
    echoes = SearchEchoes(row, column, range_m, bright.values, returns.of)
    echoes_at, returns_at = (ByLayer.of(table.layer, table.point) for table in (echoes, returns))
    view_m = float(range_m.max(initial=0.0))
    signs, others = [], []
    for rows in compact:
        patch = patch_of(returns, rows, step)
        rows = _with_gaps(returns, returns_at.around(patch), patch, rows)
        around = echoes_at.around(patch)
        here = echoes.take(around)
        target = np.flatnonzero(np.isin(here.of, rows))
        found = search_ghost(here, patch, target, view_m=view_m, trials=len(compact), most=bright.most)
        if len(found.rows) or patch.range_m > ordinary_m:
            pulled = _pulled(returns, patch, rows)
            signs.append(sign_of(scan, echoes, bright, patch, around[target], found.among(around), pulled, view))
        else:
            others.append(f"{len(target)} echoes at {patch.range_m:.2f} m, {found.why}")
    ghosts = np.concatenate([np.zeros(0, dtype=np.int64), *(sign.ghost_rows for sign in signs)])
    signs = [sign for sign in signs if np.mean(np.isin(sign.rows, ghosts)) < 0.5]
    signs.sort(key=lambda sign: (-len(sign.ghost_rows), -len(sign.rows)))
    if bright.relative:
        # Some echoes always are the brightest: without a ghost the largest cluster of them is all that can be a sign.
        signs = [sign for sign in signs if sign.has_ghost] or signs[:1]
    return _Looked(signs, others, *_of_echoes(returns, shining, clusters))


def _of_echoes(
    returns: Returns, bright: IndexArray, clusters: list[IndexArray]
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.int32]]:
    """Which echoes are of bright returns, and of which cluster of them, from 1; shapes (n,)."""
    shines, number = np.zeros(len(returns.layer), dtype=np.bool_), np.zeros(len(returns.layer), dtype=np.int32)
    shines[bright] = True
    for i, rows in enumerate(clusters, start=1):
        number[rows] = i
    return shines[returns.of], number[returns.of]


def _extent_m(beams: Beams, returns: Returns, rows: IndexArray) -> float:
    """Length of the diagonal of what a cluster spans, at its range."""
    steps_deg = (float(np.median(step)) for step in beams.spacing_deg(returns.layer[rows], returns.point[rows]))
    spans = (np.ptp(index[rows]) for index in (returns.layer, returns.point))
    angles = [step * span for step, span in zip(steps_deg, spans, strict=True)]
    return float(np.hypot(*np.deg2rad(angles)) * np.median(returns.range_m[rows]))


def _ordinary_m(returns: Returns, large: list[IndexArray], bright: Brightness, sensor: Sensor | None) -> float:
    """Up to what range a bright cluster may be an ordinary surface; beyond, it is a sign even without a ghost."""
    if bright.relative:
        return 0.0
    white_m = 0.0 if not isinstance(sensor, SpadArray) else float(np.sqrt(sensor.signal_at_1m / FIRED_TWICE_SIGNAL))
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
