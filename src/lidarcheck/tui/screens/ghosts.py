"""Ghosts: signs and their ghosts at several ranges, how they are told from all else, and the fit of the effect."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from lidarcheck.errors import InputError, LidarcheckError, UsageError
from lidarcheck.figures.data import Cloud, Distribution
from lidarcheck.tui.jobs.ghosts import GHOST, GhostPage, ghost_jobs, sign_model, sign_scans
from lidarcheck.tui.jobs.job import Computed, Job
from lidarcheck.tui.screens.pages.lines import together
from lidarcheck.tui.screens.pages.screen import PageView
from lidarcheck.tui.screens.shared.view import MOVES, bindings
from lidarcheck.tui.widgets.dialogs import AskText

if TYPE_CHECKING:
    from lidarcheck.figures.data import Figure, Page
    from lidarcheck.figures.files.result_folder import Writer

__all__ = ["Ghosts"]

_BRIGHT = "ghosts.bright"
_MODEL_FILE, _DIRECTORY = "model.toml", "ghosts"
_MOST = 1e9


class Ghosts(PageView):
    """Datasets, all of them together, and the fit."""

    NAME = "ghosts"
    EMPTY = "no scans of signs: called as 1_25m.txt, or with sign or ghost in their name or directory"
    WORDS: ClassVar[dict[str, str]] = {
        "jobs": "Datasets: scans called as 1_25m.txt, or with sign or ghost in their name or directory; all of them "
        f"together; and the fit of {GHOST} to those that have an ideal scan (1_25m_ideal.txt). o chooses the model "
        "that simulates the same, the menu (m) has the least AREA of a sign's echo. Enter or r computes; what was "
        "computed is kept.",
        "words": "What was found: counts, where the ghost stands, ghost over sign in count, AREA, PEAK, range and "
        "size, what each step holds. The menu (m) has what writes signs and ghosts alone as PCD, of a fit the model.",
        "figures": "Histograms of sign and ghost, real against simulated, the course over the datasets. ] goes through "
        "the steps from all points to what is left, [ back; v looks from top, side and front.",
    }
    BINDINGS: ClassVar[list[Any]] = [*bindings("ghosts"), *MOVES]
    DEFAULT_CSS = "Ghosts #jobs { height: 7; }"

    def jobs(self) -> list[Job]:
        """All datasets, each, and the fit."""
        return ghost_jobs(self.host.project, self.host.choice.of("model"), self._bright())

    def _bright(self) -> float | None:
        try:
            return _least_of(self.host.state.selected.get(_BRIGHT, ""))
        except UsageError:  # somebody wrote in the state's file
            return None

    def groups(self, page: Page) -> list[tuple[Figure, ...]]:
        """Distributions and courses of a section together, clouds one by one."""
        most = self.board.room(4)
        found: list[tuple[Figure, ...]] = []
        for section in page.sections:
            for kind, figures in groupby(section.figures, type):
                found += together(list(figures), 1 if kind is Cloud else most if kind is Distribution else min(most, 2))
        return found

    def more_files(self, made: Computed, kind: str) -> Mapping[str, Writer]:
        """The stripped points, or the fitted model."""
        return _files(made.page) if isinstance(made.page, GhostPage) else {}

    def action_step(self, by: int) -> None:
        """From step to step of the extraction."""
        page = self.page
        groups = self.groups(page) if page is not None else []
        steps = [i for i, (first, *_) in enumerate(groups) if isinstance(first, Cloud) and ": step " in first.title]
        if not steps:
            self.say("the steps are on the page of a single dataset, once it is computed")
            return
        at = steps.index(self.turned) + by if self.turned in steps else 0 if by > 0 else -1
        self.turned = steps[at % len(steps)]
        self.draw()

    def action_model(self) -> None:
        """Another model; what was computed with this one is kept."""
        project, chosen = self.host.project, self.host.choice.of("model")
        self.next_model(sign_model(project, sign_scans(project), chosen), "real scans")

    def action_least(self) -> None:
        """Ask from what AREA on an echo is a sign's."""
        words = "Least AREA (or INTENSITY, ...) of a sign's echo; 0: by the sensor"
        self.host.ask(AskText(words, self.host.state.selected.get(_BRIGHT, "") or "0"), self._least)

    def _least(self, text: str | None) -> None:
        if text is None:
            return
        try:
            value = _least_of(text)
        except UsageError as error:
            self.say(error)
            return
        self.host.state.selected[_BRIGHT] = "" if value is None else f"{value:g}"
        self.say("bright by the sensor" if value is None else f"bright from {value:g}; r computes with it")
        self.project_changed()

    def action_strip(self) -> None:
        """Ask where to, then write."""
        page = self.page
        if not isinstance(page, GhostPage):
            self.say("nothing is computed here yet: r computes it")
            return
        what = "the stripped points (PCD)" if page.fitted is None else f"{_MODEL_FILE}, the model with the effect,"
        ask = AskText(f"Write {what} to which directory?", _DIRECTORY)
        self.host.ask(ask, lambda name: self._strip(page, name))

    def _strip(self, page: GhostPage, name: str | None) -> None:
        if not name:
            return
        try:
            written = _write(page, self.host.project.root / name)
        except LidarcheckError as error:
            self.say(error)
        else:
            self.say(f"{name}: {', '.join(written)} written")

    def action_fit(self) -> None:
        """The form of the fit."""
        self.host.commands.open("ghosts fit", self.NAME)


def _least_of(text: str) -> float | None:
    """A number above 0; None for 0 or nothing, by the sensor."""
    try:
        value = float(text or 0)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= _MOST:
        raise UsageError(f"{text} is no amplitude", fix=f"use a number above 0, up to {_MOST:g}, or 0 for the sensor's")
    return value or None


def _files(page: GhostPage) -> Mapping[str, Writer]:
    """What writes what the page leaves, by the name of its file."""
    from lidarcheck.calibration.ghosts.files import stripped_files
    from lidarcheck.model.files.write import write_model

    if page.fitted is not None and page.model is not None:
        return {_MODEL_FILE: partial(write_model, page.model, page.fitted)}
    return stripped_files(page.stripped, page.sensor)


def _write(page: GhostPage, directory: Path) -> list[str]:
    """What the page leaves, in files, all or none; their names. A file that is there is left as it is."""
    from lidarcheck.figures.files.sets import as_it_was

    files = _files(page)
    there = next((name for name in files if (directory / name).exists()), "")
    if there:
        raise InputError("is there already", file=directory / there, fix="name another directory")
    try:
        directory.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot be made: {error.strerror}", file=directory, fix="name another directory") from error
    with as_it_was([directory / name for name in files]):
        for name, write in files.items():
            write(directory / name)
    return list(files)
