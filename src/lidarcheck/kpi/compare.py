"""Compare a measured with a simulated scan by every KPI that the two allow."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.errors import UsageError
from lidarcheck.kpi.blooming import Axis, BloomingProfile, blooming_profile, offset_step
from lidarcheck.kpi.comparison import Comparison, FeatureGap, KpiRow, Paired, PercentileGap, SurfaceGap, TargetGap
from lidarcheck.kpi.detection import detection_probability, false_alarms, range_edges
from lidarcheck.kpi.distances import energy, js, ks, ordered, wasserstein
from lidarcheck.kpi.features import (
    ComparedFeature,
    Decades,
    decades_of,
    feature_column,
    features_apart,
    strength_name,
)
from lidarcheck.kpi.ghost import GHOST_WITHIN_M, Ghost, ghost
from lidarcheck.kpi.histogram import histogram_gap
from lidarcheck.kpi.overlap import RADIUS_M, overlap
from lidarcheck.kpi.pairing import (
    OF_SURFACE_M,
    EchoPairs,
    Pairing,
    of_surface_m,
    pair_echoes,
    pair_with_ideal,
    paths,
)
from lidarcheck.kpi.percentiles import percentiles
from lidarcheck.kpi.readout import Written, direction_gap, number_gap, position_gap, written
from lidarcheck.kpi.target import Beside, Bright, beside_target, ghost_rows, target_rows
from lidarcheck.kpi.validation import dvm, mean, spread
from lidarcheck.kpi.walk import WalkOffset, walk_offset
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

if TYPE_CHECKING:
    from lidarcheck.model.spec import Model

__all__ = [
    "RANGE_RESIDUAL",
    "Compared",
    "Comparison",
    "KpiRow",
    "compare",
    "feature_gap",
]

RANGE_RESIDUAL = "range_residual"


@dataclass(frozen=True)
class Compared:
    """Two scans with what a comparison has found out of them, for whoever looks at single rows.

    `m`, `s`: beside the surfaces, None without an ideal scan; `bright`: a target's echoes, or None; `features`: those
    that both have; `strength`, `decades`: how strong each side's echoes are, (n,), None where one does not tell;
    `pairs`: echoes of one beam; `written`: what the sensors wrote, of each side.
    """

    measured: Scan
    simulated: Scan
    m: Pairing | None
    s: Pairing | None
    features: tuple[ComparedFeature, ...]
    strength: tuple[FloatArray, FloatArray] | None
    decades: Decades | None
    bright: Bright | None
    pairs: EchoPairs
    written: tuple[Written, Written]
    comparison: Comparison


def compare(
    measured: Scan,
    simulated: Scan,
    ideal: IdealScan | None = None,
    *,
    model: Model | None = None,
    sensor: Sensor | None = None,
    target: npt.ArrayLike | None = None,
    radius_m: float = RADIUS_M,
    files: Mapping[str, PathLike[str] | str] | None = None,
    look: Callable[[Compared], object] | None = None,
) -> Comparison:
    """Every KPI that the two scans, and what is known besides, allow.

    The features of the `sensor` (the model's, where None) are compared over all echoes; where nobody names a sensor
    PEAK, AREA, WIDTH and, where both scans have them, INTENSITY, SIGNAL, REFLECTIVITY and what the scans call features
    themselves. With the ideal scan: the range residuals and the walk of the echoes that come from a surface (±2 m, or
    in proportion to the sensor's detection window), detection probability per 10 m and false alarms
    (`pairing.surface_window_m`). Without it there is no residual; `paired` then tells how the ranges of one beam
    differ. Ghost and blooming need a target: the rows of the ideal scan in the mask `target`, shape (n_ideal,), or else
    those whose material is a retro-reflector in `model`. `left_out` names what was not compared. Directions and echo
    numbers are compared as the scans have them, and where echoes lie beside their surface points. `files`: where the
    scans `measured` and `simulated` were read from, for messages. `look`: gets the rows that the comparison rests on,
    as a test against chance does. `UsageError`: an echo on a beam that the ideal scan does not have; a mask of another
    shape.
    """
    seen = _Seen(measured, simulated, model, sensor if sensor is not None or model is None else model.sensor)
    features: dict[str, FeatureGap] = {}
    left_out: dict[str, str] = {}
    surfaces: SurfaceGap | None = None
    m = s = bright = None
    if ideal is None:
        left_out[RANGE_RESIDUAL] = "needs the ideal scan"
    else:
        m, s = (seen.paired_with(ideal, scan, side, files or {}) for side, scan in seen.sides())
        features[RANGE_RESIDUAL] = feature_gap(m.residual_m[m.of_one_surface], s.residual_m[s.of_one_surface], unit="m")
        surfaces = seen.surfaces(m, s)
        if surfaces.walk is None:
            left_out["walk_offset"] = seen.no_walk
        mask = target_rows(ideal, model, target)
        bright = None if mask is None else seen.bright(ideal, m, s, mask)
    if bright is None:
        left_out["ghost, blooming_profile"] = "need the ideal scan and a model with the retro-reflector that it shows"
    columns = tuple(features_apart(measured, simulated, seen.sensor, left_out))
    features |= {one.name: feature_gap(*one.known, unit=one.unit) for one in columns}
    pairs = pair_echoes(measured, simulated, tolerance_m=of_surface_m(seen.sensor, external=seen.external))
    sides, unwritten = written((measured, simulated), (m, s), ideal, seen.sensor)
    left_out |= unwritten
    comparison = Comparison(
        n_measured=len(measured),
        n_simulated=len(simulated),
        features=features,
        left_out=left_out,
        paired=_paired(pairs),
        overlap=overlap(_positions(measured), _positions(simulated), radius_m=radius_m),
        surfaces=surfaces,
        target=None if bright is None else seen.target(bright),
        direction=direction_gap(*sides),
        position=position_gap(*sides),
        numbers=number_gap(*sides),
        histogram=histogram_gap(measured, simulated),
    )
    if look is not None:
        strength = seen.strength if surfaces is not None and surfaces.walk is not None else None
        look(Compared(measured, simulated, m, s, columns, strength, seen.decades, bright, pairs, sides, comparison))
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


@dataclass(frozen=True)
class _Seen:
    """Two scans, and what is known of the sensor: the model's, where nobody names another."""

    measured: Scan
    simulated: Scan
    model: Model | None
    sensor: Sensor | None

    @property
    def external(self) -> bool:
        """Whether a program sees in the sensor's place."""
        return self.model is not None and self.model.external is not None

    def sides(self) -> tuple[tuple[str, Scan], tuple[str, Scan]]:
        """Both scans, each with what it is called."""
        return ("measured", self.measured), ("simulated", self.simulated)

    @functools.cached_property
    def strength(self) -> tuple[FloatArray, FloatArray] | None:
        """How strong the echoes of each side are, None where one does not tell."""
        name = strength_name(self.sensor)
        aliases = next((f.aliases for f in (self.sensor.features if self.sensor else ()) if f.name == name), ())
        m, s = (feature_column(scan, name, aliases) if name else None for _, scan in self.sides())
        return None if m is None or s is None else (m, s)

    @property
    def decades(self) -> Decades | None:
        """Decades of the strength."""
        return decades_of(self.sensor)

    @property
    def no_walk(self) -> str:
        """Why there is no walk."""
        name = strength_name(self.sensor)
        return f"needs {name} in both scans" if name else "needs a feature that rises with the amplitude"

    def paired_with(self, ideal: IdealScan, scan: Scan, side: str, files: Mapping[str, PathLike[str] | str]) -> Pairing:
        """The echoes of a side beside their surfaces."""
        try:
            return pair_with_ideal(ideal, scan, self.sensor, model=self.model)
        except UsageError as error:
            what = error.what.replace("the scan", f"the {side} scan", 1)
            raise UsageError(what, file=files.get(side), fix=error.fix) from error

    def surfaces(self, m: Pairing, s: Pairing) -> SurfaceGap:
        """Which surfaces were seen, and the walk."""
        walk: WalkOffset | None = None
        if self.strength is not None and self.decades is not None:
            of_m, of_s = m.of_one_surface, s.of_one_surface
            m_strength, s_strength = self.strength
            walk = walk_offset(
                *(m.residual_m[of_m], m_strength[of_m], s.residual_m[of_s], s_strength[of_s]), self.decades
            )
        edges_m = range_edges(m.distance_m)  # of all beams: each side may have fired others, the bins are the same
        return SurfaceGap(
            detection_measured=detection_probability(m.distance_m[m.judged], m.detected[m.judged], edges_m=edges_m),
            detection_simulated=detection_probability(s.distance_m[s.judged], s.detected[s.judged], edges_m=edges_m),
            false_alarms_measured=false_alarms(m),
            false_alarms_simulated=false_alarms(s),
            walk=walk,
        )

    def bright(self, ideal: IdealScan, m: Pairing, s: Pairing, target: BoolArray) -> Bright:
        """The echoes of a target, shape (n_ideal,), of its ghost and of its bloom."""
        within_m = of_surface_m(self.sensor, external=self.external)
        ghost_m = GHOST_WITHIN_M * within_m / OF_SURFACE_M
        none = np.zeros(len(self.measured)), np.zeros(len(self.simulated))
        sides = (self.measured, m), (self.simulated, s)

        def beside(axis: Axis) -> tuple[Beside, Beside]:
            one, other = (beside_target(*side, ideal, target, axis, within_m) for side in sides)
            return one, other

        ghosts = [ghost_rows(*side, target, ghost_m) for side in sides]
        return Bright(
            strength_name=strength_name(self.sensor),
            strength=self.strength or none,
            peak=(self.measured.peak, self.simulated.peak),
            ghosts=(ghosts[0], ghosts[1]),
            beside={"vertical": beside("vertical"), "horizontal": beside("horizontal")},
        )

    def target(self, bright: Bright) -> TargetGap:
        """The ghost and the blooming of a target."""
        ghosts = [_ghost(self.measured, bright, 0), _ghost(self.simulated, bright, 1)]
        vertical, horizontal = self._blooming(bright, "vertical"), self._blooming(bright, "horizontal")
        return TargetGap(ghosts[0], ghosts[1], vertical, horizontal, bright.ratios)

    def _blooming(self, bright: Bright, axis: Axis) -> BloomingProfile:
        step = offset_step(axis, self.sensor)
        (m_row, m_offset), (s_row, s_offset) = bright.beside[axis]
        m, s = bright.strength
        return blooming_profile(m_offset * step, m[m_row], s_offset * step, s[s_row])


def _ghost(scan: Scan, bright: Bright, side: int) -> Ghost:
    rows, found, partner = bright.ghosts[side]
    xyz, strength, peak = _positions(scan), bright.strength[side], bright.peak[side]
    way = None if scan.beams.central else paths(scan)
    return ghost(
        *(xyz[rows], strength[rows], peak[rows]),
        *(xyz[found], strength[found], peak[found]),
        partner=partner,
        paths_m=None if way is None else (way[rows], way[found]),
    )


def _paired(pairs: EchoPairs) -> Paired:
    d = ordered(pairs.difference_m)
    median = float(np.median(d)) if d.size else float("nan")
    return Paired(d.size, median, mean(d), spread(d), pairs.beams_both, pairs.beams_measured, pairs.beams_simulated)


def _positions(scan: Scan) -> FloatArray:
    return np.stack([scan.x_m, scan.y_m, scan.z_m], axis=-1)
