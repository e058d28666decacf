"""`lidarcheck sensor guess`: the beams that scans show, as a table and as a sensor file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from cyclopts import Parameter

from lidarcheck.cli.core.options import Flag, JsonFlag, Quiet
from lidarcheck.cli.core.outputs import check_twice, files_given, json_text, write_result
from lidarcheck.cli.core.terminal import Column, emit, hush, note, stage, table
from lidarcheck.cli.sensor.options import check_out, positive
from lidarcheck.errors import InputError, UsageError

if TYPE_CHECKING:
    from lidarcheck.formats.guess import Guess

__all__ = ["guess"]

_MOST_FRAMES = 20
"""Of a long recording so many frames are looked at, evenly taken: they show all that more would."""
_COLUMNS = ("ring", "rows", "elevation deg", "spread deg", "azimuth deg", "off deg", "fires us")


def guess(
    scans: Annotated[
        list[Path], Parameter(negative=(), help="Scans of one sensor, a frame each, or a bag (FILE#TOPIC).")
    ],
    /,
    *,
    ring: Annotated[
        str | None, Parameter(help="The column of the rings, where it is not named ring, channel, line.")
    ] = None,
    rate: Annotated[
        float | None, Parameter(converter=positive, help="Frames a second [Hz], where the scans have no times.")
    ] = None,
    features: Annotated[
        bool,
        Flag,
        Parameter(help="Suppose, by their values, what INTENSITY, SIGNAL, REFLECTIVITY report, and count the echoes."),
    ] = False,
    out: Annotated[Path | None, Parameter(help="The sensor file to write, TOML.")] = None,
    json: JsonFlag = False,
    quiet: Quiet = False,
) -> int:
    """Guess the beams of a sensor from its scans."""
    hush(quiet)
    from lidarcheck.cases.source import each_frame
    from lidarcheck.formats.guess import HEAD, clouds_of, document_of, guess_beams
    from lidarcheck.formats.guess.features import guess_features, guess_returns
    from lidarcheck.formats.sensors import document_text, sensor_of_import

    files = files_given(*scans)
    check_twice(Path(scan) for scan in scans)
    if out is not None:
        check_out(out, files)
    with stage(f"reading {len(files)} scans"):
        frames = [frame for group in each_frame(scans) for frame in group]
        some = frames[:: -(-len(frames) // _MOST_FRAMES)]
        tables = [frame.read() for frame in some]
        clouds = [cloud for own in tables for cloud in clouds_of(own, ring=ring)]
    try:
        found = guess_beams(clouds)
    except UsageError as error:
        raise InputError(error.what, file=files[0], fix=error.fix) from None
    name = files[0].name if len(files) == 1 else f"{files[0].name} and {len(files) - 1} more"
    supposed, remarks = guess_features(tables) if features else ({}, ())
    imported = document_of(found, name, rate, supposed, remarks, guess_returns(tables) if features else 1)
    sensor_of_import(imported, files[0])
    emit(json_text(_document(found)) if json else _text(found))
    if out is not None:
        write_result(out, document_text(imported, head=HEAD))
        note(f"{out}: written")
    for entry in imported.lacking:
        if entry.needed:
            note(f"the scans do not say {entry.key}: {entry.look_up}, before the sensor file is used")
    return 0


def _text(found: Guess) -> str:
    frames = f"{found.frames} frame{'s' * (found.frames > 1)}"
    by = {"elevations": "the elevations of the rows", "order of rows": "the order of the rows"}.get(found.told)
    lines = [f"{len(found.rings.number)} rings by {by or f'the column {found.told}'}; {found.rows} rows of {frames}"]
    if found.columns is not None:
        whole = {True: "they repeat", False: "they do not repeat", None: ""}[found.repeats]
        lines.append(f"columns of {found.columns.step_deg:.6g} deg, {found.columns.columns:.3f} a turn: {whole}")
    sense = {1: "to the left", -1: "to the right", 0: "unknown"}[found.sense]
    lines.append(f"turns {sense}; column 0 looks at {found.beside.first_deg:.4g} deg")
    if found.turning is not None:
        lines.append(f"{found.turning.rate_hz:g} frames a second; times in {found.turning.unit}, {found.turning.zero}")
    if found.forward_m or found.up_m:
        lines.append(f"beams start {found.forward_m:.4f} m forward and {found.up_m:.4f} m up")
    if found.range_offset_m:
        lines.append(f"RANGE is {found.range_offset_m:.4f} m longer than the way from there")
    step = found.range_step_m
    lines.append("ranges show no step" if step is None else f"ranges are multiples of {step:g} m")
    lines += [f"note: {text}" for text in found.notes]
    rows = [
        [
            str(found.rings.number[k]), str(found.rings.rows[k]), f"{found.rings.elevation_deg[k]:.4f}",
            f"{found.rings.spread_deg[k]:.2g}", f"{found.beside.offset_deg[k]:+.4f}",
            _number(found.beside.residual_deg[k], ".2g"),
            "-" if found.beside.fire_us is None else f"{found.beside.fire_us[k]:.3f}",
        ]
        for k in range(len(found.rings.number))
    ]  # fmt: skip
    return "\n".join([*lines, "", table([Column(name, right=True) for name in _COLUMNS], rows)])


def _number(value: float, style: str) -> str:
    return format(value, style) if np.isfinite(value) else "-"


def _document(found: Guess) -> dict[str, object]:
    columns, turning = found.columns, found.turning
    return {
        "told_by": found.told,
        "rows": found.rows,
        "frames": found.frames,
        "column_step_deg": None if columns is None else columns.step_deg,
        "columns_a_turn": None if columns is None else columns.columns,
        "columns_repeat": found.repeats,
        "turns": {1: "left", -1: "right", 0: None}[found.sense],
        "first_deg": found.beside.first_deg,
        "frame_rate_hz": None if turning is None else turning.rate_hz,
        "origin_m": found.forward_m,
        "height_m": found.up_m,
        "range_offset_m": found.range_offset_m,
        "range_step_m": found.range_step_m,
        "notes": list(found.notes),
        "rings": [
            {
                "ring": int(found.rings.number[k]),
                "rows": int(found.rings.rows[k]),
                "elevation_deg": float(found.rings.elevation_deg[k]),
                "spread_deg": float(found.rings.spread_deg[k]),
                "azimuth_offset_deg": float(found.beside.offset_deg[k]),
                "fire_time_us": None if found.beside.fire_us is None else float(found.beside.fire_us[k]),
            }
            for k in range(len(found.rings.number))
        ],
    }
