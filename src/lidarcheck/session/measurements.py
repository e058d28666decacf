"""What of a project gives a number: each scan, set of frames, profile, data set or case, or why it gives none.

Files belong together by their names (`pairing`), by what a data set declares, or by what a case says.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.field.place import named
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.session.pairing import ideal_of, is_simulated, labels_of, measured_in, numbers_in, partner_of
from lidarcheck.session.project import Entry, Project

if TYPE_CHECKING:
    from lidarcheck.calibration.number.number import Kind
    from lidarcheck.calibration.number.request import Request
    from lidarcheck.formats.lut import Axis

__all__ = ["NO_IDEAL", "Measurement", "measurements"]

NO_IDEAL = "no ideal scan"


@dataclass(frozen=True)
class Measurement:
    """One measurement: its name within the project and what it is, `scan`, `frames`, `profile`, `case`, `bag` or a
    class.

    `distance_m`: as names or a data set say, None where they do not. `files`: the scans, or the profile, or the case's
    directory; `ideal`: one for each, or one for all. `why`: why it has no number at all, empty where it has one.
    """

    name: str
    kind: str
    distance_m: float | None
    files: tuple[Path, ...]
    ideal: tuple[Path, ...] = ()
    why: str = ""
    placement: Placement = AS_IT_IS

    @property
    def words(self) -> str:
        """Its distance, or its name where that says none."""
        return f"{self.distance_m:g} m" if self.distance_m is not None else self.name

    def why_none(self, kind: Kind) -> str:
        """Why it has no number of a kind, empty where it has one."""
        if self.why:
            return self.why
        if self.kind == "case":
            return "a case is explained by its gap" if kind == "misfit" else ""
        if self.ideal:
            return ""
        # A profile, and a scan that says where its target stands, show it by themselves.
        alone = kind == "misfit" and (self.kind == "profile" or self.distance_m is not None)
        return "" if alone else NO_IDEAL

    def request(
        self, kind: Kind, model: Path, *, axis: Axis = "vertical", lut: Path | None = None,
        settings: Path | None = None, target: int | None = None,
    ) -> Request:  # fmt: skip
        """What is asked of it; the distance is the target's where no ideal scan tells that."""
        from lidarcheck.calibration.number.request import Request

        case = self.files[0] if self.kind == "case" else None
        return Request(
            kind, model, () if case else self.files, () if case else self.ideal, axis, lut, settings,
            None if self.ideal else self.distance_m, target, case, placement=self.placement,
        )  # fmt: skip


def measurements(project: Project) -> list[Measurement]:
    """All of a project, the nearest first within a folder."""
    found = [*_cases(project), *_datasets(project)]
    taken = [file.parent if file.is_file() else file for one in found for file in one.files if one.kind == "case"]
    own = {named(file).file.resolve() for one in found for file in one.files}

    def is_free(entry: Entry) -> bool:
        return entry.path.resolve() not in own and not any(place in entry.path.parents for place in taken)

    found += [_profile(entry) for entry in project.of("profile", sound=False) if is_free(entry)]
    found += [_recording(entry, project) for entry in project.of("recording", sound=False) if is_free(entry)]
    found += _scans(project, [entry for entry in _measured(project) if is_free(entry)])
    return sorted(found, key=lambda one: (str(Path(one.name).parent), numbers_in(one.name)))


def _measured(project: Project) -> list[Entry]:
    """The scans that are not simulated by their names; where all of a folder are, those."""
    found = measured_in(project, sound=False)
    folders = {entry.path.parent for entry in found}
    return [*found, *(e for e in project.of("scan") if is_simulated(e) and e.path.parent not in folders)]


def _cases(project: Project) -> list[Measurement]:
    entries = project.of("case", sound=False)
    return [Measurement(_folder(e), "case", None, (e.path.parent,), why=_fault(e)) for e in entries]


def _folder(entry: Entry) -> str:
    parent = Path(entry.name).parent.as_posix()
    return entry.name if parent == "." else parent


def _fault(entry: Entry) -> str:
    """What is wrong with a file, without its name in front, which stands beside it."""
    return entry.fault.split(": ", 1)[-1]


def _profile(entry: Entry) -> Measurement:
    return Measurement(entry.name, "profile", _distance_of(entry), (entry.path,), why=_fault(entry))


def _recording(entry: Entry, project: Project) -> Measurement:
    """A bag or trace whose frames no data set declares."""
    folder = shlex.quote(entry.path.parent.relative_to(project.root).as_posix())
    why = _fault(entry) or f"lidarcheck dataset scan {folder} makes measurements of its frames"
    return Measurement(entry.name, "bag", _distance_of(entry), (entry.path,), why=why)


def _distance_of(entry: Entry) -> float | None:
    from lidarcheck.calibration.vehicles.kinds import distance_in_name

    return distance_in_name(entry.path)


def _datasets(project: Project) -> Iterator[Measurement]:
    """The frames that data sets declare."""
    from lidarcheck.cases.dataset import DATASET_FILE, load_dataset

    folders = sorted({parent for entry in project.entries for parent in entry.path.parents if project.root in
                      (parent, *parent.parents)})  # fmt: skip
    for folder in folders:
        file = folder / DATASET_FILE
        if not file.is_file():
            continue
        name = folder.relative_to(project.root).as_posix()
        try:
            frames = load_dataset(file).frames
        except LidarcheckError as error:
            yield Measurement(name, "data set", None, (file,), why=error.lines()[0].removeprefix("error: "))
            continue
        for frame in frames:
            why = "" if frame.ideal is not None else f"{NO_IDEAL}: frame {frame.number} of {file.name} names none"
            yield Measurement(
                Path(os.path.relpath(frame.measured, project.root)).as_posix(), frame.kind or "scan",
                frame.distance_m, (frame.measured,),
                () if frame.ideal is None else (frame.ideal,), why, frame.declared.placement,
            )  # fmt: skip


def _scans(project: Project, scans: Sequence[Entry]) -> list[Measurement]:
    """Scans, those of one ideal scan together."""
    ideals = project.of("ideal")
    sets: dict[tuple[Path | None, Path, float | None, str], list[Entry]] = {}
    for entry in scans:
        ideal = ideal_of(entry, ideals) or partner_of(entry, ideals) or _only_one(entry, ideals)
        alone = str(entry.path) if ideal is None and _distance_of(entry) is not None else entry.fault
        sets.setdefault((ideal, entry.path.parent, _distance_of(entry), alone), []).append(entry)
    return [_set(ideal, at_m, some) for (ideal, _, at_m, _), some in sets.items()]


def _only_one(entry: Entry, ideals: Sequence[Entry]) -> Path | None:
    """The ideal scan of a folder that has only one, for frames whose names say nothing else."""
    near = [other.path for other in ideals if other.path.parent == entry.path.parent]
    return near[0] if len(near) == 1 and _distance_of(entry) is None else None


def _set(ideal: Path | None, at_m: float | None, entries: Sequence[Entry]) -> Measurement:
    first, last = entries[0], entries[-1]
    name = first.name if len(entries) == 1 else f"{first.name}..{last.path.name}"
    kind = labels_of(first).vehicle or ("scan" if len(entries) == 1 else "frames")
    files = tuple(entry.path for entry in entries)
    return Measurement(name, kind, at_m, files, () if ideal is None else (ideal,), _fault(first))
