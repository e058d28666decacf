"""The datasets of signs and ghosts in a project, and the pages of one, of all together, and of the fit to them."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.effects import with_role
from lidarcheck.errors import InputError, LidarcheckError
from lidarcheck.figures.data import Page, Section
from lidarcheck.session.model_choice import chosen_model, models_of_sensor, sensor_of_models
from lidarcheck.session.node import ProgressCallback
from lidarcheck.session.pairing import NUMBER_AND_RANGE, ideal_of, labels_of, numbers_in
from lidarcheck.session.project import Entry, Project
from lidarcheck.tui.jobs.job import Computed, Job

if TYPE_CHECKING:
    from lidarcheck.calibration.ghosts.workflow import GhostScan
    from lidarcheck.model.spec import Model
    from lidarcheck.scan import IdealScan, Scan
    from lidarcheck.sensor import Sensor

__all__ = ["ALL", "FIT", "GHOST", "GhostPage", "SignScan", "ghost_jobs", "sign_model", "sign_scans"]

ALL, FIT = "all datasets", "fit"
_KIND = "ghosts"
GHOST = with_role("ghost").name
"""The effect that is fitted."""
_SIGN = re.compile(r"(?<![a-z])(?:sign|ghost)s?(?![a-z])", re.IGNORECASE)
_NOT = re.compile(r"_ghosts$|(?<![a-z])sim(?:ulated|ulation)?(?![a-z])", re.IGNORECASE)


@dataclass(frozen=True)
class SignScan:
    """A dataset: its scan and the ideal scan that belongs to it by its name; `fault`: why it cannot be read."""

    name: str
    path: Path
    ideal: Path | None
    fault: str = ""


@dataclass(frozen=True)
class GhostPage(Page):
    """`stripped`: by dataset signs and ghosts alone; `fitted`: the model of a fit, and the file that it began with.

    `sensor`: whose files the stripped scans are, a built-in one's where None.
    """

    stripped: Mapping[str, Scan] = field(default_factory=dict)
    fitted: Model | None = None
    model: Path | None = None
    sensor: Sensor | None = None


@dataclass(frozen=True)
class _Given:
    """What all jobs are computed with: the project's directory, the model's file, the least of a sign's echo."""

    root: Path
    model: Path | None
    bright: float | None
    models: tuple[Path, ...] = ()

    def inside(self, error: LidarcheckError) -> str:
        """An error in words, without the project's own path."""
        return Project(self.root).inside("; ".join(error.lines()).removeprefix("error: "))


def sign_scans(project: Project) -> list[SignScan]:
    """Scans with sign or ghost in their name or directory, and those called as 1_25m, in order of the numbers there."""
    ideals = project.of("ideal")
    found = [
        SignScan(entry.name, entry.path, ideal_of(entry, ideals), project.inside(entry.fault))
        for entry in project.of("scan", sound=False)
        if not _NOT.search(entry.path.stem) and (_SIGN.search(entry.name) or NUMBER_AND_RANGE.match(entry.path.stem))
    ]
    return sorted(found, key=lambda scan: numbers_in(scan.name))


def sign_model(project: Project, scans: Sequence[SignScan], wanted: str) -> Entry | None:
    """The model for all of them: that called `wanted`, else the likely one for the variant that all names agree on."""
    variants = {labels_of(Entry(scan.path, "scan", scan.name)).variant for scan in scans} - {""}
    beside = scans[0].path.parent if scans else project.root
    return chosen_model(project, wanted, beside, variants.pop() if len(variants) == 1 else "")


def ghost_jobs(project: Project, wanted: str, bright: float | None) -> list[Job]:
    """All datasets together, each, and the fit; `wanted`: the model's name, as it was chosen."""
    scans = sign_scans(project)
    if not scans:
        return []
    sound = [scan for scan in scans if not scan.fault]
    model = sign_model(project, scans, wanted)
    variants = {labels_of(Entry(scan.path, "scan", scan.name)).variant for scan in scans} - {""}
    variant = variants.pop() if len(variants) == 1 else ""
    models = models_of_sensor(project, wanted, scans[0].path.parent, variant)
    given = _Given(project.root, None if model is None else model.path, bright, models)
    name = "no model" if model is None else model.path.name
    name += "" if bright is None else f", bright from {bright:g}"
    every = [_all_job(scans, given, f"{len(sound)} of {len(scans)}, {name}")] if len(scans) > 1 else []
    return [*every, _fit_job(sound, given, name), *(_one_job(scan, given, name) for scan in scans)]


