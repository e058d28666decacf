"""`lidarcheck gap`: how far the measurements of a project and its model are apart, and whether an edit helped."""

from __future__ import annotations

import json as json_module
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lidarcheck.cli.core.options import (
    Flag,
    JsonFile,
    Many,
    MaxRows,
    Permitted,
    Placed,
    Quiet,
    Seed,
    Target,
    placement_of,
)
from lidarcheck.cli.core.outputs import check_writable, write_result
from lidarcheck.cli.core.terminal import Column, emit, hush, note, progress, table
from lidarcheck.errors import InputError, LidarcheckError, UsageError
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.calibration.number.number import Kind, Number, Step
    from lidarcheck.calibration.number.request import Request
    from lidarcheck.session.measurements import Measurement
    from lidarcheck.session.project import Project

__all__ = ["gap"]

_KINDS: tuple[Kind, ...] = ("misfit", "gap")
_NEAR_M = 3.0
"""How far a measurement's distance may be from the one that is named."""
_MOST_SEED = 2**31


def gap(
    places: Annotated[tuple[Path, ...], Parameter(help="Directories of projects or cases, or measured scans.")],
    /,
    *,
    model: Annotated[Path | None, Parameter(help="The sensor model, TOML; by default the project's.")] = None,
    lut: Annotated[
        Path | None, Parameter(help="A blooming table in the place of the model's own along its axis, INI.")
    ] = None,
    before: Annotated[
        Path | None, Parameter(help="The model, TOML, or the table, INI, before the edit that is judged.")
    ] = None,
    axis: Annotated[Literal["vertical", "horizontal"], Parameter(help="Which bloom.")] = "vertical",
    at: Annotated[tuple[float, ...], Many, Parameter(help="Only measurements at these distances [m].")] = (),
    ideal: Annotated[
        tuple[Path, ...], Many, Parameter(help="The ideal scan of each scan that is named, or one for all.")
    ] = (),
    target: Target = None,
    whole: Annotated[
        bool, Flag, Parameter(help="Whole frames and 64 seeds, for a report, in the place of a sample.")
    ] = False,
    history: Annotated[
        bool, Flag, Parameter(help="The edits that were made in the terminal interface, with the numbers found then.")
    ] = False,
    seed: Seed = 0,
    placed: Placed | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Say how far measurements and model are apart, and whether an edit helped."""
    hush(quiet)
    limit_rows(max_rows)
    if json is not None:
        check_writable(json, option="--json", besides=[*places, *ideal, *(p for p in (model, lut, before) if p)])
    if history:
        return _history(places, json, computes=bool(model or lut or before or at or ideal or target or whole))
    placement = placement_of(placed)
    given = [(one, found) for one, found in _measurements(places, ideal) if _is_at(one, at)]
    if not given:
        what = f"holds no measurement{' at ' + ', '.join(f'{a:g} m' for a in at) if at else ''}"
        raise InputError(what, file=places[0], fix="name a directory with measured scans and their ideal scans")
    edit = _Edit(model, lut, before, axis, target, seed % _MOST_SEED, whole=whole)
    answers: list[_Answer] = []
    with progress("simulating") as show:
        for number, (one, project) in enumerate(given):
            show(number, len(given), one.name)
            one = replace(one, placement=placement) if placement.moves else one
            answers += [edit.answer(one, project, kind) for kind in _KINDS]
    if all(answer.number is None for answer in answers):
        raise next(filter(None, (answer.error for answer in answers)), InputError(
            answers[0].why, file=answers[0].measurement.name, fix="name its ideal scan with --ideal"))  # fmt: skip
    if json is not None:
        write_result(json, json_module.dumps(_document(answers), indent=2, ensure_ascii=False) + "\n")
    if str(json) != "-":
        _show(answers, steps=before is not None)
    return 0


def _history(places: Sequence[Path], json: JsonFile | None, *, computes: bool) -> int:
    from lidarcheck.cli.calibration.gap_history import show_history

    if computes:
        raise UsageError("--history prints what was found and computes nothing", fix="leave the other options out")
    return show_history(places, json)


def _measurements(places: Sequence[Path], ideal: tuple[Path, ...]) -> list[tuple[Measurement, Project | None]]:
    """Those of each directory, with its project; scans that are named are one measurement, of one scene."""
    from lidarcheck.session.measurements import Measurement, measurements
    from lidarcheck.session.project import read_project

    found: list[tuple[Measurement, Project | None]] = []
    scans = tuple(place for place in places if not place.is_dir())
    if scans:
        name = str(scans[0]) if len(scans) == 1 else f"{scans[0]}..{scans[-1].name}"
        found.append((Measurement(name, "scan", None, scans, ideal), None))
    elif ideal:
        raise InputError("stands beside a directory, whose ideal scans are found by name", file=ideal[0],
                         fix="leave --ideal out, or name the scans")  # fmt: skip
    for place in places:
        if not place.exists():
            raise InputError("there is no such file or directory", file=place, fix="check the path")
        if place.is_dir():
            project = read_project(place)
            found += [(one, project) for one in measurements(project)]
    return found


def _is_at(one: Measurement, at: Sequence[float]) -> bool:
    return not at or (one.distance_m is not None and any(abs(one.distance_m - m) <= _NEAR_M for m in at))


@dataclass(frozen=True)
class _Answer:
    """A number of a measurement, and the step to it; or why there is none."""

    measurement: Measurement
    kind: Kind
    number: Number | None = None
    step: Step | None = None
    why: str = ""
    error: LidarcheckError | None = None


@dataclass(frozen=True)
class _Edit:
    """What all measurements are asked with."""

    model: Path | None
    lut: Path | None
    before: Path | None
    axis: Literal["vertical", "horizontal"]
    target: int | None
    seed: int
    whole: bool

    def answer(self, one: Measurement, project: Project | None, kind: Kind) -> _Answer:
        """The number of a kind; why there is none, where something is wrong with the measurement alone."""
        from lidarcheck.calibration.number import entry
        from lidarcheck.calibration.number.number import judged

        if why := one.why_none(kind):
            return _Answer(one, kind, why=why)
        model = self.model or _model_of(one, project)
        request = one.request(kind, model, axis=self.axis, lut=self.lut, target=self.target)
        request = replace(request, seed=self.seed)
        compute = entry.whole if self.whole else entry.sample
        try:
            if self.before is None:
                return _Answer(one, kind, compute(request))
            was = self._was(request)
            now = replace(request, scale=was.model, start=_as_it_was(request.lut, was.lut))
            first, last = compute(was), compute(now)
        except LidarcheckError as error:
            return _Answer(one, kind, why=error.lines()[0].removeprefix("error: "), error=error)
        return _Answer(one, kind, last, judged(first, last))

    def _was(self, request: Request) -> Request:
        """The request as it was before the edit."""
        assert self.before is not None
        if self.before.suffix.lower() == ".toml":
            return replace(request, model=self.before)
        return replace(request, lut=self.before)


def _as_it_was(now: Path | None, before: Path | None) -> dict[str, bytes]:
    """What the table held before, by the file that holds it now."""
    if now is None or before is None or now == before:
        return {}
    return {os.path.realpath(now): before.read_bytes()}


def _model_of(one: Measurement, project: Project | None) -> Path:
    """The model that is meant; `InputError` where there is none, or several could be."""
    from lidarcheck.cases.case import case_model
    from lidarcheck.session.model_choice import chosen_model
    from lidarcheck.session.pairing import labels_of
    from lidarcheck.session.project import Entry

    if one.kind == "case":
        return case_model(one.files[0])
    if project is not None:
        variant = labels_of(Entry(one.files[0], "scan", one.name)).variant
        found = chosen_model(project, "", one.files[0].parent, variant)
        if found is not None:
            return found.path
        if models := project.of("model"):
            what = f"any of {len(models)} models could be meant"
            raise InputError(what, file=project.root, fix="say which with --model")
    raise InputError("no model is known", file=one.name, fix="name one with --model")


def _document(answers: Sequence[_Answer]) -> dict[str, Any]:
    found: dict[str, dict[str, Any]] = {}
    for one in answers:
        about = {"name": one.measurement.name, "kind": one.measurement.kind, "distance_m": one.measurement.distance_m}
        own = found.setdefault(one.measurement.name, about)
        if one.number is None:
            own[one.kind] = {"none": one.why}
        else:
            step = {} if one.step is None else {"step": one.step.to_dict()}
            own[one.kind] = {**one.number.to_dict(), **step}
    return {"format": 1, "measurements": [*found.values()]}


def _show(answers: Sequence[_Answer], *, steps: bool) -> None:
    """A table of the numbers; below it why there are none."""
    columns = [Column("measurement"), Column("number"), Column("sd", True), Column("90 %", True),
               Column("right model", True), *([Column("step", True), Column("word")] if steps else []),
               Column("parts"), Column("sample")]  # fmt: skip
    rows = [_row(one.measurement.name, one.kind, one.number, one.step) for one in answers if one.number is not None]
    emit(table(columns, rows))
    for one in answers:
        if one.number is None:
            note(f"{one.measurement.name}: no {one.kind}: {one.why}")


def _row(name: str, kind: str, number: Number, step: Step | None) -> list[str]:
    low, high = number.interval
    said = [] if step is None else [f"{step.difference:+.2g}", step.word]
    parts = ", ".join(f"{part} {value:.2g}" for part, value in number.parts.items())
    return [name, kind, f"{number.value:.2g}", f"{low:.2g}-{high:.2g}", f"{number.floor:.2g}", *said, parts,
            number.sample]  # fmt: skip
