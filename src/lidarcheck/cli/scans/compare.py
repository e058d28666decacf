"""`lidarcheck compare`: the KPIs of a measured scan against a simulated one."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lidarcheck.cli.core.options import MANY, JsonFile, Placed, Quiet, placement_of
from lidarcheck.cli.core.outputs import check_writable, files_given, json_text, with_origin, write_result
from lidarcheck.cli.core.terminal import columns, emit, hush, note, stage, table
from lidarcheck.cli.scans.compare_frames import compare_frames, geometry_notes

if TYPE_CHECKING:
    from lidarcheck.kpi.compare import Comparison

__all__ = ["compare"]

COLUMNS = columns("KPI", "of", "measured", "simulated", "value", "unit", right=("measured", "simulated", "value"))


def compare(
    measured: Annotated[Path, Parameter(help=f"The scan of the real sensor{MANY}.")],
    simulated: Annotated[Path, Parameter(help=f"The scan of the model{MANY}; frames are paired by name or number.")],
    /,
    *,
    ideal: Annotated[Path | None, Parameter(help=f"The ideal scan of the scene that both show{MANY}.")] = None,
    model: Annotated[Path | None, Parameter(help="The model: its retro-reflectors are the target of ghosts.")] = None,
    placed: Placed | None = None,
    json: JsonFile | None = None,
    quiet: Quiet = False,
) -> int:
    """Compare a measured scan with a simulated one, or many of them frame by frame."""
    hush(quiet)
    placement = placement_of(placed)
    if json is not None:
        check_writable(json, option="--json", besides=files_given(measured, simulated, ideal, model))
    from lidarcheck.cases.source import frames_in, ideal_of, scan_of
    from lidarcheck.kpi.compare import compare as run
    from lidarcheck.model import load_model

    sensor_model = None if model is None else load_model(model)
    with stage("reading"):
        sides = frames_in(measured), frames_in(simulated)
    if measured.is_dir() or max(map(len, sides)) > 1:
        compare_frames(*sides, ideal, sensor_model, json, placement)
        return 0
    with stage("reading"):
        scene = None if ideal is None else ideal_of(ideal)
        scans = scan_of(sides[0][0], placement), scan_of(sides[1][0])
    with stage("comparing"):
        for said in geometry_notes(*scans, scene, measured, simulated):
            note(said)
        files = {"measured": measured, "simulated": simulated}
        comparison = run(*scans, scene, model=sensor_model, files=files)
    if json is not None:
        write_result(json, json_text(with_origin(comparison.to_dict())))
    if json != "-":
        _show(comparison)
    return 0


def _show(comparison: Comparison) -> None:
    rows = [
        (row.kpi, row.of, _number(row.measured), _number(row.simulated), _number(row.value), row.unit)
        for row in comparison.rows()
    ]
    emit(table(COLUMNS, rows))
    for name, why in comparison.left_out.items():
        note(f"not compared: {name}: {why}")


def _number(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f"{value:.0f}" if abs(value) < 1e9 and value == int(value) else f"{value:.4g}"
