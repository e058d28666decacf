"""`lidarcheck bloom`: profiles of a bright target's bloom, the fit of the tables, and the settings of each distance."""

from __future__ import annotations

import json as json_module
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from lidarcheck.cli.calibration.bloom_inputs import (
    axis_of,
    bench_from,
    check_beside,
    check_same_distance,
    check_ways,
    free_of,
    measured_of,
    provenance_of,
    reach_of,
    table_of,
)
from lidarcheck.cli.core.options import (
    Files,
    Flag,
    JsonFile,
    MaxRows,
    Permitted,
    Placed,
    Quiet,
    Several,
    Target,
)
from lidarcheck.cli.core.outputs import alone, as_it_was, check_twice, check_writable, write_result
from lidarcheck.cli.core.terminal import Column, emit, hush, note, stage, table
from lidarcheck.cli.core.workflow_output import Plot, check_places, finish
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.calibration.blooming.cells import Cells, Profile
    from lidarcheck.calibration.blooming.workflow import ModelSide
    from lidarcheck.figures.files.result_folder import Writer
    from lidarcheck.formats.lut import Axis
    from lidarcheck.formats.settings import Settings

__all__ = ["fit", "settings", "show"]

MODEL, UNDO = "model.toml", ".undo"

Scans = Annotated[
    list[str],
    Parameter(
        help="Scans of a retro-reflecting target, or profiles as CSV; FILE@DISTANCE names the target's distance [m]; "
        "a folder, a file of several frames, or a pattern in quotes stands for a scan each."
    ),
]
AxisName = Annotated[
    Literal["vertical", "horizontal"] | None, Parameter(help="Which bloom; by default vertical, or that of a profile.")
]
ModelFile = Annotated[Path, Parameter(help="The sensor model, TOML: variant, pulse and the target's material.")]
Ideals = Annotated[
    Files | None,
    Parameter(
        help="The ideal scan of each scan, in their order, or one for all: tells the target's light beam by beam."
    ),
]
SettingsPath = Annotated[
    Path | None, Parameter(help="Settings of the distances: a JSON file, or the directory that holds them.")
]
Signal = Annotated[
    float | None, Parameter(help="The target's light instead: S of a beam at 1 m, avalanches per SPAD and shot.")
]
Reach = Annotated[
    str | None, Parameter(allow_leading_hyphen=True, help="LOW:HIGH, the offsets to look at; by default all.")
]
Out = Annotated[Path | None, Parameter(help="Directory for report.html, result.json and pictures.")]


