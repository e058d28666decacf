"""`lidarcheck dataset scan`: a data set's file from what a folder holds."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from lidarcheck.cli.core.options import MaxRows, Quiet, sensor_file
from lidarcheck.cli.core.outputs import as_it_was, check_writable, write_result
from lidarcheck.cli.core.terminal import hush, note, stage
from lidarcheck.errors import InputError
from lidarcheck.formats.limits import limit_rows

__all__ = ["scan"]


def scan(
    folder: Annotated[Path, Parameter(name="DIR", help="A folder of scans, bags and traces.")],
    /,
    *,
    out: Annotated[Path | None, Parameter(help="The file to write, in DIR; dataset.toml by default.")] = None,
    pattern: Annotated[str, Parameter(help="Only files whose path fits, as '*.pcd'.", show_default=False)] = "",
    sensor: Annotated[str | None, Parameter(help="The sensor's name or file, for the data set.")] = None,
    model: Annotated[Path | None, Parameter(help="The model's file, for the data set.")] = None,
    force: Annotated[bool, Parameter(negative=(), show_default=False, help="Replace the file.")] = False,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
) -> int:
    """Write a data set's file from the names in a folder."""
    hush(quiet)
    limit_rows(max_rows)
    if not folder.is_dir():
        raise InputError("is no folder", file=folder, fix="name the folder of the scans")
    from lidarcheck.cases.dataset import DATASET_FILE, load_dataset
    from lidarcheck.cases.dataset_scan import scan_folder

    target = folder / DATASET_FILE if out is None else out
    if target.exists() and not force:
        raise InputError("is there already", file=target, fix="name another with --out, or replace it with --force")
    if target.resolve().parent != folder.resolve():
        raise InputError("lies outside of the folder where its paths start", file=target, fix="write it in DIR")
    given = [path for path in (model, sensor_file(sensor)) if path is not None]
    check_writable(target, option="--out", besides=given, settings=True)
    with stage(f"looking into {folder}"):
        found = scan_folder(folder, pattern)
    text = found.text(_from_there(sensor_file(sensor) or sensor, sensor, folder), _from_there(model, model, folder))
    with as_it_was([target]):
        write_result(target, text)
        load_dataset(target)  # what it says of sensor and model holds, or nothing is written
    for said in (*found.topics, *found.left_out):
        note(f"not taken: {said}")
    note(f"{target}: {len(found.frames)} frames; correct it by hand")
    return 0


def _from_there(file: str | Path | None, name: str | Path | None, folder: Path) -> str:
    """A file by its path from the folder; a name as it is."""
    if file is None or not Path(file).exists():
        return str(name or "")
    return os.path.relpath(file, folder)
