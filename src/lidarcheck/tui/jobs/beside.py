"""Which ideal scan belongs to each measured frame of a project: by data set, by case, else by name."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.session.measurements import measurements
from lidarcheck.session.project import Entry, Project

__all__ = ["Beside", "beside"]


@dataclass(frozen=True)
class Beside:
    """The ideal scan of a frame, None where there is none, and `why`; `placement`: what is declared of its file."""

    ideal: Path | None
    placement: Placement = AS_IT_IS
    why: str = ""


def beside(project: Project) -> dict[Path, Beside]:
    """What stands beside each measured frame, by its resolved path."""
    found = {}
    for one in measurements(project):
        if one.kind == "case":
            continue
        ideals = one.ideal if len(one.ideal) == len(one.files) else one.ideal[:1] * len(one.files)
        for number, file in enumerate(one.files):
            ideal = ideals[number] if ideals else None
            found[file.resolve()] = Beside(ideal, one.placement, "" if ideal is not None else one.why)
    for entry in project.of("case"):
        found |= dict(_of_case(entry))
    return found


def _of_case(entry: Entry) -> Iterator[tuple[Path, Beside]]:
    """The frames that a case names; nothing of one with a fault, which Explain says."""
    from lidarcheck.config.toml_text import toml_of
    from lidarcheck.formats.source import decode_text, read_source

    try:
        frames: Any = toml_of(decode_text(read_source(entry.path), entry.path), entry.path).get("frames", [])
    except LidarcheckError:
        return
    for frame in frames if isinstance(frames, list) else []:
        names = (frame.get("measured"), frame.get("ideal")) if isinstance(frame, dict) else (None, None)
        if all(isinstance(name, str) for name in names):
            measured, ideal = (entry.path.parent / str(name) for name in names)
            yield measured.resolve(), Beside(ideal)
