"""Which rows and echoes are a bright target's: its own, its ghost's, and those of its bloom beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.kpi.blooming import Axis, target_offset
from lidarcheck.kpi.ghost import GHOST_WITHIN_M, ghost_partners
from lidarcheck.kpi.pairing import OF_SURFACE_M, Pairing, paths
from lidarcheck.scan import IdealScan, Scan

if TYPE_CHECKING:
    from lidarcheck.model.spec import Model

__all__ = ["Bright", "beside_target", "ghost_rows", "target_rows"]

Rows = tuple[IndexArray, IndexArray, IndexArray]
Beside = tuple[IndexArray, FloatArray]


@dataclass(frozen=True)
class Bright:
    """A target's echoes in two scans, measured and simulated: what its ghost and its bloom are counted from.

    `strength_name`: the feature that tells how strong an echo is, empty where there is none; `strength`, `peak`: of all
    echoes, NaN where a scan has none of it. `ghosts`: `ghost_rows` of each side; `beside`: `beside_target` by axis.
    """

    strength_name: str
    strength: tuple[FloatArray, FloatArray]
    peak: tuple[FloatArray, FloatArray]
    ghosts: tuple[Rows, Rows]
    beside: Mapping[Axis, tuple[Beside, Beside]]

    @property
    def ratios(self) -> tuple[str, ...]:
        """What the ratios of mean strength and mean PEAK are called, those that there are."""
        name = self.strength_name
        own = ("area_ratio",) if name == "AREA" else (f"{name}_ratio",) if name else ()
        return (*own, "peak_ratio") if name == "AREA" else own


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


def ghost_rows(
    scan: Scan, pairing: Pairing, target: BoolArray, within_m: float = GHOST_WITHIN_M
) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Rows of the target's echoes (n,) and of its ghost's (m,), and of each of the latter which of the former, (m,)."""
    on_target = _on_target(pairing, target)
    partner = ghost_partners(scan, on_target, tolerance_m=within_m)
    # What stands at twice the range is a surface, not a ghost.
    found = np.flatnonzero((partner >= 0) & ~pairing.of_surface)
    rows = np.flatnonzero(on_target)
    return rows, found, np.asarray(np.searchsorted(rows, partner[found]))


def beside_target(
    scan: Scan, pairing: Pairing, ideal: IdealScan, target: BoolArray, axis: Axis, within_m: float = OF_SURFACE_M
) -> tuple[IndexArray, FloatArray]:
    """Rows, and offset from the target in layers or points, of its echoes and of those at its range on beams that do
    not see it, (n,). `within_m`: of its range."""
    rows = np.flatnonzero(target)
    offset, near = target_offset(scan.layer, scan.point, ideal.layer[rows], ideal.point[rows], axis, scan.beams)
    at_its_range = np.abs(paths(scan) - ideal.distance_m[rows[near]]) <= within_m
    of_target = np.flatnonzero((_on_target(pairing, target) | (~pairing.of_surface & at_its_range)) & (near >= 0))
    return of_target, offset[of_target]


def _on_target(pairing: Pairing, target: BoolArray) -> BoolArray:
    return pairing.of_surface & target[pairing.surface] & (pairing.surface >= 0)
