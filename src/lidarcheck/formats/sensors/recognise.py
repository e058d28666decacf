"""Which calibration a file is, by its content, and the importer that reads it."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.limits import CONFIG_BYTES
from lidarcheck.formats.sensors.carla import import_carla, is_carla
from lidarcheck.formats.sensors.csv_text import rows_of
from lidarcheck.formats.sensors.helios import import_helios, is_helios
from lidarcheck.formats.sensors.hesai import import_hesai, is_angle_table, refuse_other_models
from lidarcheck.formats.sensors.hesai_firetimes import is_fire_table
from lidarcheck.formats.sensors.imported import Given, Imported
from lidarcheck.formats.sensors.isaac import import_isaac, is_isaac
from lidarcheck.formats.sensors.json_values import json_values
from lidarcheck.formats.sensors.osi import import_osi, is_osi
from lidarcheck.formats.sensors.ouster import import_ouster, is_ouster
from lidarcheck.formats.sensors.sdf import import_sdf, is_sdf
from lidarcheck.formats.sensors.usda import usda_values
from lidarcheck.formats.sensors.velodyne import import_velodyne
from lidarcheck.formats.sensors.veloview import import_veloview
from lidarcheck.formats.sensors.xml_text import xml_root
from lidarcheck.formats.sensors.yaml_text import yaml_values
from lidarcheck.formats.source import decode_text, read_source

__all__ = ["FORMATS", "Format", "import_sensor"]

_MOST_BYTES = 8 << 20
"""Of a calibration; the pattern of a solid-state lidar has some megabytes."""


class Format(NamedTuple):
    """A vendor's format: its title, its importer, which of the user's words it reads, and whether a document is one."""

    title: str
    read: Callable[[Any, Given], Imported]
    options: tuple[str, ...] = ()
    knows: Callable[[Any], bool] = lambda _: True


_TURNING = ("model", "rate_hz", "azimuth_step_deg")
_JSON = (
    Format("Ouster metadata JSON", import_ouster, (), is_ouster),
    Format("Isaac RTX lidar JSON or USD", import_isaac, (), is_isaac),
    Format("CARLA attributes JSON", import_carla, (), is_carla),
    Format("OSI LidarSensorViewConfiguration JSON", import_osi, ("rate_hz",), is_osi),
)
_XML = (
    Format("VeloView db.xml", import_veloview, _TURNING, lambda root: root.tag == "boost_serialization"),
    Format("HELIOS++ scanner XML", import_helios, (*_TURNING, "pattern"), is_helios),
    Format("SDF or URDF lidar", import_sdf, ("model", "rate_hz"), is_sdf),
)
_YAML = Format("Velodyne YAML", import_velodyne, _TURNING)
_CSV_OPTIONS = (*_TURNING, "firetimes", "state")
_HESAI = "Hesai angle-correction CSV"
FORMATS = (_JSON[0].title, _YAML.title, _XML[0].title, _HESAI, *(form.title for form in (*_JSON[1:], *_XML[1:])))
"""What is read, as the errors and the manual name it."""
_OPTIONS = {
    "model": "--model",
    "rate_hz": "--rate",
    "azimuth_step_deg": "--azimuth-step",
    "firetimes": "--firetimes",
    "state": "--state",
    "pattern": "--pattern",
}
_YAML_LINE = re.compile(r"^(?:lasers|num_lasers)[ \t]*:", re.MULTILINE)


def import_sensor(path: str | Path, given: Given | None = None) -> Imported:
    """The sensor that a vendor's file describes.

    `InputError` names the file, the line or place and the fix where the file is damaged, incomplete, in another unit or
    of no known format; `UsageError` where `given` does not fit it.
    """
    file, said = Path(path), given or Given()
    content = read_source(file, most=_MOST_BYTES)
    refuse_other_models(content, file, said.model)
    text = decode_text(content, file)
    start = text.lstrip()
    if start.startswith(("{", "[")):
        values = json_values(text, file)
        return _with(_JSON, values.data, values, said, file)
    if start.startswith("<"):
        root = xml_root(text, file)
        return _with(_XML, root, root, said, file)
    if start.startswith("#usda"):
        _check_options(_JSON[1], said)
        return import_isaac(usda_values(text, file), said)
    return _by_lines(text, file, said)


def _with(forms: tuple[Format, ...], told_by: Any, document: Any, given: Given, file: Path) -> Imported:
    form = next((form for form in forms if form.knows(told_by)), None)
    if form is None:
        raise _unknown(file)
    _check_options(form, given)
    return form.read(document, given)


def _by_lines(text: str, file: Path, given: Given) -> Imported:
    """CSV by its header, YAML by its keys."""
    if len(text) > CONFIG_BYTES:
        raise _unknown(file)
    first = next(iter(rows_of(text[:4096], file)), None)
    if first is not None and is_angle_table([cell.lower() for cell in first.cells]):
        form = Format(_HESAI, lambda _, words: import_hesai(text, file, words), _CSV_OPTIONS)
        _check_options(form, given)
        return form.read(None, given)
    if first is not None and is_fire_table(first.cells):
        fix = f"name the angle table of the sensor, and this one with --firetimes {file.name}"
        raise InputError("a table of fire times, without angles", file=file, fix=fix)
    if _YAML_LINE.search(text):
        _check_options(_YAML, given)
        return import_velodyne(yaml_values(text, file), given)
    raise _unknown(file)


def _check_options(form: Format, given: Given) -> None:
    """Refuse a word of the user's that this format does not read: it would be lost in silence."""
    for field in fields(given):
        if getattr(given, field.name) is not None and field.name not in form.options:
            known = " ".join(_OPTIONS[name] for name in form.options) or "none"
            option = _OPTIONS[field.name]
            raise UsageError(f"{option} means nothing for {form.title}", fix=f"leave it out; its options: {known}")
    if given.state is not None and given.firetimes is None:
        raise UsageError("--state is of a table of fire times", fix="give that with --firetimes FILE")


def _unknown(file: Path) -> InputError:
    fix = "use one of " + ", ".join(FORMATS) + "; of a point cloud, `lidarcheck sensor guess`"
    return InputError("not a calibration that lidarcheck knows", file=file, fix=fix)
