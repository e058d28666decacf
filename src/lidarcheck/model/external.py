"""Running somebody else's sensor model: ideal scan in, echoes out, through files."""

from __future__ import annotations

import contextlib
import logging
import os
import re
import shlex
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from lidarcheck.config.words import nearest, printable
from lidarcheck.errors import ExternalModelError, LidarcheckError, UsageError
from lidarcheck.model.spec import External
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.trust.programs import require_trust

__all__ = ["PLACEHOLDERS", "check_command", "run_external", "stop_external_models"]

PLACEHOLDERS = ("ideal", "ini", "scan", "seed")
"""What a command may name in braces; `{{` and `}}` stand for the braces themselves."""

_BRACES = re.compile(r"\{\{|\}\}|\{(?P<name>[^{}]*)\}|[{}]")
_TAIL_BYTES = 8192
_GUARD = 'read -r over || { kill -9 "-$1"; rm -rf -- "$2"; }'
"""The end of input without a word is the end of whoever would have said it."""
_log = logging.getLogger(__name__)
_running: set[int] = set()
"""Process groups of the external models that run."""


def check_command(command: Sequence[str]) -> list[tuple[int | None, UsageError]]:
    """The faults of a command's placeholders, each with the argument's index, None for the whole command."""
    faults: list[tuple[int | None, UsageError]] = []
    names = set()
    for index, argument in enumerate(command):
        for match in _BRACES.finditer(argument):
            name = match["name"]
            if name is None and match.group() in "{}":
                faults.append((index, UsageError(f"a single brace in {argument!r}", fix="write {{ or }} for a brace")))
            elif name is not None and name not in PLACEHOLDERS:
                faults.append((index, _unknown(name)))
            elif name is not None:
                names.add(name)
        if "\0" in argument or (index == 0 and not argument.strip()):
            faults.append((index, UsageError(f"{argument!r} cannot be run", fix="name a program")))
    if "scan" not in names and not faults:
        faults.append((None, UsageError("command has no {scan}", fix="add {scan}, the file that it must write")))
    return faults


def run_external(ideal: IdealScan, external: External, *, seed: int) -> Scan:
    """Let an external model simulate one ideal scan.

    Writes `ideal` as text to a temporary directory, replaces `{ideal}`, `{ini}`, `{scan}` and `{seed}` in the command,
    runs it without a shell in `external.directory` and reads the scan that it wrote. Without an `ini` of its own, the
    command gets one that holds the seed. On a timeout or an interrupt its
    whole process group is killed. `ExternalModelError`, with the command and the last line of its standard error, when
    it cannot be started, fails, takes longer than `timeout_s`, or leaves no readable scan; and when the user does not
    trust the program, which nothing is run of then.
    """
    from lidarcheck.formats import load_scan, save_ideal

    for _, fault in check_command(external.command):
        raise fault
    require_trust(external)
    with _scratch() as directory:
        ini = external.ini or _seed_file(directory, seed)
        files = {"ideal": directory / "ideal.txt", "scan": directory / "scan.txt", "seed": seed, "ini": ini}
        save_ideal(ideal, directory / "ideal.txt")
        command = [_filled(argument, files) for argument in external.command]
        errors = _run(command, external, directory)
        if errors:
            _log.info("%s said: %s", external.command[0], errors)
        scan = directory / "scan.txt"
        if not scan.is_file() or scan.stat().st_size == 0:
            what = "wrote an empty scan" if scan.exists() else "wrote no scan"
            raise _failure(what, external, errors, "let it write its echoes to {scan}")
        try:
            return load_scan(scan)
        except LidarcheckError as error:
            where = f" at line {error.line}" if error.line else ""
            raise _failure(f"wrote a malformed scan: {error.what}{where}", external, errors, error.fix) from error


def _seed_file(directory: Path, seed: int) -> Path:
    """What `{ini}` stands for when the model file names none: a settings file that holds the seed."""
    path = directory / "settings.ini"
    path.write_text(f"PostPro.Seed = {seed}\n", encoding="utf-8")
    return path


@contextlib.contextmanager
def _scratch() -> Iterator[Path]:
    """A temporary directory, gone afterwards."""
    try:
        scratch = tempfile.TemporaryDirectory(prefix="lidarcheck-", ignore_cleanup_errors=True)
    except OSError as error:
        raise ExternalModelError(f"there is no temporary directory: {error.strerror}", fix="set TMPDIR") from error
    with scratch as name:
        yield Path(name)


