"""Which rows and echoes are a bright target's: its own, its ghost's, and those of its bloom beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.kpi.blooming import Axis, target_offset
from lidarcheck.kpi.ghost import ghost_partners
from lidarcheck.kpi.pairing import OF_SURFACE_M, Pairing, ranges
from lidarcheck.scan import IdealScan, Scan

if TYPE_CHECKING:
    from lidarcheck.model.spec import Model

__all__ = ["beside_target", "ghost_rows", "target_rows"]


def target_rows(ideal: IdealScan, model: Model | None, target: npt.ArrayLike | None) -> BoolArray | None:
    """Rows of the ideal scan that are the target, shape (n_ideal,), or None where none is known."""
    if target is not None:
        mask = np.asarray(target)
        if mask.dtype != np.bool_ or mask.shape != (len(ideal),):
            raise UsageError(
                f"the target is {mask.dtype} of shape {mask.shape}",
                fix=f"give a mask of the ideal scan's {len(ideal)} rows",
            )
    elif model is not None:
        retro = [number for number, material in model.materials.items() if material.kind == "retro"]
        mask = np.isin(ideal.material_id, retro)
    else:
        return None
    hit = mask & (ideal.distance_m > 0.0)
    return hit if hit.any() else None


def ghost_rows(scan: Scan, pairing: Pairing, target: BoolArray) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Rows of the target's echoes (n,) and of its ghost's (m,), and of each of the latter which of the former, (m,)."""
    on_target = _on_target(pairing, target)
    partner = ghost_partners(scan, on_target)
    # What stands at twice the range is a surface, not a ghost.
    found = np.flatnonzero((partner >= 0) & ~pairing.of_surface)
    rows = np.flatnonzero(on_target)
    return rows, found, np.asarray(np.searchsorted(rows, partner[found]))


def beside_target(
    scan: Scan, pairing: Pairing, ideal: IdealScan, target: BoolArray, axis: Axis
) -> tuple[IndexArray, FloatArray]:
    """Rows, and offset from the target, of its echoes and of those at its range on beams that do not see it, (n,)."""
    rows = np.flatnonzero(target)
    offset, near = target_offset(scan.layer, scan.point, ideal.layer[rows], ideal.point[rows], axis)
    at_its_range = np.abs(ranges(scan) - ideal.distance_m[rows[near]]) <= OF_SURFACE_M
    of_target = np.flatnonzero((_on_target(pairing, target) | (~pairing.of_surface & at_its_range)) & (near >= 0))
    return of_target, offset[of_target]


def _on_target(pairing: Pairing, target: BoolArray) -> BoolArray:
    return pairing.of_surface & target[pairing.surface] & (pairing.surface >= 0)
