"""The maps of Cloud: whole measured frames beside what a model shows of them, and where the two disagree."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from lidarcheck.errors import LidarcheckError
from lidarcheck.session.model_choice import NONE, chosen_model, suits, which_model
from lidarcheck.session.pairing import labels_of
from lidarcheck.session.project import Entry
from lidarcheck.tui.chooser import Opening
from lidarcheck.tui.jobs.beside import Beside, beside
from lidarcheck.tui.jobs.job import Job
from lidarcheck.tui.jobs.scenes import Effects, offers_of, scene_jobs
from lidarcheck.tui.screens.pages.lines import together
from lidarcheck.tui.screens.pages.screen import PageView
from lidarcheck.tui.widgets.choose import Choose

if TYPE_CHECKING:
    from lidarcheck.figures.data import Figure, Page
    from lidarcheck.model import Model

__all__ = ["Scenes"]

_AT_ONCE = 4


class Scenes(PageView):
    """The part of Cloud that compares whole frames.

    `effects`: of each model, by its name, what was switched on and off; kept for the next start.
    """

    NAME = "cloud"
    EMPTY = (
        "no frame was measured here: that takes scans, as real_street.pcd, and for each the ideal scan of the same "
        "frame, ideal_street.pcd or real_street_ideal.pcd, and a model"
    )
    WORDS: ClassVar[dict[str, str]] = {
        "jobs": "The measured frames, each with the ideal scan of its name. r has the model show the same frame and "
        "compares the two; o chooses another model, E switches effects on and off, so that you see what an effect "
        "explains. Pages of other choices are kept.",
        "figures": "Maps over azimuth and elevation of where the two disagree: echoes, AREA, range, stray echoes, "
        "measured minus simulated; f, Right and Left go on to the points of the largest disagreement and to detection "
        "over elevation.",
        "words": "The disagreements, the largest first; overlap and Chamfer distance beside those of two simulations; "
        "the distances of the distributions; each object; each sector.",
    }

    def __init__(self) -> None:
        super().__init__()
        self.beside: dict[Path, Beside] = {}

    def jobs(self) -> list[Job]:
        """A job for each measured frame, with the model and the effects that are chosen for its variant."""

        def chosen(scan: Entry) -> tuple[Entry | None, Effects]:
            model = self._model(scan)
            return model, self._effects(model)

        self.beside = beside(self.host.project)
        return scene_jobs(self.host.project, self.beside, chosen)

    def groups(self, page: Page) -> list[tuple[Figure, ...]]:
        """The maps first, so many at once as can be read, then all else."""
        from lidarcheck.figures.data import Grid

        most = self.board.room(_AT_ONCE)
        maps = [figure for figure in page.figures() if isinstance(figure, Grid)]
        others = [figure for figure in page.figures() if not isinstance(figure, Grid)]
        return [*together(maps, most), *((figure,) for figure in others)]

    # Choices

    def _models(self) -> list[Entry]:
        return self.host.project.of("model")

    def _model(self, scan: Entry | None) -> Entry | None:
        """The model that is chosen for the variant of a frame, else the likely one."""
        project, variant = self.host.project, _variant(scan)
        beside = project.root if scan is None else scan.path.parent
        wanted = self.host.choice.of("model")
        return chosen_model(project, "" if wanted == NONE else wanted, beside, variant)

    def _scan(self) -> Entry | None:
        """The frame under the cursor."""
        scans = self.host.project.of("scan", sound=False)
        return next((entry for entry in scans if self.job is not None and entry.name == self.job.name), None)

    def _effects(self, model: Entry | None) -> Effects:
        kept = self.host.state.selected
        return Effects() if model is None else Effects.of(kept.get(f"effects {model.name}", ""))

    def _choose(self, model: Entry, effects: Effects) -> None:
        self.host.state.selected[f"effects {model.name}"] = effects.text()
        self.say(f"{model.name}{effects.words() or ', as its file says'}")
        self.project_changed()

    def action_next_model(self) -> None:
        """The next model."""
        scan = self._scan()
        models = [model for model in self._models() if suits(model, _variant(scan))]
        if not models:
            self.say(which_model(models))
            return
        now = self._model(scan)
        at = 0 if now is None else (models.index(now) + 1) % len(models)
        self.host.choice.choose("model", models[at].name)
        self.say(f"model: {models[at].name} ({at + 1} of {len(models)})")
        self.project_changed()

    def action_effects(self) -> None:
        """Switch effects on and off in a list."""
        found = self._read_model()
        if found is None:
            return
        entry, model = found
        offers = offers_of(model, self._effects(entry))
        own = [effect.name for effect in model.effects]

        def taken(on: frozenset[str] | None) -> None:
            if on is not None:
                added = tuple(offer.name for offer in offers if offer.name in on and offer.name not in own)
                self._choose(entry, Effects(tuple(name for name in own if name not in on), added))

        self.host.ask(Choose(f"Effects of {entry.name}", offers), taken)

    def _read_model(self) -> tuple[Entry, Model] | None:
        """The model that is chosen, and what its file says; None, and the reason is said, where there is none."""
        from lidarcheck.model import load_model

        entry = self._model(self._scan())
        if entry is None:
            self.say(which_model(self._models()))
            return None
        try:
            return entry, load_model(entry.path)
        except LidarcheckError as error:
            self.say(error)
            return None

    def openings(self) -> list[Opening]:
        """The catalogue's effects, each to be switched."""
        from lidarcheck.effects import catalogue

        return [Opening("effect", name, "on or off", partial(self._switch, name)) for name in sorted(catalogue())]

    def _switch(self, name: str) -> None:
        """An effect of the model that is chosen, on or off."""
        found = self._read_model()
        if found is None:
            return
        entry, model = found
        effects, own = self._effects(entry), {effect.name for effect in model.effects}
        offer = next(offer for offer in offers_of(model, effects) if offer.name == name)
        self.host.show_screen(self.NAME)
        if not offer.able:
            self.say(f"{name}: {offer.words}")
            return
        without, added = set(effects.without) - {name}, set(effects.added) - {name}
        if offer.on and name in own:
            without |= {name}
        elif not offer.on and name not in own:
            added |= {name}
        self._choose(entry, Effects(tuple(sorted(without)), tuple(sorted(added))))

    def action_own_effects(self) -> None:
        """The model as its file says."""
        entry = self._model(self._scan())
        if entry is None:
            self.say(which_model(self._models()))
        else:
            self._choose(entry, Effects())


def _variant(scan: Entry | None) -> str:
    """What the name of a frame says."""
    return "" if scan is None else labels_of(scan).variant
