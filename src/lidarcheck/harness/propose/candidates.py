"""Which KPIs may see an effect on given beams: the kinds that its physics moves, on the parts that could show it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from lidarcheck.config.schema import LineIndex
from lidarcheck.effects import Effect
from lidarcheck.effects.search import search_spec
from lidarcheck.errors import InputError
from lidarcheck.harness.kpis.registry import KINDS
from lidarcheck.harness.scenario.asked import AskedKpi, ask
from lidarcheck.harness.scenario.file import KpiTable
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan

__all__ = ["OTHERS", "Watch", "watches"]

OTHERS = (
    "area_mean",
    "detection_probability",
    "range_residual_mean",
    "range_noise",
    "width_mean",
    "echoes_per_beam",
    "false_alarms_per_beam",
)
"""What is tried of every effect besides: side effects catch a loss, too, and an effect may be new."""

_LEAST_BEAMS = 30
_MOST_MATERIALS = 4
_WIDE_M = 2.0
"""An echo so near to its surface belongs to it where ranges themselves are asked for: walk exceeds half a metre."""

Watch = tuple[dict[str, Any], AskedKpi]
"""What a scenario's file says of a KPI, its tolerance left open, and the same as the harness asks it."""


def watches(ideal: IdealScan, model: Model, effect: Effect) -> list[Watch]:
    """KPIs that might see this effect on these beams, the most telling kinds first; each of another name."""
    tables: dict[str, Watch] = {}
    for kind in dict.fromkeys((*search_spec(effect.name).watched_by, *OTHERS)):
        for part in _parts(kind, ideal, model, effect):
            table = {"kpi": kind, **part}
            faults: list[InputError] = []
            asked = ask([KpiTable(**table, tolerance=1.0)], ideal, model, None, LineIndex(Path()), faults)
            if asked and not faults:
                tables.setdefault(asked[0].spec.name, (table, asked[0]))
    return list(tables.values())


def _parts(kind: str, ideal: IdealScan, model: Model, effect: Effect) -> Iterator[dict[str, Any]]:
    """The selections on which a kind is asked."""
    if kind.startswith("ghost_"):
        yield from ({"material": number, "window_m": _WIDE_M} for number in _retros(ideal, model))
        return
    wide = {"window_m": _WIDE_M} if kind.startswith("range_residual") else {}
    yield wide
    if KINDS[kind].needs == "edge":
        return
    yield from ({**block, **wide} for block in _blocks(effect))
    if KINDS[kind].needs == "surface":
        yield from ({"material": number, **wide} for number in _materials(ideal, effect))
        yield from ({"range_m": window, **wide} for window in _thirds(ideal))
    else:
        yield from _zones(ideal, model)


def _materials(ideal: IdealScan, effect: Effect) -> list[int]:
    """The material that the effect speaks of, and those that most beams meet."""
    ids, beams = np.unique(ideal.material_id[ideal.distance_m > 0.0], return_counts=True)
    common = ids[np.argsort(-beams, kind="stable")][:_MOST_MATERIALS]
    own = [number for number in ids if number == effect.settings().get("material_id")]
    return [int(number) for number in dict.fromkeys([*own, *(i for i in common if beams[ids == i][0] >= _LEAST_BEAMS)])]


def _retros(ideal: IdealScan, model: Model) -> list[int]:
    met = np.unique(ideal.material_id[ideal.distance_m > 0.0])
    return [int(number) for number in met if number in model.materials and model.materials[number].kind == "retro"]


def _thirds(ideal: IdealScan) -> list[tuple[float, float]]:
    """The near, middle and far third of the surfaces, in whole metres; none where all are about as far."""
    distance_m = ideal.distance_m[ideal.distance_m > 0.0]
    if len(distance_m) < 3 * _LEAST_BEAMS:
        return []
    edges = np.rint(np.quantile(distance_m, (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0)))
    edges[0], edges[3] = np.floor(distance_m.min()), np.ceil(distance_m.max())
    if np.any(np.diff(edges) < 1.0):
        return []
    return [(float(edges[i]), float(edges[i + 1])) for i in range(3)]


def _blocks(effect: Effect) -> list[dict[str, Any]]:
    """The layers and points that the effect itself names."""
    values = effect.settings()
    pairs = {"layers": ("first_layer", "last_layer"), "points": ("first_point", "last_point")}
    block = {key: (values[a], values[b]) for key, (a, b) in pairs.items() if a in values and b in values}
    return [block] if block else []


def _zones(ideal: IdealScan, model: Model) -> Iterator[dict[str, Any]]:
    """Where echoes lie that belong to no surface: before all, behind all, about and behind bright targets."""
    met = ideal.distance_m > 0.0
    if np.count_nonzero(~met) >= _LEAST_BEAMS:
        yield {"range_m": (0.0, 0.0)}
    if not met.any():
        return
    nearest, farthest = float(ideal.distance_m[met].min()), float(ideal.distance_m[met].max())
    if nearest > 2.0:
        yield {"echo_range_m": (0.0, float(np.floor(nearest - 1.0)))}
    if np.ceil(farthest) + 2.0 < model.sensor.max_range_m:
        yield {"echo_range_m": (float(np.ceil(farthest) + 2.0), float(model.sensor.max_range_m))}
    for number in _retros(ideal, model):
        target = float(np.rint(np.median(ideal.distance_m[met & (ideal.material_id == number)])))
        yield {"echo_range_m": (max(target - 3.0, 0.0), target + 3.0)}
        yield {"echo_range_m": (target + 2.0, target + 40.0)}
