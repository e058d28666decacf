"""The measured frames of a project with their ideal scans, and their comparison with what a model shows of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.session.model_choice import which_model
from lidarcheck.session.node import ProgressCallback
from lidarcheck.session.pairing import measured_in
from lidarcheck.session.project import Entry, Project
from lidarcheck.tui.jobs.beside import Beside
from lidarcheck.tui.jobs.job import Computed, Job

if TYPE_CHECKING:
    from lidarcheck.model import Model

__all__ = ["Effects", "Offer", "offers_of", "scene_jobs"]


@dataclass(frozen=True)
class Effects:
    """What a model does beside its file: effects of its own that are left out, and others with typical parameters."""

    without: tuple[str, ...] = ()
    added: tuple[str, ...] = ()

    @classmethod
    def of(cls, text: str) -> Effects:
        """What `text` says; names that nobody knows are passed over."""
        from lidarcheck.effects import catalogue

        known = [(word[:1], word[1:]) for word in text.split() if word[1:] in catalogue()]
        without, added = (tuple(name for mark, name in known if mark == wanted) for wanted in "-+")
        return cls(without, added)

    def text(self) -> str:
        """As the state keeps it."""
        return " ".join([*(f"-{name}" for name in self.without), *(f"+{name}" for name in self.added)])

    def words(self) -> str:
        """As the list says it."""
        parts = [("without", self.without), ("with", self.added)]
        return "".join(f" {word} {', '.join(names)}" for word, names in parts if names)

    def applied(self, model: Model) -> Model:
        """The model with this choice; it may have changed since the choice was made."""
        from lidarcheck.calibration.scenes.effects import chosen_effects

        own = [effect.name for effect in model.effects]
        kept = [name for name in own if name not in self.without]
        added = [name for name in self.added if name not in own]
        return model if kept == own and not added else chosen_effects(model, only=[*kept, *added])[0]


class Offer(NamedTuple):
    """An effect that can be switched: whether it is on, and what is to be said of it; `able`: it can be."""

    name: str
    on: bool
    words: str
    able: bool = True


def offers_of(model: Model, effects: Effects) -> list[Offer]:
    """The model's own effects, then the others of the catalogue."""
    from lidarcheck.effects import catalogue, find, make

    own = [effect.name for effect in model.effects]
    offers = [Offer(name, name not in effects.without, "in the model") for name in own]
    for name in sorted(set(catalogue()) - set(own)):
        if reason := find(name).why_not(model.sensor):
            offers.append(Offer(name, False, reason, able=False))
            continue
        try:
            make(name, {})
            offers.append(Offer(name, name in effects.added, "with typical parameters"))
        except (TypeError, LidarcheckError):
            offers.append(Offer(name, False, "has no typical parameters: add it to the model file", able=False))
    return offers


def scene_jobs(
    project: Project, found: Mapping[Path, Beside], chosen: Callable[[Entry], tuple[Entry | None, Effects]]
) -> list[Job]:
    """A job for each measured frame, those that can be computed first.

    `found`: what stands beside each, by its resolved path. `chosen`: the model, None where there is none, and its
    effects, for a measured frame.
    """
    jobs = []
    for scan in measured_in(project, sound=False):
        own = found.get(scan.path.resolve(), Beside(None))
        jobs.append(_job(scan, own, *chosen(scan), which_model(project.of("model"))))
    return sorted(jobs, key=lambda job: bool(job.fault))


def _job(scan: Entry, own: Beside, model: Entry | None, effects: Effects, lacking: str) -> Job:
    stem, ideal = scan.path.stem, own.ideal
    fault = scan.fault
    if not fault and ideal is None:
        like = stem.removeprefix("real_").removesuffix("_real")
        fault = own.why or f"no ideal scan is named like it: ideal_{like}.txt, for example"
    if not fault and model is None:
        fault = lacking
    return Job(
        name=scan.name,
        words=f"{ideal.name if ideal else ''}, {model.name if model else ''}{effects.words()}",
        files=tuple(path for path in (scan.path, ideal, None if model is None else model.path) if path is not None),
        compute=lambda on_progress: _compare(
            scan.path, ideal, None if model is None else model.path, effects, on_progress, placement=own.placement
        ),
        choices=(effects, own.placement),
        fault=fault,
        kind="scenes",
    )


def _compare(
    measured: Path,
    ideal: Path | None,
    path: Path | None,
    effects: Effects,
    on_progress: ProgressCallback,
    *,
    placement: Placement = AS_IT_IS,
) -> Computed:
    from lidarcheck.calibration.scenes.read import provenance_of, read_frame
    from lidarcheck.calibration.scenes.workflow import compare_scene
    from lidarcheck.figures.pages.scenes import page
    from lidarcheck.model import load_model

    assert ideal is not None
    assert path is not None
    model = effects.applied(load_model(path))
    on_progress(0, 2, "reading and simulating; steps")
    frames = [read_frame(measured, ideal, model=model, placement=placement)]
    on_progress(1, 2, "comparing; steps")
    result = compare_scene(frames, materials={n: m.name for n, m in model.materials.items()})
    return Computed(page(result, provenance_of([(measured, ideal)], model)), result.to_dict(), result)
