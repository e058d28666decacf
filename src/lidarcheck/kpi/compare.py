"""Compare a measured with a simulated scan by every KPI that the two allow."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.errors import UsageError
from lidarcheck.kpi.blooming import Axis, BloomingProfile, blooming_profile
from lidarcheck.kpi.comparison import Comparison, FeatureGap, KpiRow, Paired, PercentileGap, SurfaceGap, TargetGap
from lidarcheck.kpi.detection import detection_probability, false_alarms, range_edges
from lidarcheck.kpi.distances import energy, js, ks, ordered, wasserstein
from lidarcheck.kpi.ghost import Ghost, ghost
from lidarcheck.kpi.overlap import RADIUS_M, overlap
from lidarcheck.kpi.pairing import EchoPairs, Pairing, pair_echoes, pair_with_ideal
from lidarcheck.kpi.percentiles import percentiles
from lidarcheck.kpi.readout import Written, direction_gap, number_gap, position_gap, written
from lidarcheck.kpi.target import beside_target, ghost_rows, target_rows
from lidarcheck.kpi.validation import dvm, mean, spread
from lidarcheck.kpi.walk import WalkOffset, walk_offset
from lidarcheck.scan import IdealScan, Scan

if TYPE_CHECKING:
    from lidarcheck.model.spec import Model

__all__ = [
    "COLUMNS",
    "RANGE_RESIDUAL",
    "STAND_INS",
    "Compared",
    "Comparison",
    "KpiRow",
    "compare",
    "feature_column",
    "feature_gap",
]

RANGE_RESIDUAL = "range_residual"
COLUMNS = {"PEAK": ("peak", ""), "AREA": ("area", ""), "WIDTH": ("width_ns", "ns")}
"""Standard features: column of the scan, unit (PEAK and AREA count detectors)."""
STAND_INS = ("INTENSITY", "SIGNAL", "REFLECTIVITY")
"""What sensors without PEAK and AREA bring."""


@dataclass(frozen=True)
class Compared:
    """Two scans with what a comparison has found out of them, for whoever looks at single rows.

    `m`, `s`: beside the surfaces, None without an ideal scan; `target`: its rows there, shape (n_ideal,), or None;
    `pairs`: echoes of one beam; `written`: what the sensors wrote, of each side.
    """

    measured: Scan
    simulated: Scan
    m: Pairing | None
    s: Pairing | None
    ideal: IdealScan | None
    target: BoolArray | None
    pairs: EchoPairs
    written: tuple[Written, Written]
    comparison: Comparison


def compare(
    measured: Scan,
    simulated: Scan,
    ideal: IdealScan | None = None,
    *,
    model: Model | None = None,
    target: npt.ArrayLike | None = None,
    radius_m: float = RADIUS_M,
    files: Mapping[str, PathLike[str] | str] | None = None,
    look: Callable[[Compared], object] | None = None,
) -> Comparison:
    """Every KPI that the two scans, and what is known besides, allow.

    PEAK, AREA, WIDTH and, where both scans have them, INTENSITY, SIGNAL and REFLECTIVITY are compared over all
    echoes. With the ideal scan: the range residuals and the walk of the echoes that come from a surface (±2 m),
    detection probability per 10 m and false alarms (`pairing.surface_window_m`). Without it there is no residual;
    `paired` then tells how the ranges of one beam differ. Ghost and blooming need a target: the rows of the ideal scan
    in the mask `target`, shape (n_ideal,), or else those whose material is a retro-reflector in `model`. `left_out`
    names what was not compared. Directions and echo numbers are compared as the scans have them, and where echoes lie
    beside their surface points. `files`: where the scans `measured` and `simulated` were read from, for messages.
    `look`: gets the rows that the comparison rests on, as a test against chance does. `UsageError`: an echo on a beam
    that the ideal scan does not have; a mask of another shape.
    """
    features: dict[str, FeatureGap] = {}
    left_out: dict[str, str] = {}
    surfaces: SurfaceGap | None = None
    bright: TargetGap | None = None
    m = s = mask = None
    if ideal is None:
        left_out[RANGE_RESIDUAL] = "needs the ideal scan"
    else:
        m, s = (
            _pair(ideal, scan, side, files or {}, model)
            for side, scan in (("measured", measured), ("simulated", simulated))
        )
        features[RANGE_RESIDUAL] = feature_gap(m.residual_m[m.of_surface], s.residual_m[s.of_surface], unit="m")
        surfaces = _surfaces(measured, simulated, m, s)
        if surfaces.walk is None:
            left_out["walk_offset"] = "needs AREA in both scans"
        mask = target_rows(ideal, model, target)
        bright = None if mask is None else _bright(measured, simulated, m, s, ideal, mask)
    if bright is None:
        left_out["ghost, blooming_profile"] = "need the ideal scan and a model with the retro-reflector that it shows"
    _compare_columns(measured, simulated, features, left_out)
    pairs = pair_echoes(measured, simulated)
    sides, unwritten = written((measured, simulated), (m, s), ideal)
    left_out |= unwritten
    comparison = Comparison(
        n_measured=len(measured),
        n_simulated=len(simulated),
        features=features,
        left_out=left_out,
        paired=_paired(pairs),
        overlap=overlap(_positions(measured), _positions(simulated), radius_m=radius_m),
        surfaces=surfaces,
        target=bright,
        direction=direction_gap(*sides),
        position=position_gap(*sides),
        numbers=number_gap(*sides),
    )
    if look is not None:
        look(Compared(measured, simulated, m, s, ideal, mask, pairs, sides, comparison))
    return comparison


def feature_gap(measured: npt.ArrayLike, simulated: npt.ArrayLike, *, unit: str = "") -> FeatureGap:
    """All distances of one feature's two samples, shapes (n,) and (m,); NaN where either is empty."""
    m, s = ordered(measured), ordered(simulated)
    bias, scatter = dvm(m, s)
    both = zip(percentiles(m).items(), percentiles(s).values(), strict=True)
    return FeatureGap(
        unit=unit,
        n_measured=m.size,
        n_simulated=s.size,
        mean_measured=mean(m),
        mean_simulated=mean(s),
        wasserstein=wasserstein(m, s),
        ks=ks(m, s),
        energy=energy(m, s),
        js=js(m, s),
        dvm_bias=bias,
        dvm_scatter=scatter,
        percentiles={level: PercentileGap(of_m, of_s) for (level, of_m), of_s in both},
    )


