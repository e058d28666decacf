"""The table of a LUT, edited by keys."""

from __future__ import annotations

from typing import Any

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.lut import Axis, LutTable
from lidarcheck.session.edited_file import journal_of
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.tui.screens.blooming.editor import Editing, Editor
from lidarcheck.tui.widgets.lines import Line, line
from lidarcheck.tui.widgets.themes import Role

__all__ = ["TableEditor"]

_AXES: tuple[Axis, Axis] = ("vertical", "horizontal")


class TableEditor(Editor[EditedLut]):
    """One of the tables of the LUT file that is open."""

    TYPED = "type a value first: 0 to 1000, or with a point a true Y"

    def __init__(self, view: Editing) -> None:
        super().__init__(view)
        self.axis: Axis = "vertical"

    def table(self, *, saved: bool = False) -> LutTable | None:
        """The table as it is edited, or as it was saved; None without a file."""
        if self.file is None:
            return None
        return (self.file.saved if saved else self.file.current).tables[self.axis]

    def names(self) -> list[str]:
        """The names of the project's sound LUT files."""
        return [entry.name for entry in self.view.host.project.of("lut")]

    def find(self) -> None:
        """Open what was open, or what an ended session left; keep that where it is still there."""
        if self.file is not None:
            return
        project, wanted, names = self.view.host.project, self.view.host.state.selected.get("lut", ""), self.names()
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
            self.file.close()
        self.file, self.marked, self.typed = file, set(), ""
        app.state.selected["lut"] = name
        wanted, tables = app.state.selected.get("axis", ""), file.current.tables
        self.axis = next((a for a in _AXES if a == wanted and a in tables), next(iter(tables)))
        row = app.state.selected.get("row", "")
        self.at = int(row) if first and row.isdigit() else 0
        for words in (file.notice, file.read_only):
            if words:
                self.view.say(words, bad=True)
        if file.found:
            app.show_screen(self.view.NAME)
            self.ask_back()

    def next_file(self) -> bool:
        """The next LUT file; whether there is one."""
        names = self.names()
        if self.file is None or len(names) < 2:
            self.view.say("there is no other LUT file")
            return False
        if self.file.dirty:
            self.view.say("save the edits first (^S), or take them back (u)", bad=True)
            return False
        now = self.view.host.state.selected.get("lut", "")
        self.open(names[(names.index(now) + 1) % len(names)] if now in names else names[0])
        return True

    # What is shown

    def count(self) -> int:
        """The rows of the table."""
        table = self.table()
        return 0 if table is None else len(table)

    def lines(self) -> tuple[str, list[Line], bool]:
        """X, scaled value and Y of each row."""
        table, saved = self.table(), self.table(saved=True)
        if self.file is None or table is None or saved is None:
            app = self.view.host
            words = [line(app.inside(e.fault), "bad") for e in app.project.of("lut", sound=False) if e.fault]
            return "Table", words or [line(" no LUT file in this project", "dim")], False
        self.within()
        title = f"{self.file.path.name} {self.axis}{' *' if self.file.dirty else ''}"
        rows = zip(table.rows(), saved.y.tolist(), strict=True)
        return title, [self._row(number, row, row.y != before) for number, (row, before) in enumerate(rows)], True

    def _row(self, number: int, row: Any, edited: bool) -> Line:
        mark = "*" if number in self.marked else " "
        pointer = ">" if number == self.at else " "
        look: Role = "edited" if edited else "text"
        scaled = f"{row.scaled:>6}"
        if number == self.at and self.typed:
            scaled = f"{self.typed + '_':>6}"
        return ((f"{pointer}{mark}{row.x:>8g}", "text"), (f"{scaled}{row.y:>12.7g}{'~' if edited else ' '}", look))

    def diff_lines(self) -> list[Line]:
        """Row, X, scaled value and Y, before and after."""
        assert self.file is not None
        head = f"{'table':11}{'row':>4}{'X':>9}{'scaled':>8}{'new':>6}{'Y':>13}{'new':>13}"
        lines = [line(head, "title")]
        for c in self.file.diff():
            old, new = c.scaled
            lines.append(line(f"{c.table:11}{c.row:>4}{c.x:>9g}{old:>8}{new:>6}{c.before:>13.7g}{c.after:>13.7g}"))
        return lines

    def under_cursor(self) -> str:
        """The row under the cursor in words, for where the table itself is not seen."""
        table = self.table()
        if table is None:
            return ""
        row = table.rows()[min(self.at, len(table) - 1)]
        return f"X = {row.x:g}: scaled {row.scaled}, Y = {row.y:.7g}"

    # Edits

    def enter(self, typed: str) -> None:
        """A scaled value or a true Y."""
        self.edit(lambda file: file.set(self.axis, self.rows(), typed))

    def nudge(self, steps: int) -> None:
        """Along the scale."""
        self.edit(lambda file: file.nudge(self.axis, self.rows(), steps))

    def smooth(self) -> None:
        """On the log scale."""
        self.edit(lambda file: file.smooth(self.axis, self.rows()))

    def read_again(self) -> None:
        """It may have other tables now."""
        if self.file is not None and self.axis not in self.file.current.tables:
            self.axis = next(iter(self.file.current.tables))
