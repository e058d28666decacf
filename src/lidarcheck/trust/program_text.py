"""What a program named in `[external]` is made of, as one hash: its table, its files, and the text around them."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import re
import stat
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar, Protocol

from lidarcheck.errors import InputError
from lidarcheck.formats.recognise import FORMATS, recognise
from lidarcheck.trust.module_text import module_place
from lidarcheck.trust.places import project_of

__all__ = ["Program", "hash_of", "module_files", "named_paths", "program_files"]

NOT_PROGRAM = frozenset({".lidarcheck", ".git", "__pycache__"})
_RESULTS = frozenset({"report.html", "report.json", "result.json"})
_OUTPUTS = frozenset({".log", ".png", ".svg"})
_HEADER = re.compile(rb"[ \t]*(?://)?([^\r\n]*)")
_NUMBERS = b"0123456789+-.,;eEnNaAiIfF \t\r\n"
"""The bytes of rows of numbers: no language has a program of these alone."""
_SETTLED_NS = 2_000_000_000
"""A file that was changed so lately may be changed again without its times showing it."""
_digests: dict[tuple[int, ...], str] = {}
_kinds: dict[tuple[object, ...], bool] = {}
"""Of files as they were: their digests, and whether they are program text."""


class Program(Protocol):
    """The `[external]` table of a model: a dataclass, with the folder of the model's file."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def command(self) -> tuple[str, ...]:
        """The words of the command."""

    @property
    def directory(self) -> Path:
        """Where it runs: the folder of the model's file."""

    @property
    def ini(self) -> Path | None:
        """The file of its settings."""

    @property
    def module(self) -> str:
        """The Python function, `package.module:function`, where it is one and no command."""


def hash_of(program: Program) -> str:
    """SHA-256 over the table, its `ini`, every argument that is a file, and the program text around these.

    Program text are all files below the folder of each argument that is a file of the project, below each argument
    that is a folder of it, and below the model's own folder where the command begins with no file of the project. Of a
    module it is the text of its package, wherever that lies. Not what `NOT_PROGRAM` names, results, goldens, scans and
    ideal scans, which change without the program. Links are followed inside the project. `InputError` for a file that
    cannot be read, `ExternalModelError` for a module that is not there.
    """
    place = program.directory
    parts = {os.path.relpath(path, place): _digest(path) for path in program_files(program)}
    parts |= {name: _digest(path) for name, path in module_files(program).items()}
    document = {"table": _table(program), "files": parts}
    return hashlib.sha256(
        json.dumps(document, sort_keys=True, default=dataclasses.asdict).encode("utf-8", "surrogateescape")
    ).hexdigest()


def program_files(program: Program) -> set[Path]:
    """The files that a command names, and the program text around these; see `hash_of`."""
    files = {path for path in named_paths(program) if _kind(path) == stat.S_IFREG}
    folders = set() if program.module else _folders(program)
    return files | {path for folder in folders for path in _program_text(folder, _project(program))}


def module_files(program: Program) -> dict[str, Path]:
    """The text of a module's package, by what each file is called there; nothing for a command."""
    if not program.module:
        return {}
    place = module_place(program.module, program.directory)
    found = _program_text(place, _project(program)) if _kind(place) == stat.S_IFDIR else [place]
    return {f"module {os.path.relpath(path, place.parent)}": path for path in found}


def named_paths(program: Program) -> list[Path]:
    """What the words of the command may name, there or not, and the `ini`.

    A word counts as it stands, and what follows its first `=`, as in `--config=FILE`.
    """
    words = [word for argument in program.command for word in (argument, argument.partition("=")[2]) if word]
    named = {program.directory / word.replace("{{", "{").replace("}}", "}") for word in words}
    return sorted(named | ({program.ini} if program.ini else set()))


def _table(program: Program) -> dict[str, Any]:
    """The table as its file has it; what stands as it would without being written is left out."""
    table: dict[str, Any] = {}
    for field in dataclasses.fields(program):
        value = getattr(program, field.name)
        if field.name != "directory" and value != field.default:
            table[field.name] = os.path.relpath(value, program.directory) if isinstance(value, Path) else value
    return table


def _project(program: Program) -> Path:
    return Path(os.path.realpath(project_of(program.directory / "model.toml")))


