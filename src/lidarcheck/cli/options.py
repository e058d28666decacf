"""What several commands take: their types, ranges and help."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from cyclopts import Parameter

from lidarcheck.errors import UsageError

__all__ = ["MAX_SEED", "JsonFile", "JsonFlag", "Quiet", "Seed"]

MAX_SEED = 2**64 - 1


def _seed(_type: Any, tokens: Sequence[Any]) -> int:
    text = tokens[0].value
    if not (text.isascii() and text.isdecimal()) or int(text[:21]) > MAX_SEED:
        raise UsageError(f"--seed {text} is not a seed", fix=f"use a whole number from 0 to {MAX_SEED} (2^64 - 1)")
    return int(text)


def _jobs(_type: Any, tokens: Sequence[Any]) -> int:
    text = tokens[0].value
    if not (text.isascii() and text.isdecimal()) or not 1 <= int(text[:5]) <= 1024:
        raise UsageError(f"--jobs {text} is out of range", fix="use a whole number from 1 to 1024")
    return int(text)


Seed = Annotated[
    int, Parameter(converter=_seed, help="Seed of the random numbers, 0 to 2^64 - 1: the same seed, the same bytes.")
]
Jobs = Annotated[int, Parameter(converter=_jobs, help="Cores to use, 1 to 1024; all of them by default.")]
Quiet = Annotated[
    bool,
    Parameter(
        name=("--quiet", "-q"),
        negative=(),
        show_default=False,
        help="Results and errors only, no progress or warnings.",
    ),
]
JsonFile = Annotated[str, Parameter(help="Also write the result as JSON to this file; `-` is standard output.")]
JsonFlag = Annotated[bool, Parameter(negative=(), show_default=False, help="Print JSON instead of text.")]
