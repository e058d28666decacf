"""What is said of a case, before and after the frames that no fit has seen were asked."""

from __future__ import annotations

from dataclasses import dataclass, replace

from lidarcheck.explain.explanation import Finding
from lidarcheck.model.spec import Model

__all__ = ["CALIBRATION", "Answer"]

CALIBRATION = "gain, reflectances and pose"
"""The last stage of an explained model: small errors put right."""


@dataclass(frozen=True)
class Answer:
    """The verdict with its findings, and the models from the case's own to the explained one, effect by effect."""

    verdict: str
    findings: tuple[Finding, ...]
    stages: tuple[tuple[str, Model], ...]
    words: str

    def without_terms(self) -> Answer:
        """The same without its empirical terms."""
        finding = replace(self.findings[0], effects=())
        stages = (self.stages[0], ("empirical: no term helps", self.stages[0][1]))
        return replace(self, findings=(finding,), stages=stages)

    def without_calibration(self) -> Answer:
        """The same with the small errors left as they are."""
        return replace(self, stages=tuple(stage for stage in self.stages if stage[0] != CALIBRATION))
