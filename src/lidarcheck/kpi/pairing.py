"""Which surface does an echo belong to? The echoes of a scan beside what its beams meet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.kpi.fired import at_marked_edges, judged_rows
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, Material, PhotonHistogram, Sensor

if TYPE_CHECKING:
    from lidarcheck.model.spec import Model

__all__ = [
    "OF_SURFACE_M",
    "EchoPairs",
    "Pairing",
    "SortedRows",
    "beam_keys",
    "nearest_on_line",
    "of_surface_m",
    "pair_echoes",
    "pair_with_ideal",
    "paths",
    "ranges",
    "surface_window_m",
]

OF_SURFACE_M = 2.0
"""An echo this close to a surface of its beam comes from it: pile-up shifts the echo of a retro-reflector by
more than a metre, so that a residual must not be cut at the window of `surface_window_m`. Of a pulse of 5 ns."""

RANGE_DIGITS = 4
_PULSE_NS = 5.0
"""The pulse of a sensor that nobody names: the built-in ones'."""


@dataclass(frozen=True)
class Pairing:
    """A scan's echoes beside the surfaces of their beams.

    Per beam, shape (n_beams,), in ascending (layer, point): `layer`, `point`, `distance_m` (its nearest surface, 0
    where it meets nothing, NaN where nobody knows all that it meets), `detected` (an echo lies on one of its
    surfaces), `judged`: it was fired, what it meets is known, and the ideal scan does not mark it as a beam that may
    meet two surfaces, so that an echo that is missing or too many means something.

    Per echo, shape (n_echoes,), in the scan's order: `echo_beam` (index of its beam), `residual_m` (its way from the
    beam's origin minus the distance of the surface of its beam that lies closest to it; NaN where the beam meets
    nothing), `on_surface` (within the window of it), `of_surface` (within `of_surface_m` of it, 2 m for the built-in
    sensors), `surface`, that surface's row in the ideal scan (-1 where there is none), and `at_edge` (the ideal scan
    marks its beam as one that may meet two surfaces: it says nothing of spread); None where no beam is marked.
    """

    layer: npt.NDArray[np.int32]
    point: npt.NDArray[np.int32]
    distance_m: FloatArray
    detected: BoolArray
    judged: BoolArray
    echo_beam: IndexArray
    residual_m: FloatArray
    on_surface: BoolArray
    of_surface: BoolArray
    surface: IndexArray
    at_edge: BoolArray | None = None

    @property
    def of_one_surface(self) -> BoolArray:
        """Echoes that come from a surface, and whose beam is not marked as one that may meet two, shape (n_echoes,)."""
        return self.of_surface if self.at_edge is None else self.of_surface & ~self.at_edge


@dataclass(frozen=True)
class SortedRows:
    """The rows of an ideal scan by beam and distance: what pairing asks of it, the same for every scan of its beams.

    Per beam, shape (n_beams,), ascending: `beams` (their keys), `first_row` (one of the beam's), `distance_m` (as
    `Pairing` has it). `beam_of_row` (n_rows,); `order`: the rows that meet a surface, ascending in (beam, distance);
    `marked` (n_rows,): as of `at_marked_edges`.
    """

    beams: IndexArray
    first_row: IndexArray
    beam_of_row: IndexArray
    order: IndexArray
    distance_m: FloatArray
    marked: BoolArray | None

    @classmethod
    def of(cls, ideal: IdealScan) -> SortedRows:
        """Those of an ideal scan."""
        keys = beam_keys(ideal.layer, ideal.point)
        beams, first_row, beam_of_row = np.unique(keys, return_index=True, return_inverse=True)
        hit = np.flatnonzero(ideal.distance_m > 0.0)
        order = hit[np.lexsort((ideal.distance_m[hit], beam_of_row[hit]))]
        distance = np.zeros(beams.size)
        # Descending distance within a beam: the last written, and so kept, is the nearest.
        distance[beam_of_row[order[::-1]]] = ideal.distance_m[order[::-1]]
        distance[beam_of_row[np.isnan(ideal.distance_m)]] = np.nan
        return cls(beams, first_row, beam_of_row, order, distance, at_marked_edges(ideal))


@dataclass(frozen=True)
class EchoPairs:
    """Echoes of two scans that lie on one beam within a tolerance; shapes (n_pairs,).

    `measured`, `simulated`: rows of the two scans. `beams_both`, `beams_measured`, `beams_simulated`: number of beams
    with an echo in both, only in the first, only in the second.
    """

    measured: IndexArray
    simulated: IndexArray
    difference_m: FloatArray
    beams_both: int
    beams_measured: int
    beams_simulated: int


def ranges(scan: Scan) -> FloatArray:
    """Ranges [m] to a tenth of a millimetre, shape (n,).

    A text file rounds X, Y and Z; without this, ranges that the sensor quantised to one value would differ in the
    sixth digit and two equal distributions would seem to step at different places.
    """
    return np.round(scan.range_m, RANGE_DIGITS)


