"""Whether a program that a model names may run: the one place that decides."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

from lidarcheck.config.words import printable
from lidarcheck.errors import ExternalModelError, UsageError
from lidarcheck.permissions import given
from lidarcheck.trust.program_text import Program, hash_of
from lidarcheck.trust.user_file import HASH, UserFile, user_file, user_file_path

__all__ = ["EVERYTHING", "VARIABLE", "require_trust"]

VARIABLE = "LIDARCHECK_TRUST"
"""The environment's list of hashes, with commas between them."""
EVERYTHING = "all"
"""In the place of hashes: every program."""


def require_trust(program: Program, model: str | os.PathLike[str] | None = None) -> None:
    """Return if the user trusts the program as it is now.

    `ExternalModelError` otherwise, with what would run, its hash, and the line that trusts it; `model`: the file that
    names it.
    """
    hashes = _in_environment()
    if given().trust or EVERYTHING in hashes:
        return
    mine, own = user_file(), hash_of(program)
    if own in hashes or own in mine.trust:
        return
    command, place = printable(program.module or shlex.join(program.command)), os.path.normpath(program.directory)
    what = f"runs a program that you do not trust: {command} in {place}"
    raise ExternalModelError(what, file=model, fix=_how(own, mine, user_file_path()))


def _in_environment() -> frozenset[str]:
    hashes = frozenset(word.strip() for word in os.environ.get(VARIABLE, "").split(",")) - {""}
    for word in sorted(hashes - {EVERYTHING}):
        if not HASH.fullmatch(word):
            fix = "give hashes of 64 digits with commas between them, or all"
            raise UsageError(f"{VARIABLE} holds {printable(word)[:80]!r}, which is no program's hash", fix=fix)
    return hashes


def _how(own: str, mine: UserFile, path: Path) -> str:
    """What the user can do, for a program with the hash `own`."""
    line = f'trust = ["{own}"]'
    where = f"add to trust in {path}: " if mine.trust else f"add to {path} the line "
    return f"look at it, then {where}{line if not mine.trust else own}; or set {VARIABLE}={own}; or give --trust"
