"""The table of a LUT, edited by keys."""

from __future__ import annotations

import os
from typing import Any

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.lut import Axis, LutTable
from lidarcheck.session.edited_file import journal_of
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.tui.runs.taking import lut_change_lines
from lidarcheck.tui.screens.blooming.editor import Editing, Editor
from lidarcheck.tui.widgets.lines import Line, line
from lidarcheck.tui.widgets.themes import Role

__all__ = ["X_COLUMNS", "TableEditor"]

X_COLUMNS = 11
"""Of a line of the table those up to the end of X."""

_AXES: tuple[Axis, Axis] = ("vertical", "horizontal")


class TableEditor(Editor[EditedLut]):
    """One of the tables of the LUT file that is open."""

    TYPED = "type a value first: 0 to 1000, or with a point a true Y"

    def __init__(self, view: Editing) -> None:
        super().__init__(view)
        self.axis: Axis = "vertical"
        self._wanted: dict[tuple[str, str], LutTable] = {}

    def table(self, *, saved: bool = False) -> LutTable | None:
        """The table as it is edited, or as it was saved; None without a file."""
        if self.file is None:
            return None
        return (self.file.saved if saved else self.file.current).tables.get(self.axis)

    def shown(self) -> LutTable | None:
        """The table that plots show: as it is edited, or as it was at the baseline."""
        if self.file is None or not self.view.host.session.shows_baseline:
            return self.table()
        content = self.view.host.session.content_shown(self.file)
        return self.file.parsed(content).tables.get(self.axis)

    def wanted(self) -> LutTable | None:
        """What a fit wants the table to be, until that is taken over; None without."""
        return None if self.file is None else self._wanted.get((os.path.realpath(self.file.path), self.axis))

    def want(self, table: LutTable | None) -> None:
        """Show this table as the one that is wanted, or none."""
        assert self.file is not None
        self._wanted.pop((os.path.realpath(self.file.path), self.axis), None)
        if table is not None:
            self._wanted[os.path.realpath(self.file.path), self.axis] = table

    def names(self) -> list[str]:
        """The names of the project's sound LUT files."""
        return [entry.name for entry in self.view.host.project.of("lut")]

    def find(self) -> None:
        """Open what was open, or what an ended session left; keep that where it is still there."""
        if self.file is not None:
            return
        project, wanted, names = self.view.host.project, self.view.host.choice.of("lut"), self.names()
        left = (entry.name for entry in project.of("lut") if journal_of(entry.path, project.root).exists())
        usual = [wanted if wanted in names else names[0]] if names else []
        name = next(iter([*left, *usual]), "")
        if name:
            self.open(name)

    def open(self, name: str) -> None:
        """Open a LUT file of the project."""
        app = self.view.host
        entry = next(entry for entry in app.project.of("lut") if entry.name == name)
        try:
            file = EditedLut(entry.path, app.project.root)
        except LidarcheckError as error:
            self.view.say(error)
            return
        first = self.file is None
        if self.file is not None:
            app.session.drop(self.file)
            self.file.close()
        self.file, self.marked, self.typed = file, set(), ""
        app.session.hold(file)
        wanted, tables = app.choice.of("axis"), file.current.tables
        self.axis = next((a for a in _AXES if a == wanted and a in tables), next(iter(tables)))
        app.choice.choose("axis", self.axis)
        app.choice.choose("lut", name)
        row = app.state.selected.get("row", "")
        self.at = int(row) if first and row.isdigit() else 0
        for words in (file.notice, file.read_only):
            if words:
                self.view.say(words, bad=True)
        if file.found:
            app.show_screen(self.view.NAME)
            self.ask_back()

    def go_to(self, name: str) -> None:
        """Open a LUT file, unless it is open."""
        now = self.file.path if self.file is not None else None
        if next((entry.path for entry in self.view.host.project.of("lut") if entry.name == name), None) == now:
            return
        if self.file is not None and self.file.dirty:
            self.view.say("save the edits first (^S), or take them back (u)", bad=True)
            return
        self.open(name)

    def next_file(self) -> bool:
        """The next LUT file; whether there is one."""
        names = self.names()
        if self.file is None or len(names) < 2:
            self.view.say("there is no other LUT file")
            return False
        if self.file.dirty:
            self.view.say("save the edits first (^S), or take them back (u)", bad=True)
            return False
        now = self.view.host.choice.of("lut")
        self.open(names[(names.index(now) + 1) % len(names)] if now in names else names[0])
        return True

    # What is shown

    def count(self) -> int:
        """The rows of the table."""
        table = self.table()
        return 0 if table is None else len(table)

    def lines(self) -> tuple[str, list[Line], bool]:
        """X, scaled value and Y of each row."""
        table = self.table()
        if self.file is None or table is None:
            app = self.view.host
            words = [line(app.inside(e.fault), "bad") for e in app.project.of("lut", sound=False) if e.fault]
            return "Table", words or [line(" no LUT file in this project", "dim")], False
        self.within()
        title = f"{self.file.path.name} {self.axis}{' *' if self.file.dirty else ''}"
        rows = zip(table.rows(), self.file.edited(self.axis), strict=True)
        return title, [self._row(number, row, edited) for number, (row, edited) in enumerate(rows)], True

    def _row(self, number: int, row: Any, edited: bool) -> Line:
        mark = "*" if number in self.marked else " "
        pointer = ">" if number == self.at else " "
        look: Role = "edited" if edited else "text"
        here = number == self.at
        x, scaled = (
            f"{self.typed if here and chosen and self.typed else value:>{width}}{'_' if here and chosen else ' '}"
            for value, width, chosen in ((f"{row.x:g}", 8, self.on_x), (row.scaled, 6, not self.on_x))
        )
        return (
            (f"{pointer}{mark}{x}", look if self.on_x else "text"),
            (f"{scaled}{row.y:>11.7g}", look),
            ("~" if edited else " ", look),
        )

    def diff_lines(self, file: EditedLut) -> list[Line]:
        """Row, X, scaled value and Y, before and after."""
        return lut_change_lines(file.diff())

    def under_cursor(self) -> str:
        """The row under the cursor in words, for where the table itself is not seen."""
        table = self.table()
        if table is None:
            return ""
        row = table.rows()[min(self.at, len(table) - 1)]
        return f"X = {row.x:g}: scaled {row.scaled}, Y = {row.y:.7g}"

    # Edits

    def enter(self, typed: str) -> None:
        """A scaled value or a true Y; or the X of the row under the cursor."""
        if self.on_x:
            self.edit(lambda file: file.set_x(self.axis, self.at, typed))
        else:
            self.edit(lambda file: file.set(self.axis, self.rows(), typed))

    def choose_cell(self, x: bool) -> None:
        """X or Y is typed next."""
        self.on_x, self.typed = x, ""

    def add_row(self) -> None:
        """A row after this one, which the cursor goes to."""
        before = self.count()
        self.edit(lambda file: file.insert(self.axis, self.at))
        if self.count() > before:
            self.at, self.marked = self.at + 1, set()

    def remove_rows(self) -> None:
        """Without the marked rows, or the one under the cursor."""
        before = self.count()
        self.edit(lambda file: file.remove(self.axis, self.rows()))
        if self.count() < before:
            self.marked = set()

    def nudge(self, steps: int) -> None:
        """Along the scale; X has none, and a minus begins what is typed."""
        if self.on_x:
            self.view.say("X is typed: + and - move Y, Right goes to it")
            return
        self.edit(lambda file: file.nudge(self.axis, self.rows(), steps))

    def smooth(self) -> None:
        """On the log scale."""
        self.edit(lambda file: file.smooth(self.axis, self.rows()))

    def read_again(self) -> None:
        """It may have other tables now."""
        if self.file is not None and self.axis not in self.file.current.tables:
            self.axis = next(iter(self.file.current.tables))
