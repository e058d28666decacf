"""What the commands of sensor files share: numbers above 0, and files that are written anew."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lidarcheck.cli.core.outputs import check_writable
from lidarcheck.errors import InputError, UsageError

__all__ = ["check_new", "check_out", "positive"]


def positive(_type: Any, tokens: Sequence[Any]) -> float:
    """A number above 0, up to 10000, of the command line."""
    try:
        value = float(tokens[0].value)
    except ValueError:
        value = float("nan")
    if not 0.0 < value <= 10_000.0:
        fix = "use a number above 0, up to 10000"
        raise UsageError(f"{tokens[0].keyword} {tokens[0].value} is out of range", fix=fix)
    return value


def check_out(out: Path, inputs: Sequence[Path | None]) -> None:
    """Refuse a sensor file that is no TOML by its name, or that is there already."""
    if out.suffix.lower() != ".toml":
        raise UsageError(f"--out {out} is no TOML file", fix="end its name in .toml")
    check_new(out, inputs)


def check_new(target: Path, inputs: Sequence[Path | None]) -> None:
    """Refuse to replace a file: a sensor file is edited by hand."""
    check_writable(target, option="--out", besides=inputs, settings=True)
    if target.exists():
        raise InputError("is there already", file=target, fix="name another file for --out, or move this one away")
