"""What a sensor reports of an echo besides its range."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

__all__ = ["LAWS", "Feature"]

LAWS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "peak_counts": (),
        "area_counts": (),
        "width_bins": (),
        "photons": (),
        "affine": ("gain", "offset"),
        "log": ("gain", "offset"),
        "range_corrected": ("gain",),
        "calibrated_reflectivity": ("knee", "above", "top_percent"),
        "background": ("gain",),
        "width_above_threshold": (),
        "attenuation": ("per_m",),
        "confidence": ("snr_full",),
        "histogram": (),
        "table": ("file",),
    }
)
"""Every law of a feature with the numbers of its own; `lidarcheck.sensor.laws` computes them."""


@dataclass(frozen=True)
class Feature:
    """One value that the sensor reports an echo, by its law.

    Values are rounded to `step` (0: not at all; halves to even) and cut to `low`, `high` and `bits`. `log`: differences
    are judged as ratios. `aliases`: names of its column in files. `numbers`: the law's own. `table`: amplitudes
    and values of the law `table`, as its file holds them.
    """

    name: str
    law: str
    unit: str = ""
    step: float = 0.0
    low: float | None = None
    high: float | None = None
    bits: int | None = None
    log: bool = False
    aliases: tuple[str, ...] = ()
    numbers: Mapping[str, Any] = field(default_factory=dict)
    table: tuple[tuple[float, ...], tuple[float, ...]] | None = None

    def __hash__(self) -> int:
        return hash((self.name, self.law, self.step, self.low, self.high, self.bits))

    @property
    def most(self) -> float | None:
        """The largest value that it can have, None without a limit."""
        limits = [
            limit for limit in (self.high, None if self.bits is None else 2.0**self.bits - 1.0) if limit is not None
        ]
        return min(limits, default=None)
