"""Processes of somebody else's model: each a group of its own, which is gone when nobody waits for it any more."""

from __future__ import annotations

import contextlib
import os
import shlex
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

from lidarcheck.errors import ExternalModelError
from lidarcheck.model.spec import External

__all__ = [
    "Child",
    "Groups",
    "exit_words",
    "failure",
    "last_words",
    "name_of",
    "scratch_directory",
    "stop_external_models",
]

Groups = set[int]
"""Process groups that one piece of work has running."""

_TAIL_BYTES = 8192
_GUARD = 'read -r group; read -r over || { test -z "$group" || kill -9 "-$group"; rm -rf -- "$1"; }'
"""The end of input without a word is the end of whoever would have said it."""
_GENTLE_S = 1.0
_running: Groups = set()
"""Those of all external models that run."""


class Child:
    """A process of its own session, with a guard: a shell that kills the session and clears `directory` when this
    process is gone, as after `kill -9`.

    What it says on standard error goes to `directory / "stderr.txt"`. `pipes`: whether its standard input and output
    are ours; else it has none. `groups`: where its process group is listed while it runs, besides.
    `ExternalModelError` when it cannot be started.
    """

    def __init__(
        self, command: Sequence[str], external: External, directory: Path, *, pipes: bool, groups: Groups
    ) -> None:
        self.log = directory / "stderr.txt"
        self._lists = (_running, groups)
        self._guard = _guard(directory)  # there before what it guards
        try:
            with self.log.open("ab") as errors:
                pipe = subprocess.PIPE if pipes else subprocess.DEVNULL
                self._process = _started(command, external, pipe, errors)
        except BaseException:
            self._dismiss_guard(b"\nover\n")
            raise
        self._tell_guard(f"{self.group}\n".encode())
        for listed in self._lists:
            listed.add(self.group)

    @property
    def group(self) -> int:
        """The number of its process group."""
        return self._process.pid

    @property
    def stdin(self) -> IO[bytes]:
        """Its standard input."""
        assert self._process.stdin is not None
        return self._process.stdin

    @property
    def stdout(self) -> IO[bytes]:
        """Its standard output."""
        assert self._process.stdout is not None
        return self._process.stdout

    def wait(self, seconds: float) -> int | None:
        """Its exit code, None when it still runs after so long."""
        try:
            return self._process.wait(timeout=seconds)
        except subprocess.TimeoutExpired:
            return None

    def forget_words(self) -> None:
        """Let what it said so far be nothing that it said last."""
        os.truncate(self.log, 0)

    def close(self) -> None:
        """End its standard input and give it a moment to end by itself."""
        with contextlib.suppress(OSError):
            self.stdin.close()
        self.wait(_GENTLE_S)

    def end(self) -> None:
        """Kill it and all that it started."""
        for listed in self._lists:
            listed.discard(self.group)
        kill_group(self.group)
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        self._dismiss_guard(b"over\n")

    def _tell_guard(self, words: bytes) -> None:
        if self._guard is not None and self._guard.stdin is not None:
            with contextlib.suppress(BrokenPipeError):
                self._guard.stdin.write(words)

    def _dismiss_guard(self, words: bytes) -> None:
        self._tell_guard(words)
        if self._guard is not None:
            self._guard.communicate()


def _started(command: Sequence[str], external: External, pipe: int, errors: IO[bytes]) -> subprocess.Popen[bytes]:
    if not external.directory.is_dir():
        raise failure(f"cannot be started: there is no directory {external.directory}", external, "", "make it")
    try:
        return subprocess.Popen(
            command,
            cwd=external.directory,
            stdin=pipe,
            stdout=pipe,
            stderr=errors,
            env=_environment(),
            start_new_session=True,
            bufsize=0,
        )
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        fix = "check the command and its permissions"
        if os.sep not in command[0] and (external.directory / command[0]).is_file():
            fix = f"write ./{command[0]} for the file beside the model"
        raise failure(f"cannot be started: {reason}", external, "", fix) from None


def _guard(directory: Path) -> subprocess.Popen[bytes] | None:
    try:
        return subprocess.Popen(
            ["sh", "-c", _GUARD, "sh", str(directory)],
            stdin=subprocess.PIPE,
            bufsize=0,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
    except OSError:  # without a shell, or another process, a killed run leaves its external model to end by itself
        return None


def _environment() -> dict[str, str]:
    """What the program finds: compiled Python beside its text, which no hash covers, is not taken for the text."""
    from lidarcheck.jit import base_directory

    with contextlib.suppress(RuntimeError):  # there is no home directory
        return {"PYTHONPYCACHEPREFIX": str(base_directory().absolute() / "python"), **os.environ}
    return {**os.environ, "PYTHONPYCACHEPREFIX": os.devnull}


@contextlib.contextmanager
def scratch_directory() -> Iterator[Path]:
    """A temporary directory, gone afterwards."""
    try:
        scratch = tempfile.TemporaryDirectory(prefix="lidarcheck-", ignore_cleanup_errors=True)
    except OSError as error:
        raise ExternalModelError(f"there is no temporary directory: {error.strerror}", fix="set TMPDIR") from error
    with scratch as name:
        yield Path(name)


def stop_external_models(groups: Groups | None = None) -> None:
    """Kill external models that run now, in whatever thread, with all that they started; those of `groups`, or all."""
    for group in list(_running if groups is None else groups):
        kill_group(group)


def kill_group(group: int) -> None:
    """Kill a process group, if it is there."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)


def name_of(external: External) -> str:
    """What messages call the model: its module, or its command as a shell takes it."""
    return external.module or shlex.join(external.command)


def failure(what: str, external: External, errors: str, fix: str) -> ExternalModelError:
    """The error to raise; `errors`: what it said last."""
    said = f' (it said: "{errors}")' if errors else ""
    return ExternalModelError(f"the external model {name_of(external)} {what}{said}", fix=fix)


def exit_words(code: int) -> str:
    """How a process ended, by its exit code."""
    return f"ended with exit code {code}" if code >= 0 else f"was killed by {_signal_name(-code)}"


def last_words(log: Path) -> str:
    """The last line that is not blank, made printable."""
    with log.open("rb") as stream:
        stream.seek(0, os.SEEK_END)
        stream.seek(max(0, stream.tell() - _TAIL_BYTES))
        lines = stream.read().decode("utf-8", errors="replace").splitlines()
    last = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return "".join(c if c.isprintable() else " " for c in last)[:200]


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
