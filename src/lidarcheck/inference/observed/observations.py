"""What a scan shows of each beam: paired residuals of the surface's echo, and the echoes of no surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.inference.observed.beam_table import BeamTable
from lidarcheck.inference.observed.kernels import write_nearest
from lidarcheck.kpi.pairing import nearest_on_line
from lidarcheck.scan import Scan

__all__ = ["FEATURES", "Observations", "observations_of"]


FEATURES = ("range", "area", "peak", "width")
"""The features of a surface's echo: range residual [m], ln AREA, ln PEAK, WIDTH [ns]; of other sensors their amplitude
and two further features (`EchoView`), under the same names."""


_STEPS = 1.0
"""An aim that is off by so many beams still shows a surface as the same one."""


@dataclass(frozen=True)
class Observations:
    """What scans of all frames show of each beam of a `BeamTable` table.

    `detected` (n,): an echo within 2 m of a surface of the beam, or, where the surface is seen at a grazing angle,
    within what an aim off by a part of a beam makes of its range; of several the nearest. `feature` (n, 4): that echo's
    features in the order of `FEATURES`, 0 where there is none. `strayed` (n,): beams that show nothing but a
    neighbour's surface, as an aim off by a fraction of a beam makes them.

    The other echoes, in order of the beams, shape (m,): `extra_beam`, `extra_m` (range), `extra_area` (ln AREA),
    `extra_peak` (ln PEAK), `extra_width` [ns], and `extra_side`, the side whose neighbour meets a surface at that
    range, as `beams.SIDES`, -1 for none.
    """

    detected: npt.NDArray[np.bool_]
    feature: FloatArray
    extra_beam: IndexArray
    extra_m: FloatArray
    extra_area: FloatArray
    extra_peak: FloatArray
    extra_width: FloatArray
    extra_side: IndexArray
    strayed: npt.NDArray[np.bool_]


def observations_of(beams: BeamTable, scans: Sequence[Scan]) -> Observations:
    """Pair the echoes of the frames' scans with what the beams meet; those of beams that are left out are left out."""
    scans, beam = beams.echoes_of(scans)
    range_m = np.concatenate([np.asarray(scan.range_m) for scan in scans]) - beams.range_offset_m[beam]
    surface = nearest_on_line(beams.hit_beam, beams.hit_m, beam, range_m)
    residual = np.where(surface >= 0, range_m - np.append(beams.hit_m, 0.0)[np.maximum(surface, 0)], np.inf)
    nearest = np.full(len(beams), -1)
    write_nearest(beam, np.abs(residual), beams.view.reach_m + _STEPS * beams.step_m, nearest)
    own = nearest[nearest >= 0]
    detected = np.zeros(len(beams), dtype=bool)
    detected[beam[own]] = True
    feature = np.zeros((len(beams), len(FEATURES)))
    amplitude, height, width = beams.view.columns(scans)
    for j, value in enumerate((residual, amplitude, height, width)):
        feature[beam[own], j] = value[own]
    others = np.ones(len(beam), dtype=bool)
    others[own] = False
    rest = np.flatnonzero(others)
    rest = rest[np.lexsort((range_m[rest], beam[rest]))]
    side = _sides(beams, beam[rest], range_m[rest])
    strayed = np.zeros(len(beams), dtype=bool)
    strayed[beam[rest][side >= 0]] = True
    return Observations(
        detected=detected,
        feature=feature,
        extra_beam=beam[rest],
        extra_m=range_m[rest],
        extra_area=amplitude[rest],
        extra_peak=height[rest],
        extra_width=width[rest],
        extra_side=side,
        strayed=strayed & ~detected,
    )


def _sides(beams: BeamTable, beam: IndexArray, range_m: FloatArray) -> IndexArray:
    """The side on which a neighbouring beam's surface lies at the echo's range, and the beam's own does not."""
    beside, own = beams.neighbour_m[beam], beams.distance_m[beam]
    reach = (beams.view.length_scale + 0.03 * range_m)[:, None] + beams.neighbour_step_m[beam]
    near = (beside > 0.0) & (np.abs(range_m[:, None] - beside) < reach)
    near &= (own[:, None] == 0.0) | (np.abs(own[:, None] - beside) > reach)
    return np.where(near.any(axis=1), near.argmax(axis=1), -1)