def _files(scans: Sequence[SignScan], given: _Given) -> tuple[Path, ...]:
    paths = (path for scan in scans for path in (scan.path, scan.ideal))
    return tuple(path for path in (*paths, given.model) if path is not None)


def _all_job(scans: Sequence[SignScan], given: _Given, words: str) -> Job:
    fault = "" if any(not scan.fault for scan in scans) else "no dataset that can be read"
    return Job(ALL, words, _files(scans, given), partial(_all_page, scans, given), given, fault, kind=_KIND)


def _one_job(scan: SignScan, given: _Given, model: str) -> Job:
    ideal = "no ideal scan" if scan.ideal is None else scan.ideal.name
    words = f"{ideal}, {model}"
    compute = partial(_find_page, [scan], given, steps=True)
    return Job(scan.name, words, _files([scan], given), compute, given, scan.fault, kind=_KIND)


def _fit_job(scans: Sequence[SignScan], given: _Given, model: str) -> Job:
    some = [scan for scan in scans if scan.ideal is not None]
    fault = ""
    if given.model is None:
        fault = "a fit needs a model: o chooses one"
    elif not some:
        fault = "a fit needs ideal scans, and no dataset has one: 1_25m_ideal.txt belongs to 1_25m.txt"
    words = f"{GHOST} to {len(some)} of {len(scans)} datasets, {model}"
    return Job(FIT, words, _files(some, given), partial(_fit_page, some, given), given, fault, kind=_KIND)


# Computing, in a thread


def _all_page(scans: Sequence[SignScan], given: _Given, on_progress: ProgressCallback) -> Computed:
    return _find_page(scans, given, on_progress, steps=False)


def _find_page(scans: Sequence[SignScan], given: _Given, on_progress: ProgressCallback, *, steps: bool) -> Computed:
    """What `lidarcheck ghosts find` computes; a dataset that shows no sign is left out and named, if another does."""
    from lidarcheck.calibration.ghosts.files import load_ghost_model
    from lidarcheck.figures.pages.ghosts import find_document, find_page

    model = None if given.model is None else load_ghost_model(given.model)
    sensor = sensor_of_models(given.models) if model is None else model.sensor
    found, used, ideals, words = [], [], [], []
    for i, (scan, name) in enumerate(zip(scans, _names(scans), strict=True)):
        on_progress(i, len(scans), name)
        try:
            one, ideal = _found(scan, name, model, given.bright, sensor)
        except LidarcheckError as error:
            if len(scans) == 1:
                raise
            words.append(f"Left out: {given.inside(error)}")
            continue
        found.append(one)
        used.append(scan)
        ideals.append(ideal)
    if not found:
        raise InputError(f"no dataset shows a sign. {' '.join(words)}", fix="see each of them for itself")
    simulated, why = _simulated(found, ideals, model, given, on_progress)
    page = find_page(found, simulated, _provenance("find", used, given, bool(simulated)), steps=steps)
    shown = _page(page, (*words, *why), {one.name: one.stripped() for one in found}, sensor)
    return Computed(shown, {"datasets": find_document(found), "simulated": find_document(simulated)})


def _names(scans: Sequence[SignScan]) -> list[str]:
    from lidarcheck.calibration.ghosts.files import dataset_names

    return dataset_names([scan.path for scan in scans])


def _found(
    scan: SignScan, name: str, model: Model | None, bright: float | None, sensor: Sensor | None
) -> tuple[GhostScan, IdealScan | None]:
    from lidarcheck.calibration.ghosts.files import find_in
    from lidarcheck.formats import load_ideal

    if scan.fault:
        raise InputError(scan.fault)
    ideal = load_ideal(scan.ideal, sensor) if scan.ideal is not None and model is not None else None
    return find_in(scan.path, name, ideal=ideal, model=model, bright=bright, sensor=sensor), ideal


