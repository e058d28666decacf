"""Where a golden came from: hashes of model source, scenario and parameters, seeds, versions, date."""

from __future__ import annotations

import dataclasses
import datetime
import functools
import hashlib
import json
import os
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

import lidarcheck
from lidarcheck.errors import InputError
from lidarcheck.harness.goldens.hash_words import hashed_parts
from lidarcheck.harness.scenario.scenario import Scenario
from lidarcheck.model.spec import External, Model
from lidarcheck.trust.program_text import module_files
from lidarcheck.workers.identity import versions

__all__ = [
    "NO_RESULTS",
    "Provenance",
    "external_files",
    "hash_of",
    "package_directory",
    "parameters_hash",
    "provenance_of",
    "source_files",
    "source_hash",
    "versions",
]

_PACKAGE = Path(lidarcheck.__file__).resolve().parent
NO_RESULTS = (
    "__main__.py",
    "calibration",
    "cases",
    "cli",
    "effects/search",
    "explain",
    "figures",
    "harness/goldens",
    "harness/propose",
    "harness/reports",
    "harness/review",
    "harness/watch",
    "inference",
    "session",
    "tui",
    "workers",
)
"""What only compares and shows, by its path in the package; all else, and so all that is new, determines results."""


@dataclasses.dataclass(frozen=True, slots=True)
class Provenance:
    """How a golden was made.

    `model_source`, `scenario`, `parameters`: SHA-256 of the code that determines results, of what is measured, and of
    the model's numbers; `seeds`, `reference_seeds`: the seeds of the means and of the distances' reference, as text;
    `kept`: KPIs that stayed as they were when the others were last accepted; `date`: ISO 8601; `base`: in a proposal,
    the hash of the golden's file that it was compared with.
    """

    model_source: str
    scenario: str
    parameters: str
    seeds: str
    reference_seeds: str
    python: str
    numpy: str
    numba: str
    lidarcheck: str
    date: str
    kept: tuple[str, ...] = ()
    base: str = ""

    def same_model(self, other: Provenance) -> bool:
        """Whether both were measured on the same scenario with the same source and parameters."""
        mine = (self.model_source, self.scenario, self.parameters)
        return mine == (other.model_source, other.scenario, other.parameters)


def provenance_of(scenario: Scenario, model: Model, *, seeds: str, reference_seeds: str) -> Provenance:
    """The provenance of what is measured now."""
    found = versions()
    return Provenance(
        model_source=source_hash(),
        scenario=scenario.content_hash,
        parameters=parameters_hash(model),
        seeds=seeds,
        reference_seeds=reference_seeds,
        python=found["python"],
        numpy=found["numpy"],
        numba=found["numba"],
        lidarcheck=found["lidarcheck"],
        date=datetime.datetime.now(datetime.UTC).date().isoformat(),
    )


def package_directory() -> Path:
    """Where the installed package lies."""
    return _PACKAGE


def source_files(package: Path = _PACKAGE) -> list[Path]:
    """The files of the package that determine results, by path: all but what `NO_RESULTS` names."""
    files = [path for suffix in ("*.py", "*.toml") for path in package.rglob(suffix)]
    return sorted(path for path in files if _determines_results(path.relative_to(package)))


@functools.cache
def source_hash() -> str:
    """`hash_of` this package when it is first asked for: what runs is what was loaded, whatever is edited since."""
    return hash_of(_PACKAGE)


def hash_of(package: Path) -> str:
    """SHA-256 over names and contents of `source_files`; line ends do not count."""
    digest = hashlib.sha256()
    for path in source_files(package):
        content = path.read_bytes().replace(b"\r\n", b"\n")
        digest.update(f"{path.relative_to(package).as_posix()}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


def parameters_hash(model: Model) -> str:
    """SHA-256 over every number and name of the model, wherever its file lies, and over an external model's files."""
    return hashlib.sha256(json.dumps(_plain(model), sort_keys=True).encode()).hexdigest()


def external_files(external: External) -> list[Path]:
    """The files of an external model: its `ini`, and what its command names and its directory holds, by path.

    An argument counts as it stands, and what follows its first `=`, as in `--config=FILE`; of a module it is the text
    of its package.
    """
    words = [word for argument in external.command for word in (argument, argument.partition("=")[2]) if word]
    named = {external.directory / word.replace("{{", "{").replace("}}", "}") for word in words}
    named |= set(module_files(external).values())
    files = {path for path in named if _is_file(path) and not _within(external.directory, path).startswith("..")}
    return sorted(files | ({external.ini} if external.ini else set()))


def _determines_results(path: Path) -> bool:
    return not {path.as_posix(), *(parent.as_posix() for parent in path.parents)} & set(NO_RESULTS)


def _plain(value: Any) -> Any:
    """The value as JSON holds it, the same in every process and on every machine."""
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value.hex()
    if isinstance(value, External):
        return _plain_external(value)
    parts = hashed_parts(value)
    return _plain_container(value) if parts is None else {word: _plain(part) for word, part in parts.items()}


def _plain_external(external: External) -> dict[str, Any]:
    files = [path for path in external_files(external) if path != external.ini]
    hashes = {_within(external.directory, path): _file_hash(path) for path in files}
    ini = None if external.ini is None else _file_hash(external.ini)
    return {"command": list(external.command), "ini": ini, "files": hashes, **_newer(external)}


def _newer(external: External) -> dict[str, Any]:
    """What older goldens do not know, where the model has it."""
    numbers = {one.name: [one.value, one.effect, one.scale] for one in external.parameters}
    given = {
        "reads": external.reads,
        "scatter_material": external.scatter_material,
        "parameters": numbers or None,
        "module": external.module or None,
        "server": external.server or None,
    }
    return {word: _plain(value) for word, value in given.items() if value is not None}


def _within(directory: Path, path: Path) -> str:
    return Path(os.path.relpath(path, directory)).as_posix()


def _file_hash(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        what = f"cannot read this file of the external model: {error.strerror or error}"
        raise InputError(what, file=path, fix="make it readable: its content is part of what was measured") from error


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:
        return False  # an argument that no file can be called, such as a long script


def _plain_container(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(value[key]) for key in sorted(value, key=str)}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Enum):
        return _plain(value.value)
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, np.ndarray):
        return {"dtype": str(value.dtype), "values": _plain(value.tolist())}
    if isinstance(value, Path):
        return hashlib.sha256(value.read_bytes()).hexdigest() if value.is_file() else value.name
    raise TypeError(f"{type(value).__name__} is no parameter that can be hashed, and has no words in hash_words")
