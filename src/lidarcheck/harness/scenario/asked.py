"""From a scenario's `[[kpis]]` tables to what is asked: the kind, the selection, the name, the thresholds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.config.schema import LineIndex
from lidarcheck.config.words import shown
from lidarcheck.errors import InputError, UsageError
from lidarcheck.harness.kpis.fired import FiredBeams
from lidarcheck.harness.kpis.registry import KINDS
from lidarcheck.harness.kpis.selection import KpiSelection, SelectedEchoes
from lidarcheck.harness.kpis.spec import KpiSpec
from lidarcheck.harness.scenario.file import KpiTable
from lidarcheck.kpi.features import strength_name
from lidarcheck.kpi.pairing import pair_with_ideal, surface_window_m
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = ["AskedKpi", "ask", "hashed", "name_of"]

_LATER_KEYS = ("layers", "points", "echo_range_m", "number", "feature")
"""Keys that younger scenarios may have: left out they say nothing, so that older goldens keep their hash."""

_NOT_MEASURED = {"requirement", "catches"}
"""Keys that change neither what is measured nor a verdict: no golden is another for them."""

_OF_HISTOGRAM = {"feature_mean": "counts", "feature_spread": "1"}
_WALK = "range_residual_per_decade"

_FORMER_WINDOW_M = 0.5
"""The window of KPIs that name none, before it followed from the pulse. Goldens were hashed with it, and names made."""


@dataclass(frozen=True)
class AskedKpi:
    """One KPI of a scenario: its kind in `KINDS`, what it looks at, what is asked of it.

    `measured`: for a distance from a measured file, that file's sample, shape (n,); None otherwise.
    """

    kind: str
    spec: KpiSpec
    selection: KpiSelection
    measured: npt.NDArray[np.float64] | None = None


def ask(
    tables: Sequence[KpiTable],
    ideal: IdealScan,
    model: Model,
    measured: Scan | None,
    lines: LineIndex,
    faults: list[InputError],
) -> tuple[AskedKpi, ...]:
    """The KPIs; to `faults` come names that occur twice and selections that cannot show what is asked.

    `model`: its sensor gives the window of KPIs that name none, and reports the features.
    """
    fired = FiredBeams.of(ideal)
    asked: list[AskedKpi] = []
    for index, table in enumerate(tables):
        try:
            made = _one(table, ideal, model, fired, measured)
        except UsageError as error:
            faults.append(lines.fault(("kpis", index), error.what, fix=error.fix))
            continue
        if any(other.spec.name == made.spec.name for other in asked):
            what = f"there are two KPIs {shown(made.spec.name)}"
            faults.append(lines.fault(("kpis", index), what, fix="give one of them another name"))
        asked.append(made)
    return tuple(asked)


def hashed(table: KpiTable) -> dict[str, Any]:
    """What of a KPI enters the scenario's content hash, by the keys that the file has."""
    values = table.model_dump(mode="json", by_alias=True, exclude=_NOT_MEASURED)
    if table.window_m is None:
        values["window_m"] = _FORMER_WINDOW_M
    return {key: value for key, value in values.items() if value is not None or key not in _LATER_KEYS}


def name_of(kpi: KpiTable) -> str:
    """The KPI's name within its scenario: its own, or its kind and what it selects."""
    return kpi.name or ".".join([kpi.kpi, *_label(kpi)])


def _one(kpi: KpiTable, ideal: IdealScan, model: Model, fired: FiredBeams, measured: Scan | None) -> AskedKpi:
    kind, sensor = KINDS[kpi.kpi], model.sensor
    _check_feature(kpi, sensor)
    selection = _selection(kpi, ideal, model, fired)
    name = name_of(kpi)
    from_file = kind.sample is not None and measured is not None
    spec = KpiSpec(
        name=name,
        kind="mean" if from_file else kind.gate,
        unit=kind.unit if kpi.feature is None else _unit(sensor, kpi.kpi, kpi.feature),
        direction=kpi.direction or kind.direction,
        tolerance=kpi.tolerance,
        low=kpi.low,
        high=kpi.high,
        requirement=kpi.requirement or "",
        catches=kpi.catches,
        feature=name if kind.gate == "distance" and not from_file else None,
    )
    if kind.sample is None or measured is None:
        return AskedKpi(kpi.kpi, spec, selection)
    pairing = pair_with_ideal(ideal, measured, model=model)
    sample = kind.sample(selection.seen(SelectedEchoes.of(measured, pairing, sensor=sensor)))
    if not len(sample):
        raise UsageError(f"the measured file has no echo for {name}", fix="look at other beams, or widen window_m")
    return AskedKpi(kpi.kpi, spec, selection, sample)