def _run(command: Sequence[str], external: External, directory: Path) -> str:
    """Run to the end; what it said last on standard error."""
    log = directory / "stderr.txt"
    if not external.directory.is_dir():
        raise _failure(f"cannot be started: there is no directory {external.directory}", external, "", "make it")
    try:
        with log.open("wb") as errors:
            process = subprocess.Popen(
                command,
                cwd=external.directory,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                env=_environment(),
                start_new_session=True,
            )
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        fix = "check the command and its permissions"
        if os.sep not in command[0] and (external.directory / command[0]).is_file():
            fix = f"write ./{command[0]} for the file beside the model"
        raise _failure(f"cannot be started: {reason}", external, "", fix) from None
    with _group_killed_on_error(process), _guarded(process.pid, directory):
        try:
            code = process.wait(timeout=external.timeout_s)
        except subprocess.TimeoutExpired:
            what = f"took longer than {external.timeout_s:g} s"
            raise _failure(what, external, _tail(log), "raise timeout_s or make it faster") from None
    said = _tail(log)
    if code < 0:
        raise _failure(f"was killed by {_signal_name(-code)}", external, said, "run the command by hand")
    if code > 0:
        raise _failure(f"ended with exit code {code}", external, said, "run the command by hand")
    return said


def _environment() -> dict[str, str]:
    """What the program finds: compiled Python beside its text, which no hash covers, is not taken for the text."""
    from lidarcheck.model.jit import base_directory

    with contextlib.suppress(RuntimeError):  # there is no home directory
        return {"PYTHONPYCACHEPREFIX": str(base_directory().absolute() / "python"), **os.environ}
    return {**os.environ, "PYTHONPYCACHEPREFIX": os.devnull}


@contextlib.contextmanager
def _group_killed_on_error(process: subprocess.Popen[bytes]) -> Iterator[None]:
    """However the block ends, the process and all that it started are gone afterwards."""
    _running.add(process.pid)
    try:
        yield
    finally:
        _running.discard(process.pid)
        _kill(process.pid)
        process.wait()


@contextlib.contextmanager
def _guarded(group: int, directory: Path) -> Iterator[None]:
    """While the block runs, a shell waits to kill the group and clear its temporary directory when this process is
    gone, as after `kill -9`.
    """
    try:
        guard = subprocess.Popen(
            ["sh", "-c", _GUARD, "sh", str(group), str(directory)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
    except OSError:  # without a shell, or another process, a killed run leaves its external model to end by itself
        yield
        return
    try:
        yield
    finally:
        with contextlib.suppress(BrokenPipeError):
            guard.communicate(b"over\n")


def stop_external_models() -> None:
    """Kill all external models that run now, in whatever thread, with all that they started."""
    for group in list(_running):
        _kill(group)


def _kill(group: int) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)


def _filled(argument: str, values: Mapping[str, object]) -> str:
    def replacement(match: re.Match[str]) -> str:
        return match.group()[0] if match["name"] is None else str(values[match["name"]])

    return _BRACES.sub(replacement, argument)


def _failure(what: str, external: External, errors: str, fix: str) -> ExternalModelError:
    said = f' (it said: "{errors}")' if errors else ""
    return ExternalModelError(f"the external model {shlex.join(external.command)} {what}{said}", fix=fix)


def _tail(log: Path) -> str:
    """The last line that is not blank, made printable."""
    with log.open("rb") as stream:
        stream.seek(0, os.SEEK_END)
        stream.seek(max(0, stream.tell() - _TAIL_BYTES))
        lines = stream.read().decode("utf-8", errors="replace").splitlines()
    last = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return "".join(c if c.isprintable() else " " for c in last)[:200]


def _unknown(name: str) -> UsageError:
    near = nearest(name, PLACEHOLDERS)
    known = ", ".join(f"{{{known}}}" for known in PLACEHOLDERS)
    fix = f"did you mean {{{near}}}?" if near else f"placeholders are {known}; write {{{{ for a brace"
    return UsageError(f"unknown placeholder {{{printable(name)}}}", fix=fix)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