def _folders(program: Program) -> set[Path]:
    """The folders whose text belongs to the program, real paths."""
    project = _project(program)
    found, begins = set(), False
    for path in named_paths(program):
        real = Path(os.path.realpath(path)) if _kind(path) else None
        for place in (path.absolute(), real):
            if place is None or not _is_below(Path(os.path.realpath(place.parent)), project):
                continue
            if _kind(path) == stat.S_IFREG:
                found.add(Path(os.path.realpath(place.parent)))
            elif real is not None and _is_below(real, project):
                found.add(real)
    for word in program.command[:2]:  # the program, or what reads it and then the program
        path = program.directory / word
        begins = begins or (_kind(path) == stat.S_IFREG and _is_below(Path(os.path.realpath(path)), project))
    return found if begins else found | {Path(os.path.realpath(program.directory))}


def _program_text(folder: Path, project: Path) -> Iterator[Path]:
    """The files below a folder of the project that belong to a program; links are followed inside the project."""
    seen, waiting = set[str](), [str(folder)]
    while waiting:
        here = waiting.pop()
        if here in seen:
            continue
        seen.add(here)
        for entry in _entries(here):
            path = Path(entry.path)
            if entry.is_symlink():
                real = Path(os.path.realpath(path))
                if _kind(real) == stat.S_IFDIR and _is_below(real, project):
                    waiting.append(str(real))
                elif _kind(real) == stat.S_IFREG and _is_program(real):
                    yield path
            elif entry.is_dir(follow_symlinks=False):
                if entry.name not in NOT_PROGRAM:
                    waiting.append(entry.path)
            elif entry.is_file(follow_symlinks=False) and _is_program(path):
                yield path


def _entries(folder: str) -> list[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as entries:
            return sorted(entries, key=lambda entry: entry.name)
    except OSError as error:
        what = f"cannot read this folder of a program: {error.strerror or error}"
        raise InputError(what, file=folder, fix="make it readable: what is in it decides what runs") from error


def _is_program(path: Path) -> bool:
    """Whether a file is neither a result, a golden nor a scan; what can be run never is one of these."""
    suffix = path.suffix.lower()
    if path.name in _RESULTS or suffix in _OUTPUTS or (suffix == ".toml" and "goldens" in path.parts):
        return False
    asked = next((name for name, form in FORMATS.items() if suffix in form.suffixes), None)
    state = path.stat()
    if asked is None or state.st_size == 0:
        return True
    key = (str(path), *_identity(state))
    if key in _kinds:
        return _kinds[key]
    found = _is_none_of(path, asked)
    if _is_settled(state):
        _kinds[key] = found
    return found


def _is_none_of(path: Path, asked: str) -> bool:
    """Whether a file is not what its suffix says."""
    try:
        found = recognise(path)
        if asked not in ("text", "csv"):
            return found != asked
        return found not in ("text", "csv") or not _is_table(path.read_bytes())
    except (InputError, OSError):
        return True


def _is_table(content: bytes) -> bool:
    """Whether the bytes are a header of a scan and numbers below it, nothing else."""
    header = _HEADER.match(content.removeprefix(b"\xef\xbb\xbf"))
    assert header is not None
    names = set(re.split(rb"[\s,;\"]+", header[1].lower()))
    return ({b"x", b"y", b"z"} <= names or {b"layer", b"point"} <= names) and not content[header.end() :].translate(
        None, _NUMBERS
    )


def _digest(path: Path) -> str:
    """SHA-256 of a file's content, read again only where the file has changed."""
    try:
        with path.open("rb") as stream:
            state = os.fstat(stream.fileno())
            key = _identity(state)
            if key not in _digests:
                digest = hashlib.file_digest(stream, "sha256").hexdigest()
                if not _is_settled(state):
                    return digest
                _digests[key] = digest
            return _digests[key]
    except OSError as error:
        what = f"cannot read this file of a program: {error.strerror or error}"
        raise InputError(what, file=path, fix="make it readable: its content decides what runs") from error


def _identity(state: os.stat_result) -> tuple[int, ...]:
    """What changes when a file's content does."""
    return (state.st_dev, state.st_ino, state.st_size, state.st_mtime_ns, state.st_ctime_ns)


def _is_settled(state: os.stat_result) -> bool:
    return time.time_ns() - max(state.st_mtime_ns, state.st_ctime_ns) >= _SETTLED_NS


def _kind(path: Path) -> int | None:
    """What a path leads to; None for nothing, and for a word that no file can be called."""
    try:
        return stat.S_IFMT(path.stat().st_mode)
    except (OSError, ValueError):
        return None


def _is_below(path: Path, folder: Path) -> bool:
    return path.is_relative_to(folder)
