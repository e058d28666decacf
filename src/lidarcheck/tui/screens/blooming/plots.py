"""The plots on the right side of Blooming: drawn, and computed anew, when the hand rests."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from lidarcheck.session.model_choice import RANGE
from lidarcheck.session.node import Node
from lidarcheck.session.session import CURRENT, OLD
from lidarcheck.tui.engine import Known
from lidarcheck.tui.jobs.profile_worker import ProfileWorker
from lidarcheck.tui.jobs.profiles import Choice, ProfileData
from lidarcheck.tui.screens.blooming.charts import BASELINE, NOW, REAL, SAVED, WANTED
from lidarcheck.tui.screens.blooming.draw import draw_curve, draw_fault, draw_profile, draw_words
from lidarcheck.tui.screens.blooming.panes import BloomingPanes
from lidarcheck.tui.screens.blooming.selection import Selection
from lidarcheck.tui.screens.blooming.settings import SettingsEditor
from lidarcheck.tui.screens.blooming.table import TableEditor

if TYPE_CHECKING:
    from lidarcheck.formats.lut import LutTable
    from lidarcheck.formats.settings import Setting
    from lidarcheck.tui.jobs.profiles import Shown

__all__ = ["DEBOUNCE_S", "BloomingPlots"]

DEBOUNCE_S = 0.15


class BloomingPlots:
    """The curve of the table, and a tile for each dataset or feature that is seen.

    `on_dataset`: what is known of the dataset under the hand may be another. `wanted`: a table that is shown as a
    curve beside the one that is edited, as one that a fit proposes.
    """

    def __init__(
        self,
        panes: BloomingPanes,
        selection: Selection,
        editors: tuple[TableEditor, SettingsEditor],
        on_dataset: Callable[[], object],
    ) -> None:
        self.panes, self.selection = panes, selection
        self._table, self._settings = editors
        self._on_dataset = on_dataset
        self.wanted: LutTable | None = None
        self._worker: ProfileWorker | None = None
        self._timer: Any = None
        self._numbers: dict[int, object] = {}

    @property
    def worker(self) -> ProfileWorker:
        """Reads and computes, beside the interface; made with the first question, when there is an app."""
        if self._worker is None:
            self._worker = ProfileWorker(self.panes.host.session, self._arrived, self.panes.say)
        return self._worker

    # What is known of the datasets

    def found(self, choice: Choice) -> ProfileData | str | None:
        """A dataset as it was read, or in words why it cannot be; None while it is read."""
        found = self.worker.found(choice)
        if choice.dataset.by_settings and self._settings.fault and not isinstance(found, str):
            return self._settings.fault
        return found

    def expectation(self, choice: Choice) -> tuple[str, Shown | None]:
        """(its state, what the table gives there); while that is computed, what it gave before the last edit."""
        word, profile = self.worker.expected(choice, self._table.shown())
        return "computing" if word.startswith(OLD) or not word else self.panes.host.inside(word), profile

    def node(self) -> Node | None:
        """What the expectation of the dataset under the hand is computed by."""
        choice, table = self.selection.choice(self.selection.dataset), self._table.shown()
        return None if choice is None or table is None else self.worker.node(choice, table)

    @property
    def expected(self) -> Shown | None:
        """The expectation of the dataset under the hand with the table as it is now; None until it is computed."""
        choice = self.selection.choice(self.selection.dataset)
        if choice is None:
            return None
        word, profile = self.worker.expected(choice, self._table.shown())
        return profile if word == CURRENT else None

    def shown(self) -> ProfileData | None:
        """The dataset under the hand; None until it was read."""
        choice = self.selection.choice(self.selection.dataset)
        found = None if choice is None else self.found(choice)
        return found if isinstance(found, ProfileData) else None

    def setting(self) -> Setting | None:
        """The setting that said where the target of the dataset under the hand is; None where none did."""
        shown = self.shown()
        return None if shown is None else shown.setting

    def distance_in_words(self) -> str:
        """The distance of the dataset under the hand [m]: as read, else by its name; empty where neither tells."""
        shown, dataset = self.shown(), self.selection.current
        if shown is not None:
            return f"{shown.distance_m:.1f}"
        number = re.search(r"\d+(?:[._]\d+)?(?=m)", dataset.path.stem if dataset else "")
        return number[0].replace("_", ".") if number else ""

    def setting_in_words(self) -> str:
        """What settings have to do with the dataset under the hand."""
        dataset = self.selection.current
        if dataset is None:
            return ""
        if dataset.is_profile:
            return "shown is a profile: it needs none"
        if dataset.ideal is not None:
            return "the ideal scan tells the target"
        return "" if self.setting() is not None or self.shown() is None else "found without: by saturation"

    # Computing

    @property
    def rests(self) -> bool:
        """Whether nothing waits to be drawn or computed."""
        return self._timer is None and not self.worker.busy

    def later(self) -> None:
        """Draw, and compute, once the hand has rested."""
        if self._timer is not None:
            self._timer.stop()
        self._timer = self.panes.set_timer(DEBOUNCE_S, self._rested)

    def _rested(self) -> None:
        self._timer = None
        self.update()

    def update(self) -> None:
        """Draw what is there, and have the rest computed."""
        choices = self.selection.choices()
        self.worker.ask(choices, self._table.shown(), self.panes.host.soon)
        self.redraw()
        self._on_dataset()

    def _arrived(self, choice: Choice) -> None:
        for number, (dataset, _) in enumerate(self.selection.tiles()):
            here = self.selection.choice(dataset)
            if here is not None and here.about == choice.about:
                self._draw_tile(number)
        if choice.dataset == self.selection.current:
            self._on_dataset()

    # Drawing

    @property
    def _now(self) -> str:
        """What the table that is shown is called."""
        return BASELINE if self.panes.host.session.shows_baseline else NOW

    def redraw(self) -> None:
        """All panes that are seen."""
        if self.panes.is_mounted:
            self.redraw_curve()
            for number in range(len(self.selection.tiles())):
                self._draw_tile(number)

    def redraw_curve(self) -> None:
        """The curve alone."""
        pane, editor = self.panes.curve_pane(), self._table
        table, saved = editor.shown(), editor.table(saved=True)
        if not pane.display or editor.file is None or table is None:
            return
        tables = {self._now: table}
        if editor.file.dirty and saved is not None:
            tables[SAVED] = saved
        wanted = editor.wanted() if self.wanted is None else self.wanted
        if wanted is not None:
            tables[WANTED] = wanted
        draw_curve(pane, tables, editor.at, editor.axis)

    def _draw_tile(self, number: int) -> None:
        panes = self.panes.tile_panes()
        if number >= len(panes):
            return
        pane, (dataset, feature), datasets = panes[number], self.selection.tiles()[number], self.selection.datasets
        choice = self.selection.choice(dataset)
        if choice is None:
            draw_words(pane, f"{'no model' if datasets else 'no measured profile or scan'} in this project", "Profile")
            return
        found, where = self.found(choice), f"{dataset + 1}/{len(datasets)} {choice.dataset.name}"
        if isinstance(found, str):
            draw_fault(pane, self.panes.host.inside(found), where)
        elif found is None:
            draw_words(pane, "reading ...", where)
        elif not found.has(feature):
            draw_words(pane, f"none: {choice.dataset.name} has no {feature}", where)
        else:
            sides, state = {REAL: found.real}, CURRENT
            if feature != RANGE and self._table.file is not None:
                state, expected = self.expectation(choice)
                sides |= {} if expected is None else {self._now: expected}
                saved = self._saved(choice)
                sides |= {} if saved is None else {SAVED: saved}
            key = (choice.dataset.name, choice.model.name)
            where = f"{self._distance(dataset, found)}, {dataset + 1}/{len(datasets)}"
            known = self._known(choice)
            self._numbers[number] = _mark(known)
            draw_profile(pane, feature, sides, where, choice.axis, key=key, state=state, known=known)

    def numbers_changed(self) -> None:
        """Draw what is seen again where its number is another one, or belongs to something else."""
        for number, (dataset, _) in enumerate(self.selection.tiles()):
            choice = self.selection.choice(dataset)
            if choice is not None and _mark(self._known(choice)) != self._numbers.get(number):
                self._draw_tile(number)

    def _known(self, choice: Choice) -> Known | None:
        """What is known of the misfit of a dataset; None where it has none."""
        known = self.panes.host.numbers.of_file(choice.dataset.path)
        return known if known is not None and known.number is not None and known.number.residual is not None else None

    def _saved(self, choice: Choice) -> Shown | None:
        """What the table as the disk has it gives there, where that is another and was computed."""
        if self._table.file is None or not self._table.file.dirty:
            return None
        word, profile = self.worker.expected(choice, self._table.table(saved=True))
        return profile if word == CURRENT else None

    def _distance(self, dataset: int, found: ProfileData) -> str:
        """The distance of a tile, within < > where it is the one of several that n and p go on from."""
        distance = f"{found.distance_m:.1f} m"
        several = not self.selection.four and len(self.selection.tiles()) > 1
        return f"<{distance}>" if several and dataset == self.selection.dataset else distance


def _mark(known: Known | None) -> object:
    """What a strip is drawn from: which numbers, and whether they are of what is shown."""
    return None if known is None else (id(known.number), id(known.before), known.is_of_now)
