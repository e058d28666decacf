"""What a comparison of two scans found: the numbers, as JSON and as rows of a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from lidarcheck.formats.plain import plain
from lidarcheck.kpi.blooming import BloomingProfile
from lidarcheck.kpi.detection import Detection, FalseAlarms
from lidarcheck.kpi.ghost import Ghost
from lidarcheck.kpi.histogram import HistogramGap
from lidarcheck.kpi.overlap import Overlap
from lidarcheck.kpi.percentiles import Percentile
from lidarcheck.kpi.walk import WalkOffset

__all__ = [
    "Comparison",
    "DirectionGap",
    "FeatureGap",
    "KpiRow",
    "Paired",
    "PercentileGap",
    "Sides",
    "SurfaceGap",
    "TargetGap",
]

NAN = float("nan")


@dataclass(frozen=True)
class FeatureGap:
    """One feature, measured against simulated: sizes and means of the samples, and the distances of `lidarcheck.kpi`.

    All in `unit`, but `energy` in its square root, `ks` without unit and `js` in bits. `percentiles`: by level [%].
    """

    unit: str
    n_measured: int
    n_simulated: int
    mean_measured: float
    mean_simulated: float
    wasserstein: float
    ks: float
    energy: float
    js: float
    dvm_bias: float
    dvm_scatter: float
    percentiles: Mapping[int, PercentileGap]


class PercentileGap(NamedTuple):
    """A percentile of the measured and of the simulated sample."""

    measured: Percentile
    simulated: Percentile


class DirectionGap(NamedTuple):
    """How far echoes lie off their beams' directions, in `azimuth` or `elevation` [deg]."""

    bias_measured: float
    bias_simulated: float
    scatter_measured: float
    scatter_simulated: float


class Sides(NamedTuple):
    """One number of the measured and of the simulated scan."""

    measured: float
    simulated: float


@dataclass(frozen=True)
class Paired:
    """Ranges of the measured echoes minus those of the closest simulated echo on the same beam, within 2 m.

    `spread_m`: half the central 68.3 %. The beams are those with an echo in both scans, or in one alone.
    """

    pairs: int
    median_m: float
    mean_m: float
    spread_m: float
    beams_both: int
    beams_measured_only: int
    beams_simulated_only: int


@dataclass(frozen=True)
class SurfaceGap:
    """What needs the ideal scan: which surfaces were seen, where there was none, and the walk."""

    detection_measured: Detection
    detection_simulated: Detection
    false_alarms_measured: FalseAlarms
    false_alarms_simulated: FalseAlarms
    walk: WalkOffset | None


@dataclass(frozen=True)
class TargetGap:
    """What needs a known bright target: its ghost, and its blooming along the `vertical` and the `horizontal` axis.

    `ratios`: what the ghost's ratios of mean strength and mean PEAK are called, those that there are.
    """

    ghost_measured: Ghost
    ghost_simulated: Ghost
    vertical: BloomingProfile
    horizontal: BloomingProfile
    ratios: tuple[str, ...] = ("area_ratio", "peak_ratio")


class KpiRow(NamedTuple):
    """A line of the table.

    `of`: feature, range bin or decade; `value`: the KPI, or measured minus simulated. NaN: not defined.
    """

    kpi: str
    of: str
    measured: float
    simulated: float
    value: float
    unit: str


@dataclass(frozen=True)
class Comparison:
    """Everything that two scans can be compared by.

    `features`: by name, e.g. `AREA`; `left_out`: what could not be compared, and why. `surfaces` needs an ideal scan,
    `target` besides a known target; else None. `direction`: by angle, where both scans say which beam an echo is of;
    `position`: by axis, with an ideal scan; `numbers`: by echo number, where both scans have them; `histogram`: where
    both have the bins of their beams.
    """

    n_measured: int
    n_simulated: int
    features: Mapping[str, FeatureGap]
    left_out: Mapping[str, str]
    paired: Paired
    overlap: Overlap
    surfaces: SurfaceGap | None = None
    target: TargetGap | None = None
    direction: Mapping[str, DirectionGap] | None = None
    position: Mapping[str, Sides] | None = None
    numbers: Mapping[int, Sides] | None = None
    histogram: HistogramGap | None = None

    def to_dict(self) -> dict[str, Any]:
        """The comparison for JSON, by KPI: plain numbers and lists, null where a number is not defined."""
        kpis: dict[str, Any] = {
            "echoes": {"measured": self.n_measured, "simulated": self.n_simulated},
            "features": self.features,
            "paired_range": self.paired,
            "overlap": self.overlap,
            "direction": self.direction,
            "position_bias": self.position,
            "echo_number_share": self.numbers,
            "histogram": self.histogram,
        }
        if (seen := self.surfaces) is not None:
            kpis["detection_probability"] = _sides(seen.detection_measured, seen.detection_simulated)
            kpis["false_alarms"] = _sides(seen.false_alarms_measured, seen.false_alarms_simulated)
            kpis["walk_offset"] = seen.walk
        if (bright := self.target) is not None:
            kpis["ghost"] = _sides(bright.ghost_measured, bright.ghost_simulated)
            axes = {"vertical": bright.vertical, "horizontal": bright.horizontal}
            kpis["blooming_profile"] = axes
        return {name: plain(kpi) for name, kpi in {**kpis, "left_out": self.left_out}.items() if kpi is not None}

    def rows(self) -> list[KpiRow]:
        """The comparison as a table, in the order of reading."""
        found = [KpiRow("echoes", "", self.n_measured, self.n_simulated, self.n_measured - self.n_simulated, "")]
        for name, gap in self.features.items():
            found.extend(_feature_rows(name, gap))
        if (bins := self.histogram) is not None:
            found.append(KpiRow("histogram_residual", bins.of, NAN, NAN, bins.residual, "√counts"))
            found.append(KpiRow("histogram_distance", bins.of, NAN, NAN, bins.distance_bins, "bins"))
        if self.surfaces is not None:
            found.extend(_surface_rows(self.surfaces))
        found.extend(_readout_rows(self))
        if self.target is not None:
            found.extend(_target_rows(self.target))
        found.append(KpiRow("paired_range", "median", NAN, NAN, self.paired.median_m, "m"))
        found.append(KpiRow("paired_range", "spread", NAN, NAN, self.paired.spread_m, "m"))
        shares = self.overlap.measured_share, self.overlap.simulated_share
        found.append(KpiRow("overlap", f"within {self.overlap.radius_m:g} m", *shares, NAN, ""))
        found.append(KpiRow("chamfer", "", NAN, NAN, self.overlap.chamfer_m, "m"))
        return found


