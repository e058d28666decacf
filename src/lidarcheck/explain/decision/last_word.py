"""What the frames say that no fit and no choice has seen: the gap, and at most one word of the verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from lidarcheck.explain.decision.answer import Answer
from lidarcheck.explain.decision.calibration import with_shares
from lidarcheck.explain.report.explanation import Calibrated
from lidarcheck.inference.intervals import Gap
from lidarcheck.inference.wasserstein import Scale, gap_of
from lidarcheck.model.spec import Model
from lidarcheck.workers import WorkerPool

__all__ = ["CALIBRATION", "LEAST_CLOSED", "Verified", "last_word", "verified"]

CALIBRATION = "gain, reflectances and pose"
"""The last stage of an explained model: small errors put right."""

LEAST_CLOSED = 0.5
"""Where less of the gap closes on unseen frames, by the upper end of its 90 % interval, nothing is explained: most of
what is wrong is something else, or the names hold only where they were chosen."""


@dataclass(frozen=True)
class Verified:
    """What was found on the unseen frames: the verdict, the gap, the model that is written, and what of it is
    calibrated."""

    verdict: str
    gap: Gap
    model: Model
    calibrated: tuple[Calibrated, ...]


def last_word(verdict: str, gap: Gap) -> str:
    """The verdict after the look at the unseen frames; `unknown` in the place of `explained` where these do not bear it
    out. Names and numbers stay as they are."""
    return "unknown" if verdict == "explained" and gap.closed_span[1] < LEAST_CLOSED else verdict


def verified(
    scale: Scale,
    answer: Answer,
    calibrates: bool,
    on_progress: Callable[[Sequence[str], int, int, float], object],
    pool: WorkerPool,
) -> Verified:
    """What some unseen frames say of an answer. The word is said of the model with its calibration, whether or not that
    is to be written: usual errors are no reason to call an effect unknown."""

    def gap_with(stages: Sequence[tuple[str, Model]]) -> Gap:
        return gap_of(scale, stages, lambda i, n, gap: on_progress([name for name, _ in stages], i, n, gap), pool)

    stages = answer.stages
    if not answer.calibrated:
        gap = gap_with(stages)
        return Verified(last_word(answer.verdict, gap), gap, stages[-1][1], ())
    all_stages = (*stages, (CALIBRATION, answer.calibrating[-1]))
    gap = gap_with(all_stages)
    verdict = last_word(answer.verdict, gap)
    if not calibrates:
        return Verified(verdict, gap_with(stages), stages[-1][1], ())
    shares = with_shares(scale, answer.calibrated, answer.calibrating, gap, pool)
    return Verified(verdict, gap, answer.calibrating[-1], shares)
