"""The panels of a project: which files are frames of one hall, and the page of what they show."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.figures.data import Figure, Page, Table
from lidarcheck.formats.table import counted
from lidarcheck.session.model_choice import chosen_model, models_of_sensor, sensor_of_models
from lidarcheck.session.node import ProgressCallback
from lidarcheck.session.pairing import ideal_of, labels_of, numbers_in
from lidarcheck.session.project import Entry, Project
from lidarcheck.tui.jobs.job import Computed, Job

if TYPE_CHECKING:
    from lidarcheck.calibration.panels.workflow import PanelsResult

__all__ = ["Hall", "NoisePage", "halls_of", "noise_jobs"]

_NUMBERED = re.compile(r"^(.*?)[ _.-]*\d+$")
_HALL = re.compile(r"panel|(?<![a-z])(?:lab|hall)(?![a-z])", re.IGNORECASE)
_MADE = re.compile(r"^panel_\d+_(?:real|simulated)$", re.IGNORECASE)
"""The echoes of a single panel, as `lidarcheck panels` writes them."""
_SIMULATED = re.compile(r"(?<![a-z])sim(?:ulated|ulation)?(?![a-z])", re.IGNORECASE)
_SIDE = re.compile(
    r"(?<![a-z])(?:sim(?:ulated|ulation)?|real|measured|frames?|scans?)(?![a-z])|[^a-z0-9]+", re.IGNORECASE
)


@dataclass(frozen=True)
class Hall:
    """Frames of one scene. `variant`: as their names say; `ideals`: one for all frames or one for each; `faults`: of
    the files that were left out.
    """

    name: str
    variant: str
    frames: tuple[Path, ...]
    ideals: tuple[Path, ...] = ()
    simulated: tuple[Path, ...] = ()
    faults: tuple[str, ...] = ()


@dataclass(frozen=True)
class NoisePage(Page):
    """`panels`: a line for each panel; `own`: the figures of each; `over_all`: those of all panels together."""

    panels: Table | None = None
    own: tuple[tuple[Figure, ...], ...] = ()
    over_all: tuple[Figure, ...] = ()


def halls_of(project: Project) -> list[Hall]:
    """Scans of one directory whose names differ by the number at their end, and single ones called panel, lab, hall."""
    groups: dict[tuple[Path, str], list[Entry]] = {}
    for entry in project.of("scan", sound=False):
        if not _MADE.match(entry.path.stem):
            groups.setdefault((entry.path.parent, _without_number(entry.path)), []).append(entry)
    wanted = {key: some for key, some in groups.items() if len(some) > 1 or _HALL.search(some[0].name)}
    real = {key: some for key, some in wanted.items() if not _SIMULATED.search(key[1])}
    made = {key: some for key, some in groups.items() if _SIMULATED.search(key[1])}
    halls = []
    for (directory, stem), entries in real.items():
        entries.sort(key=lambda entry: numbers_in(entry.name))
        sound = [entry for entry in entries if not entry.fault]
        others = [some for (place, name), some in made.items() if place == directory and _alike(name, stem, len(real))]
        simulated = sorted((e for some in others for e in some if not e.fault), key=lambda e: numbers_in(e.name))
        name = (directory / stem).relative_to(project.root).as_posix()
        ideals = _ideals(project, sound, directory, stem)
        faults = tuple(project.inside(entry.fault) for entry in entries if entry.fault)
        variant = labels_of(entries[0]).variant
        halls.append(Hall(name, variant, _paths(sound), ideals, _paths(simulated), faults))
    return sorted(halls, key=lambda hall: numbers_in(hall.name))


def _without_number(path: Path) -> str:
    """A name without the number at its end: frames differ by it. A distance, as 25m, is none."""
    numbered = _NUMBERED.match(path.stem)
    return numbered[1] if numbered and numbered[1] else path.stem


def _alike(simulated: str, real: str, halls: int) -> bool:
    """Whether names differ only by words as `sim` and `real`; a bare `sim` belongs to the only hall."""
    one, other = (_SIDE.sub("", name.lower()) for name in (simulated, real))
    return one == other or (not one and halls == 1)


def _paths(entries: Sequence[Entry]) -> tuple[Path, ...]:
    return tuple(entry.path for entry in entries)


def _ideals(project: Project, frames: Sequence[Entry], directory: Path, stem: str) -> tuple[Path, ...]:
    """An ideal scan for each frame by its name; else the only one of the directory, or the one named as the frames."""
    ideals = [entry for entry in project.of("ideal") if entry.path.parent == directory]
    each = [ideal_of(frame, ideals) for frame in frames]
    found = tuple(path for path in each if path is not None)
    if found and len(found) == len(each):
        return found
    named = [entry for entry in ideals if _SIDE.sub("", stem.lower()) in _SIDE.sub("", entry.path.stem.lower())]
    return next((_paths(some) for some in (ideals, named) if len(some) == 1), ())


def noise_jobs(project: Project, wanted: str) -> list[Job]:
    """A job for each hall; `wanted`: the model's name, as it was chosen."""
    return [_job(project, hall, wanted) for hall in halls_of(project)]


