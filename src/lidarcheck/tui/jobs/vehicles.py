"""The vehicle measurements of a project, by vehicle and variant, and their comparison with the simulated ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.errors import InputError, LidarcheckError
from lidarcheck.session.model_choice import likely_model, sensor_of_models, suits, which_model
from lidarcheck.session.node import ProgressCallback
from lidarcheck.session.pairing import (
    Labels,
    is_simulated,
    labels_of,
    measured_in,
    partner_of,
)
from lidarcheck.session.project import Entry, Project
from lidarcheck.tui.jobs.job import Computed, Job

if TYPE_CHECKING:
    from lidarcheck.calibration.vehicles.compare import VehicleComparison

__all__ = ["FILES", "Group", "Measurement", "groups_of", "job_of", "options_of", "source_of"]

FILES = "simulated files"
"""In the place of a model's name: what was simulated stands in files."""


@dataclass(frozen=True)
class Measurement:
    """A measured vehicle; `distance_m`: as the names say; `simulated`, `ideal`: None where no name fits."""

    name: str
    path: Path
    distance_m: float | None
    simulated: Path | None
    ideal: Path | None
    fault: str = ""

    def words(self) -> str:
        """Its distance, or its name where that says none."""
        return f"{self.distance_m:g} m" if self.distance_m is not None else Path(self.name).name


@dataclass(frozen=True)
class Group:
    """The measurements of a kind of vehicle with a variant, the nearest first."""

    labels: Labels
    measurements: tuple[Measurement, ...]

    @property
    def name(self) -> str:
        """As in the list."""
        return " ".join(filter(None, self.labels))

    def used(self, source: str) -> list[Measurement]:
        """Those that can be compared with the simulated files, or with what a model makes of the ideal scans."""
        return [m for m in self.measurements if not m.fault and (m.simulated if source == FILES else m.ideal)]


def groups_of(project: Project) -> list[Group]:
    """All vehicles in the order of their names."""
    from lidarcheck.calibration.vehicles.kinds import distance_in_name

    simulated = [entry for entry in project.of("scan") if is_simulated(entry)]
    ideals = project.of("ideal")
    found: dict[Labels, list[Measurement]] = {}
    for entry in measured_in(project, sound=False):
        labels = labels_of(entry)
        if not labels.vehicle:
            continue
        shown, ideal = partner_of(entry, simulated), partner_of(entry, ideals)
        distance = distance_in_name(entry.path) or (None if shown is None else distance_in_name(shown))
        one = Measurement(entry.name, entry.path, distance, shown, ideal, entry.fault)
        found.setdefault(labels, []).append(one)
    return [
        Group(labels, tuple(sorted(found[labels], key=lambda m: (m.distance_m is None, m.distance_m or 0.0, m.name))))
        for labels in sorted(found)
    ]


def options_of(group: Group, models: Sequence[Entry]) -> list[str]:
    """What a group can be compared with, the likeliest first: simulated files, where there are some, then models."""
    files = [FILES] if group.used(FILES) else []
    if not any(m.ideal for m in group.measurements):
        return files
    first = _likely(group, models)
    able = [entry.name for entry in models if suits(entry, group.labels.variant)]
    return files + sorted(able, key=lambda name: first is not None and name != first.name)


def source_of(group: Group, models: Sequence[Entry], chosen: str) -> str:
    """What it is compared with: as chosen, else simulated files, else the likely model; empty where none is."""
    options, likely = options_of(group, models), _likely(group, models)
    if chosen in options:
        return chosen
    return next((name for name in options if name == FILES or (likely is not None and name == likely.name)), "")


def _likely(group: Group, models: Sequence[Entry]) -> Entry | None:
    return likely_model(models, group.measurements[0].path.parent, group.labels.variant)