def _check_feature(kpi: KpiTable, sensor: Sensor) -> None:
    """`UsageError` for a KPI of a feature that the sensor does not report."""
    names = [feature.name for feature in sensor.features]
    asked, kind = kpi.feature, KINDS[kpi.kpi]
    if asked is not None:
        sensor.feature(asked)
    elif kind.column and kind.column not in names:
        fix = f"ask for feature_mean and its like, with feature one of {', '.join(names) or 'none'}"
        raise UsageError(f"{kpi.kpi} is of {kind.column}, which {sensor.name} does not report", fix=fix)
    elif kpi.kpi == _WALK and not strength_name(sensor):
        raise UsageError(f"{kpi.kpi} needs a feature that rises with the amplitude", fix="ask for another KPI")


def _unit(sensor: Sensor, kind: str, name: str) -> str:
    """The unit of a feature's KPI; of a histogram's own, which are of counts or of places in bins."""
    feature = sensor.feature(name)
    return _OF_HISTOGRAM.get(kind, "bins") if feature.law == "histogram" else feature.unit


def _selection(kpi: KpiTable, ideal: IdealScan, model: Model, fired: FiredBeams) -> KpiSelection:
    """The part of the scenario that a KPI looks at; windows include both ends."""
    rows = np.ones(len(ideal), dtype=np.bool_)
    if kpi.object is not None:
        if ideal.object_id is None:
            raise UsageError("object is asked for, but the ideal scan has no ObjectID", fix="select by material")
        rows &= np.isin(ideal.object_id, kpi.object)
    if kpi.material is not None:
        rows &= np.isin(ideal.material_id, kpi.material)
    windows: list[tuple[tuple[float, float] | None, npt.NDArray[Any]]] = [
        (kpi.layers, ideal.layer),
        (kpi.points, ideal.point),
        (kpi.range_m, ideal.distance_m),
        (kpi.incidence_deg, ideal.incidence_deg),
    ]
    for window, column in windows:
        if window is not None:
            rows &= (column >= window[0]) & (column <= window[1])
    if not rows.any():
        fix = "check its object, material, layers, points, range_m and incidence_deg"
        raise UsageError("the KPI selects no beams", fix=fix)
    window_m = kpi.window_m or surface_window_m(model.sensor, external=model.external is not None)
    selection = KpiSelection(fired, rows, window_m, kpi.echo_range_m, kpi.number, kpi.feature or "", model.sensor)
    needs = KINDS[kpi.kpi].needs
    if needs == "surface" and not selection.meeting.any():
        raise UsageError(f"{kpi.kpi} needs a surface, and no selected beam meets one", fix="select other beams")
    if needs == "edge" and not selection.at_edge.any():
        what = f"{kpi.kpi} needs neighbouring surfaces more than {2.0 * window_m:g} m apart in range"
        raise UsageError(f"{what}, and no selected beam has them", fix="select beams at an edge, or lower window_m")
    return selection


def _label(kpi: KpiTable) -> list[str]:
    """What tells this selection from others, for the KPI's name."""
    parts = [] if kpi.feature is None else [kpi.feature]
    parts += [] if kpi.number is None else [f"number_{kpi.number}"]
    for word, ids in (("object", kpi.object), ("material", kpi.material)):
        if ids is not None:
            parts.append(f"{word}_{'_'.join(map(str, ids))}")
    for word, span in (("layers", kpi.layers), ("points", kpi.points)):
        if span is not None:
            parts.append(f"{word}_{span[0]}_{span[1]}")
    for word, window, unit in (
        ("", kpi.range_m, "m"),
        ("", kpi.incidence_deg, "deg"),
        ("echo_", kpi.echo_range_m, "m"),
    ):
        if window is not None:
            parts.append(f"{word}{window[0]:g}_{window[1]:g}{unit}".replace(".", "p"))
    if kpi.window_m not in (None, _FORMER_WINDOW_M):
        parts.append(f"within_{kpi.window_m:g}m".replace(".", "p"))
    return parts
