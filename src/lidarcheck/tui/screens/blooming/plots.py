"""The right side of Blooming: which datasets are looked at, and what is computed for them beside the interface."""

from __future__ import annotations

import re
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarcheck.errors import LidarcheckError
from lidarcheck.tui.jobs.profiles import (
    Choice,
    Dataset,
    ProfileData,
    Profiles,
    compile_aside,
    datasets_of,
    first_time,
    retros_of,
    variant_of,
)
from lidarcheck.tui.screens.blooming.draw import FEATURES, draw_curve, draw_profile
from lidarcheck.tui.widgets.lines import Lines

if TYPE_CHECKING:
    from lidarcheck.calibration.blooming.cells import Profile
    from lidarcheck.formats.lut import LutTable
    from lidarcheck.formats.settings import Setting
    from lidarcheck.tui.app import LidarcheckApp
    from lidarcheck.tui.screens.blooming.screen import Blooming

__all__ = ["DEBOUNCE_S", "BloomingPlots"]

DEBOUNCE_S = 0.15
_ONCE = "computing: the sensor model is compiled first, once on this machine; it takes a while"


class BloomingPlots:
    """Draws the plots when the hand rests. A thread reads datasets and computes; what it was asked for last counts."""

    def __init__(self, view: Blooming) -> None:
        self.view = view
        self.shown_once = False
        self.datasets: list[Dataset] = []
        self.dataset = 0
        self.feature = 0
        self.four = False
        """Whether all features of one distance are shown, or one feature at several distances."""
        self.across = 1
        """How many distances there is room for."""
        self.material: int | None = None
        self.model: Path | None = None
        self.computed = 0
        """How many expectations were computed, for tests."""
        self._profiles = Profiles()
        self._timer: Any = None
        self._wanted = threading.Condition()
        self._job: tuple[list[Choice], LutTable | None] | None = None
        self._busy = False
        self._broken: dict[tuple[Any, ...], str] = {}
        self._last: dict[tuple[Any, ...], Profile] = {}

    # What is looked at

    def opened(self) -> None:
        """The screen is seen for the first time, or again."""
        self.shown_once = True
        self.find()

    def find(self) -> None:
        """Datasets of the table's direction, and the model; also after the project, the table or the file changed."""
        if not self.shown_once:
            return
        project, selected = self.view.host.project, self.view.host.state.selected
        self.datasets = datasets_of(project, self.view.axis)
        names = [dataset.name for dataset in self.datasets]
        wanted = selected.get("dataset", "")
        self.dataset = names.index(wanted) if wanted in names else 0
        self.feature = min(int(number) if (number := selected.get("feature", "")).isdigit() else 0, len(FEATURES) - 1)
        models = [entry.name for entry in project.of("model")]
        model = selected.get("model", "")
        model = model if model in models else self._likely(models)
        self.model = next((entry.path for entry in project.of("model") if entry.name == model), None)
        self._find_settings()
        self.later()

    def _likely(self, models: list[str]) -> str:
        """Of the models that have a retro-reflector the one whose variant the settings are for, else the first."""
        paths = {entry.name: entry.path for entry in self.view.host.project.of("model")}
        able = [name for name in models if _retros(paths[name])]
        names = " ".join(entry.name.upper() for entry in self.view.host.project.of("settings"))
        alike = [name for name in able if any(v in names and v in name.upper() for v in ("SLIM", "SMART"))]
        return next(iter([*alike, *able, *models]), "")

    def _find_settings(self) -> None:
        variant = ""
        if self.model is not None:
            try:
                variant = variant_of(self.model)
            except LidarcheckError as error:
                self.view.say(error)
        self.view.settings.find(variant, self.view.axis)

    def next_dataset(self, by: int) -> None:
        """The next distance; what was read before is there at once."""
        if not self.datasets:
            self.view.say("no measurement in this project shows this table's axis")
            return
        self.dataset = (self.dataset + by) % len(self.datasets)
        self.view.host.state.selected["dataset"] = self.datasets[self.dataset].name
        self._ask_and_draw()

    def next_model(self) -> None:
        """The next model."""
        models = self.view.host.project.of("model")
        if not models:
            self.view.say("there is no model in this project")
            return
        paths = [entry.path for entry in models]
        at = (paths.index(self.model) + 1) % len(paths) if self.model in paths else 0
        self.model, self.material = paths[at], None
        self.view.host.state.selected["model"] = models[at].name
        self.view.say(f"model: {models[at].name}")
        self._find_settings()
        self._ask_and_draw()

    def next_target(self) -> None:
        """The next retro-reflecting material."""
        retros = _retros(self.model) if self.model else []
        if not retros:
            self.view.say("the model has no retro-reflector")
            return
        at = (retros.index(self.material) + 1) % len(retros) if self.material in retros else min(1, len(retros) - 1)
        self.material = retros[at]
        self.view.say(f"target: material {self.material} of {', '.join(map(str, retros))}")
        self._ask_and_draw()

    def next_feature(self) -> None:
        """AREA, PEAK, WIDTH, range."""
        if self.four:
            self.view.say("all four are shown; V goes back to one of them")
            return
        self.feature = (self.feature + 1) % len(FEATURES)
        self.view.host.state.selected["feature"] = str(self.feature)
        self.redraw()

    # The panes

    def tiles(self) -> list[tuple[int, int]]:
        """(dataset, feature) of each pane that is seen."""
        if self.four:
            return [(self.dataset, feature) for feature in range(len(FEATURES))]
        number = max(min(self.across, len(self.datasets)), 1)
        first = max(min(self.dataset, len(self.datasets) - number), 0)
        return [(first + i, self.feature) for i in range(number)]

    def choice(self, dataset: int) -> Choice | None:
        """What a dataset is looked at with; None without datasets or a model."""
        if not self.datasets or self.model is None or not self.shown_once:
            return None
        one = self.datasets[dataset]
        settings = self.view.settings.in_force() if one.by_settings else None
        return Choice(one, self.model, self.view.axis, settings, self.material)

    def found(self, choice: Choice) -> ProfileData | str | None:
        """A dataset as it was read, or in words why it cannot be; None while it is read."""
        broken = self._broken.get(choice.key, "")
        if choice.dataset.by_settings and self.view.settings.fault:
            broken = self.view.settings.fault
        known = self._profiles.known(choice)
        if isinstance(known, LidarcheckError):
            broken = known.lines()[0].removeprefix("error: ")
        return broken or (known if isinstance(known, ProfileData) else None)

    def expectation(self, choice: Choice) -> Profile | None:
        """What the table gives there; while that is computed, what it gave before the last edit."""
        now = self._known(choice, self.view.table.table())
        if now is not None:
            self._last[choice.key] = now
        return self._last.get(choice.key)

    def _known(self, choice: Choice, table: LutTable | None) -> Profile | None:
        return None if table is None else self._profiles.known_expected(choice, table)

    @property
    def expected(self) -> Profile | None:
        """The expectation of the dataset under the hand with the table as it is now; None until it is computed."""
        choice = self.choice(self.dataset)
        return None if choice is None else self._known(choice, self.view.table.table())

    def shown(self) -> ProfileData | None:
        """The dataset under the hand; None until it was read."""
        choice = self.choice(self.dataset)
        found = None if choice is None else self.found(choice)
        return found if isinstance(found, ProfileData) else None

    def setting(self) -> Setting | None:
        """The setting that said where the target of the dataset under the hand is; None where none did."""
        shown = self.shown()
        return None if shown is None else shown.cells.setting

    def distance_in_words(self) -> str:
        """The distance of the dataset under the hand [m]: as read, else by its name; empty where neither tells."""
        shown = self.shown()
        if shown is not None:
            return f"{shown.cells.distance_m:.1f}"
        name = self.datasets[self.dataset].path.stem if self.datasets else ""
        number = re.search(r"\d+(?:[._]\d+)?(?=m)", name)
        return number[0].replace("_", ".") if number else ""

    def setting_in_words(self) -> str:
        """What settings have to do with the dataset under the hand."""
        if not self.datasets:
            return ""
        dataset = self.datasets[self.dataset]
        if dataset.is_profile:
            return "shown is a profile: it needs none"
        if dataset.ideal is not None:
            return "the ideal scan tells the target"
        return "" if self.setting() is not None or self.shown() is None else "found without: by saturation"

    # Computing

    def later(self) -> None:
        """Draw, and compute, once the hand has rested."""
        if self._timer is not None:
            self._timer.stop()
        self._timer = self.view.set_timer(DEBOUNCE_S, self._rested)

    def _rested(self) -> None:
        self._timer = None
        self._ask_and_draw()

    def _ask_and_draw(self) -> None:
        self._ask()
        self.redraw()
        self.view.settings_shown()

    def _ask(self) -> None:
        """Have the thread compute what is seen now and is not there yet."""
        table = self.view.table.table()
        seen = [self.choice(dataset) for dataset in dict.fromkeys(dataset for dataset, _ in self.tiles())]
        choices = [choice for choice in seen if choice is not None and choice.key not in self._broken]
        self._last = {choice.key: self._last[choice.key] for choice in choices if choice.key in self._last}
        missing = [choice for choice in choices if self._is_missing(choice, table)]
        with self._wanted:
            self._job = (missing, table) if missing else None
            if missing and not self._busy:
                self._busy = True
                threading.Thread(target=self._work, args=(self.view.host,), name="profiles", daemon=True).start()

    def _is_missing(self, choice: Choice, table: LutTable | None) -> bool:
        found = self._profiles.known(choice)
        return found is None or (
            isinstance(found, ProfileData) and table is not None and self._known(choice, table) is None
        )

    def _work(self, app: LidarcheckApp) -> None:
        """Compute what was asked for last, until nothing new is."""
        while True:
            with self._wanted:
                job, self._job = self._job, None
                if job is None:
                    self._busy = False
                    return
            for step in (self._load, self._expect):
                for choice in job[0]:
                    if self._job is None:
                        self._guarded(app, step, choice, job[1])

    def _guarded(self, app: LidarcheckApp, step: Any, choice: Choice, table: LutTable | None) -> None:
        try:
            step(app, choice, table)
        except Exception as error:  # noqa: BLE001 - a fault in a profile must not take the editor with it
            app.soon(self._fell, choice, f"internal error, {type(error).__name__}: {error}")

    def _load(self, app: LidarcheckApp, choice: Choice, _table: LutTable | None) -> None:
        if self._profiles.known(choice) is None:
            self._profiles.load(choice)
            app.soon(self._arrived, choice)

    def _expect(self, app: LidarcheckApp, choice: Choice, table: LutTable | None) -> None:
        shown = self._profiles.load(choice)
        if table is not None and isinstance(shown, ProfileData):
            first = first_time()
            if first:
                app.soon(self.view.say, _ONCE)
                compile_aside()
            self._profiles.expected(choice, shown, table)
            if first:
                app.soon(self.view.say, "the sensor model is compiled")
            self.computed += 1
            app.soon(self._arrived, choice)

    def _arrived(self, choice: Choice) -> None:
        for number, (dataset, _) in enumerate(self.tiles()):
            here = self.choice(dataset)
            if here is not None and here.key == choice.key:
                self._draw_tile(number)
        if self.datasets and choice.dataset == self.datasets[self.dataset]:
            self.view.settings_shown()

    def _fell(self, choice: Choice, what: str) -> None:
        self._broken[choice.key] = what
        self._arrived(choice)

    # Drawing

    def redraw(self) -> None:
        """All panes that are seen."""
        if self.view.is_mounted:
            self.redraw_curve()
            for number in range(len(self.tiles())):
                self._draw_tile(number)

    def redraw_curve(self) -> None:
        """The curve alone."""
        pane = self.view.query_one("#curve", Lines)
        if pane.display and self.view.table.session is not None:
            draw_curve(self.view, pane)

    def _draw_tile(self, number: int) -> None:
        panes = self.view.tile_panes()
        if number < len(panes):
            draw_profile(self, panes[number], *self.tiles()[number])


def _retros(model: Path) -> list[int]:
    try:
        return retros_of(model)
    except LidarcheckError:
        return []
