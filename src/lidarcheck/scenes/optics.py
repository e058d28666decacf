"""Surfaces that show more than themselves: mirrors and panes."""

from __future__ import annotations

from dataclasses import dataclass

from lidarcheck.errors import UsageError

__all__ = ["Optics"]


@dataclass(frozen=True, slots=True)
class Optics:
    """The parts of the light that a smooth surface reflects as a mirror (`mirror`) and lets through (`transmission`).

    Of the power that falls on it, for one passage, 0 ... 1, together at most 1; what is left over is scattered, as the
    material's table entry says, or absorbed. A pane modelled as one sheet has the values of the whole pane.
    """

    mirror: float = 0.0
    transmission: float = 0.0

    def __post_init__(self) -> None:
        for name in ("mirror", "transmission"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= 1.0:
                raise UsageError(f"{name} = {value!r} is out of range", fix="use a number from 0 to 1")
        if self.mirror + self.transmission > 1.0 + 1e-12:
            raise UsageError(
                f"mirror + transmission = {self.mirror + self.transmission:g} is more than the light that falls in",
                fix="together they are at most 1",
            )
