"""The fit of the table that Blooming shows: its form, its proposal as a curve, and taking that over."""

from __future__ import annotations

from collections.abc import Callable

from lidarcheck.errors import LidarcheckError
from lidarcheck.session.runs import Run
from lidarcheck.session.takeover import fitted_table
from lidarcheck.tui.jobs.forms.bloom_fit import FitBench, bloom_fit_form
from lidarcheck.tui.runs.taking import ask_table, offered_table
from lidarcheck.tui.screens.blooming.selection import Selection
from lidarcheck.tui.screens.blooming.settings import SettingsEditor
from lidarcheck.tui.screens.blooming.table import TableEditor
from lidarcheck.tui.screens.shared.view import View

__all__ = ["Fitting"]


class Fitting:
    """`draw`: shows the table, its curve and what is wanted."""

    def __init__(
        self, view: View, selection: Selection, table: TableEditor, settings: SettingsEditor, draw: Callable[[], object]
    ) -> None:
        self._view, self._selection, self._table, self._settings = view, selection, table, settings
        self._draw = draw

    def form(self) -> None:
        """The form of `bloom fit`, filled with what is seen."""
        try:
            bench = self._bench()
        except LidarcheckError as error:
            self._view.say(error)
            return
        if isinstance(bench, str):
            self._view.say(bench)
        else:
            self._view.host.commands.ask(bloom_fit_form(bench), self._view.NAME)

    def _bench(self) -> FitBench | str:
        """What is seen; in words what is missing. `LidarcheckError` where the model's sensor has no tables to fit."""
        selection, file, at = self._selection, self._table.file, self._selection.current
        if file is None:
            return "there is no table to fit here"
        if at is None or selection.model is None:
            return "no measurement in this project shows this table's axis" if at is None else "there is no model"
        from lidarcheck.calibration.blooming.workflow import check_counts
        from lidarcheck.model import load_model

        check_counts(load_model(selection.model))
        settings = self._settings.file
        there = settings is not None and (settings.there or settings.dirty)
        return FitBench(
            self._view.host.project,
            selection.datasets,
            at,
            selection.model,
            file.path,
            self._table.axis,
            content=file.content if file.dirty else None,
            settings=settings.path if settings is not None and there else None,
            settings_content=settings.content if settings is not None and settings.dirty else None,
            target=selection.material,
            marked=tuple(sorted(self._table.marked)),
        )

    def offer(self, run: Run, taken: Callable[[], object]) -> None:
        """Show the table of a run as the one that is wanted, and ask whether it is to be taken over."""
        host, table = self._view.host, self._table
        path = host.project.root / run.takes["table"]
        entry = next((one for one in host.project.of("lut") if one.path == path), None)
        if entry is None:
            host.say(f"{run.takes['table']} is not in this project any more", bad=True)
            return
        if table.file is None or table.file.path != path:
            if table.file is not None and table.file.dirty:
                words = f"{table.file.path.name} has edits that are not saved: save them, then take over from the runs"
                host.say(words, bad=True)
                return
            table.open(entry.name)
        try:
            wanted = fitted_table(run, host.project.root)
        except LidarcheckError as error:
            host.say(error)
            return
        file = table.file
        if file is None or run.takes["axis"] not in file.current.tables:
            host.say(f"{run.takes['table']} has no {run.takes['axis']} table any more", bad=True)
            return
        table.axis = "horizontal" if run.takes["axis"] == "horizontal" else "vertical"
        table.want(wanted)
        self._draw()
        change = offered_table(host, run, file)
        if change is not None:
            ask_table(host, change, lambda: self._took(taken))

    def _took(self, taken: Callable[[], object]) -> None:
        self._table.want(None)
        taken()
        self._draw()
