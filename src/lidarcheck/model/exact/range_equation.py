"""The lidar range equation for rows of an ideal scan, in compiled code that several threads can run at once."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.jit import kernel

__all__ = ["NOT_FINITE", "UNKNOWN", "range_equation"]


NOT_FINITE, UNKNOWN = 1, 2
"""What is wrong with rows: a distance below 0 or anything not finite; a surface of a material without an entry."""
_NEAREST_M = 1e-3
"""The range equation has no limit at zero range; nothing can stand nearer than this to the sensor's window."""


@kernel
def range_equation(
    distance_m: FloatArray,
    cosine: FloatArray,
    material: npt.NDArray[np.int32],
    strength: FloatArray,
    falloff: FloatArray,
    near2: float,
    signal: FloatArray,
) -> int:
    """S of each row into `signal`, 0 where it meets nothing; returns what is wrong, as a sum of the above.

    `cosine`: of the incidence angle. `strength` and `falloff` (see `light.material_tables`), by material, end with the
    entry of all that have none, which is NaN. `near2` [m^2] is added to the range's square: what optics lose close by.
    """
    wrong = 0
    last = np.uint32(len(strength) - 1)
    for row in range(len(signal)):
        i: Any = np.uint64(row)
        distance = distance_m[i]
        number = np.uint32(material[i])
        number = number if number < last else last
        lit = min(max(cosine[i], 0.0), 1.0) if falloff[number] > 0.0 else 1.0
        range_m = max(distance, _NEAREST_M)
        value = strength[number] * lit / (range_m * range_m + near2)
        if not (distance >= 0.0 and distance < math.inf and cosine[i] - cosine[i] == 0.0):
            wrong |= NOT_FINITE
        elif distance > 0.0 and value != value:
            wrong |= UNKNOWN
        signal[i] = value if distance > 0.0 else 0.0
    return wrong
