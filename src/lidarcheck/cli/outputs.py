"""Where a command writes: a file, or standard output."""

from __future__ import annotations

from pathlib import Path

from lidarcheck.cli.terminal import emit
from lidarcheck.plots.outputs import STANDARD_OUTPUT, check_writable, json_text, write_file

__all__ = ["check_writable", "json_text", "write_result"]


def write_result(path: str | Path, text: str) -> None:
    """Write text to a file, at once; `-` is standard output, and a device or pipe is written as it is."""
    if str(path) == STANDARD_OUTPUT:
        emit(text)
    else:
        write_file(path, text)
