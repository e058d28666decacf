"""Kinds of KPI of all echoes of the selected beams, wherever they lie: stray ones, mixed pixels, ghosts, halos."""

from __future__ import annotations

from collections.abc import Mapping

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.harness.kpis.base import KpiKind, proportion_kind, quantile, share, standard_deviation
from lidarcheck.harness.kpis.selection import KpiInput
from lidarcheck.kpi.ghost import Ghost, ghost
from lidarcheck.kpi.validation import mean

__all__ = ["ECHO_KINDS", "GHOST_KINDS"]

_ONSET = 0.05

ECHO_KINDS: Mapping[str, KpiKind] = {
    "echoes_per_beam": KpiKind(
        "echoes / fired beams", "1", value=lambda seen: share(len(seen.every), seen.beams), needs="beams"
    ),
    "echo_share": proportion_kind(
        "beams with an echo / fired beams",
        lambda seen: seen.beams_with(seen.every),
        lambda seen: seen.beams,
        needs="beams",
    ),
    "multi_echo_share": proportion_kind(
        "beams with two echoes or more / fired beams",
        lambda seen: seen.beams_with(seen.every, echoes=2),
        lambda seen: seen.beams,
        needs="beams",
    ),
    "echo_area_mean": KpiKind(
        "mean AREA of all echoes", "counts", value=lambda seen: mean(seen.echoes.area[seen.every]), needs="beams"
    ),
    "echo_peak_mean": KpiKind(
        "mean PEAK of all echoes", "detectors", value=lambda seen: mean(seen.echoes.peak[seen.every]), needs="beams"
    ),
    "echo_width_mean": KpiKind(
        "mean WIDTH of all echoes", "ns", value=lambda seen: mean(seen.echoes.width_ns[seen.every]), needs="beams"
    ),
    "echo_range_mean": KpiKind(
        "mean range of all echoes", "m", value=lambda seen: mean(seen.echoes.range_m[seen.every]), needs="beams"
    ),
    "echo_layer_mean": KpiKind(
        "mean Layer of all echoes", "layers", value=lambda seen: mean(seen.layer(seen.every)), needs="beams"
    ),
    "echo_point_mean": KpiKind(
        "mean Point of all echoes", "points", value=lambda seen: mean(seen.point(seen.every)), needs="beams"
    ),
    "echo_layer_spread": KpiKind(
        "standard deviation of the Layer of all echoes: how tall a halo is",
        "layers",
        value=lambda seen: standard_deviation(seen.layer(seen.every)),
        needs="beams",
    ),
    "echo_point_spread": KpiKind(
        "standard deviation of the Point of all echoes: how wide a halo is",
        "points",
        value=lambda seen: standard_deviation(seen.point(seen.every)),
        needs="beams",
    ),
    "false_alarm_probability": proportion_kind(
        "beams with an echo on no surface / fired beams",
        lambda seen: seen.beams_with(seen.stray),
        lambda seen: seen.beams,
        needs="beams",
    ),
    "false_alarms_per_beam": KpiKind(
        "echoes on no surface / fired beams", "1", value=lambda seen: share(len(seen.stray), seen.beams), needs="beams"
    ),
    "stray_range_onset": KpiKind(
        "5 % quantile of the range of echoes on no surface: where backscatter begins",
        "m",
        value=lambda seen: quantile(seen.echoes.range_m[seen.stray], _ONSET),
        needs="beams",
    ),
    "mixed_pixel_share": proportion_kind(
        "beams at an edge with an echo between its surfaces, on none of them / beams at an edge",
        lambda seen: seen.beams_with(seen.mixed),
        lambda seen: seen.beams_at_edge,
        needs="edge",
    ),
}
"""How many echoes there are, where, and what they are like."""

GHOST_KINDS: Mapping[str, KpiKind] = {
    "ghost_count_ratio": KpiKind("ghosts / echoes on the surface", "1", value=lambda seen: _ghost(seen).count_ratio),
    "ghost_area_ratio": KpiKind(
        "mean AREA of ghosts / on the surface", "1", value=lambda seen: _ghost(seen).area_ratio
    ),
    "ghost_peak_ratio": KpiKind(
        "mean PEAK of ghosts / on the surface", "1", value=lambda seen: _ghost(seen).peak_ratio
    ),
    "ghost_range_excess": KpiKind(
        "mean range of ghosts minus twice the true range", "m", value=lambda seen: mean(seen.ghost_excess_m)
    ),
    "ghost_size_ratio": KpiKind(
        "RMS size of the ghosts / of the echoes on the surface", "1", value=lambda seen: _ghost(seen).size_ratio
    ),
}
"""Echoes at twice the range of the surface on their beam."""


def _ghost(seen: KpiInput) -> Ghost:
    echoes, targets, ghosts = seen.echoes, seen.on, seen.ghosts
    return ghost(
        _positions(seen, targets),
        echoes.area[targets],
        echoes.peak[targets],
        _positions(seen, ghosts),
        echoes.area[ghosts],
        echoes.peak[ghosts],
    )


def _positions(seen: KpiInput, which: IndexArray) -> FloatArray:
    return seen.selection.fired.beams.positions_m(seen.layer(which), seen.point(which), seen.echoes.range_m[which])
