"""Which repeats fit, select and verify: in time, so that what changes slowly shows between them."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FEWEST_FOR_VERDICT", "Parts", "parts_of"]

FEWEST_FOR_VERDICT = 3


@dataclass(frozen=True)
class Parts:
    """The part of each frame, in order of time: fit, select, verify; fewer than three frames all fit."""

    names: tuple[str, ...]

    @property
    def estimating(self) -> tuple[int, ...]:
        """The frames that ideal scans are made of: fit and select; of three frames all."""
        if len(self.names) <= FEWEST_FOR_VERDICT:
            return tuple(range(len(self.names)))
        return tuple(k for k, name in enumerate(self.names) if name != "verify")

    def others(self, frame: int) -> tuple[int, ...]:
        """The frames that the ideal scan of a frame is made of: never itself."""
        return tuple(k for k in self.estimating if k != frame)

    @property
    def fitting(self) -> tuple[int, ...]:
        """The frames that laws are fitted on: those of the fit; with select, where these alone are one."""
        fit = tuple(k for k, name in enumerate(self.names) if name == "fit")
        return fit if len(fit) > 1 else tuple(k for k, name in enumerate(self.names) if name != "verify")


def parts_of(frames: int) -> Parts:
    """A quarter of the frames verifies, a quarter selects, at least one each; the rest, and the first, fit.

    Of three frames each is judged by the other two: what is left of the fit and the select frame alone is no repeat.
    """
    if frames < FEWEST_FOR_VERDICT:
        return Parts(("fit",) * frames)
    quarter = max(frames // 4, 1)
    return Parts(("fit",) * (frames - 2 * quarter) + ("select",) * quarter + ("verify",) * quarter)