def show(
    scans: Scans,
    /,
    *,
    model: ModelFile,
    simulated: Annotated[
        list[str] | None,
        Several,
        Parameter(help="Simulated scans, one for each measured one, in their order."),
    ] = None,
    lut: Annotated[Path | None, Parameter(help="A table: what the model is expected to show with it.")] = None,
    axis: AxisName = None,
    ideal: Ideals = None,
    settings: SettingsPath = None,
    target: Target = None,
    signal: Signal = None,
    reach: Reach = None,
    out: Out = None,
    placed: Placed | None = None,
    plot: Plot | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Show the profiles of the bloom, real over simulated."""
    hush(quiet)
    limit_rows(max_rows)
    check_ways(ideal, settings, signal)
    _check_outputs(out, json, [*scans, *(simulated or ()), *(ideal or ()), model, lut])
    from lidarcheck.calibration.blooming.beside import beside_target
    from lidarcheck.calibration.blooming.cells import profile_of
    from lidarcheck.calibration.blooming.workflow import gather
    from lidarcheck.figures.pages.blooming import profiles_document, profiles_page
    from lidarcheck.figures.pages.blooming_beside import beside_document, beside_page
    from lidarcheck.model import load_model
    from lidarcheck.sensor import SpadArray

    if lut is not None and simulated:
        raise UsageError("--lut and --simulated both say what is simulated", fix="give one of them")
    measured = measured_of(scans, ideal, placed)
    others = measured_of(simulated, ideal) if simulated else []
    loaded = load_model(model)
    if others and len(others) != len(measured):
        raise UsageError(f"{len(measured)} scans and {len(others)} simulated ones", fix="give one --simulated for each")
    provenance = provenance_of(model, [m.path for m in measured])
    if not isinstance(loaded.sensor.nominal, SpadArray):
        given = {"--lut": lut, "--settings": settings, "--target": target, "--signal": signal, "--reach": reach}
        check_beside(given, loaded.sensor)
        with stage("reading"):
            own = axis_of(axis, measured)
            shown, beside = ([beside_target(one, loaded, own) for one in side] for side in (measured, others))
        page = beside_page(shown, beside or [None] * len(shown), provenance)
        finish(page, beside_document(shown, beside or [None] * len(shown)), out=out, json=json, plot=plot)
        return 0
    with stage("reading"):
        bench = bench_from(model, axis_of(axis, measured), settings, target, signal)
        cells = gather(measured, bench, reach_of(reach))
        real = [profile_of(one) for one in cells]
        made: Sequence[Profile | None] = [None] * len(real)
        if others:
            made = _simulated(cells, gather(others, bench, reach_of(reach)))
        if lut is not None:
            made = _expected(cells, bench, lut)
    page = profiles_page(cells, real, made, provenance)
    finish(page, profiles_document(cells, real, made), out=out, json=json, plot=plot)
    return 0


def _simulated(cells: Sequence[Cells], simulated: Sequence[Cells]) -> list[Profile]:
    """The profiles of simulated scans, each of which must show the target where the measured one does."""
    from lidarcheck.calibration.blooming.cells import profile_of

    for one, other in zip(cells, simulated, strict=True):
        check_same_distance(one, other)
    return [profile_of(one) for one in simulated]


def _expected(cells: Sequence[Cells], bench: ModelSide, lut: Path) -> list[Profile]:
    """The profiles that the model is expected to show with the table of `lut`."""
    from lidarcheck.calibration.blooming.operator import nodes_of
    from lidarcheck.calibration.blooming.response import response_of
    from lidarcheck.calibration.blooming.workflow import expected_profile
    from lidarcheck.formats.lut import load_lut

    nodes = nodes_of(table_of(load_lut(lut), bench.axis, lut), bench.axis)
    responses = [response_of(bench.sensor, bench.shape, within=one.within) for one in cells]
    return [expected_profile(one, nodes, response) for one, response in zip(cells, responses, strict=True)]


def fit(
    scans: Scans,
    /,
    *,
    model: ModelFile,
    lut: Annotated[
        Path, Parameter(help="The table to fit: its X stay as they are, its Y are kept where no data speak.")
    ],
    out: Annotated[
        Path, Parameter(help="Directory for the fitted table, model.toml, report.html, result.json and pictures.")
    ],
    axis: AxisName = None,
    ideal: Ideals = None,
    settings: SettingsPath = None,
    target: Target = None,
    signal: Signal = None,
    reach: Reach = None,
    free: Annotated[
        str | None,
        Parameter(help="What else to fit, with commas: pulse (its length), tail, brightness (of the target)."),
    ] = None,
    smoothness: Annotated[
        float | None, Parameter(help="Weight of smoothness, above 0; by default chosen by leaving out distances.")
    ] = None,
    placed: Placed | None = None,
    plot: Plot | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Fit a blooming table to the profiles of all distances together."""
    hush(quiet)
    limit_rows(max_rows)
    check_ways(ideal, settings, signal)
    if out.resolve() == lut.resolve().parent:
        raise InputError("is the directory of --lut, which would be replaced", file=out, fix="name another for --out")
    _check_outputs(out, json, [*scans, *(ideal or ()), model, lut], [lut.name, MODEL])
    _check_smoothness(smoothness)
    from lidarcheck.calibration.blooming.pulses import FreeLight
    from lidarcheck.calibration.blooming.workflow import calibrate, fitted_model, gather
    from lidarcheck.figures.pages.blooming import calibration_document, calibration_page
    from lidarcheck.formats.lut import load_lut, save_lut
    from lidarcheck.model import load_model
    from lidarcheck.model.files.write import write_model

    choice = FreeLight(**dict.fromkeys(free_of(free), True))
    measured = measured_of(scans, ideal, placed)
    check_twice([one.path for one in measured])
    given = load_lut(lut)
    with stage("reading"):
        bench = bench_from(model, axis_of(axis, measured), settings, target, signal)
        if choice.brightness and bench.material is None and signal is None:
            raise UsageError("--free brightness does not say of which retro-reflector", fix="name it with --target")
        cells = gather(measured, bench, reach_of(reach))
    with stage("fitting"):
        result = calibrate(cells, bench, given, free=choice, smoothness=smoothness)
    provenance = provenance_of(model, [lut, *(m.path for m in measured)])
    files: dict[str, Writer] = {
        lut.name: lambda place: save_lut(result.lut, place),
        MODEL: lambda place: write_model(
            model, fitted_model(load_model(model), bench, result, place.with_name(lut.name), choice), place
        ),
    }
    finish(
        calibration_page(result, provenance), calibration_document(result), out=out, json=json, plot=plot, files=files
    )
    note(f"{out / lut.name}: the table; {out / MODEL}: the model that uses it")
    return 0


def _check_smoothness(smoothness: float | None) -> None:
    if smoothness is not None and not 0.0 < smoothness < float("inf"):
        raise UsageError(f"--smoothness {smoothness:g} is out of range", fix="use a number above 0, as 0.3")


def settings(
    file: Annotated[Path, Parameter(help="Blooming_Calibration_V_SLIM.json or the like; it need not be there yet.")],
    /,
    *,
    change: Annotated[
        list[str] | None,
        Parameter(
            name="--set",
            negative=(),
            allow_leading_hyphen=True,
            help="DISTANCE:KEY=VALUE, as 69:SegHor=440; may be repeated.",
        ),
    ] = None,
    remove: Annotated[
        list[float] | None, Parameter(negative=(), help="Take out the settings of this distance [m].")
    ] = None,
    defaults: Annotated[bool, Flag, Parameter(help="Begin with the defaults again.")] = False,
    axis: AxisName = None,
    dry_run: Annotated[bool, Flag, Parameter(help="Show the result and write nothing.")] = False,
    json: JsonFile | None = None,
    quiet: Quiet = False,
) -> int:
    """Show the settings of each distance, or change them."""
    hush(quiet)
    from lidarcheck.calibration.blooming.settings_edit import edited_settings, without_distance
    from lidarcheck.formats.settings import check_settings, default_settings, load_settings

    if json is not None:
        check_writable(json, option="--json", besides=(file,))
    edits = bool(change or remove or defaults)
    if edits and not dry_run:
        check_writable(file, option="FILE")
    there = file.exists()
    wanted = axis or _axis_in_name(file)
    now = default_settings(wanted or "vertical") if defaults or not there else load_settings(file, axis)
    for distance_m in remove or ():
        now = without_distance(now, distance_m)
    for edit in change or ():
        now = edited_settings(now, edit)
    if edits:
        check_settings(now, file)
    if edits and not dry_run:
        _save_settings(now, file)
    elif not there:
        note(f"{file}: not there; these are the defaults")
    text = json_module.dumps(now.document(), indent=2, ensure_ascii=False) + "\n"
    if json is not None:
        write_result(json, text)
    if json != "-":
        _show_settings(now)
    return 0


def _save_settings(now: Settings, file: Path) -> None:
    """Write the settings, and what the file was beside it."""
    from lidarcheck.formats.atomic import write_bytes
    from lidarcheck.formats.settings import save_settings

    if not file.exists():
        save_settings(now, file)
        note(f"{file}: written")
        return
    before, kept = file.read_bytes(), file.with_name(file.name + UNDO)
    with alone(file, before if now.content is None else now.content), as_it_was([file, kept]):
        save_settings(now, file)
        if before != file.read_bytes():
            write_bytes(kept, before)
            note(f"{file}: written; {kept.name} holds what it was")
        else:
            note(f"{file}: written, the same bytes")


def _show_settings(now: Settings) -> None:
    from lidarcheck.calibration.blooming.settings_edit import KEYS

    keys = KEYS[now.axis]
    emit(f"{now.axis}")
    rows = [[f"{getattr(entry, field):g}" for field in keys.values()] for entry in now.entries]
    emit(table([Column(name, right=True) for name in keys], rows) if rows else "no distance has settings")


def _axis_in_name(file: Path) -> Axis | None:
    name = file.name.lower()
    if name.startswith("blooming_calibration_h"):
        return "horizontal"
    return "vertical" if name.startswith("blooming_calibration_v") else None


def _check_outputs(
    out: Path | None, json: str | None, inputs: Sequence[str | Path | None], names: Sequence[str] = ()
) -> None:
    files = [None if one is None else str(one).rpartition("@")[0] or str(one) for one in inputs]
    check_places(out, json, files, names)
