"""The number, as a process that stays up computes it; what it may use again is held here, by content."""

from __future__ import annotations

from collections.abc import Callable

from lidarcheck.calibration.number.number import Number
from lidarcheck.calibration.number.request import Request

__all__ = ["expected", "sample", "whole"]

ProgressCallback = Callable[[int, int, str], object]


def _ignore(_done: int, _of: int, _now: str) -> None:
    """Nobody listens."""


def expected(request: Request, progress: ProgressCallback = _ignore) -> Number | None:
    """The number without noise, without a simulation; None where nothing can be expected without one."""
    raise NotImplementedError


def sample(request: Request, progress: ProgressCallback = _ignore) -> Number:
    """The number of the sample: of a table every line with a bright beam, of all else columns spread over the frame.

    `progress` hears (seeds done, of, what) and may raise to stop it, between seeds.
    """
    raise NotImplementedError


def whole(request: Request, progress: ProgressCallback = _ignore) -> Number:
    """The number of whole frames, for a report: `WHOLE_SEEDS` where the request leaves the sample's."""
    raise NotImplementedError
