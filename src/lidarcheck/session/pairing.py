"""Which of a project's files belong together, by their names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from lidarcheck.session.project import Entry, Project

__all__ = [
    "NUMBER_AND_RANGE",
    "Labels",
    "ideal_of",
    "is_simulated",
    "labels_of",
    "measured_in",
    "numbers_in",
    "partner_of",
]

_WORDS = re.compile(r"ideal|postpro|scan|measured|real|at|[^a-z0-9.]+")
_SIMULATED = re.compile(r"(?<![a-z])(?:sim|simulated|simulation)(?![a-z])")
_MERGED = re.compile(r"(?<![a-z])merged(?![a-z])")
NUMBER_AND_RANGE = re.compile(r"^(\d+)_\d+(?:\.\d+)?m(?![a-z])", re.IGNORECASE)
"""A scan's name that counts and says its range: `1_25m`."""
_LABELS = re.compile(r"(?<![a-z])(?:car|van|truck|smart|slim)(?![a-z])")
_VEHICLES, _VARIANTS = ("car", "van", "truck"), ("SMART", "SLIM")


class Labels(NamedTuple):
    """What a file's name, or that of a directory that it is in, says of its measurement; empty where it does not."""

    vehicle: str
    variant: str

    def agrees(self, other: Labels) -> bool:
        """Whether the names contradict each other in nothing."""
        return all(not a or not b or a == b for a, b in zip(self, other, strict=True))


def numbers_in(name: str) -> tuple[list[float], str]:
    """Sorts names by the numbers in them: 69 m before 157 m."""
    return [float(text) for text in re.findall(r"\d+(?:\.\d+)?", Path(name).stem)], name


def is_simulated(entry: Entry) -> bool:
    """Whether a scan's name says that it is simulated."""
    return _SIMULATED.search(entry.path.stem.lower()) is not None


def measured_in(project: Project, *, sound: bool = True) -> list[Entry]:
    """The scans that are not simulated by their names, and not merged of others, in the order of their numbers."""
    scans = project.of("scan", sound=sound)
    own = [e for e in scans if not is_simulated(e) and not _MERGED.search(e.path.stem.lower())]
    return sorted(own, key=lambda entry: numbers_in(entry.name))


def labels_of(entry: Entry) -> Labels:
    """The vehicle and the variant, from the file's name, else from the nearest directory that names one."""
    parts = [entry.path.stem, *reversed(Path(entry.name).parts[:-1])]
    words = [_LABELS.findall(part.lower()) for part in parts]
    vehicle = next((word for found in words for word in found if word in _VEHICLES), "")
    variant = next((word.upper() for found in words for word in found if word.upper() in _VARIANTS), "")
    return Labels(vehicle, variant)


def ideal_of(scan: Entry, ideals: Sequence[Entry]) -> Path | None:
    """The ideal scan whose name differs by such words only: `real_69.txt` and `ideal_69.txt`; of `1_25m` also `1_ideal`
    beside it."""
    key = _key(scan)
    alike = [entry for entry in ideals if key and _key(entry) == key]
    alike.sort(key=lambda entry: entry.path.parent != scan.path.parent)
    number = NUMBER_AND_RANGE.match(scan.path.stem)
    if not alike and number is not None:
        beside = [entry for entry in ideals if entry.path.parent == scan.path.parent]
        same = [entry for entry in beside if entry.path.stem.startswith(f"{number[1]}_")]
        alike = same if len(same) == 1 else []
    return alike[0].path if alike else None


def partner_of(scan: Entry, others: Sequence[Entry]) -> Path | None:
    """The simulated or ideal scan of a vehicle: as `ideal_of`, but its name may leave out vehicle and variant."""
    own, labels = _rest(scan), labels_of(scan)
    alike = [entry for entry in others if _rest(entry) == own and labels_of(entry).agrees(labels)]
    alike.sort(key=lambda entry: (entry.path.parent != scan.path.parent, -sum(map(bool, labels_of(entry)))))
    return alike[0].path if alike else None


def _key(entry: Entry) -> str:
    return _WORDS.sub("", entry.path.stem.lower())


def _rest(entry: Entry) -> str:
    """What is left of a name without sides, vehicle and variant."""
    return _WORDS.sub("", _LABELS.sub("", _SIMULATED.sub("", entry.path.stem.lower())))
