"""What drivers mean by the fields of their clouds, where a name alone does not say it.

Times keep their own column (`formats.times`, `formats.assign.clock`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["known_fields"]

Column = npt.NDArray[Any]
_MM = 0.001


def known_fields(columns: Mapping[str, Column]) -> tuple[dict[str, Column], tuple[str, ...]]:
    """The columns with ranges in metres under one name, and what was done to them, in words.

    `range` in whole numbers is Ouster's, in mm; `distance` beside positions is nebula's, in m.
    """
    found: dict[str, Column] = {}
    said: list[str] = []
    lowered = {name.casefold() for name in columns}
    for name, column in columns.items():
        plain = name.casefold()
        if plain == "range" and column.dtype.kind in "iu" and {"x", "y", "z"} <= lowered:
            found["RANGE"] = column * np.float64(_MM)
            said.append(f"{name} (whole mm) as RANGE in metres")
        elif plain == "distance" and {"x", "y", "z"} <= lowered and "range" not in lowered:
            found["RANGE"] = column
            said.append(f"{name} as RANGE")
        else:
            found[name] = column
    return found, tuple(said)
