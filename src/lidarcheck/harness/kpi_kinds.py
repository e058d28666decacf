"""The kinds of KPI that a scenario may ask for, in one table, and what each is computed from.

A new kind is a small function of `Seen` and a line in `KINDS`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from lidarcheck.harness.kpi_spec import Direction, GateKind
from lidarcheck.kpi.pairing import Pairing
from lidarcheck.kpi.validation import mean
from lidarcheck.scan import Scan

__all__ = ["KINDS", "Echoes", "KpiKind", "Seen", "Selection"]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Echoes:
    """The echoes of a seed beside the surfaces of their beams, all frames together; shape (n,) each.

    `beam`: of the scenario, counted from 0 in ascending (layer, point); `frame`, from 0; `surface`: the row of the
    ideal scan that is nearest in range on that beam, -1 where the beam meets nothing; `residual_m`: range minus that
    row's, NaN where there is none.
    """

    beam: IndexArray
    frame: IndexArray
    surface: IndexArray
    residual_m: FloatArray
    area: FloatArray
    peak: FloatArray
    width_ns: FloatArray

    @classmethod
    def of(cls, scan: Scan, pairing: Pairing, frame: int = 0) -> Echoes:
        """The echoes of one frame."""
        frames = np.full(len(scan), frame, dtype=np.int64)
        columns = (scan.area, scan.peak, scan.width_ns)
        return cls(pairing.echo_beam, frames, pairing.surface, pairing.residual_m, *columns)

    @classmethod
    def joined(cls, parts: list[Echoes]) -> Echoes:
        """The echoes of several frames."""
        if len(parts) == 1:
            return parts[0]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in cls.__slots__))


@dataclass(frozen=True)
class Selection:
    """The part of a scenario that one KPI looks at.

    `rows`: mask over the ideal scan's rows; `beams`, `meeting`: masks over its beams, those with a selected row and
    those of them that meet a surface there. `window_m`: an echo within it of a surface lies on that surface.
    """

    rows: Mask
    beams: Mask
    meeting: Mask
    window_m: float

    def seen(self, echoes: Echoes, frames: int = 1) -> Seen:
        """The echoes of these beams, and those on the selected surfaces."""
        on_any = np.abs(echoes.residual_m) <= self.window_m
        mine = self.beams[echoes.beam]
        hits = np.flatnonzero(on_any & self.rows[echoes.surface])
        stray = np.flatnonzero(mine & ~on_any)
        return Seen(
            beams=frames * int(np.count_nonzero(self.beams)),
            beams_meeting=frames * int(np.count_nonzero(self.meeting)),
            beams_detected=self._beams_with(echoes, hits),
            beams_with_stray=self._beams_with(echoes, stray),
            echoes=int(np.count_nonzero(mine)),
            stray_echoes=len(stray),
            residual_m=echoes.residual_m[hits],
            area=echoes.area[hits],
            peak=echoes.peak[hits],
            width_ns=echoes.width_ns[hits],
        )

    def _beams_with(self, echoes: Echoes, which: IndexArray) -> int:
        """How many beams, counted in each frame, have one of those echoes."""
        return len(np.unique(echoes.frame[which] * len(self.beams) + echoes.beam[which]))


@dataclass(frozen=True, slots=True)
class Seen:
    """What one KPI is computed from.

    `beams`, `beams_meeting`: fired beams of the selection, and those that meet a surface; `beams_detected`,
    `beams_with_stray`: those with an echo on it, and those with an echo on no surface. `echoes`, `stray_echoes`: all
    echoes of the beams, and those on no surface. `residual_m`, `area`, `peak`, `width_ns`: of the echoes on the
    surface, shape (n,) each.
    """

    beams: int
    beams_meeting: int
    beams_detected: int
    beams_with_stray: int
    echoes: int
    stray_echoes: int
    residual_m: FloatArray
    area: FloatArray
    peak: FloatArray
    width_ns: FloatArray


def _share(part: int, whole: int) -> float:
    return part / whole if whole else float("nan")


def _standard_deviation(values: FloatArray) -> float:
    return float(values.std(ddof=1)) if len(values) > 1 else float("nan")


def _median(values: FloatArray) -> float:
    return float(np.median(values)) if len(values) else float("nan")


@dataclass(frozen=True, slots=True)
class KpiKind:
    """One kind of KPI: either `value`, a number per seed, or `sample`, whose distribution's distance is taken.

    `trials`: of a proportion. `on_surface`: it means nothing for beams that meet no surface. `meaning`: one line for
    help and documentation.
    """

    meaning: str
    unit: str
    direction: Direction
    gate: GateKind = "mean"
    value: Callable[[Seen], float] | None = None
    trials: Callable[[Seen], int] | None = None
    sample: Callable[[Seen], FloatArray] | None = None
    on_surface: bool = True


def _distance(meaning: str, unit: str, sample: Callable[[Seen], FloatArray]) -> KpiKind:
    return KpiKind(f"1-Wasserstein distance of the {meaning} distribution", unit, "lower", "distance", sample=sample)


KINDS: Mapping[str, KpiKind] = MappingProxyType(
    {
        "detection_probability": KpiKind(
            "beams with an echo on their surface / beams that meet one",
            "1",
            "target",
            "proportion",
            value=lambda seen: _share(seen.beams_detected, seen.beams_meeting),
            trials=lambda seen: seen.beams_meeting,
        ),
        "area_mean": KpiKind("mean AREA on the surface", "counts", "target", value=lambda seen: mean(seen.area)),
        "peak_mean": KpiKind("mean PEAK on the surface", "detectors", "target", value=lambda seen: mean(seen.peak)),
        "width_mean": KpiKind("mean WIDTH on the surface", "ns", "target", value=lambda seen: mean(seen.width_ns)),
        "range_residual_mean": KpiKind(
            "mean range minus true range: offset and walk", "m", "target", value=lambda seen: mean(seen.residual_m)
        ),
        "range_residual_median": KpiKind(
            "median range minus true range", "m", "target", value=lambda seen: _median(seen.residual_m)
        ),
        "range_noise": KpiKind(
            "standard deviation of range minus true range",
            "m",
            "target",
            value=lambda seen: _standard_deviation(seen.residual_m),
        ),
        "area_spread": KpiKind(
            "standard deviation of AREA on the surface",
            "counts",
            "target",
            value=lambda seen: _standard_deviation(seen.area),
        ),
        "echoes_per_beam": KpiKind(
            "echoes / fired beams", "1", "target", value=lambda seen: _share(seen.echoes, seen.beams), on_surface=False
        ),
        "false_alarm_probability": KpiKind(
            "beams with an echo on no surface / fired beams",
            "1",
            "target",
            "proportion",
            value=lambda seen: _share(seen.beams_with_stray, seen.beams),
            trials=lambda seen: seen.beams,
            on_surface=False,
        ),
        "false_alarms_per_beam": KpiKind(
            "echoes on no surface / fired beams",
            "1",
            "target",
            value=lambda seen: _share(seen.stray_echoes, seen.beams),
            on_surface=False,
        ),
        "area_distance": _distance("AREA", "counts", lambda seen: seen.area),
        "peak_distance": _distance("PEAK", "detectors", lambda seen: seen.peak),
        "width_distance": _distance("WIDTH", "ns", lambda seen: seen.width_ns),
        "range_residual_distance": _distance("range residual", "m", lambda seen: seen.residual_m),
    }
)
"""Every kind of KPI by the name that a scenario uses."""
