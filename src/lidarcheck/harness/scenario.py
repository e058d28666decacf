"""A scenario: what the beams meet, the model that is asked, and the KPIs it is judged by.

A scenario is a TOML file; `docs/scenarios.md` describes it. Reading it finds all faults at once, each with its line.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import ConfigError, InputError, UsageError
from lidarcheck.formats import load_ideal, load_scan
from lidarcheck.formats.config import LineIndex, parse_toml, validate
from lidarcheck.formats.config_words import shown
from lidarcheck.harness.beams import lay_beams
from lidarcheck.harness.kpi_kinds import KINDS, Echoes, Selection
from lidarcheck.harness.kpi_spec import KpiSpec
from lidarcheck.harness.scenario_file import WINDOW_M, KpiTable, ScenarioTable
from lidarcheck.kpi.pairing import beam_keys, pair_with_ideal
from lidarcheck.model.file import load_model, model_of
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Scan

__all__ = ["AskedKpi", "Scenario", "load_scenario"]

IntArray = npt.NDArray[np.int32]


@dataclass(frozen=True)
class AskedKpi:
    """One KPI of a scenario: its kind in `KINDS`, what it looks at, what is asked of it.

    `measured`: for a distance from a measured file, that file's sample, shape (n,); None otherwise.
    """

    kind: str
    spec: KpiSpec
    selection: Selection
    measured: npt.NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Scenario:
    """A scenario file, read.

    `name`: the file's name without `.toml`. `frames`: simulated per seed. `content_hash`: SHA-256 over the beams, the
    KPIs with their tolerances and limits, and the measured echoes; neither comments nor the model change it.
    """

    name: str
    description: str
    path: Path
    model: Model
    ideal: IdealScan
    asked: tuple[AskedKpi, ...]
    frames: int = 1
    content_hash: str = ""
    kpis: tuple[KpiSpec, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "kpis", tuple(asked.spec for asked in self.asked))


def load_scenario(path: Path | str) -> Scenario:
    """Read a scenario file and the files that it names, by paths relative to it.

    `InputError` when a file cannot be read, `ConfigError` with every fault of the scenario and its line.
    """
    data, lines = parse_toml(path)
    table = validate(data, lines, ScenarioTable)
    model = _model(data, table, lines)
    ideal, faults = _ideal(table, model, lines)
    measured = _measured(table, ideal, lines)
    asked = _asked(table, ideal, measured, lines, faults)
    if faults:
        raise ConfigError(sorted(faults, key=lambda fault: fault.line or 0))
    return Scenario(
        name=Path(path).stem,
        description=table.description,
        path=Path(path),
        model=model,
        ideal=ideal,
        asked=asked,
        frames=table.frames,
        content_hash=_content_hash(table, ideal, asked),
    )


def _model(data: Mapping[str, Any], table: ScenarioTable, lines: LineIndex) -> Model:
    if isinstance(table.model, Path):
        model = load_model(_existing(table.model, "model", lines))
    else:
        inside = {key[1:]: line for key, line in lines.lines.items() if key[0] == "model"}
        model = model_of(data["model"], LineIndex(lines.file, inside))
    if model.external is not None and table.frames > 1:
        what = f"frames = {table.frames}, but an external model does not know frames"
        raise ConfigError([lines.fault(("frames",), what, fix="use frames = 1 and more beams")])
    return model


def _existing(name: Path, key: str, lines: LineIndex) -> Path:
    file = lines.file.parent / name
    try:
        there = file.is_file()
    except OSError:
        there = False
    if not there:
        fix = "give its path from the scenario's directory"
        raise ConfigError([lines.fault((key,), f"{key} = {shown(str(name))} is not a file", fix=fix)])
    return file


def _ideal(table: ScenarioTable, model: Model, lines: LineIndex) -> tuple[IdealScan, list[InputError]]:
    """What the beams meet, and what is wrong with the shapes."""
    if table.ideal is not None:
        ideal = load_ideal(_existing(table.ideal, "ideal", lines))
        if not len(ideal):
            raise ConfigError([lines.fault(("ideal",), f"{table.ideal} has no beams", fix="give a file with beams")])
        return ideal, []
    ideal, shape_of_row = lay_beams(table.beams)
    return ideal, [
        *_shared_beams(ideal, shape_of_row, lines),
        *_too_far(ideal, shape_of_row, model, lines),
        *_unknown_materials(ideal, shape_of_row, model, lines),
    ]


def _shared_beams(ideal: IdealScan, shape_of_row: IntArray, lines: LineIndex) -> list[InputError]:
    """A fault for every shape with a beam that an earlier one has."""
    _, first, beam = np.unique(beam_keys(ideal.layer, ideal.point), return_index=True, return_inverse=True)
    earlier = shape_of_row[first[beam]]
    faults = []
    for shape in np.unique(shape_of_row[earlier < shape_of_row]):
        row = int(np.flatnonzero((shape_of_row == shape) & (earlier < shape))[0])
        where = f"Layer {ideal.layer[row]}, Point {ideal.point[row]}"
        what = f"beams[{shape}] shares {where} with beams[{earlier[row]}]"
        faults.append(lines.fault(("beams", int(shape)), what, fix="give each other layers or points"))
    return faults


def _too_far(ideal: IdealScan, shape_of_row: IntArray, model: Model, lines: LineIndex) -> list[InputError]:
    limit = model.sensor.max_range_m
    faults = []
    for shape in np.unique(shape_of_row[ideal.distance_m > limit]):
        far = float(ideal.distance_m[shape_of_row == shape].max())
        what = f"beams[{shape}] reaches {far:.1f} m, the sensor only {limit:g} m"
        faults.append(lines.fault(("beams", int(shape)), what, fix="put it nearer, or on beams closer to the front"))
    return faults


def _unknown_materials(ideal: IdealScan, shape_of_row: IntArray, model: Model, lines: LineIndex) -> list[InputError]:
    if model.external is not None:
        return []
    unknown = (ideal.distance_m > 0.0) & ~np.isin(ideal.material_id, list(model.materials))
    known = ", ".join(str(number) for number in sorted(model.materials)) or "none"
    faults = []
    for shape in np.unique(shape_of_row[unknown]):
        material = ideal.material_id[shape_of_row == shape][0]
        what = f"beams[{shape}] has material {material}, which the model's table lacks (there: {known})"
        inline = model.file == lines.file
        fix = f"add [model.materials.{material}]" if inline else f"add [materials.{material}] to {model.file}"
        faults.append(lines.fault(("beams", int(shape), "material"), what, fix=fix))
    return faults


def _measured(table: ScenarioTable, ideal: IdealScan, lines: LineIndex) -> Scan | None:
    if table.measured is None:
        return None
    scan = load_scan(_existing(table.measured, "measured", lines))
    try:
        pair_with_ideal(ideal, scan)
    except UsageError as error:
        raise ConfigError([lines.fault(("measured",), error.what, fix=error.fix)]) from None
    return scan


def _asked(
    table: ScenarioTable, ideal: IdealScan, measured: Scan | None, lines: LineIndex, faults: list[InputError]
) -> tuple[AskedKpi, ...]:
    """The KPIs; to `faults` come names that occur twice and selections without beams."""
    beam_of_row = np.unique(beam_keys(ideal.layer, ideal.point), return_inverse=True)[1]
    asked: list[AskedKpi] = []
    for index, kpi in enumerate(table.kpis):
        try:
            made = _one(kpi, ideal, beam_of_row, measured)
        except UsageError as error:
            faults.append(lines.fault(("kpis", index), error.what, fix=error.fix))
            continue
        if any(other.spec.name == made.spec.name for other in asked):
            what = f"there are two KPIs {shown(made.spec.name)}"
            faults.append(lines.fault(("kpis", index), what, fix="give one of them another name"))
        asked.append(made)
    return tuple(asked)


def _one(kpi: KpiTable, ideal: IdealScan, beam_of_row: npt.NDArray[np.int64], measured: Scan | None) -> AskedKpi:
    kind = KINDS[kpi.kpi]
    selection = _selection(kpi, ideal, beam_of_row)
    name = kpi.name or ".".join([kpi.kpi, *_label(kpi)])
    from_file = kind.sample is not None and measured is not None
    spec = KpiSpec(
        name=name,
        kind="mean" if from_file else kind.gate,
        unit=kind.unit,
        direction=kpi.direction or kind.direction,
        tolerance=kpi.tolerance,
        low=kpi.low,
        high=kpi.high,
        feature=name if kind.gate == "distance" and not from_file else None,
    )
    if kind.sample is None or measured is None:
        return AskedKpi(kpi.kpi, spec, selection)
    sample = kind.sample(selection.seen(Echoes.of(measured, pair_with_ideal(ideal, measured))))
    if not len(sample):
        raise UsageError(f"the measured file has no echo for {name}", fix="look at other beams, or widen window_m")
    return AskedKpi(kpi.kpi, spec, selection, sample)


def _selection(kpi: KpiTable, ideal: IdealScan, beam_of_row: npt.NDArray[np.int64]) -> Selection:
    """The rows and beams that a KPI looks at; windows include both ends."""
    rows = np.ones(len(ideal), dtype=np.bool_)
    if kpi.object is not None:
        if ideal.object_id is None:
            raise UsageError("object is asked for, but the ideal scan has no ObjectID", fix="select by material")
        rows &= np.isin(ideal.object_id, kpi.object)
    if kpi.material is not None:
        rows &= np.isin(ideal.material_id, kpi.material)
    for window, column in ((kpi.range_m, ideal.distance_m), (kpi.incidence_deg, ideal.incidence_deg)):
        if window is not None:
            rows &= (column >= window[0]) & (column <= window[1])
    meeting_rows = rows & (ideal.distance_m > 0.0)
    if not rows.any():
        raise UsageError("the KPI selects no beams", fix="check its object, material, range_m and incidence_deg")
    if KINDS[kpi.kpi].on_surface and not meeting_rows.any():
        raise UsageError(f"{kpi.kpi} needs a surface, and no selected beam meets one", fix="select other beams")
    beams, meeting = (np.bincount(beam_of_row, weights=mask) > 0.0 for mask in (rows, meeting_rows))
    return Selection(rows, beams, meeting, kpi.window_m)


def _label(kpi: KpiTable) -> list[str]:
    """What tells this selection from others, for the KPI's name."""
    parts = []
    for word, ids in (("object", kpi.object), ("material", kpi.material)):
        if ids is not None:
            parts.append(f"{word}_{'_'.join(map(str, ids))}")
    for unit, window in (("m", kpi.range_m), ("deg", kpi.incidence_deg)):
        if window is not None:
            parts.append(f"{window[0]:g}_{window[1]:g}{unit}".replace(".", "p"))
    if kpi.window_m != WINDOW_M:
        parts.append(f"within_{kpi.window_m:g}m".replace(".", "p"))
    return parts


def _content_hash(table: ScenarioTable, ideal: IdealScan, asked: Sequence[AskedKpi]) -> str:
    digest = hashlib.sha256()
    kpis = [kpi.model_dump(mode="json") for kpi in table.kpis]
    digest.update(json.dumps({"frames": table.frames, "kpis": kpis}, sort_keys=True).encode())
    columns: list[npt.NDArray[Any]] = [
        ideal.layer,
        ideal.point,
        ideal.distance_m,
        ideal.material_id,
        ideal.incidence_deg,
    ]
    columns += [column for column in (ideal.object_id, ideal.time_s) if column is not None]
    columns += [kpi.measured for kpi in asked if kpi.measured is not None]
    for column in columns:
        # Angles come from library functions whose last digit may differ between machines.
        digest.update(np.round(column.astype(np.float64), 9).tobytes())
    return digest.hexdigest()