def _compare_columns(
    measured: Scan, simulated: Scan, features: dict[str, FeatureGap], left_out: dict[str, str]
) -> None:
    for name, (_, unit) in {**COLUMNS, **dict.fromkeys(STAND_INS, ("", ""))}.items():
        m, s = feature_column(measured, name), feature_column(simulated, name)
        if m is not None and s is not None:
            features[name] = feature_gap(m, s, unit=unit)
        elif name in COLUMNS or m is not None or s is not None:
            lacking = [side for side, column in (("measured", m), ("simulated", s)) if column is None]
            left_out[name] = f"not in the {' nor in the '.join(lacking)} scan"


def feature_column(scan: Scan, name: str) -> FloatArray | None:
    """A feature of the scan, shape (n,), or None where its source did not have it."""
    if name in COLUMNS:
        column: FloatArray = getattr(scan, COLUMNS[name][0])
        return None if name in scan.defaulted else column
    named = {
        key.upper(): np.asarray(value, dtype=np.float64) for key, value in scan.extra.items() if key.upper() == name
    }
    return named.get(name)


def _pair(
    ideal: IdealScan, scan: Scan, side: str, files: Mapping[str, PathLike[str] | str], model: Model | None
) -> Pairing:
    try:
        return pair_with_ideal(ideal, scan, None if model is None else model.sensor)
    except UsageError as error:
        what = error.what.replace("the scan", f"the {side} scan", 1)
        raise UsageError(what, file=files.get(side), fix=error.fix) from error


def _surfaces(measured: Scan, simulated: Scan, m: Pairing, s: Pairing) -> SurfaceGap:
    walk: WalkOffset | None = None
    m_area, s_area = feature_column(measured, "AREA"), feature_column(simulated, "AREA")
    if m_area is not None and s_area is not None:
        walk = walk_offset(
            m.residual_m[m.of_surface], m_area[m.of_surface], s.residual_m[s.of_surface], s_area[s.of_surface]
        )
    edges_m = range_edges(m.distance_m)  # of all beams: each side may have fired others, the bins are the same
    return SurfaceGap(
        detection_measured=detection_probability(m.distance_m[m.judged], m.detected[m.judged], edges_m=edges_m),
        detection_simulated=detection_probability(s.distance_m[s.judged], s.detected[s.judged], edges_m=edges_m),
        false_alarms_measured=false_alarms(m),
        false_alarms_simulated=false_alarms(s),
        walk=walk,
    )


def _bright(measured: Scan, simulated: Scan, m: Pairing, s: Pairing, ideal: IdealScan, target: BoolArray) -> TargetGap:
    return TargetGap(
        ghost_measured=_ghost(measured, m, target),
        ghost_simulated=_ghost(simulated, s, target),
        vertical=_blooming(measured, simulated, m, s, ideal, target, "vertical"),
        horizontal=_blooming(measured, simulated, m, s, ideal, target, "horizontal"),
    )


def _ghost(scan: Scan, pairing: Pairing, target: BoolArray) -> Ghost:
    rows, found, partner = ghost_rows(scan, pairing, target)
    xyz = _positions(scan)
    return ghost(
        *(xyz[rows], scan.area[rows], scan.peak[rows]),
        *(xyz[found], scan.area[found], scan.peak[found]),
        partner=partner,
    )


def _blooming(
    measured: Scan, simulated: Scan, m: Pairing, s: Pairing, ideal: IdealScan, target: BoolArray, axis: Axis
) -> BloomingProfile:
    (m_row, m_offset), (s_row, s_offset) = (
        beside_target(scan, pairing, ideal, target, axis) for scan, pairing in ((measured, m), (simulated, s))
    )
    return blooming_profile(m_offset, measured.area[m_row], s_offset, simulated.area[s_row])


def _paired(pairs: EchoPairs) -> Paired:
    d = ordered(pairs.difference_m)
    median = float(np.median(d)) if d.size else float("nan")
    return Paired(d.size, median, mean(d), spread(d), pairs.beams_both, pairs.beams_measured, pairs.beams_simulated)


def _positions(scan: Scan) -> FloatArray:
    return np.stack([scan.x_m, scan.y_m, scan.z_m], axis=-1)
