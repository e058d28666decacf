"""Simulating a frame again with a model that differs by little: only what differs is simulated.

Random numbers are keyed by the beam, so that beams whose light is the same give the same echoes, to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lidarcheck.model.chain import echoes_of, read_out
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Run, Surfaces, check_seed, of_stage, run_and_light
from lidarcheck.scan import IdealScan, Light, Scan, joined, light_of_beams
from lidarcheck.sensor import Program

__all__ = ["DetectedFrame", "program_frames", "simulate_detected"]

_FEW = 0.7
"""Where more than this share of the beams differ, simulating all is as fast."""


@dataclass(frozen=True, slots=True)
class DetectedFrame:
    """Echoes of the SPADs before any readout effect, and the light and the run that they come from."""

    scan: Scan
    light: Light
    run: Run

    def read_out(self, model: Model) -> Scan:
        """What `simulate` gives with a model that differs from the one simulated by its readout effects alone."""
        return read_out(self.scan, replace(self.run, model=model), of_stage("readout", model.effects))


def simulate_detected(
    ideal: IdealScan,
    model: Model,
    *,
    seed: int = 0,
    frame: int = 0,
    threads: int | None = None,
    like: DetectedFrame | None = None,
    surfaces: Surfaces | None = None,
) -> DetectedFrame:
    """`simulate` up to the readout effects. `like`: the same frame with the same seed and another model, whose echoes
    are taken for the beams that get the same light. `surfaces`: those of this ideal scan, if known already."""
    check_seed(seed, frame)
    run, light = run_and_light(ideal, model, seed, frame, None, surfaces, threads)
    if isinstance(run.sensor, Program):
        return program_frames([(light, run)], [like])[0]

    def echoes(part: Light) -> Scan:
        return echoes_of(part, run.sensor, seed=seed, frame=frame, threads=threads, rounded=False)

    differs = None if like is None or like.run.sensor != run.sensor else _differing_beams(like.light, light)
    if like is None or differs is None or differs.mean() > _FEW:
        return DetectedFrame(echoes(light), light, run)
    if not differs.any():
        return DetectedFrame(like.scan, light, run)
    return DetectedFrame(_merged(like.scan, echoes(light_of_beams(light, differs)), light, differs), light, run)


def program_frames(
    frames: Sequence[tuple[Light, Run]], like: Sequence[DetectedFrame | None] = ()
) -> list[DetectedFrame]:
    """`simulate_detected` of a program on several frames at once. What its random numbers belong to nobody knows: only
    where no beam differs from `like` are those echoes taken."""
    from lidarcheck.model.external.around import program_echoes

    kept = [*like, *[None] * (len(frames) - len(like))]
    same = [_is_same(one, *frame) for one, frame in zip(kept, frames, strict=True)]
    new = iter(program_echoes([frame for frame, is_same in zip(frames, same, strict=True) if not is_same]))
    return [
        DetectedFrame(one.scan if one is not None and is_same else next(new), light, run)
        for one, (light, run), is_same in zip(kept, frames, same, strict=True)
    ]


def _is_same(like: DetectedFrame | None, light: Light, run: Run) -> bool:
    """Whether the program was handed just this before."""
    if like is None or like.run.sensor != run.sensor or (like.run.seed, like.run.frame) != (run.seed, run.frame):
        return False
    differs = _differing_beams(like.light, light)
    same_rows = like.run.ideal is run.ideal or np.array_equal(like.run.ideal.material_id, run.ideal.material_id)
    return same_rows and differs is not None and not bool(differs.any())


def _differing_beams(old: Light, new: Light) -> npt.NDArray[np.bool_] | None:
    """The beams of `new` whose pulses or background are others than in `old`, shape (n,); None where all may be."""
    same_air = old.haze is None and new.haze is None and old.shape == new.shape
    if not same_air or len(old) != len(new) or not np.array_equal(old.point, new.point):
        return None
    if not np.array_equal(old.layer, new.layer):
        return None
    counts = np.diff(new.first_pulse)
    differs = (old.background_per_ns != new.background_per_ns) | (np.diff(old.first_pulse) != counts)
    # Compare pulse by pulse in the beams that have equally many.
    mine = np.flatnonzero(~differs[new.pulse_beam])
    theirs = np.flatnonzero(~differs[old.pulse_beam])
    other = (old.pulse_range_m[theirs] != new.pulse_range_m[mine]) | (
        old.pulse_signal[theirs] != new.pulse_signal[mine]
    )
    differs[new.pulse_beam[mine][other]] = True
    return np.asarray(differs)


def _merged(old: Scan, new: Scan, light: Light, differs: npt.NDArray[np.bool_]) -> Scan:
    """The echoes of the beams that differ from `new`, those of the others from `old`, in order of beam and echo."""
    keys = light.layer.astype(np.int64) << 32 | light.point
    changed = keys[differs]
    kept = old.take(~np.isin(old.layer.astype(np.int64) << 32 | old.point, changed))
    both = joined([kept, new])
    return both.take(np.lexsort((both.echo_number, both.point, both.layer)))
