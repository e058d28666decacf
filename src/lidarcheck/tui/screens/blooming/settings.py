"""The settings of each distance, edited by keys: those of the model's variant along the table's direction."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.lut import Axis
from lidarcheck.formats.settings import Setting, Settings, limits_of
from lidarcheck.session.settings_session import SettingsSession, left_behind, settings_path
from lidarcheck.tui.screens.blooming.editor import Editor
from lidarcheck.tui.widgets.lines import Line, line
from lidarcheck.tui.widgets.themes import Role

if TYPE_CHECKING:
    from lidarcheck.tui.screens.blooming.screen import Blooming

__all__ = ["SettingsEditor"]


class SettingsEditor(Editor[SettingsSession]):
    """One session for each variant and direction that was looked at; edits of the others stay where they are."""

    TYPED = "type a whole number first; a distance is in m"

    def __init__(self, view: Blooming) -> None:
        super().__init__(view)
        self.sessions: dict[Path, SettingsSession] = {}
        self.variant = ""
        self.fault = ""

    def find(self, variant: str, axis: Axis) -> None:
        """The settings of a variant along a direction; what is wrong with them is in `fault`."""
        if not variant:
            self.session, self.variant, self.fault = None, "", "no model, and so no variant"
            return
        project = self.view.host.project
        path = settings_path(project, axis, variant)
        if self.session is not None and self.session is self.sessions.get(path):
            return
        self.variant, self.session, self.fault = variant, None, ""
        self.at, self.marked, self.typed = 0, set(), ""
        try:
            if path not in self.sessions:
                self.sessions[path] = SettingsSession(path, project.root, axis)
            self.session = self.sessions[path]
        except LidarcheckError as error:
            self.fault = error.lines()[0].removeprefix("error: ")

    def look_back(self) -> None:
        """Offer edits that an earlier session did not save."""
        left = left_behind(self.view.host.project)
        if left is None or self.sessions:
            return
        self.find(left[1], left[0])
        if self.session is not None and self.session.found:
            self.view.host.show_screen(self.view.NAME)
            self.ask_back()

    def in_force(self) -> Settings | None:
        """What profiles are made with; None for the defaults."""
        return None if self.session is None else self.session.in_force

    def all_unsaved(self) -> int:
        """Values that are edited and not saved, of all variants and directions."""
        return sum(len(session.diff()) for session in self.sessions.values() if session.dirty)

    # What is shown

    def count(self) -> int:
        """The values of all distances."""
        return 0 if self.session is None else len(self.session.rows())

    def lines(self) -> tuple[str, list[Line], bool]:
        """Each value with its limits; below, what they are for."""
        if self.session is None:
            words = textwrap.wrap(self.view.host.inside(self.fault), 32)
            return "Settings", [line(f" {text}", "bad") for text in words], False
        self.within()
        session, here = self.session, self.view.plots.setting()
        rows = zip(session.rows(), session.edited(), strict=True)
        lines = [self._row(number, row, edited, here) for number, (row, edited) in enumerate(rows)]
        words = ["" if session.there else "no file: these are the defaults", self.view.plots.setting_in_words()]
        words += [] if lines else ["no distance: A adds one"]
        notes = [line(f" {text}", "dim") for text in words if text]
        title = f"Settings {session.axis} {self.variant}{' *' if session.dirty else ''}"
        return title, [*lines, *notes], bool(lines)

    def _row(self, number: int, row: tuple[Setting, str], edited: bool, here: Setting | None) -> Line:
        assert self.session is not None
        pointer, mark = ">" if number == self.at else " ", "*" if number in self.marked else " "
        value = f"{self.session.value(row):g}"
        if number == self.at and self.typed:
            value = f"{self.typed}_"
        low, high = limits_of(self.session.axis)[row[1]]
        behind = "<- here" if row[1] == "Distance" and row[0] == here else f"{low:g}..{high:g}"
        look: Role = "edited" if edited else "title" if row[1] == "Distance" else "text"
        name = row[1] if row[1] != "Distance" else "Distance [m]"
        return ((f"{pointer}{mark}{name:13}", look), (f"{value:>7}{'~' if edited else ' '} {behind}", look))

    def diff_lines(self) -> list[Line]:
        """Distance, key and value, before and after."""
        assert self.session is not None
        lines = [line(f"{'distance [m]':>12} {'setting':14}{'value':>9}{'new':>9}", "title")]
        for c in self.session.diff():
            old, new = ("-" if value is None else f"{value:g}" for value in (c.before, c.after))
            lines.append(line(f"{c.distance_m:>12g} {c.key:14}{old:>9}{new:>9}"))
        if not self.session.there:
            lines.append(line(f"{self.session.path.name} is made: the defaults with these changes"))
        return lines

    # Edits

    def enter(self, typed: str) -> None:
        """Values within their limits."""
        self.edit(lambda session: session.set(self.rows(), typed))

    def nudge(self, steps: int) -> None:
        """By whole steps."""
        self.edit(lambda session: session.nudge(self.rows(), steps))

    def smooth(self) -> None:
        """There is nothing to smooth."""
        self.view.say("settings are not smoothed")

    def add(self, typed: str | None) -> None:
        """Settings of a distance, as those of the nearest one."""
        if typed:
            self.edit(lambda session: session.add(typed))

    def remove(self) -> None:
        """No settings for the distance under the cursor."""
        if not self.count():
            self.view.say("there are no settings to take out")
            return
        self.edit(lambda session: session.remove(session.rows()[self.at][0].distance_m))