def _simulated(
    found: Sequence[GhostScan],
    ideals: Sequence[IdealScan | None],
    model: Model | None,
    given: _Given,
    on_progress: ProgressCallback,
) -> tuple[list[GhostScan], tuple[str, ...]]:
    """The same of the model, one for each dataset, or none and why."""
    from lidarcheck.calibration.ghosts.files import find_simulated

    if model is None:
        return [], ("Not compared with a model: none is chosen.",)
    others: list[GhostScan] = []
    for i, (one, ideal) in enumerate(zip(found, ideals, strict=True)):
        if ideal is None:
            return [], (f"Not compared with the model: {one.name} has no ideal scan.",)
        on_progress(i, len(found), f"simulating {one.name}")
        try:
            others.append(find_simulated(one, ideal, model, bright=given.bright))
        except InputError as error:
            return [], (f"Not compared with the model: {given.inside(error)}",)
    return others, ()


def _page(page: Page, words: Sequence[str], stripped: Mapping[str, Scan], sensor: Sensor | None) -> GhostPage:
    first, *rest = page.sections
    sections: tuple[Section, ...] = (replace(first, words=(*first.words, *words)), *rest)
    return GhostPage(page.title, page.summary, sections, page.provenance, stripped, sensor=sensor)


def _fit_page(scans: Sequence[SignScan], given: _Given, on_progress: ProgressCallback) -> Computed:
    """What `lidarcheck ghosts fit` computes; every dataset must show the sign of its ideal scan."""
    from lidarcheck.calibration.ghosts.data import check_fit
    from lidarcheck.calibration.ghosts.files import find_simulated, load_ghost_model
    from lidarcheck.calibration.ghosts.fit import fit_ghosts
    from lidarcheck.figures.pages.ghost_fit import fit_document, fit_page

    assert given.model is not None
    model, found, ideals = load_ghost_model(given.model), [], []
    check_fit(model)
    for i, (scan, name) in enumerate(zip(scans, _names(scans), strict=True)):
        on_progress(i, 2 * len(scans) + 1, name)
        one, ideal = _found(scan, name, model, given.bright, model.sensor)
        assert ideal is not None
        found.append(one)
        ideals.append(ideal)
    on_progress(len(scans), 2 * len(scans) + 1, "fitting")
    fitted = fit_ghosts(found, ideals, model)
    others = []
    for i, (one, ideal) in enumerate(zip(found, ideals, strict=True)):
        on_progress(len(scans) + 1 + i, 2 * len(scans) + 1, f"simulating {one.name}")
        others.append(find_simulated(one, ideal, fitted.model, bright=given.bright))
    page = fit_page(fitted, others, _provenance("fit", scans, given, True))
    shown = GhostPage(page.title, page.summary, page.sections, page.provenance, fitted=fitted.model, model=given.model)
    return Computed(shown, fit_document(fitted))


def _provenance(command: str, scans: Sequence[SignScan], given: _Given, ideals: bool) -> dict[str, str]:
    """The files, and the command that computes the same."""
    ideal = [str(scan.ideal) for scan in scans if scan.ideal is not None] if ideals else []
    model = [str(given.model)] if given.model is not None and ideals else []
    words = ["lidarcheck", "ghosts", command, *(str(scan.path) for scan in scans)]
    words += ["--ideal", *ideal] if ideal else []
    words += ["--model", *model] if model else []
    sensor = None if model else sensor_of_models(given.models)
    words += ["--sensor", sensor.variant] if sensor is not None else []
    words += ["--bright", f"{given.bright:g}"] if given.bright is not None else []
    said = {"scans": ", ".join(str(scan.path) for scan in scans), "ideal scans": ", ".join(ideal)}
    said |= {"model": ", ".join(model), "seed": "0" if ideals else "", "command": shlex.join(words)}
    return {name: text for name, text in said.items() if text}
