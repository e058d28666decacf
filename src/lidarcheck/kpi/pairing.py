"""Which surface does an echo belong to? The echoes of a scan beside what its beams meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.kpi.fired import judged_rows
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, VARIANTS, Sensor

__all__ = [
    "OF_SURFACE_M",
    "EchoPairs",
    "Pairing",
    "beam_keys",
    "nearest_on_line",
    "pair_echoes",
    "pair_with_ideal",
    "ranges",
    "surface_window_m",
]

OF_SURFACE_M = 2.0
"""An echo this close to a surface of its beam comes from it: pile-up shifts the echo of a retro-reflector by
more than a metre, so that a residual must not be cut at the window of `surface_window_m`."""

RANGE_DIGITS = 4


@dataclass(frozen=True)
class Pairing:
    """A scan's echoes beside the surfaces of their beams.

    Per beam, shape (n_beams,), in ascending (layer, point): `layer`, `point`, `distance_m` (its nearest surface, 0
    where it meets nothing, NaN where nobody knows all that it meets), `detected` (an echo lies on one of its
    surfaces), `judged`: it was fired, and what it meets is known, so that an echo that is missing or too many means
    something.

    Per echo, shape (n_echoes,), in the scan's order: `echo_beam` (index of its beam), `residual_m` (range minus the
    distance of the surface of its beam that lies closest to it; NaN where the beam meets nothing), `on_surface`
    (within the window of it), `of_surface` (within 2 m of it), and `surface`, that surface's row in the ideal scan (-1
    where there is none).
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


def surface_window_m(sensor: Sensor | None = None) -> float:
    """How far an echo may lie from a surface that it still lies on [m]: half the way that light goes in a pulse.

    c·FWHM/2, 0.749 m at 5 ns. Two surfaces closer than this share a pulse, and pile-up moves an echo by no more than
    its front half. `sensor`: whose pulse; None: the reference sensor's, which all variants share.
    """
    pulse_ns = (sensor or Sensor.of(VARIANTS[0])).pulse_fwhm_ns
    return 0.5 * LIGHT_SPEED_M_PER_NS * pulse_ns


def pair_with_ideal(ideal: IdealScan, scan: Scan, sensor: Sensor | None = None) -> Pairing:
    """Find the surface of every echo and the beams that were detected, within the window of `surface_window_m`.

    `sensor`: what made the scan, the reference sensor where None. Rows of one (layer, point) in the ideal scan are
    sub-beams: the beam counts once and an echo on any of their surfaces detects it. `UsageError` names the first echo's
    beam that the ideal scan does not have.
    """
    keys = beam_keys(ideal.layer, ideal.point)
    beams, first_row, beam_of_row = np.unique(keys, return_index=True, return_inverse=True)
    echo_beam = _beams_of_echoes(beams, scan)
    range_m = ranges(scan)

    hit = np.flatnonzero(ideal.distance_m > 0.0)
    order = hit[np.lexsort((ideal.distance_m[hit], beam_of_row[hit]))]
    surface = nearest_on_line(beam_of_row[order], ideal.distance_m[order], echo_beam, range_m)
    row = np.where(surface >= 0, order[surface] if order.size else -1, -1)
    residual = np.full(len(scan), np.nan)
    residual[row >= 0] = range_m[row >= 0] - ideal.distance_m[row[row >= 0]]
    on_surface = np.abs(residual) <= surface_window_m(sensor)

    distance = np.zeros(beams.size)
    # Descending distance within a beam: the last written, and so kept, is the nearest.
    distance[beam_of_row[order[::-1]]] = ideal.distance_m[order[::-1]]
    distance[beam_of_row[np.isnan(ideal.distance_m)]] = np.nan
    detected = np.zeros(beams.size, dtype=np.bool_)
    detected[echo_beam[on_surface]] = True
    return Pairing(
        layer=ideal.layer[first_row],
        point=ideal.point[first_row],
        distance_m=distance,
        detected=detected,
        judged=judged_rows(ideal, scan)[first_row],
        echo_beam=echo_beam,
        residual_m=residual,
        on_surface=on_surface,
        of_surface=np.abs(residual) <= OF_SURFACE_M,
        surface=row,
    )


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
