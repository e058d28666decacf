"""Overview: what is measured with its number, what each edit did, scenarios with verdicts and KPIs, files at fault."""

from __future__ import annotations

from typing import Any, ClassVar

from textual import events
from textual.app import ComposeResult
from textual.containers import Vertical

from lidarcheck.formats.table import counted
from lidarcheck.session.measurements import Measurement
from lidarcheck.tui.screens.overview.measured import detail, edit_lines, measured_lines, screen_of, summary
from lidarcheck.tui.screens.overview.scenarios import Scenarios
from lidarcheck.tui.screens.shared.view import MOVES, bindings
from lidarcheck.tui.widgets.lines import Lines, cursor_after, line

__all__ = ["Overview"]

_NOTHING = "no scan or profile was measured here: see docs/own-recording.md"
_WIDE, _TALL = 120, 30


class Overview(Scenarios):
    """The first screen. `check` stands in for the harness's in tests."""

    NAME = "overview"
    WORDS: ClassVar[dict[str, str]] = {
        "measured": "Every measurement with its number: how far what was measured is from what the model shows, in "
        "standard deviations of one beam. Of an edit of blooming tables that is the misfit of the target's profile, "
        "of all else the gap that explain prints. 'edit': what the last step changed, 'start': what has changed since "
        "the interface was started. r computes the number again, R whole frames of all with 64 seeds, Enter goes to "
        "the screen that shows the measurement, n and p to the next distance, B makes what is set now the baseline.",
        "edits": "The edits of this session, the last one first, with the number after each and its change; from 120 "
        "columns on the change at each distance.",
        "scenarios": "Every scenario with the verdict of its last run against its golden, and files that have a fault. "
        "'changed' moved within what does not matter; 'fell out' fails the gate. Behind it stands whether that is of "
        "what is set: OLD, where the scenario, its golden, the model or a table has changed since; 'saved model', "
        "where edits that are not saved are not in it.",
        "kpis": "The KPIs of the scenario: the golden's value, the last run's, how far it moved over the "
        "tolerance, the "
        "tolerance, the smallest change that would be caught, and the absolute limits.",
    }
    BINDINGS: ClassVar[list[Any]] = [*bindings("overview"), *MOVES]
    DEFAULT_CSS = """
    Overview #lists { layout: vertical; height: 1fr; }
    Overview #measured { height: 11; max-height: 11; }
    Overview #edits { height: 4; dock: bottom; }
    Overview #kpis { height: 9; dock: bottom; display: none; }
    Overview.verdicts #measured { max-height: 6; }
    Overview.verdicts #edits { display: none; }
    Overview.verdicts #kpis { display: block; }
    Overview.wide #lists { layout: grid; grid-size: 2; grid-gutter: 0 1; grid-columns: 80 1fr; }
    Overview.wide #lists Lines { height: 1fr; max-height: 100%; dock: none; display: block; }
    """

    def compose(self) -> ComposeResult:
        """Measurements, scenarios, and below these the edits, or the KPIs of a scenario."""
        with Vertical(id="lists"):
            yield Lines("Measured", label="s", id="measured")
            yield Lines("Edits", label="h", id="edits")
            yield Lines("Scenarios", label="c", id="scenarios")
            yield Lines("KPIs", label="k", id="kpis", folds=True)

    def on_mount(self) -> None:
        """Lines are as long as there is room."""
        for name in ("measured", "edits"):
            self.query_one(f"#{name}", Lines).when_resized = self._draw_numbers

    def on_resize(self, event: events.Resize) -> None:
        """All four side by side, or the KPIs in the place of the edits while scenarios are looked at."""
        wide = event.size.width >= _WIDE and event.size.height >= _TALL
        self.set_class(wide, "wide")
        if wide:
            self.query_one("#measured", Lines).styles.height = "1fr"

    def on_descendant_focus(self, _event: events.DescendantFocus) -> None:
        """Where there is room for one of both, the edits go with measurements and the KPIs with scenarios."""
        focused = self.app.focused
        self.set_class(focused is not None and focused.id in ("scenarios", "kpis"), "verdicts")

    def panes(self) -> list[Lines]:
        """Those that are seen; the others can be jumped to."""
        order = ("measured", "scenarios", "kpis", "edits")
        return [self.query_one(f"#{name}", Lines) for name in order]

    def reveal(self, pane: Lines) -> None:
        """The edits or the KPIs, whichever is asked for."""
        self.set_class(pane.id in ("scenarios", "kpis"), "verdicts")

    def _is_on(self, name: str) -> bool:
        return self.query_one(f"#{name}", Lines).has_focus

    @property
    def on_scenarios(self) -> bool:
        """Whether keys are for scenarios: they, or their KPIs, have the focus."""
        return self._is_on("scenarios") or self._is_on("kpis")

    # What is shown

    def choice_changed(self) -> None:
        """The cursor goes to what is looked at."""
        self.numbers_changed()

    def numbers_changed(self) -> None:
        """A number, or what is known of it, is another."""
        if self.is_mounted:
            self._draw_numbers()

    def runs_changed(self) -> None:
        """A command has begun, told how far it is, or ended."""
        if self.is_chosen:
            self._draw_numbers()

    def measured(self) -> list[Measurement]:
        """The measurements, those without a number last."""
        numbers = self.host.numbers
        return sorted(numbers.measured.all, key=lambda one: numbers.asked(one).request is None)

    @property
    def seen(self) -> Measurement | None:
        """The measurement under the cursor: the one that all screens look at."""
        return self.host.numbers.seen

    def _draw_numbers(self) -> None:
        """Measurements and edits."""
        pane, numbers, order = self.query_one("#measured", Lines), self.host.numbers, self.measured()
        if not pane.size.width:
            return
        edits = self.query_one("#edits", Lines)
        title, lines = edit_lines(numbers, edits.size.width, several=self.has_class("wide"))
        runs = self.host.commands.runs
        if runs.book.runs:
            lines = [*lines, line(" commands that were started here", "title"), *runs.lines()]
        edits.show(lines, title=title)
        if not order or self.seen is None:
            pane.show([line(f"  {_NOTHING}", "dim")], title="Measured: nothing")
            return
        at = order.index(self.seen)
        listed, (did, mean) = measured_lines(numbers, order, at, pane.size.width), summary(numbers, order)
        above, below = [detail(numbers, self.seen, pane.size.width)], [line(f" {mean}", "dim")] if mean else []
        shown = [*above, *listed.lines, *below]
        models = counted(len(self.host.project.of("model")), "model")
        words = f"Measured: {counted(len(order), 'set')}, {models}{f'; {did}' if did else ''}"
        if not self.has_class("wide"):
            pane.styles.height = len(shown) + 1  # and no more than there is room for
        pane.show(shown, title=words, cursor=listed.rows[at] + len(above))

    def draw(self) -> None:
        """All panes."""
        self._draw_numbers()
        self.draw_scenarios()

    # Actions

    def action_move(self, key: str) -> None:
        """The cursor; in the KPIs and the edits the keys scroll."""
        for name in ("kpis", "edits"):
            if self._is_on(name):
                self.query_one(f"#{name}", Lines).scroll_by_key(key)
                return
        if self._is_on("scenarios"):
            self.move_in_scenarios(key)
            return
        order = self.measured()
        if self.seen is not None:
            at = cursor_after(key, order.index(self.seen), len(order), max(self.query_one("#measured", Lines).rows, 1))
            self.host.numbers.choose(order[at])

    # Numbers

    def action_go(self) -> None:
        """The screen that shows the measurement; in the scenarios run the one under the cursor."""
        if self.on_scenarios:
            self.action_run_one()
        elif self.seen is not None:
            self.host.show_screen(screen_of(self.host.numbers.measured.kind(self.seen)))

    def action_renew(self) -> None:
        """The number of the measurement under the cursor; in the scenarios run the one under the cursor."""
        numbers, seen = self.host.numbers, self.seen
        if self.on_scenarios:
            self.action_run_one()
        elif seen is None:
            self.say("nothing is measured here")
        elif not numbers.engine.renew(numbers.asked(seen)):
            state = self.host.inside(numbers.known(seen).state) or "no number is computed here"
            self.say(f"{numbers.measured.words(seen)}: {state}")

    def action_all(self) -> None:
        """Whole frames of all measurements; in the scenarios run all of them."""
        if self.on_scenarios:
            self.action_run_all()
            return
        count = self.host.numbers.engine.run_all()
        words = "whole frames, 64 seeds; x stops" if count else "nothing to compute"
        self.say(f"{counted(count, 'number')}: {words}" if count else words)

    # Both

    def action_stop(self) -> None:
        """Stop the run, and the numbers that are computed."""
        if self.host.numbers.engine.stop() and not self.running:
            self.say("numbers: stopped; r computes one again")
        else:
            self.stop_scenarios()

    def action_look_again(self) -> None:
        """Read the project again."""
        self.host.read_project()
