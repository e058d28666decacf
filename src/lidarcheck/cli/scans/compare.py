"""`lidarcheck compare`: the KPIs of a measured scan against a simulated one, and what chance gives."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lidarcheck.cli.core.options import (
    MANY,
    JsonFile,
    MaxRows,
    Permitted,
    Placed,
    Quiet,
    SensorName,
    placement_of,
    sensor_file,
    sensor_named,
)
from lidarcheck.cli.core.outputs import files_given
from lidarcheck.cli.core.terminal import columns, hush, note, stage
from lidarcheck.cli.scans.compare_frames import compare_frames, geometry_notes
from lidarcheck.cli.scans.compare_results import chance_cells, check_places, say, write
from lidarcheck.cli.scans.fail_on import Value, conditions_of, outcomes
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.kpi.chance.verdict import Verdict
    from lidarcheck.kpi.compare import Comparison, KpiRow

__all__ = ["compare"]

COLUMNS = columns(
    *("KPI", "of", "value", "chance", "unit", "verdict", "measured", "simulated"),
    right=("value", "chance", "measured", "simulated"),
)


def compare(
    measured: Annotated[Path, Parameter(help=f"The scan of the real sensor{MANY}.")],
    simulated: Annotated[Path, Parameter(help=f"The scan of the model{MANY}; frames are paired by name or number.")],
    /,
    *,
    ideal: Annotated[Path | None, Parameter(help=f"The ideal scan of the scene that both show{MANY}.")] = None,
    model: Annotated[Path | None, Parameter(help="The model: its retro-reflectors are the target of ghosts.")] = None,
    sensor: SensorName = None,
    fail_on: Annotated[
        list[str] | None,
        Parameter(
            negative=(),
            help="Exit with 1 when this is met: any (a KPI stands out), KPI>NUMBER, or KPI:FEATURE>NUMBER, in quotes; "
            "a difference counts by its magnitude. Repeatable.",
        ),
    ] = None,
    out: Annotated[
        Path | None, Parameter(help="Directory for the result as JSON, the KPIs as CSV, and the picture.")
    ] = None,
    placed: Placed | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Compare a measured scan with a simulated one, or many of them frame by frame."""
    hush(quiet)
    limit_rows(max_rows)
    conditions, placement = conditions_of(fail_on or ()), placement_of(placed)
    check_places(out, json, files_given(measured, simulated, ideal, model, sensor_file(sensor)))
    from lidarcheck.cases.dataset import dataset_file
    from lidarcheck.cases.source import frames_in, how_of, ideal_of, scan_of
    from lidarcheck.kpi.chance.verdict import ChanceTest
    from lidarcheck.kpi.compare import compare as run
    from lidarcheck.kpi.variant import OneVariant
    from lidarcheck.model import load_model

    sensor_model = None if model is None else load_model(model)
    seen_by = sensor_named(sensor, sensor_model)
    with stage("reading"):
        sides = frames_in(measured), frames_in(simulated)
    seen_by = how_of(sides[0][0], sensor=seen_by)[1]
    if measured.is_dir() or dataset_file(measured) or max(map(len, sides)) > 1:
        return compare_frames(*sides, ideal, sensor_model, seen_by, placement, conditions, out, json)
    with stage("reading"):
        scene = None if ideal is None else ideal_of(ideal, seen_by)
        scans = scan_of(sides[0][0], placement, seen_by), scan_of(sides[1][0], sensor=seen_by)
        variant = OneVariant(sensor_model, seen_by if sensor_model is None else None)
        for scan, file in zip(scans, (measured, simulated), strict=True):
            variant.check(scan, file)
    with stage("comparing"):
        for said in geometry_notes(*scans, scene, measured, simulated):
            note(said)
        files, test = {"measured": measured, "simulated": simulated}, ChanceTest()
        comparison = run(*scans, scene, model=sensor_model, sensor=seen_by, files=files, look=test.add)
        verdict = test.verdict()
    values = [Value(row.kpi, row.of, row.measured if row.kpi == "overlap" else row.value) for row in comparison.rows()]
    failed = outcomes(conditions, values, verdict, comparison.left_out)
    document = {**comparison.to_dict(), "chance": verdict.to_dict(), "fail_on": failed}
    write(out, json, document, [_record(row, verdict) for row in comparison.rows()], verdict)
    if json != "-":
        left_out = [f"{name}: {why}" for name, why in comparison.left_out.items()]
        say(COLUMNS, _rows(comparison, verdict), verdict, left_out, failed)
    return int(any(one.met for one in failed))


def _rows(comparison: Comparison, verdict: Verdict) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for row in comparison.rows():
        chance, word = chance_cells(verdict, row.kpi, row.of)
        value, measured, simulated = map(_number, (row.value, row.measured, row.simulated))
        rows.append((row.kpi, row.of, value, _number(chance), row.unit, word, measured, simulated))
    return rows


def _record(row: KpiRow, verdict: Verdict) -> dict[str, object]:
    """A line of the CSV."""
    chance, word = chance_cells(verdict, row.kpi, row.of)
    found = verdict.kpis.get((row.kpi, row.of))
    return {**row._asdict(), "chance_95": chance, "verdict": word, "why": "" if found is None else found.not_judged}


def _number(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f"{value:.0f}" if abs(value) < 1e9 and value == int(value) else f"{value:.4g}"
