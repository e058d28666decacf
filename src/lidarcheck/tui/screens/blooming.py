"""Blooming: the table of a LUT, edited by keys, beside its curve and the profile that it is expected to give."""

from __future__ import annotations

from typing import Any, ClassVar

from textual import events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.lut import Axis
from lidarcheck.tui.core.lut_session import LutSession
from lidarcheck.tui.core.places import key_of
from lidarcheck.tui.screens.base import bindings
from lidarcheck.tui.screens.blooming_file import LutFileView
from lidarcheck.tui.screens.blooming_plots import BloomingPlots
from lidarcheck.tui.themes import Role
from lidarcheck.tui.widgets.lines import Line, Lines, line

__all__ = ["Blooming"]

_TYPED = {**{digit: digit for digit in "0123456789e"}, "full_stop": "."}
_AXES: tuple[Axis, Axis] = ("vertical", "horizontal")


class Blooming(LutFileView):
    """The LUT editor and the profiles."""

    NAME = "blooming"
    WORDS: ClassVar[dict[str, str]] = {
        "table": "The table: X, Y as a whole number from 1 to 1000 on the log scale (0.007 decades a step; 0 is "
        "no light), "
        "and the true Y. '*' marks rows that edits are for; without any it is the row under the cursor. '~' "
        "stands behind "
        "what is edited and not saved. Type digits to set a scaled value, with a point (0.0125) a true Y; Enter "
        "sets it. "
        "Every edit is on the disk before you see it: after a lost connection the next start offers it again.",
        "curve": "The curve of the table on a log scale: the table as it is edited, as the disk has it, and the "
        "cursor.",
        "profile": "What was measured over the offset from the target, and what is expected, without noise, "
        "with the table "
        "as it is edited. It follows an edit by itself. n and p go to the next and previous distance.",
    }
    BINDINGS: ClassVar[list[Any]] = [
        *bindings("blooming"),
        *(Binding(key, f"move('{key}')", show=False) for key in ("up", "down", "pageup", "pagedown", "home", "end")),
        *(Binding(key, f"type('{character}')", show=False) for key, character in _TYPED.items()),
        Binding("backspace", "rub_out", show=False),
        Binding("escape", "drop", show=False),
    ]
    DEFAULT_CSS = (
        "Blooming #left { width: 34; } Blooming.narrow #right { display: none; } Blooming.narrow #left { width: 1fr; }"
    )

    def __init__(self) -> None:
        super().__init__(id=self.NAME)
        self.at = 0
        self.marked: set[int] = set()
        self.typed = ""
        self.plots = BloomingPlots(self)

    def compose(self) -> ComposeResult:
        """The table on the left, curve and profile on the right."""
        with Horizontal():
            with Vertical(id="left"):
                yield Lines("Table", label="t", id="table")
            with Vertical(id="right"):
                yield Lines("Curve", label="u", id="curve")
                yield Lines("Profile", label="p", id="profile")

    def on_mount(self) -> None:
        """Two clocks, which send nothing while nothing changes: a look at the file, and none else."""
        self.set_interval(2.0, self._look_at_disk)
        for name in ("curve", "profile"):
            self.query_one(f"#{name}", Lines).when_resized = self.plots.redraw

    def on_resize(self, event: events.Resize) -> None:
        """Without room for a plot the table has all of it."""
        self.set_class(event.size.width < 74, "narrow")
        self.plots.redraw()

    # What is shown

    def files(self) -> list[str]:
        """The names of the project's sound LUT files."""
        return [entry.name for entry in self.ours.project.of("lut")]

    def project_changed(self) -> None:
        """Open what was open, or what an ended session left; keep the session where its file is still there."""
        if self.session is None:
            left = self._left_behind()
            wanted = self.ours.state.selected.get("lut", "")
            names = self.files()
            if left or names:
                self._open(left or (wanted if wanted in names else names[0]))
        self.draw()

    def _left_behind(self) -> str:
        """A LUT whose journal is still there."""
        directory = self.ours.project.root / ".lidarcheck" / "tui"
        for entry in self.ours.project.of("lut"):
            if (directory / f"{key_of(entry.path)}.journal").exists():
                return entry.name
        return ""

    def _open(self, name: str) -> None:
        entry = next(entry for entry in self.ours.project.of("lut") if entry.name == name)
        try:
            session = LutSession(entry.path, self.ours.project.root)
        except LidarcheckError as error:
            self.say(error)
            return
        if self.session is not None:
            self.session.close()
        self.session, self.marked, self.typed = session, set(), ""
        self.ours.state.selected["lut"] = name
        wanted = self.ours.state.selected.get("axis", "")
        self.axis = next(
            (a for a in _AXES if a == wanted and a in session.current.tables), next(iter(session.current.tables))
        )
        self.at = int(self.ours.state.selected.get("row", "0") or 0) if not self.plots.shown_once else 0
        for words in (session.notice, session.read_only):
            if words:
                self.say(words, bad=True)
        self.plots.axis_changed()
        if session.found:
            self.ours.show_screen(self.NAME)
            self._ask_back()

    def opened(self) -> None:
        """The screen is seen: profiles are read now and not before."""
        self.plots.opened()
        self.draw()

    def unsaved(self) -> int:
        """Rows that are edited and not saved."""
        return len(self.session.diff()) if self.session and self.session.dirty else 0

    def draw(self) -> None:
        """The table; the plots follow when the hand rests."""
        pane = self.query_one("#table", Lines)
        if self.session is None:
            faults = [e for e in self.ours.project.of("lut", sound=False) if e.fault]
            words = [line(self.ours.inside(entry.fault), "bad") for entry in faults]
            pane.show(words or [line(" no LUT file in this project", "dim")], title="Table")
            return
        table, saved = self.session.current.tables[self.axis], self.session.saved.tables[self.axis]
        self.at = max(min(self.at, len(table) - 1), 0)
        self.marked &= set(range(len(table)))
        title = f"{self.session.path.name} {self.axis}{' *' if self.session.dirty else ''}"
        rows = zip(table.rows(), saved.y.tolist(), strict=True)
        lines = [self._row(number, row, row.y != before) for number, (row, before) in enumerate(rows)]
        pane.show(lines, title=title, cursor=self.at)
        self.plots.later()

    def _row(self, number: int, row: Any, edited: bool) -> Line:
        mark = "*" if number in self.marked else " "
        pointer = ">" if number == self.at else " "
        look: Role = "edited" if edited else "text"
        scaled = f"{row.scaled:>6}"
        if number == self.at and self.typed:
            scaled = f"{self.typed + '_':>6}"
        return ((f"{pointer}{mark}{row.x:>8g}", "text"), (f"{scaled}{row.y:>12.7g}{'~' if edited else ' '}", look))

    # Edits

    def rows(self) -> list[int]:
        """The rows that an edit is for."""
        return sorted(self.marked) or [self.at]

    def _edit(self, make: Any) -> None:
        """Do an edit; whatever speaks against it is one line."""
        if self.session is None:
            self.say("there is no LUT file")
            return
        if self.session.found:
            self._ask_back()
            return
        try:
            what = make(self.session)
        except LidarcheckError as error:
            self.say(error)
            return
        if what is False or what == "":
            self.say("nothing to take back" if what == "" else "no row changes")
        elif isinstance(what, str):
            self.say(what)
        self.draw()

    def action_type(self, character: str) -> None:
        """Digits type a value. They are bound as all keys are: fast typing must not overtake Enter."""
        if self.query_one("#table", Lines).has_focus and len(self.typed) < 12 and (character != "e" or self.typed):
            self.typed += character
            self.draw()

    def action_enter(self) -> None:
        """Set the typed value."""
        typed, self.typed = self.typed, ""
        if not typed:
            self.say("type a value first: 0 to 1000, or with a point a true Y")
            return
        self._edit(lambda session: session.set(self.axis, self.rows(), typed))
        self.draw()

    def action_rub_out(self) -> None:
        """The last digit."""
        self.typed = self.typed[:-1]
        self.draw()

    def action_drop(self) -> None:
        """What was typed, or the marks."""
        if self.typed:
            self.typed = ""
        else:
            self.marked.clear()
        self.draw()

    def action_nudge(self, steps: int) -> None:
        """Up or down the scale; within a typed number a minus belongs to it."""
        if self.typed.endswith("e") and steps == -1:
            self.typed += "-"
            self.draw()
            return
        self._edit(lambda session: session.nudge(self.axis, self.rows(), steps))

    def action_smooth(self) -> None:
        """Smooth the rows."""
        self._edit(lambda session: session.smooth(self.axis, self.rows()))

    def action_undo(self) -> None:
        """Take back."""
        self._edit(lambda session: f"taken back: {what}" if (what := session.undo()) else "")

    def action_redo(self) -> None:
        """Make again."""
        self._edit(lambda session: f"made again: {what}" if (what := session.redo()) else "")

    # The cursor and the marks

    def action_move(self, key: str) -> None:
        """The cursor, or the plot's pane has nothing to move."""
        rows, last = max(self.query_one("#table", Lines).rows, 1), 10**6
        steps = {"up": -1, "down": 1, "pageup": -rows, "pagedown": rows, "home": -last, "end": last}
        self.typed = ""
        self.at += steps[key]
        self.draw()

    def action_mark(self) -> None:
        """Mark the row, or not."""
        self.marked ^= {self.at}
        self.draw()

    def action_mark_and_move(self, by: int) -> None:
        """Mark while moving."""
        self.marked |= {self.at}
        self.at += by
        self.draw()
        self.marked |= {self.at}
        self.draw()

    def action_mark_all(self) -> None:
        """All, or none."""
        if self.session is not None:
            self.marked = set() if self.marked else set(range(len(self.session.current.tables[self.axis])))
            self.draw()

    # Other tables, files and datasets

    def action_next_table(self) -> None:
        """The other table of the file."""
        if self.session is None or len(self.session.current.tables) < 2:
            self.say("the file has one table")
            return
        self.axis = "horizontal" if self.axis == "vertical" else "vertical"
        self.at, self.marked, self.typed = 0, set(), ""
        self.plots.axis_changed()
        self.draw()

    def action_next_file(self) -> None:
        """The next LUT file; edits of this one stay in its journal until they are saved."""
        names = self.files()
        if self.session is None or len(names) < 2:
            self.say("there is no other LUT file")
            return
        if self.session.dirty:
            self.say("save the edits first (^S), or take them back (u)", bad=True)
            return
        now = self.ours.state.selected.get("lut", "")
        self._open(names[(names.index(now) + 1) % len(names)] if now in names else names[0])
        self.draw()

    def action_next_dataset(self, by: int) -> None:
        """The next distance."""
        self.plots.next_dataset(by)

    def action_next_model(self) -> None:
        """The next model."""
        self.plots.next_model()

    def action_next_target(self) -> None:
        """The next retro-reflector."""
        self.plots.next_target()

    def action_feature(self) -> None:
        """The next feature."""
        self.plots.next_feature()

    def closing(self) -> None:
        """Keep where the cursor was; the journal stays where there are edits."""
        self.ours.state.selected |= {"axis": self.axis, "row": str(self.at)}
        if self.session is not None:
            self.session.close()
