"""What is looked at on the right side of Blooming: which datasets, with which model and target, and which feature."""

from __future__ import annotations

from pathlib import Path

from lidarcheck.errors import LidarcheckError
from lidarcheck.session.model_choice import RANGE, features_of
from lidarcheck.tui.jobs.measured import bloom_model, model_beside
from lidarcheck.tui.jobs.profiles import Choice, Dataset, datasets_of, retros_of, sensor_of
from lidarcheck.tui.screens.blooming.panes import TILES
from lidarcheck.tui.screens.blooming.settings import SettingsEditor
from lidarcheck.tui.screens.blooming.table import TableEditor
from lidarcheck.tui.screens.shared.view import View

__all__ = ["Selection"]


class Selection:
    """Indices into what there is; what the user chose is kept for the next start.

    `four`: all features of one distance are shown, not one feature at several distances. `across`: how many distances
    there is room for. `features`: those of the model's sensor.
    """

    def __init__(self, view: View, table: TableEditor, settings: SettingsEditor) -> None:
        self.view, self._table, self._settings = view, table, settings
        self.opened = False
        self.datasets: list[Dataset] = []
        self.dataset = 0
        self.four = False
        self.across = 1
        self.model: Path | None = None
        self.features: tuple[str, ...] = (RANGE,)

    @property
    def feature(self) -> str:
        """The feature that is looked at."""
        return self.view.host.choice.feature(self.features)

    @property
    def material(self) -> int | None:
        """The target's; None for the only retro-reflector there is."""
        return self.view.host.choice.target

    def find(self) -> None:
        """Datasets of the table's direction, the model, and its settings; nothing before the screen was `opened`."""
        if not self.opened:
            return
        project, choice = self.view.host.project, self.view.host.choice
        self.datasets = datasets_of(project, self._table.axis)
        names = [dataset.name for dataset in self.datasets]
        path = self._seen()
        wanted = next((dataset.name for dataset in self.datasets if dataset.path == path), "")
        kept = min(self.dataset, max(len(names) - 1, 0))
        self.dataset = names.index(wanted) if wanted in names else kept
        at = self.current
        meant = None if at is None else model_beside(project, choice, at.path, at.name)
        model = meant or bloom_model(project)
        self.model = None if model is None else model.path
        self._find_settings()

    def _find_settings(self) -> None:
        variant = ""
        if self.model is not None:
            try:
                sensor = sensor_of(self.model)
                variant, self.features = str(sensor.variant), features_of(sensor)
            except LidarcheckError as error:
                self.view.say(error)
        self._settings.find(variant, self._table.axis)

    def _seen(self) -> Path | None:
        """The file of the measurement that all screens look at."""
        host = self.view.host
        seen = host.numbers.seen
        return host.choice.measured(host.project) or (None if seen is None else seen.files[0])

    def follow(self) -> bool:
        """Go to what was chosen elsewhere; whether that is another dataset or model than before."""
        before = self.dataset, self.model
        self.find()
        return before != (self.dataset, self.model)

    # The next one; whether there is one

    def next_dataset(self, by: int) -> bool:
        """The next distance; what was read before is there at once."""
        if not self.datasets:
            self.view.say("no measurement in this project shows this table's axis")
            return False
        self.dataset = self._next(by)
        self.view.host.choice.choose("measurement", self.datasets[self.dataset].name)
        return True

    def _next(self, by: int) -> int:
        """The dataset after this one, of its set where that has others, else of all."""
        numbers, path = self.view.host.numbers, self.datasets[self.dataset].path
        own = [one for one in numbers.measured.all if path in one.files]
        files = {one.files[0] for mine in own[:1] for one in numbers.measured.set_of(mine)}
        near = [at for at, dataset in enumerate(self.datasets) if dataset.path in files]
        among = near if len(near) > 1 and self.dataset in near else list(range(len(self.datasets)))
        return among[(among.index(self.dataset) + by) % len(among)]

    def next_model(self) -> bool:
        """The next model."""
        models = self.view.host.project.of("model")
        if not models:
            self.view.say("there is no model in this project")
            return False
        paths = [entry.path for entry in models]
        at = (paths.index(self.model) + 1) % len(paths) if self.model in paths else 0
        self.model = paths[at]
        self.view.host.choice.choose("target", "")
        self.view.host.choice.choose("model", models[at].name)
        self.view.say(f"model: {models[at].name}")
        self._find_settings()
        return True

    def next_target(self) -> bool:
        """The next retro-reflecting material."""
        retros = _retros(self.model) if self.model else []
        if not retros:
            self.view.say("the model has no retro-reflector")
            return False
        at = (retros.index(self.material) + 1) % len(retros) if self.material in retros else min(1, len(retros) - 1)
        self.view.host.choice.choose("target", str(retros[at]))
        self.view.say(f"target: material {self.material} of {', '.join(map(str, retros))}")
        return True

    def retros(self) -> list[int]:
        """The retro-reflecting materials of the model."""
        return _retros(self.model) if self.model else []

    def aim(self, material: int) -> None:
        """A material as the target."""
        self.view.host.choice.choose("target", str(material))
        self.view.say(f"target: material {material}")

    def next_feature(self) -> bool:
        """The next feature of the sensor."""
        if self.four:
            self.view.say("all features are shown; b goes back to one of them")
            return False
        self.view.host.choice.next_feature(self.features)
        return True

    # What is seen

    @property
    def current(self) -> Dataset | None:
        """The dataset that n and p go on from."""
        return self.datasets[self.dataset] if self.datasets else None

    def tiles(self) -> list[tuple[int, str]]:
        """(dataset, feature) of each pane that is seen."""
        if self.four:
            return [(self.dataset, feature) for feature in self.features[: len(TILES)]]
        number = max(min(self.across, len(self.datasets)), 1)
        first = max(min(self.dataset, len(self.datasets) - number), 0)
        return [(first + i, self.feature) for i in range(number)]

    def choice(self, dataset: int) -> Choice | None:
        """What a dataset is looked at with; None without datasets or a model."""
        if not self.datasets or self.model is None or not self.opened:
            return None
        one = self.datasets[dataset]
        settings = self._settings.in_force() if one.by_settings else None
        return Choice(one, self.model, self._table.axis, settings, self.material)

    def choices(self) -> list[Choice]:
        """Those of all panes, each once."""
        seen = (self.choice(dataset) for dataset in dict.fromkeys(dataset for dataset, _ in self.tiles()))
        return [choice for choice in seen if choice is not None]


def _retros(model: Path) -> list[int]:
    try:
        return retros_of(model)
    except LidarcheckError:
        return []