def beam_keys(layer: npt.NDArray[np.int32], point: npt.NDArray[np.int32]) -> IndexArray:
    """One number a beam, ascending in (layer, point), shape (n,)."""
    return layer.astype(np.int64) * 2**32 + point


def paths(scan: Scan) -> FloatArray:
    """The ways of echoes from their beams' origins [m], shape (n,): `ranges` without the beams' range offset."""
    range_m = ranges(scan)
    offset_m = 0.0 if scan.beams.central or not len(scan) else _offset_m(scan)
    return range_m - offset_m if np.any(offset_m) else range_m


def _offset_m(scan: Scan) -> FloatArray | float:
    known = scan.beams.has(scan.layer, scan.point)
    return np.where(known, scan.beams.range_offset_m(np.where(known, scan.layer, 0)), 0.0)


def surface_window_m(sensor: Sensor | None = None, *, external: bool = False) -> float:
    """How far an echo may lie from a surface that it still lies on [m]: the detection window of its sensor.

    c·FWHM/2, half the way that light goes in a pulse, 0.749 m at 5 ns: two surfaces closer than this share a pulse, and
    pile-up moves an echo by no more than its front half. A sensor with a coarse range has a wider one. `external`: a
    program sees in the sensor's place, and keeps surfaces apart from the sensor's separation on. `sensor`: None where
    nobody names one, with the pulse of the built-in ones.
    """
    if sensor is None:
        return 0.5 * LIGHT_SPEED_M_PER_NS * _PULSE_NS
    return sensor.separation_m if external else sensor.window_m


def of_surface_m(sensor: Sensor | None = None, *, external: bool = False) -> float:
    """How far an echo may lie from a surface that it still comes from [m]: 2 m for a pulse of 5 ns, and in proportion
    to the detection window."""
    return OF_SURFACE_M * (surface_window_m(sensor, external=external) / surface_window_m())


def pair_with_ideal(
    ideal: IdealScan,
    scan: Scan,
    sensor: Sensor | None = None,
    *,
    model: Model | None = None,
    rows: SortedRows | None = None,
) -> Pairing:
    """Find the surface of every echo and the beams that were detected, within the window of `surface_window_m`.

    `sensor`: what made the scan, that of the `model` where None, the built-in one where neither is given. Rows of one
    (layer, point) in the ideal scan are sub-beams: the beam counts once and an echo on any of their surfaces detects
    it. The residual of a histogram's echo is taken against the mean of all rows within its window, each with the signal
    that it sends (equal reflectances where no `model` and no column tells them). `rows`: those of this ideal scan, if
    known already. `UsageError` names the first echo's beam that the ideal scan does not have, or says that the two are
    read as two sensors'.
    """
    if not ideal.beams.alike(scan.beams):
        what = "the ideal scan is read with the beams of one sensor, the echoes with those of another"
        raise UsageError(what, fix="name the sensor that measured, for both")
    rows = rows or SortedRows.of(ideal)
    beam_of_row, order, first_row, marked = rows.beam_of_row, rows.order, rows.first_row, rows.marked
    echo_beam = _beams_of_echoes(rows.beams, scan)
    path_m = paths(scan)
    external = model is not None and model.external is not None
    sensor = model.sensor if sensor is None and model is not None else sensor
    window_m = surface_window_m(sensor, external=external)

    surface = nearest_on_line(beam_of_row[order], ideal.distance_m[order], echo_beam, path_m)
    row = np.where(surface >= 0, order[surface] if order.size else -1, -1)
    residual = np.full(len(scan), np.nan)
    residual[row >= 0] = path_m[row >= 0] - ideal.distance_m[row[row >= 0]]
    on_surface = np.abs(residual) <= window_m
    if isinstance(sensor, PhotonHistogram) and not external:
        mean_m = _mean_surface_m(ideal, order, beam_of_row, echo_beam, path_m, window_m, sensor, model)
        residual = np.where(np.isnan(mean_m), residual, path_m - mean_m)

    detected = np.zeros(rows.beams.size, dtype=np.bool_)
    detected[echo_beam[on_surface]] = True
    judged = judged_rows(ideal, scan)
    return Pairing(
        layer=ideal.layer[first_row],
        point=ideal.point[first_row],
        distance_m=rows.distance_m,
        detected=detected,
        judged=(judged if marked is None else judged & ~marked)[first_row],
        echo_beam=echo_beam,
        residual_m=residual,
        on_surface=on_surface,
        of_surface=np.abs(residual) <= of_surface_m(sensor, external=external),
        surface=row,
        at_edge=None if marked is None else marked[first_row][echo_beam],
    )


