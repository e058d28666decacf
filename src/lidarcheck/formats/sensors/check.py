"""Whether what was imported is a sensor: held against the schema and the geometry before a file is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.sensors.imported import Imported
from lidarcheck.sensor import Sensor, sensor_of

__all__ = ["sensor_of_import"]


def sensor_of_import(imported: Imported, file: Path, *, all_keys: bool = False) -> Sensor:
    """The sensor, with the examples of what is needed and lacking, or with `all_keys` of all that is lacking.

    `InputError` names the vendor's file where it is well-formed and yet describes no sensor.
    """
    columns = {name: np.asarray(values) for name, values in imported.table.items()}
    document = imported.completed(all_keys=all_keys)
    if columns:
        document["beams"]["file"] = "its beams"
    try:
        return sensor_of(document, columns=lambda _name: columns)
    except UsageError as error:
        raise InputError(f"no sensor: {error.what}", file=file, fix=error.fix) from None
