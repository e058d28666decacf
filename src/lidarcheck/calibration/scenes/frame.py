"""A frame of a scene as it was measured and as the model shows it."""

from __future__ import annotations

import functools
from dataclasses import dataclass

from lidarcheck.model.chain import simulate
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Surfaces
from lidarcheck.rays import Caster
from lidarcheck.scan import IdealScan, Scan

__all__ = ["SceneFrame", "simulated_frame"]


@dataclass(frozen=True)
class SceneFrame:
    """A frame: what was measured, what the beams meet, what the model shows.

    `again`: the model's frame with other random numbers, None where there is none. `file`, `ideal_file`,
    `simulated_file`: where they were read from, for messages.
    """

    measured: Scan
    ideal: IdealScan
    simulated: Scan
    again: Scan | None = None
    file: str = ""
    ideal_file: str = ""
    simulated_file: str = ""


def simulated_frame(
    measured: Scan,
    ideal: IdealScan,
    model: Model,
    *,
    seed: int = 0,
    number: int = 0,
    scene: Caster | None = None,
    file: str = "",
    ideal_file: str = "",
) -> SceneFrame:
    """A frame with the model's two simulations of it, of `seed` and of the seed behind it."""
    shown = functools.partial(simulate, ideal, model, frame=number, scene=scene, surfaces=Surfaces(ideal))
    one, other = (shown(seed=run % 2**64) for run in (seed, seed + 1))
    return SceneFrame(measured, ideal, one, other, file, ideal_file, "" if model.file is None else str(model.file))
