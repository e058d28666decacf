"""Kinds of KPI of what the readout writes: where an echo lies, which number it has, in which steps its features come.

Effects seldom move them; a mistake in a table, in a column or in rounding does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from lidarcheck.arrays import FloatArray
from lidarcheck.harness.kpis.base import KpiKind, Needs, proportion_kind, standard_deviation
from lidarcheck.harness.kpis.selection import KpiInput
from lidarcheck.kpi.numbering import number_share
from lidarcheck.kpi.percentiles import LEVELS, percentile
from lidarcheck.kpi.quantisation import quantisation_step
from lidarcheck.kpi.validation import mean

__all__ = ["READOUT_KINDS"]

_RANGE_OFF_M = 1e-4
"""How far a range may lie off a multiple of its step: a text file rounds X, Y and Z."""

Feature = Callable[[KpiInput], FloatArray]
Statistic = Callable[[FloatArray], float]


def _kind(meaning: str, unit: str, of: Feature, statistic: Statistic, needs: Needs) -> KpiKind:
    return KpiKind(meaning, unit, value=lambda seen: statistic(of(seen)), needs=needs)


def _direction_kinds() -> Iterator[tuple[str, KpiKind]]:
    angles: Mapping[str, Feature] = {
        "azimuth": lambda seen: seen.off_beam().azimuth_deg,
        "elevation": lambda seen: seen.off_beam().elevation_deg,
    }
    for angle, of in angles.items():
        meaning = f"mean of {angle} minus that of the beam, of all echoes"
        yield f"direction_bias_{angle}", _kind(meaning, "deg", of, mean, "beams")
        meaning = f"standard deviation of {angle} minus that of the beam, of all echoes"
        yield f"direction_scatter_{angle}", _kind(meaning, "deg", of, standard_deviation, "beams")


def _position_kinds() -> Iterator[tuple[str, KpiKind]]:
    axes: Mapping[str, Feature] = {
        "x": lambda seen: seen.off_surface_m[:, 0],
        "y": lambda seen: seen.off_surface_m[:, 1],
        "z": lambda seen: seen.off_surface_m[:, 2],
    }
    for axis, of in axes.items():
        meaning = f"mean {axis.upper()} of the echoes on the surface minus that of the surface point"
        yield f"position_bias_{axis}", replace(_kind(meaning, "m", of, mean, "surface"), of_place=True)


def _percentile_kinds() -> Iterator[tuple[str, KpiKind]]:
    features: Mapping[str, tuple[str, str, Feature]] = {
        "area": ("AREA on the surface", "counts", lambda seen: seen.area),
        "peak": ("PEAK on the surface", "detectors", lambda seen: seen.peak),
        "width": ("WIDTH on the surface", "ns", lambda seen: seen.width_ns),
        "range_residual": ("range minus true range", "m", lambda seen: seen.residual_m),
    }
    for name, (words, unit, of) in features.items():
        for level in LEVELS:
            yield (
                f"{name}_percentile_{level}",
                _kind(f"{level}th percentile of {words}", unit, of, _percentile_of(level), "surface"),
            )


def _percentile_of(level: float) -> Statistic:
    return lambda values: percentile(values, level)


def _step_kinds() -> Iterator[tuple[str, KpiKind]]:
    features: Mapping[str, tuple[str, Feature, Statistic]] = {
        "range": ("m", lambda seen: seen.echoes.range_m[seen.every], _step_of_ranges),
        "area": ("counts", lambda seen: seen.echoes.area[seen.every], quantisation_step),
        "peak": ("detectors", lambda seen: seen.echoes.peak[seen.every], quantisation_step),
        "width": ("ns", lambda seen: seen.echoes.width_ns[seen.every], quantisation_step),
    }
    for name, (unit, of, step) in features.items():
        feature = name if name == "range" else name.upper()
        meaning = f"largest step of which 99 % of the {feature} of all echoes are multiples, 0 without one"
        yield f"{name}_quantisation_step", _kind(meaning, unit, of, step, "beams")


def _step_of_ranges(range_m: FloatArray) -> float:
    return quantisation_step(range_m, _RANGE_OFF_M)


READOUT_KINDS: Mapping[str, KpiKind] = {
    **dict(_direction_kinds()),
    **dict(_position_kinds()),
    "echo_order": proportion_kind(
        "beams whose numbers, as written, are in the sensor's order / beams with two echoes or more",
        lambda seen: int(seen.in_order.sum()),
        lambda seen: len(seen.in_order),
        needs="beams",
    ),
    "echo_number_share": KpiKind(
        "echoes with that number, as written / echoes",
        "1",
        value=lambda seen: number_share(seen.numbers, seen.number),
        needs="beams",
        of_number=True,
    ),
    **dict(_percentile_kinds()),
    **dict(_step_kinds()),
}
"""Directions, positions, echo numbers, percentiles and steps."""
