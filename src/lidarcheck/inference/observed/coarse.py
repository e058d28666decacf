"""Whether amplitudes of repeats say anything: not where they are reported in steps that are wide beside the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lidarcheck.cases.frame import Frame
from lidarcheck.inference.observed.beam_table import beams_of
from lidarcheck.inference.observed.observations import FEATURES, observations_of
from lidarcheck.model.chain import simulate
from lidarcheck.model.estimates import DISTANCE_ERROR, REFLECTANCE_ERROR
from lidarcheck.model.spec import Model

__all__ = ["amplitude_tells"]

_AREA = FEATURES.index("area")
_STEPS = 2.0
"""A standard deviation of fewer steps is not resolved."""
_BINS, _FEWEST = 10, 8


def amplitude_tells(frames: Sequence[Frame], model: Model) -> bool:
    """Whether half of the amplitudes at least resolve their scatter; always where ideal scans are not from repeats.

    Where they do not, all rays of a surface lie at one place within a step, which no number of repeats tells: what
    their estimates are off by is common to them, and looks like an effect.
    """
    if frames[0].origin.source != "repeats":
        return True
    ideal = frames[0].ideal
    known = {name: c for name, c in ideal.extra.items() if name not in (DISTANCE_ERROR, REFLECTANCE_ERROR)}
    ideal = replace(ideal, extra=known)
    beams = beams_of([ideal], model)
    slot = beams.view.slots[0]
    if not slot.name:
        return False
    shown = [observations_of(beams, [simulate(ideal, model, seed=seed, threads=1)]) for seed in range(2)]
    both = shown[0].detected & shown[1].detected
    one, other = (np.exp(a.feature[both, _AREA]) if slot.log else a.feature[both, _AREA] for a in shown)
    order = np.argsort(one + other, kind="stable")
    squares = [part.mean() for part in np.array_split(((one - other) ** 2)[order], _BINS) if len(part) >= _FEWEST]
    resolved = [0.5 * square >= (_STEPS * slot.step) ** 2 for square in squares]
    return bool(squares) and 2 * sum(resolved) >= len(resolved)