def job_of(group: Group, source: str, models: Sequence[Entry]) -> Job:
    """What the list has of a group; `source`: one of `options_of`, empty where there is none."""
    model = next((entry.path for entry in models if entry.name == source), None)
    meant = _likely(group, models)
    could = tuple(entry.path for entry in ([meant] if meant is not None else models))
    used = group.used(source)
    lacking = "no simulated file" if source == FILES else "no ideal scan"
    notes = tuple(
        f"left out: {m.name}: {m.fault or f'{lacking} is named like it'}" for m in group.measurements if m not in used
    )
    files = [path for m in used for path in (m.path, m.simulated if source == FILES else None, m.ideal)]
    at = ", ".join(m.words().removesuffix(" m") for m in used)
    return Job(
        name=group.name,
        words=f"at {at} m, {source if source == FILES else f'simulated with {source}'}" if used else "",
        files=tuple(path for path in (*files, model) if path is not None),
        compute=lambda on_progress: _compare(group.labels, used, source == FILES, model, could, on_progress),
        choices=source,
        fault="" if used and source else _why_not(group, models),
        notes=notes if used else (),
        kind="vehicles",
    )


def _why_not(group: Group, models: Sequence[Entry]) -> str:
    """Why nothing of a group can be compared."""
    faults = [m for m in group.measurements if m.fault]
    if len(faults) == len(group.measurements):
        return faults[0].fault
    if any(m.ideal and not m.fault for m in group.measurements):
        return f"there are ideal scans, but {which_model(models).removeprefix('there is ')}"
    first = next(m for m in group.measurements if not m.fault)
    return f"no simulated file or ideal scan is named like {first.name}"


def _compare(
    labels: Labels,
    used: Sequence[Measurement],
    files: bool,
    model: Path | None,
    models: Sequence[Path],
    on_progress: ProgressCallback,
) -> Computed:
    """Compare at each distance; one that has a fault is left out, and said. `models`: what may say what measured."""
    from lidarcheck.calibration.vehicles.compare import compare_vehicles, joined
    from lidarcheck.calibration.vehicles.kinds import vehicle_named
    from lidarcheck.calibration.vehicles.read import check_model, read_pair
    from lidarcheck.model import load_model

    kind, variant = vehicle_named(labels.vehicle), labels.variant or None
    sensor_model = None if model is None else load_model(model)
    check_model(sensor_model, variant)
    sensor = sensor_of_models(models)
    parts: list[VehicleComparison] = []
    done: list[Measurement] = []
    faults: list[tuple[Measurement, LidarcheckError]] = []
    for number, m in enumerate(used):
        on_progress(number, len(used), f"{m.words()}; compared")
        try:
            shown = m.simulated if files else None
            pair = read_pair(
                m.path,
                shown,
                m.ideal,
                sensor_model,
                distance_m=m.distance_m,
                variant=variant,
                number=number,
                sensor=sensor,
            )
            parts.append(compare_vehicles(kind, [pair]))
            done.append(m)
        except LidarcheckError as error:
            faults.append((m, error))
    if not parts:
        raise faults[0][1] if faults else InputError("there is nothing to compare")
    return _computed(joined(parts), done, faults, files, model)


def _computed(
    result: VehicleComparison,
    done: Sequence[Measurement],
    faults: Sequence[tuple[Measurement, LidarcheckError]],
    files: bool,
    model: Path | None,
) -> Computed:
    """The page as the command has it; what was left out comes first."""
    from lidarcheck.calibration.vehicles.read import provenance_of
    from lidarcheck.figures.data import Section
    from lidarcheck.figures.pages.vehicles import page

    shown = [m.simulated for m in done if m.simulated is not None] if files else []
    ideals = [m.ideal for m in done if m.ideal is not None]
    made = page(result, provenance_of([m.path for m in done], shown, ideals, model))
    if faults:
        words = tuple("; ".join(error.lines()).removeprefix("error: ") for _, error in faults)
        names = ", ".join(Path(m.name).name for m, _ in faults)
        sections = (Section("Left out", words), *made.sections)
        made = replace(made, summary=f"{made.summary} Left out: {names}.", sections=sections)
    return Computed(made, result.to_dict(), result)
