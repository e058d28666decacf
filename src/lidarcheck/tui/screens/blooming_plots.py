"""The right side of Blooming: the curve, and the profile that follows every edit, computed beside the interface."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lidarcheck.errors import LidarcheckError
from lidarcheck.tui.core.profiles import Choice, Dataset, Profiles, Shown, datasets_of, retros_of, settings_for
from lidarcheck.tui.widgets.lines import Line, Lines, line

if TYPE_CHECKING:
    from lidarcheck.calibration.blooming_cells import Profile
    from lidarcheck.formats.lut import LutTable
    from lidarcheck.tui.app import LidarcheckApp
    from lidarcheck.tui.screens.blooming import Blooming

__all__ = ["DEBOUNCE_S", "FEATURES", "BloomingPlots"]

DEBOUNCE_S = 0.15
FEATURES = ("AREA", "PEAK", "WIDTH", "range")
_UNITS = {"AREA": "AREA", "PEAK": "PEAK", "WIDTH": "WIDTH [ns]", "range": "range [m]"}
_OFFSET = {"vertical": "SPAD rows, upward", "horizontal": "columns of 0.05 deg, to the left"}
_LEAST = (40, 8)


class BloomingPlots:
    """Draws both plots when the hand rests. A thread reads datasets and computes; what it asks for last counts."""

    def __init__(self, view: Blooming) -> None:
        self.view = view
        self.shown_once = False
        self.datasets: list[Dataset] = []
        self.dataset = 0
        self.feature = 0
        self.material: int | None = None
        self.model: Path | None = None
        self.shown: Shown | None = None
        self.expected: Profile | None = None
        self.fault = ""
        self.computed = 0
        """How often the expectation was computed, for tests."""
        self._profiles = Profiles()
        self._timer: Any = None
        self._wanted = threading.Condition()
        self._job: tuple[Choice, LutTable] | None = None
        self._busy = False
        self._done: tuple[Any, ...] = ()

    # What is looked at

    def opened(self) -> None:
        """The screen is seen for the first time, or again."""
        self.shown_once = True
        self._find()

    def axis_changed(self) -> None:
        """Another table: other datasets."""
        if self.shown_once:
            self._find()

    def _find(self) -> None:
        project, selected = self.view.ours.project, self.view.ours.state.selected
        self.datasets = datasets_of(project, self.view.axis)
        names = [dataset.name for dataset in self.datasets]
        wanted = selected.get("dataset", "")
        self.dataset = names.index(wanted) if wanted in names else 0
        models = [entry.name for entry in project.of("model")]
        model = selected.get("model", "")
        model = model if model in models else self._likely(models)
        self.model = next((entry.path for entry in project.of("model") if entry.name == model), None)
        self.later()

    def _likely(self, models: list[str]) -> str:
        """Of the models that have a retro-reflector the one whose variant the settings are for, else the first."""
        paths = {entry.name: entry.path for entry in self.view.ours.project.of("model")}
        able = [name for name in models if _retros(paths[name])]
        names = " ".join(entry.name.upper() for entry in self.view.ours.project.of("settings"))
        alike = [name for name in able if any(v in names and v in name.upper() for v in ("SLIM", "SMART"))]
        return next(iter([*alike, *able, *models]), "")

    def next_dataset(self, by: int) -> None:
        """The next distance; what was read before is there at once."""
        if not self.datasets:
            self.view.say("no measurement in this project shows this table's axis")
            return
        self.dataset = (self.dataset + by) % len(self.datasets)
        self.view.ours.state.selected["dataset"] = self.datasets[self.dataset].name
        self._ask()
        self.redraw()

    def next_model(self) -> None:
        """The next model."""
        models = self.view.ours.project.of("model")
        if not models:
            self.view.say("there is no model in this project")
            return
        paths = [entry.path for entry in models]
        at = (paths.index(self.model) + 1) % len(paths) if self.model in paths else 0
        self.model, self.material = paths[at], None
        self.view.ours.state.selected["model"] = models[at].name
        self.view.say(f"model: {models[at].name}")
        self._ask()

    def next_target(self) -> None:
        """The next retro-reflecting material."""
        retros = _retros(self.model) if self.model else []
        if not retros:
            self.view.say("the model has no retro-reflector")
            return
        at = (retros.index(self.material) + 1) % len(retros) if self.material in retros else min(1, len(retros) - 1)
        self.material = retros[at]
        self.view.say(f"target: material {self.material} of {', '.join(map(str, retros))}")
        self._ask()

    def next_feature(self) -> None:
        """AREA, PEAK, WIDTH, range."""
        self.feature = (self.feature + 1) % len(FEATURES)
        self.redraw()

    # Computing

    def later(self) -> None:
        """Draw, and compute, once the hand has rested."""
        if self._timer is not None:
            self._timer.stop()
        self._timer = self.view.set_timer(DEBOUNCE_S, self._rested)

    def _rested(self) -> None:
        self._timer = None
        self._ask()
        self.redraw()

    def _choice(self) -> Choice | None:
        if not self.datasets or self.model is None or not self.shown_once:
            return None
        axis = self.view.axis
        try:
            settings = settings_for(self.view.ours.project, self.model, axis)
        except LidarcheckError:
            settings = None  # what is wrong with the model is said when it is used
        return Choice(self.datasets[self.dataset], self.model, axis, settings, self.material)

    def _ask(self) -> None:
        """Have the thread compute what is shown now, unless that is what there is."""
        choice, session = self._choice(), self.view.session
        if choice is None or session is None:
            self.shown = self.expected = None
            return
        table = session.current.tables[self.view.axis]
        key = (choice, table.y.tobytes(), table.x.tobytes())
        if key == self._done:
            return
        self._done = key
        known = self._profiles.known(choice)
        if known is not self.shown:
            self.shown, self.expected = known, None
        self.fault = ""
        with self._wanted:
            self._job = (choice, table)
            if not self._busy:
                self._busy = True
                threading.Thread(target=self._work, args=(self.view.ours,), name="profiles", daemon=True).start()

    def _work(self, app: LidarcheckApp) -> None:
        """Compute what was asked for last, until nothing new is."""
        while True:
            with self._wanted:
                job, self._job = self._job, None
                if job is None:
                    self._busy = False
                    return
            shown = expected = None
            fault = ""
            try:
                shown = self._profiles.load(job[0])
                expected = self._profiles.expected(shown, job[1])
            except LidarcheckError as error:
                fault = error.lines()[0].removeprefix("error: ")
            except Exception as error:  # noqa: BLE001 - a fault in a profile must not take the editor with it
                fault = f"internal error, {type(error).__name__}: {error}"
            app.soon(self._computed, job, shown, expected, fault)

    def _computed(self, job: tuple[Choice, LutTable], shown: Shown | None, expected: Any, fault: str) -> None:
        if job[0] == self._choice():
            self.shown, self.expected, self.fault = shown, expected, fault
            self.computed += 1
            self._draw_profile()

    # Drawing

    def redraw(self) -> None:
        """Both panes."""
        if self.view.session is not None and self.view.is_mounted:
            self._draw_curve()
            self._draw_profile()

    def _draw_curve(self) -> None:
        assert self.view.session is not None
        session, axis = self.view.session, self.view.axis
        table, saved = session.current.tables[axis], session.saved.tables[axis]
        here = np.where(np.arange(len(table)) == self.view.at, table.y, np.nan)
        curves = [("on disk", saved.x, saved.y)] if session.dirty else []
        curves += [("table", table.x, table.y), ("cursor", table.x, here)]
        self._show("curve", "Curve", curves, "Y", f"X [{_OFFSET[axis]}]", log=True)

    def _draw_profile(self) -> None:
        pane = self.view.query_one("#profile", Lines)
        if not self.datasets or self.model is None:
            what = "no model" if self.datasets else "no measured profile or scan"
            pane.show([line(f" {what} in this project", "dim")], title="Profile")
            return
        dataset, name = self.datasets[self.dataset], FEATURES[self.feature]
        where = f"{self.dataset + 1}/{len(self.datasets)} {dataset.name}"
        if self.fault:
            words = self.view.ours.inside(self.fault)
            width = max(pane.size.width - 2, 20)
            pane.show([line(f" {words[i : i + width]}", "bad") for i in range(0, len(words), width)], title=where)
            return
        if self.shown is None:
            pane.show([line(" reading ...", "dim")], title=where)
            return
        real = self.shown.real
        curves = [("real", real.offset, _column(real, name))]
        if self.expected is not None and name != "range":
            curves.append(("expected", self.expected.offset, _column(self.expected, name)))
        title = f"{self.shown.cells.distance_m:.1f} m, {where}, {self.model.stem}"
        label = f"offset [{_OFFSET[self.view.axis]}]"
        self._show("profile", title, curves, _UNITS[name], label, log=name in ("AREA", "PEAK"))

    def _show(self, pane: str, title: str, curves: Any, y_label: str, x_label: str, *, log: bool) -> None:
        from lidarcheck.plots.terminal import Series
        from lidarcheck.plots.terminal import curves as draw

        where = self.view.query_one(f"#{pane}", Lines)
        width, height = where.size.width, where.rows
        if width < _LEAST[0] or height < _LEAST[1]:
            where.show([line(" no room for a plot here", "dim")], title=title)
            return
        series = [Series(name, x, y) for name, x, y in curves]
        text = draw(
            series,
            x_label=x_label,
            y_label=y_label,
            width=width,
            height=height,
            log_y=log,
            plain=self.view.app.theme == "plain",
        )
        lines: list[Line] = [line(row) for row in text.splitlines()]
        where.show(lines, title=title)


def _column(profile: Profile, name: str) -> Any:
    return profile.range_m if name == "range" else profile.value[:, ("PEAK", "AREA", "WIDTH").index(name)]


def _retros(model: Path) -> list[int]:
    try:
        return retros_of(model)
    except LidarcheckError:
        return []
