"""How much more or less light each beam's echo asks for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["Dimming"]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Dimming:
    """Per beam the ln gain that its echo asks for, and the weight of that; shape (n,)."""

    log_gain: FloatArray
    weight: FloatArray

    def mean(self, group: IndexArray, count: int) -> tuple[FloatArray, FloatArray]:
        """Weighted mean of each group and its weight; groups below 0 take no part."""
        used = group >= 0
        weight = np.bincount(group[used], self.weight[used], count)
        total = np.bincount(group[used], (self.weight * self.log_gain)[used], count)
        return total / np.maximum(weight, 1e-9), weight.astype(np.float64)
