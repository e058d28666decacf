"""The types of numpy arrays that the package's signatures name."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["BoolArray", "FloatArray", "IndexArray", "IntArray", "WordArray"]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]
"""Indices, counts and keys: 64 bits."""
IntArray = npt.NDArray[np.int32]
"""Layers, points, materials and objects: 32 bits."""
BoolArray = npt.NDArray[np.bool_]
WordArray = npt.NDArray[np.uint64]
