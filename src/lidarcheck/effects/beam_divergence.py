"""A beam's footprint spans edges."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.base import AimEffect, Surroundings, parameter
from lidarcheck.effects.geometry.aiming import (
    moving_of,
    rank_in_beam,
    rays_of,
    redirected,
    second_rows,
    with_met_reflectance,
)
from lidarcheck.effects.geometry.footprint import Spans, offsets_rad, spans_of, spread_rays
from lidarcheck.effects.geometry.surfaces import LocalSurfaces
from lidarcheck.effects.geometry.zones import widened
from lidarcheck.rays import Rays
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Linear, PhotonHistogram, Sensor

__all__ = ["BeamDivergence"]

_BLOCK = 1 << 16


@dataclass(frozen=True)
class BeamDivergence(AimEffect):
    """A beam's footprint spans edges: mixed ranges, fringes, split echoes.

    The beam's light has a Gaussian profile over angle; `vertical_deg` and `horizontal_deg` are its full widths at half
    maximum, 2.3548 standard deviations, from the sensor. Each row becomes `rays` x `rays` rows of equal weight, at the
    middles of equally probable parts of the profile along either axis: the trace is the sum of the pulses that those
    meet. The outermost of 3, 5, 7 and 15 rays stand at 0.97, 1.28, 1.47 and 1.83 standard deviations: many rays see
    what the profile's faint flanks meet. Beams all of whose rays meet one material of one object at ranges that spread
    by at most `least_m` keep their one row. Without a scene, what lies between two beams is
    taken from these: an edge is anywhere between them, at a place of its own for each pair. Where a surface goes on
    evenly along one axis, rays are then spread along the other only; with a scene all rays are cast. A zone of a
    histogram chip is its footprint: the zone's own rays are spread over a zone that is wider by the widths. Pulsed edge
    emitters diverge by 0.05 to 0.5 deg. Identity at both widths 0.
    """

    name = "beam_divergence"
    handed = ("Parts",)
    tree = (105, 109, 118)

    vertical_deg: float = parameter(
        "deg", low=0.0, high=3.0, typical=0.1, noticeable=0.02, meaning="width (FWHM) along elevation"
    )
    horizontal_deg: float = parameter(
        "deg", low=0.0, high=3.0, typical=0.2, noticeable=0.04, meaning="width (FWHM) along azimuth"
    )
    rays: int = parameter("", low=2, high=15, typical=5, whole=True, noticeable=-3, meaning="rays per axis")
    least_m: float = parameter(
        "m", low=0.0, high=10.0, typical=0.1, noticeable=0.02, meaning="spread of ranges that is worth rays"
    )

    @classmethod
    def needs(cls, sensor: Sensor) -> str:
        """A footprint of the sensor file, for a detector that merges what lies in it."""
        narrow = isinstance(sensor, Linear) and not any(sensor.footprint_deg)
        return "its file gives beams no footprint_deg" if narrow else ""

    def aim(self, ideal: IdealScan, around: Surroundings) -> IdealScan:
        """What the rays of the footprints meet."""
        if self.vertical_deg == self.horizontal_deg == 0.0:
            return ideal
        if isinstance(around.sensor, PhotonHistogram):
            return widened(ideal, *self._times(around.sensor), around)
        up, left = (offsets_rad(width, int(self.rays)) for width in (self.vertical_deg, self.horizontal_deg))
        own, axis = rays_of(ideal), np.zeros(1)
        spans = _equal_in_beams(ideal, self._spans(own, around, up, left))
        kinds = (
            (np.flatnonzero(spans.up & spans.left), up, left),
            (np.flatnonzero(spans.up & ~spans.left), up, axis),
            (np.flatnonzero(spans.left & ~spans.up), axis, left),
        )
        blocks = [
            _cast(own, rows[start : start + _BLOCK], spread, around, self.least_m)
            for rows, *spread in kinds
            for start in range(0, len(rows), _BLOCK)
        ]
        if around.scene is not None and ideal.object_id is not None:
            behind = second_rows(ideal, own)
            for block in blocks if behind.any() else ():
                _keep(block, behind[block.row], ideal)
        return _subdivided(ideal, own, blocks, around)

    def _times(self, sensor: PhotonHistogram) -> tuple[float, float]:
        """How many times as high and as wide zones are."""
        wide, high = sensor.footprint_deg
        both = (self.vertical_deg, high), (self.horizontal_deg, wide)
        up, aside = (1.0 + more / own if own > 0.0 else 1.0 for more, own in both)
        return up, aside

    def _spans(self, own: Rays, around: Surroundings, up: FloatArray, left: FloatArray) -> Spans:
        caster = around.caster
        if not isinstance(caster, LocalSurfaces) or moving_of(own, caster):
            everywhere = np.ones(len(own), dtype=bool)
            return Spans(everywhere, everywhere)
        return spans_of(caster, own, (float(up.max()), float(left.max())), self.least_m)


class _Block(NamedTuple):
    """What the footprints of some rows meet: `row` and whether it `spans` more than one range or surface, (rows,).

    The other columns are those of an ideal scan, (rows, rays) and (rows, rays, 3).
    """

    row: IndexArray
    spans: BoolArray
    columns: dict[str, npt.NDArray[Any]]


def _cast(own: Rays, row: IndexArray, spread: list[FloatArray], around: Surroundings, least_m: float) -> _Block:
    """What the footprints of those rows meet, their rays spread so far up and to the left."""
    from lidarcheck.effects.geometry.compiled import spread_of

    rays = spread_rays(own.take(row), *spread)
    max_range_m = around.sensor.max_range_m
    hits = around.caster.cast(rays, moving=moving_of(own, around.caster) or None, max_range_m=max_range_m)
    met = (hits.distance_m > 0.0) & (hits.distance_m <= max_range_m)
    shape = len(row), len(spread[0]) * len(spread[1])
    columns = {
        "distance_m": np.where(met, hits.distance_m, 0.0),
        "material_id": np.where(met, hits.material_id, np.int32(0)),
        "object_id": np.where(met, hits.object_id, np.int32(0)),
        "incidence_deg": np.where(met, np.clip(hits.incidence_deg, 0.0, 90.0), 0.0),
        "direction": rays.direction,
    }
    columns = {name: column.reshape(*shape, *column.shape[1:]) for name, column in columns.items()}
    spans = np.empty(len(row), dtype=bool)
    spread_of(columns["distance_m"], columns["material_id"], columns["object_id"], least_m, spans)
    return _Block(row, spans, columns)


def _keep(block: _Block, rows: BoolArray, ideal: IdealScan) -> None:
    """Let those rows of a block, which lie behind panes and mirrors, meet what they met before."""
    for name in ("distance_m", "material_id", "object_id", "incidence_deg"):
        block.columns[name][rows] = getattr(ideal, name)[block.row[rows], None]
    block.spans[rows] = False


def _equal_in_beams(ideal: IdealScan, spans: Spans) -> Spans:
    """Beams of several rows: all of them along both axes or none, for rows of a beam must keep equal weights."""
    if not rank_in_beam(ideal).any():
        return spans
    either = _in_whole_beams(ideal, spans.up | spans.left)
    return Spans(either, either)


def _in_whole_beams(ideal: IdealScan, rows: BoolArray) -> BoolArray:
    """All rows of every beam one of whose rows is marked."""
    _, beam = np.unique(ideal.layer.astype(np.int64) << 32 | ideal.point, return_inverse=True)
    return np.asarray(np.bincount(beam, weights=rows)[beam] > 0)


def _subdivided(ideal: IdealScan, own: Rays, blocks: list[_Block], around: Surroundings) -> IdealScan:
    """The scan with the rows that span something replaced by their footprints' rays."""
    spans = np.zeros(len(ideal), dtype=bool)
    for block in blocks:
        spans[block.row[block.spans]] = True
    if not spans.any():
        return ideal
    if rank_in_beam(ideal).any():
        spans = _in_whole_beams(ideal, spans)
    count = np.ones(len(ideal), dtype=np.int64)
    for block in blocks:
        count[block.row] = np.where(spans[block.row], block.columns["distance_m"].shape[1], 1)
    source = np.repeat(np.arange(len(ideal)), count)
    first = np.cumsum(count) - count
    table, rays = ideal.take(source), own.take(source)
    number = table.object_id
    if number is None and around.scene is not None:
        number = np.zeros(len(table), dtype=np.int32)
    columns = {name: np.array(getattr(table, name)) for name in ("distance_m", "material_id", "incidence_deg")}
    columns |= {"direction": np.array(rays.direction)} | ({} if number is None else {"object_id": np.array(number)})
    for block in blocks:
        kept = spans[block.row]
        place = (first[block.row[kept], None] + np.arange(block.columns["distance_m"].shape[1])).ravel()
        for name, column in columns.items():
            values = block.columns[name][kept]
            column[place] = values.reshape(-1, *values.shape[2:])
    direction = columns.pop("direction")
    direction.flags.writeable = False
    rays = redirected(rays, direction)
    share = None if table.share is None else table.share / count[source]
    spread = replace(table, rays=rays, share=share, **columns)  # type: ignore[arg-type]
    return with_met_reflectance(spread, table, rays, around)