def _job(project: Project, hall: Hall, wanted: str) -> Job:
    directory = (project.root / hall.name).parent
    model = chosen_model(project, wanted, directory, hall.variant) if hall.ideals else None
    given = "" if model is None else model.name
    frames = counted(len(hall.frames), "frame") + (f" ({len(hall.faults)} left out)" if hall.faults else "")
    ideal = hall.ideals[0].name if len(hall.ideals) == 1 else "an ideal scan each"
    side = Path(given).name if given else counted(len(hall.simulated), "simulated frame") if hall.simulated else ""
    words = [frames, ideal if hall.ideals else "no ideal scan, so no model", side]
    path = None if model is None else model.path
    models = (path,) if path else models_of_sensor(project, wanted, directory, hall.variant)
    return Job(
        name=hall.name,
        words=", ".join(word for word in words if word),
        files=(*hall.frames, *hall.ideals, *hall.simulated, *([path] if path else [])),
        compute=partial(_page, hall, path, models),
        choices=given,
        fault="" if hall.frames else "; ".join(hall.faults),
        notes=tuple(f"left out: {fault}" for fault in hall.faults),
        kind="panels",
    )


def _page(hall: Hall, model: Path | None, models: tuple[Path, ...], on_progress: ProgressCallback) -> Computed:
    """What `lidarcheck panels` computes of the same files; `models`: those that say what measured."""
    from lidarcheck.calibration.panels.files import arrangements_of, provenance
    from lidarcheck.calibration.panels.workflow import characterise
    from lidarcheck.figures.pages.panels import document, page
    from lidarcheck.model import load_model

    sensor_model = None if model is None else load_model(model)
    sensor = sensor_of_models(models) if sensor_model is None else sensor_model.sensor
    names = {} if sensor_model is None else {n: material.name for n, material in sensor_model.materials.items()}
    simulated = [] if model is not None else list(hall.simulated)
    if len(hall.ideals) > 1 and len(simulated) != len(hall.ideals):
        simulated = []
    arrangements = arrangements_of(hall.frames, list(hall.ideals), simulated, sensor_model, 0, sensor=sensor)
    result = characterise(arrangements, materials=names, sensor=sensor, progress=on_progress)
    origin = {"measured": hall.frames, "ideal": hall.ideals, "simulated": simulated, "model": [model] if model else []}
    options = [word for kind, paths in list(origin.items())[1:] if paths for word in (f"--{kind}", *map(str, paths))]
    options += ["--sensor", sensor.variant] if sensor is not None and model is None else []
    command = shlex.join(["lidarcheck", "panels", *map(str, hall.frames), *options, "--out", "DIRECTORY"])
    shown = _laid_out(page(result, provenance(origin, command, None if model is None else 0)), result)
    return Computed(shown, document(result))


def _laid_out(page: Page, result: PanelsResult) -> NoisePage:
    from lidarcheck.figures.pages.panel_tables import overview

    first, second = page.sections[:2]
    own = tuple(section.figures for section in page.sections[2 : 2 + len(result.panels)])
    figures = (*second.figures, *first.figures)
    return NoisePage(page.title, page.summary, page.sections, page.provenance, overview(result), own, figures)
