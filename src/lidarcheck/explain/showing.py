"""What a case's data can show, before anything is explained: the first steps of the gap workflow, and no more."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from lidarcheck.cases.frame import FEWEST_FRAMES
from lidarcheck.effects.finding import catalogue, find
from lidarcheck.effects.search import search_spec
from lidarcheck.explain.progress import ignore_progress
from lidarcheck.explain.report.explanation import Progress, ProgressCallback
from lidarcheck.explain.steps import Workflow
from lidarcheck.workers import Processes, one_blas_thread

if TYPE_CHECKING:
    from lidarcheck.cases.case import Case

__all__ = ["SHOWING", "Showing", "what_shows"]

SHOWING = Progress({"residuals and floor": 0.45, "candidates": 0.5, "equivalence and testability": 0.05})
"""The steps' shares of the work."""
_TOO_FEW = f"fewer than {FEWEST_FRAMES} frames: one each to fit, to select and to verify is the least"
_NO_SEARCH = "nothing says where a search for it would begin"


@dataclass(frozen=True)
class Showing:
    """What the data can show. `shown`, `not_testable`: the catalogue's effects, and of the others why not.

    `parts`: the numbers of the frames that are to fit, to select and to verify. `before`, `floor`: distance of measured
    and simulated summaries on the frames to fit, before any fit and where nothing is missing; None with too few frames.
    `geometry`: whether X, Y, Z agree with the beams, in words. `left_out`: damaged frames, and why. `ideals_from`: what
    the ideal scans were made from, empty for a scene.
    """

    shown: tuple[str, ...]
    not_testable: Mapping[str, str]
    parts: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    before: float | None = None
    floor: float | None = None
    geometry: str = ""
    left_out: Mapping[str, str] = field(default_factory=dict)
    ideals_from: str = ""

    @property
    def words(self) -> str:
        """How many of the effects these data can show."""
        total = len(self.shown) + len(self.not_testable)
        return f"{len(self.shown)} of {total} effects can be shown by these data"

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "words": self.words,
            "shown": list(self.shown),
            "not_testable": dict(self.not_testable),
            "effects": len(self.shown) + len(self.not_testable),
            "parts": {name: list(numbers) for name, numbers in self.parts.items()},
            "distance": {"before": self.before, "floor": self.floor},
            "geometry": self.geometry,
            "left_out": dict(self.left_out),
            "ideals_from": self.ideals_from,
        }


def what_shows(case: Case, *, seed: int = 0, jobs: int = 1, on_progress: ProgressCallback | None = None) -> Showing:
    """Which effects a case's frames can show, by what `explain` itself would say of them with the same seed.

    Frames to verify are not looked at for it. With fewer than three frames nothing can be shown.
    """
    about: dict[str, Any] = {
        "geometry": case.geometry_words, "left_out": case.left_out, "ideals_from": case.origin.source
    }  # fmt: skip
    if len(case.frames) < FEWEST_FRAMES:
        return Showing((), dict.fromkeys(catalogue(), _TOO_FEW), **about)
    with one_blas_thread(), Processes(jobs) as pool:
        run = Workflow(case.model, seed, (), pool, on_progress or ignore_progress, origin=case.origin)
        split = run.split(case)
        split, bench = run.exchange_frames(split, run.measure_residuals_and_floor(split))
        screened, bench = run.screen_candidates(bench)
        untestable = {name: why for name, why in run.list_untestable(bench, screened).items() if why}
    untestable |= {name: _why_never(name, case) for name in catalogue() if not search_spec(name).is_searched}
    untestable = {name: untestable[name] for name in catalogue() if name in untestable}
    shown = tuple(name for name in catalogue() if name not in untestable)
    floor = bench.simulator.floor_distance
    return Showing(shown, untestable, split.numbers(), bench.start, floor, **about)


def _why_never(name: str, case: Case) -> str:
    return find(name).why_not(case.model.sensor) or case.origin.why_unseen(search_spec(name)) or _NO_SEARCH
