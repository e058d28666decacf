"""The steps of a quick start: commands that are printed, run in this process, and not run again once they are done."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import shlex
import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lidarcheck import __version__
from lidarcheck.cli.core.command import ARGUMENTS
from lidarcheck.cli.core.terminal import note
from lidarcheck.errors import InputError
from lidarcheck.formats.atomic import write_text
from lidarcheck.formats.table import clock_text

__all__ = ["Steps"]

KEPT, SAID = "steps.json", "steps"
_SHARES = {"frames": 0.04, "sensor": 0.02, "repeats": 0.06, "case": 0.03, "check": 0.15, "explain": 0.7}
"""What part of the whole each step usually takes."""


@dataclass
class Steps:
    """The steps of a quick start in `out`, which is its own. `recording`: files that the first one reads.

    What was done is kept in `steps.json`, what each command said in `steps/`. A step is not done again where its
    command, those before it and the recording are the same.
    """

    out: Path
    recording: Sequence[Path]
    seconds: dict[str, float] = field(default_factory=dict)
    commands: dict[str, str] = field(default_factory=dict)
    _key: str = ""
    _done: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._key = _state(self.recording)
        file = self.out / KEPT
        if self.out.exists() and (not self.out.is_dir() or (any(self.out.iterdir()) and not file.is_file())):
            raise InputError(
                "is there already, and no quick start", file=self.out, fix="name a new directory for --out"
            )
        if file.is_file():
            try:
                kept = json.loads(file.read_text(encoding="utf-8"))
                self._done, begun = dict(kept["steps"]), kept["recording"]
            except (OSError, ValueError, KeyError, TypeError):
                fix = "name another directory for --out, or remove this one"
                raise InputError("is no list of steps", file=file, fix=fix) from None
            if begun != self._key:
                fix = "name another directory for --out, or remove this one"
                raise InputError("is the quick start of another recording", file=self.out, fix=fix)

    def begin(self) -> None:
        """Make the directory; now it is a quick start's."""
        (self.out / SAID).mkdir(parents=True, exist_ok=True)
        self._keep()

    def run(self, name: str, argv: Sequence[object], makes: Sequence[Path], *, codes: Sequence[int] = (0,)) -> str:
        """Run a command, unless it was done before, and give what it wrote to standard output.

        `makes`: what it writes, which is removed before it runs anew. `codes`: the exit codes that mean it worked;
        `InputError` with the first line of its output for another one.
        """
        words = [str(word) for word in argv]
        line = f"lidarcheck {shlex.join(words)}"
        self._key = hashlib.sha256(f"{self._key}\n{__version__}\n{line}".encode()).hexdigest()
        self.commands[name] = line
        said = self.out / SAID / f"{name}.txt"
        if self._done.get(name, {}).get("key") == self._key and said.is_file() and all(one.exists() for one in makes):
            self.seconds[name] = float(self._done[name]["seconds"])
            note(f"done before: {line}")
            return said.read_text(encoding="utf-8")
        note(line)
        for one in makes:
            _removed(one)
        begun = time.monotonic()
        code, text = _run(words)
        if code not in codes:
            first = next((row for row in text.splitlines() if row.strip()), f"{name} ended with {code}")
            raise InputError(f"`{line}` says: {first}", fix="put that right, and run the same command again")
        self.seconds[name] = time.monotonic() - begun
        write_text(said, text)
        self._done[name] = {"key": self._key, "command": line, "seconds": round(self.seconds[name], 3)}
        self._keep()
        note(f"  {clock_text(self.seconds[name])}{self._left()}")
        return text

    def _left(self) -> str:
        """How long the rest will take at the pace so far, in words."""
        done = sum(_SHARES.get(name, 0.0) for name in self.seconds)
        rest = sum(share for name, share in _SHARES.items() if name not in self.seconds)
        if rest <= 0.0 or done <= 0.0:
            return ""
        return f", about {clock_text(sum(self.seconds.values()) / done * rest)} left"

    def _keep(self) -> None:
        document: Mapping[str, Any] = {"recording": _state(self.recording), "steps": self._done}
        write_text(self.out / KEPT, json.dumps(document, indent=1) + "\n")


def _run(words: Sequence[str]) -> tuple[int, str]:
    """A command's exit code and its standard output; what it tells the person at the terminal goes there."""
    from lidarcheck.cli.core.app import make_app

    given, said = ARGUMENTS.set(tuple(words)), io.StringIO()
    try:
        with contextlib.redirect_stdout(said):
            result = make_app()(list(words), exit_on_error=False, print_error=False, result_action="return_value")
    finally:
        ARGUMENTS.reset(given)
    return (result if isinstance(result, int) else 0), said.getvalue()


def _removed(place: Path) -> None:
    """A result of an earlier run in the quick start's own directory."""
    if place.is_dir() and not place.is_symlink():
        shutil.rmtree(place)
    else:
        place.unlink(missing_ok=True)


def _state(files: Sequence[Path]) -> str:
    """Which files these are, told by their places, sizes and times."""
    sha = hashlib.sha256()
    for file in files:
        inside = sorted(file.rglob("*")) if file.is_dir() else [file]
        for one in inside:
            with contextlib.suppress(OSError):
                stat = one.stat()
                sha.update(f"{os.path.realpath(one)} {stat.st_size} {stat.st_mtime_ns}\n".encode())
    return sha.hexdigest()
