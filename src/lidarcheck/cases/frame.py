"""One frame of a case."""

from __future__ import annotations

from dataclasses import dataclass

from lidarcheck.scan import IdealScan, Scan

__all__ = ["Frame"]


@dataclass(frozen=True)
class Frame:
    """One frame of a case: `number` from 0 as in the case's file, what its beams meet, and what was measured."""

    number: int
    ideal: IdealScan
    measured: Scan
    time_s: float