def _mean_surface_m(
    ideal: IdealScan, order: IndexArray, beam_of_row: IndexArray, echo_beam: IndexArray, path_m: FloatArray,
    window_m: float, sensor: Sensor, model: Model | None,
) -> FloatArray:  # fmt: skip
    """Mean distance of the rows within the window of each echo, by the signal of each; NaN where there is none.

    `order`: the rows that meet a surface, ascending in (beam, distance).
    """
    if not order.size or not path_m.size:
        return np.full(path_m.size, np.nan)
    line, place = beam_of_row[order], ideal.distance_m[order]
    length = 3.0 + 2.0 * window_m + max(float(place.max()), float(path_m.max()))
    along, at = line * length + place, echo_beam * length + path_m
    first, last = np.searchsorted(along, at - window_m, "left"), np.searchsorted(along, at + window_m, "right")
    weight = _signal(ideal, order, sensor, model)
    upto, far = (np.append(0.0, np.cumsum(w)) for w in (weight, weight * place))
    light = upto[last] - upto[first]
    some = light > 1e-12 * upto[-1]
    return np.where(some, (far[last] - far[first]) / np.where(some, light, 1.0), np.nan)


def _signal(ideal: IdealScan, rows: IndexArray, sensor: Sensor, model: Model | None) -> FloatArray:
    """What each row sends back; of equal reflectances where no model tells them."""
    from lidarcheck.model.light import surface_signal
    from lidarcheck.model.spec import Model

    if model is None:
        model = Model(sensor, {int(number): Material("", 1.0) for number in np.unique(ideal.material_id)})
    return np.asarray(surface_signal(ideal.take(rows), model) * ideal.shares()[rows])


def pair_echoes(measured: Scan, simulated: Scan, *, tolerance_m: float = OF_SURFACE_M) -> EchoPairs:
    """Pair each measured echo with the simulated echo of its beam that lies closest in range, within the tolerance.

    Echoes whose beam is not known (-1) take no part.
    """
    m_keys, s_keys = beam_keys(measured.layer, measured.point), beam_keys(simulated.layer, simulated.point)
    m_beams, s_beams = (_distinct(keys[_known(x)]) for keys, x in ((m_keys, measured), (s_keys, simulated)))
    both = np.intersect1d(m_beams, s_beams, assume_unique=True)
    near_key = np.minimum(np.searchsorted(both, m_keys), max(both.size - 1, 0))
    shared = np.flatnonzero(both[near_key] == m_keys) if both.size else np.zeros(0, dtype=np.int64)
    s_range, m_range = ranges(simulated), ranges(measured)[shared]
    rows = np.flatnonzero(_known(simulated))
    order = rows[np.lexsort((s_range[rows], s_keys[rows]))]
    near = nearest_on_line(
        np.searchsorted(s_beams, s_keys[order]), s_range[order], np.searchsorted(s_beams, m_keys[shared]), m_range
    )
    partner = order[near] if order.size else near
    difference = m_range - s_range[partner] if order.size else m_range
    close = np.abs(difference) <= tolerance_m
    return EchoPairs(
        measured=shared[close],
        simulated=partner[close],
        difference_m=difference[close],
        beams_both=both.size,
        beams_measured=m_beams.size - both.size,
        beams_simulated=s_beams.size - both.size,
    )


def _distinct(keys: IndexArray) -> IndexArray:
    """The keys once each, ascending: at once where they ascend already, as in most scans."""
    steps = np.diff(keys)
    return keys[np.append(True, steps > 0)] if keys.size and not (steps < 0).any() else np.unique(keys)


def _known(scan: Scan) -> BoolArray:
    return (scan.layer >= 0) & (scan.point >= 0)


def _beams_of_echoes(beams: IndexArray, scan: Scan) -> IndexArray:
    """Index into `beams` of each echo's beam."""
    keys = beam_keys(scan.layer, scan.point)
    if not keys.size:
        return np.zeros(0, dtype=np.int64)
    index = np.minimum(np.searchsorted(beams, keys), max(beams.size - 1, 0))
    strange = np.flatnonzero(beams[index] != keys) if beams.size else np.zeros(1, dtype=np.int64)
    if strange.size:
        layer, point = int(scan.layer[strange[0]]), int(scan.point[strange[0]])
        raise UsageError(
            f"the scan has an echo on Layer {layer}, Point {point}, a beam that the ideal scan does not have",
            fix="compare with the ideal scan of the same frame, which has a row for every fired beam",
        )
    return np.asarray(index, dtype=np.int64)


def nearest_on_line(line: IndexArray, place: FloatArray, query_line: IndexArray, query: FloatArray) -> IndexArray:
    """Index of the entry on the same line (beam, column, layer) closest to each query; -1 where there is none.

    `line`, `place`: entries in ascending (line, place), shapes (n,); queries (m,), result (m,). Places are -1 or
    more. Of two that are equally close the lower.
    """
    if not line.size:
        return np.full(query_line.size, -1, dtype=np.int64)
    # Lines end to end on one axis, each long enough for its places: one search finds both neighbours.
    length = 3.0 + max(float(place.max()), float(query.max(initial=0.0)))
    upper = np.searchsorted(line * length + place, query_line * length + query)
    below, above = np.maximum(upper - 1, 0), np.minimum(upper, line.size - 1)
    to_below = np.where(line[below] == query_line, np.abs(query - place[below]), np.inf)
    to_above = np.where(line[above] == query_line, np.abs(query - place[above]), np.inf)
    best = np.where(to_below <= to_above, below, above)
    return np.where(np.minimum(to_below, to_above) < np.inf, best, -1)
