"""`[external]` in a model file: somebody else's model, its numbers, and what may stand beside it."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from lidarcheck.config.schema import Config, LineIndex, PathText
from lidarcheck.config.words import nearest, shown
from lidarcheck.effects.finding import catalogue
from lidarcheck.errors import InputError, UsageError
from lidarcheck.model.external import check_command
from lidarcheck.model.spec import READS, External, ProgramNumber
from lidarcheck.sensor import Material, Program, Sensor, StandIn
from lidarcheck.sensor.schema import overrides_table, program_overrides
from lidarcheck.trust.places import named_file

__all__ = [
    "ExternalTable",
    "directory_key",
    "document_of",
    "external_of",
    "faults_of",
    "foreign_numbers",
    "sensor_around",
]

_DIRECTORY = ("external", "directory")
_MODULE = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")


class _NumberTable(Config):
    value: float
    low: float
    high: float
    unit: str = ""
    effect: str = ""
    scale: float = 1.0


class ExternalTable(Config):
    """The keys of `[external]`."""

    command: tuple[str, ...] = ()
    server: bool = False
    module: str = ""
    directory: PathText | None = None
    ini: PathText | None = None
    timeout_s: float = Field(600.0, gt=0.0, le=86_400.0, json_schema_extra={"unit": "s"})
    reads: tuple[str, ...] | None = None
    scatter_material: Annotated[int, Field(ge=0, le=2**31 - 1)] | None = None
    parameters: dict[str, _NumberTable] = Field(default_factory=dict)


def external_of(table: ExternalTable, lines: LineIndex) -> External:
    """The model that the table names."""
    own = lines.file.absolute().parent
    directory = own if table.directory is None else Path(os.path.normpath(own / table.directory))
    numbers = tuple(ProgramNumber(name, **entry.model_dump()) for name, entry in table.parameters.items())
    return External(
        table.command,
        directory,
        table.ini and Path(os.path.normpath(own / table.ini)),
        table.timeout_s,
        table.server,
        table.module,
        None if table.reads is None else tuple(word for word in READS if word in table.reads),
        table.scatter_material,
        numbers,
    )


def sensor_around(external: External, described: Sensor, materials: Mapping[int, Material]) -> Program:
    """The sensor whose echoes the model finds; `described`: whose beams and features it has."""
    stand_ins = []
    for one in external.parameters:
        if one.effect:
            name, parameter = _stands_for(one.effect)
            stand_ins.append(StandIn(one.name, name, parameter, one.scale, one.low, one.high))
    return Program.around(
        described,
        settings={one.name: one.value for one in external.parameters},
        stand_ins=tuple(stand_ins),
        scatter_material=external.scatter_material,
        known=materials,
        runs=external,
        reads=external.reads,
    )


def _stands_for(effect: str) -> tuple[str, str]:
    """The effect and its parameter: the first that can act inside where none is named; `UsageError` for another."""
    name, _, parameter = effect.partition(".")
    able = {known: kind.inside for known, kind in catalogue().items() if kind.inside}
    if name not in able:
        near = nearest(name, able)
        fix = f"did you mean {near}?" if near else f"a number may stand for {', '.join(able)}"
        raise UsageError(f"effect = {shown(effect)}: no such effect acts inside a program", fix=fix)
    parameter = parameter or next(iter(able[name]))
    if parameter not in able[name]:
        what = f"effect = {shown(effect)}: no number can stand for {parameter}"
        raise UsageError(what, fix=f"of {name} it may be {', '.join(able[name])}")
    return name, parameter


def foreign_numbers(data: Mapping[str, Any], sensor: Sensor, lines: LineIndex) -> list[InputError]:
    """A fault for each number of a detector that `[sensor]` gives beside the program."""
    given = data.get("sensor")
    inside = overrides_table(type(sensor)).model_fields.keys() - program_overrides().model_fields.keys()
    return [
        lines.fault(
            ("sensor", key),
            f"{key} is a number of the detector, which is the program's own beside [external]",
            fix=f"remove it; a number of the program's own stands in [external.parameters.{key}]",
        )
        for key in (given if isinstance(given, dict) else ())
        if key in inside
    ]


def faults_of(table: ExternalTable, materials: Mapping[int, Any], lines: LineIndex) -> list[InputError]:
    """What is wrong with the table beyond single keys."""
    faults = []
    checked = check_command(table.command, table.parameters, server=table.server) if table.command else ()
    for index, error in checked:
        place = ("external", "command") if index is None else ("external", "command", index)
        faults.append(lines.fault(place, error.what, fix=error.fix))
    faults += _kind_faults(table, lines)
    if table.directory is not None and not named_file(lines.file, table.directory, lines.line(_DIRECTORY)).is_dir():
        what = f"directory = {shown(str(table.directory))} is no folder"
        faults.append(lines.fault(_DIRECTORY, what, fix="give its path from the model file's directory"))
    if table.ini is not None and not named_file(lines.file, table.ini, lines.line(("external", "ini"))).is_file():
        what = f"ini = {shown(str(table.ini))} is not a file"
        faults.append(lines.fault(("external", "ini"), what, fix="give its path from the model file's directory"))
    for word in (word for word in table.reads or () if word not in READS):
        near = nearest(word, READS)
        fix = f"did you mean {near}?" if near else f"a program may read {', '.join(READS)}"
        faults.append(lines.fault(("external", "reads"), f"reads has {shown(word)}, which nobody hands over", fix=fix))
    if table.scatter_material is not None and table.scatter_material not in materials:
        what = f"scatter_material = {table.scatter_material} has no entry in [materials]"
        fix = f"add [materials.{table.scatter_material}] with the reflectance that the program has for it"
        faults.append(lines.fault(("external", "scatter_material"), what, fix=fix))
    for name, number in table.parameters.items():
        faults += _number_faults(name, number, lines)
    return faults


def _kind_faults(table: ExternalTable, lines: LineIndex) -> list[InputError]:
    """What is wrong with the choice of a command, a server or a module."""
    if table.module and (table.command or table.server):
        other = "command" if table.command else "server"
        fix = f"remove {other} or module"
        return [lines.fault(("external", other), f"external.{other} stands beside module", fix=fix)]
    if table.module and not _MODULE.fullmatch(table.module):
        what = f"module = {shown(table.module)} names no function"
        return [lines.fault(("external", "module"), what, fix='write it as "package.module:function"')]
    if not table.module and not table.command:
        fix = "add it: a list of at least 1, each entry text; or module"
        return [lines.fault(("external",), "external.command is missing", fix=fix)]
    return []


def _number_faults(name: str, number: _NumberTable, lines: LineIndex) -> list[InputError]:
    place = ("external", "parameters", name)
    if not number.low <= number.value <= number.high or number.low == number.high:
        what = f"{name}: value = {number.value:g} does not lie between low = {number.low:g} and high = {number.high:g}"
        return [lines.fault((*place, "value"), what, fix="give an interval of some length around it")]
    if number.effect:
        try:
            _stands_for(number.effect)
        except UsageError as error:
            return [lines.fault((*place, "effect"), error.what, fix=error.fix)]
    return []


def document_of(external: External, directory: Path) -> dict[str, Any]:
    """The table as a file in that directory holds it; the command runs where it ran."""
    table: dict[str, Any] = {"module": external.module} if external.module else {"command": list(external.command)}
    if external.server:
        table["server"] = True
    if elsewhere := directory_key(external, directory):
        table["directory"] = elsewhere
    if external.ini is not None:
        table["ini"] = Path(os.path.relpath(external.ini, directory)).as_posix()
    if external.timeout_s != External.__dataclass_fields__["timeout_s"].default:
        table["timeout_s"] = float(external.timeout_s)
    if external.reads is not None:
        table["reads"] = list(external.reads)
    if external.scatter_material is not None:
        table["scatter_material"] = external.scatter_material
    if external.parameters:
        table["parameters"] = {one.name: _number_document(one) for one in external.parameters}
    return table


def directory_key(external: External, directory: Path) -> str:
    """What `directory` says in a file in that one; empty where the command runs there."""
    if directory.resolve() == external.directory.resolve():
        return ""
    return Path(os.path.relpath(external.directory, directory)).as_posix()


def _number_document(number: ProgramNumber) -> dict[str, Any]:
    """What stands as it would without being written is left out."""
    fields = ProgramNumber.__dataclass_fields__
    written = {name: getattr(number, name) for name in fields if name != "name"}
    return {name: value for name, value in written.items() if value != fields[name].default}
