"""What Goldens does with a review: asks for a reason where one is needed, shows the diff, writes; or drops it."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.table import counted
from lidarcheck.harness.review.accept import ALL, accept, preview, reject
from lidarcheck.harness.review.review import ReviewReport
from lidarcheck.harness.review.wording import verdict_word
from lidarcheck.tui.jobs.proposals import Waiting, changes, reasons
from lidarcheck.tui.screens.shared.view import View
from lidarcheck.tui.widgets.dialogs import Ask, AskText
from lidarcheck.tui.widgets.lines import diff_lines, hanging, line

__all__ = ["Accepting"]


def _in_short(report: ReviewReport, names: Sequence[str]) -> list[str]:
    """The KPIs that are accepted, with the values of the golden and the new ones."""
    open_ones = [(one, kpi) for one in report.scenarios if not one.settled for kpi in one.kpis if kpi.open]
    lines = []
    for one, kpi in open_ones:
        if ALL in names or kpi.name in names:
            old, new = ("-" if side is None else f"{side.reference.mean:.5g}" for side in (kpi.old, kpi.new))
            lines.append(f"{one.name}, {kpi.name}: {old} -> {new}, {verdict_word(kpi)}")
    return lines


class Accepting(View):
    """A screen with proposals; `start` reviews some of them and then asks about accepting."""

    waiting: list[Waiting]
    marked: set[str]

    @property
    def chosen(self) -> Waiting | None:
        """The scenario under the cursor."""
        raise NotImplementedError

    def start(self, groups: Sequence[Sequence[Path]], names: Sequence[str] | None = None) -> None:
        """Review; then, with `names`, `ask_accept`."""
        raise NotImplementedError

    def action_accept(self) -> None:
        """The marked KPIs of the scenario, or all of it."""
        if self.chosen is None:
            self.say("nothing waits for review; R reviews every scenario")
            return
        self.start([[self.chosen.path]], sorted(self.marked) or [ALL])

    def action_accept_all(self) -> None:
        """All that is listed, at once or not at all."""
        paths = [one.path for one in self.waiting]
        if not paths:
            self.say("nothing waits for review; R reviews every scenario")
            return
        self.start([paths], [ALL])

    def ask_accept(self, report: ReviewReport, names: Sequence[str]) -> None:
        """What a review has just found is asked about: a reason first, where one is needed."""
        if report.settled:
            self.say("nothing to accept: all is as the goldens say")
            return
        wanted = reasons(report.scenarios, () if ALL in names else names)
        refused = [kpi for one in report.scenarios for kpi in one.kpis if kpi.refused and kpi.open]
        if not wanted or any(ALL in names or kpi.name in names for kpi in refused):
            self._ask_write(report, names, "")
            return
        ask = AskText(
            "Why is this accepted? The golden keeps the reason.",
            lines=[part for text in wanted for part in hanging(text, self.size.width)],
        )
        self.host.ask(ask, lambda reason: self._reasoned(report, names, reason))

    def _reasoned(self, report: ReviewReport, names: Sequence[str], reason: str | None) -> None:
        if reason is None:
            self.say("not accepted: it needs a reason")
        else:
            self._ask_write(report, names, reason)

    def _ask_write(self, report: ReviewReport, names: Sequence[str], reason: str) -> None:
        """Show what would be written."""
        try:
            texts = preview(report, names, reason=reason)
        except LidarcheckError as error:
            self.say(error)
            return
        files = ", ".join(self.host.inside(str(path)) for path in texts)
        title = f"Write {files}?" if len(texts) < 4 else f"Write {counted(len(texts), 'golden')}?"
        words = [line("It cannot be taken back here; version control can.", "dim")]
        words += [line(text) for text in _in_short(report, names)]
        shown = diff_lines([self.host.inside(text) for text in changes(texts)])
        ask = Ask(title, [*words, *shown], {"Enter": "write"}, unasked=True)
        self.host.ask(ask, lambda key: self._answered(key, report, names, reason))

    def _answered(self, key: str | None, report: ReviewReport, names: Sequence[str], reason: str) -> None:
        if key != "Enter":
            self.say("not accepted: nothing was written")
            return

        host = self.host

        def write() -> None:
            # Another review may hold the lock for a while.
            try:
                host.soon(self._written, accept(report, names, reason=reason))
            except LidarcheckError as error:
                host.soon(host.say, error)
            except OSError as error:
                host.soon(host.say, f"error: cannot write: {error}")

        threading.Thread(target=write, name="accept", daemon=True).start()

    def _written(self, paths: Sequence[Path]) -> None:
        self.marked.clear()
        self.say(f"accepted: {', '.join(self.host.inside(str(path)) for path in paths)}")
        self.host.files_changed()

    def action_drop(self) -> None:
        """Drop the proposal, once asked."""
        one = self.chosen
        if one is None or not one.drawn:
            self.say("there is no proposal under the cursor")
            return
        words = [
            line("Its golden stays as it is. A check leaves a proposal anew while the values are not the golden's.")
        ]
        ask = Ask(f"Drop the proposal for {one.name}?", words, {"Enter": "drop it"})
        self.host.ask(ask, lambda key: self._drop(one) if key == "Enter" else None)

    def _drop(self, one: Waiting) -> None:
        try:
            there = reject(one.layout, one.name)
        except (LidarcheckError, OSError) as error:
            self.say(error if isinstance(error, LidarcheckError) else f"cannot drop it: {error}", bad=True)
            return
        self.say(f"{one.name}: proposal dropped" if there else f"{one.name}: the proposal was gone already")
        self.project_changed()
