"""The settings of each distance, edited by keys: those of the model's variant along the table's direction."""

from __future__ import annotations

import textwrap
from pathlib import Path

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.lut import Axis
from lidarcheck.formats.settings import Setting, Settings, limits_of
from lidarcheck.session.edited_settings import EditedSettings, left_behind, settings_path
from lidarcheck.tui.screens.blooming.editor import Editing, Editor
from lidarcheck.tui.widgets.lines import Line, line
from lidarcheck.tui.widgets.themes import Role

__all__ = ["SettingsEditor"]


class SettingsEditor(Editor[EditedSettings]):
    """One open file for each variant and direction that was looked at; edits of the others stay where they are."""

    TYPED = "type a whole number first; a distance is in m"

    def __init__(self, view: Editing) -> None:
        super().__init__(view)
        self.files: dict[Path, EditedSettings] = {}
        self.variant = ""
        self.fault = ""

    def find(self, variant: str, axis: Axis) -> None:
        """The settings of a variant along a direction; what is wrong with them is in `fault`."""
        if not variant:
            self.file, self.variant, self.fault = None, "", "no model, and so no variant"
            return
        project = self.view.host.project
        path = settings_path(project, axis, variant)
        if self.file is not None and self.file is self.files.get(path):
            return
        self.variant, self.file, self.fault = variant, None, ""
        self.at, self.marked, self.typed = 0, set(), ""
        try:
            if path not in self.files:
                self.files[path] = EditedSettings(path, project.root, axis)
                self.view.host.session.hold(self.files[path])
            self.file = self.files[path]
        except LidarcheckError as error:
            self.fault = error.lines()[0].removeprefix("error: ")

    def look_back(self) -> None:
        """Offer edits that an earlier session did not save."""
        left = left_behind(self.view.host.project)
        if left is None or self.files:
            return
        self.find(left[1], left[0])
        if self.file is not None and self.file.found:
            self.view.host.show_screen(self.view.NAME)
            self.ask_back()

    def in_force(self) -> Settings | None:
        """What profiles are made with, those of the baseline while that is shown; None for the defaults."""
        if self.file is None:
            return None
        shown = self.view.host.session.content_shown(self.file)
        return self.file.in_force if shown == self.file.content else self.file.parsed(shown)

    def all_unsaved(self) -> int:
        """Values that are edited and not saved, of all variants and directions."""
        return sum(len(file.diff()) for file in self.files.values() if file.dirty)

    # What is shown

    def count(self) -> int:
        """The values of all distances."""
        return 0 if self.file is None else len(self.file.rows())

    def lines(self) -> tuple[str, list[Line], bool]:
        """Each value with its limits; below, what they are for."""
        if self.file is None:
            words = textwrap.wrap(self.view.host.inside(self.fault), 32)
            return "Settings", [line(f" {text}", "bad") for text in words], False
        self.within()
        file, here = self.file, self.view.setting()
        rows = zip(file.rows(), file.edited(), strict=True)
        lines = [self._row(number, row, edited, here) for number, (row, edited) in enumerate(rows)]
        words = ["" if file.there else "no file: these are the defaults", self.view.setting_in_words()]
        words += [] if lines else ["no distance: i adds one"]
        notes = [line(f" {text}", "dim") for text in words if text]
        title = f"Settings {file.axis} {self.variant}{' *' if file.dirty else ''}"
        return title, [*lines, *notes], bool(lines)

    def _row(self, number: int, row: tuple[Setting, str], edited: bool, here: Setting | None) -> Line:
        assert self.file is not None
        pointer, mark = ">" if number == self.at else " ", "*" if number in self.marked else " "
        value = f"{self.file.value(row):g}"
        if number == self.at and self.typed:
            value = f"{self.typed}_"
        low, high = limits_of(self.file.axis)[row[1]]
        behind = "<- here" if row[1] == "Distance" and row[0] == here else f"{low:g}..{high:g}"
        look: Role = "edited" if edited else "title" if row[1] == "Distance" else "text"
        name = row[1] if row[1] != "Distance" else "Distance [m]"
        return ((f"{pointer}{mark}{name:13}", look), (f"{value:>7}{'~' if edited else ' '} {behind}", look))

    def all_files(self) -> list[EditedSettings]:
        """Those of all variants and directions that were looked at."""
        return list(self.files.values())

    def diff_lines(self, file: EditedSettings) -> list[Line]:
        """Distance, key and value, before and after."""
        lines = [line(f"{'distance [m]':>12} {'setting':14}{'value':>9}{'new':>9}", "title")]
        for c in file.diff():
            old, new = ("-" if value is None else f"{value:g}" for value in (c.before, c.after))
            lines.append(line(f"{c.distance_m:>12g} {c.key:14}{old:>9}{new:>9}"))
        if not file.there:
            lines.append(line(f"{file.path.name} is made: the defaults with these changes"))
        return lines

    # Edits

    def enter(self, typed: str) -> None:
        """Values within their limits."""
        self.edit(lambda file: file.set(self.rows(), typed))

    def nudge(self, steps: int) -> None:
        """By whole steps."""
        self.edit(lambda file: file.nudge(self.rows(), steps))

    def smooth(self) -> None:
        """There is nothing to smooth."""
        self.view.say("settings are not smoothed")

    def add(self, typed: str | None) -> None:
        """Settings of a distance, as those of the nearest one."""
        if typed:
            self.edit(lambda file: file.add(typed))

    def remove_rows(self) -> None:
        """No settings for the distance under the cursor."""
        if not self.count():
            self.view.say("there are no settings to take out")
            return
        self.edit(lambda file: file.remove(file.rows()[self.at][0].distance_m))