def _sides(measured: object, simulated: object) -> dict[str, object]:
    return {"measured": measured, "simulated": simulated}


def _feature_rows(name: str, gap: FeatureGap) -> Iterator[KpiRow]:
    root = f"√({gap.unit})" if " " in gap.unit else f"√{gap.unit}" if gap.unit else ""
    yield KpiRow("dvm_bias", name, gap.mean_measured, gap.mean_simulated, gap.dvm_bias, gap.unit)
    yield KpiRow("dvm_scatter", name, NAN, NAN, gap.dvm_scatter, gap.unit)
    yield KpiRow("wasserstein", name, NAN, NAN, gap.wasserstein, gap.unit)
    yield KpiRow("ks", name, NAN, NAN, gap.ks, "")
    yield KpiRow("energy", name, NAN, NAN, gap.energy, root)
    yield KpiRow("js", name, NAN, NAN, gap.js, "bits")
    for level, (m, s) in gap.percentiles.items():
        yield KpiRow(f"percentile_{level}", name, m.value, s.value, m.value - s.value, gap.unit)


def _readout_rows(found: Comparison) -> Iterator[KpiRow]:
    for of, angle in (found.direction or {}).items():
        m, s = angle.bias_measured, angle.bias_simulated
        yield KpiRow("direction_bias", of, m, s, m - s, "deg")
        m, s = angle.scatter_measured, angle.scatter_simulated
        yield KpiRow("direction_scatter", of, m, s, m - s, "deg")
    for axis, place in (found.position or {}).items():
        yield KpiRow(f"position_bias_{axis}", "", *place, place.measured - place.simulated, "m")
    for number, part in (found.numbers or {}).items():
        yield KpiRow("echo_number_share", str(number), *part, part.measured - part.simulated, "")


def _surface_rows(gap: SurfaceGap) -> Iterator[KpiRow]:
    m, s = gap.detection_measured, gap.detection_simulated
    yield KpiRow("detection_probability", "all", m.overall, s.overall, m.overall - s.overall, "")
    for i in np.flatnonzero(m.beams).tolist():
        of = f"{m.edges_m[i]:g}–{m.edges_m[i + 1]:g} m"
        p, q = float(m.probability[i]), float(s.probability[i])
        yield KpiRow("detection_probability", of, p, q, p - q, "")
    a, b = gap.false_alarms_measured.per_beam, gap.false_alarms_simulated.per_beam
    yield KpiRow("false_alarms", "per beam", a, b, a - b, "")
    if gap.walk is not None:
        w = gap.walk
        for i, of in enumerate(w.of):
            yield KpiRow("walk_offset", of, float(w.measured_m[i]), float(w.simulated_m[i]), float(w.offset_m[i]), "m")


def _target_rows(gap: TargetGap) -> Iterator[KpiRow]:
    fields = dict(zip(gap.ratios, ("area_ratio", "peak_ratio"), strict=False))
    for name in ("count_ratio", *gap.ratios, "range_ratio", "size_ratio"):
        m, s = (getattr(side, fields.get(name, name)) for side in (gap.ghost_measured, gap.ghost_simulated))
        yield KpiRow("ghost", name, m, s, m - s, "")
    yield KpiRow("blooming_profile", "vertical", NAN, NAN, gap.vertical.rms_log10, "log10")
    yield KpiRow("blooming_profile", "horizontal", NAN, NAN, gap.horizontal.rms_log10, "log10")
