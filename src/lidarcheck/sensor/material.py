"""What surfaces return."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from lidarcheck.errors import UsageError

__all__ = ["RETRO_GAIN_MAX", "Material"]

RETRO_GAIN_MAX = 1e6


@dataclass(frozen=True, slots=True)
class Material:
    """What a surface returns.

    `reflectance` 0 ... 1; a retro-reflector multiplies it by `retro_gain`, at any incidence.
    """

    name: str
    reflectance: float
    kind: Literal["lambertian", "retro"] = "lambertian"
    retro_gain: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.reflectance <= 1.0:
            raise UsageError(f"reflectance = {self.reflectance} of {self.name} is out of range", fix="use 0 to 1")
        if not 0.0 <= self.retro_gain <= RETRO_GAIN_MAX:
            fix = f"use 0 to {RETRO_GAIN_MAX:g}"
            raise UsageError(f"retro_gain = {self.retro_gain} of {self.name} is out of range", fix=fix)
