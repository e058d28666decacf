"""Simulating a frame again with a model that differs by little: only what differs is simulated.

Random numbers are keyed by the beam, so that beams whose light is the same give the same echoes, to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.model.chain import echoes_of, read_out
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Run, Surfaces, check_seed, of_stage, run_and_light
from lidarcheck.scan import Haze, IdealScan, Light, Scan, joined, light_of_beams
from lidarcheck.sensor import Program

__all__ = ["DetectedFrame", "detected", "program_frames", "simulate_detected"]

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
    return detected(light, run, like, threads=threads)


def detected(light: Light, run: Run, like: DetectedFrame | None = None, *, threads: int | None = None) -> DetectedFrame:
    """The echoes of a light. `like`: as of `simulate_detected`; of another seed, frame or sensor nothing is taken."""
    if isinstance(run.sensor, Program):
        return program_frames([(light, run)], [like])[0]

    def echoes(part: Light) -> Scan:
        return echoes_of(part, run.sensor, seed=run.seed, frame=run.frame, threads=threads, rounded=False)

    differs = None if like is None else _differing(like, light, run)
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
    if like is None:
        return False
    differs = _differing(like, light, run)
    same_rows = like.run.ideal is run.ideal or np.array_equal(like.run.ideal.material_id, run.ideal.material_id)
    return same_rows and differs is not None and not bool(differs.any())


def _differing(like: DetectedFrame, light: Light, run: Run) -> BoolArray | None:
    """The beams that get another light than they got there, shape (n,); None where all may show other echoes."""
    if like.run.sensor != run.sensor or (like.run.seed, like.run.frame) != (run.seed, run.frame):
        return None
    return np.zeros(len(light), dtype=np.bool_) if like.light is light else _differing_beams(like.light, light)


def _differing_beams(old: Light, new: Light) -> BoolArray | None:
    """The beams of `new` whose pulses, background or haze are others than in `old`, shape (n,); None where all may
    be."""
    if old.shape != new.shape or len(old) != len(new) or not np.array_equal(old.point, new.point):
        return None
    if not np.array_equal(old.layer, new.layer) or not _same_air(old.haze, new.haze):
        return None
    differs = old.background_per_ns != new.background_per_ns
    pulses = ("pulse_range_m", "pulse_signal")
    differs |= _rows_differ(old.first_pulse, new.first_pulse, [(getattr(old, n), getattr(new, n)) for n in pulses])
    if old.haze is not None and new.haze is not None:
        rows = [(getattr(old.haze, n), getattr(new.haze, n)) for n in ("row_end_m", "row_share")]
        differs |= _rows_differ(old.haze.first_row, new.haze.first_row, rows)
    return np.asarray(differs)


def _same_air(old: Haze | None, new: Haze | None) -> bool:
    """Whether the air scatters light back alike, up to whatever range a beam sees of it."""
    if old is None or new is None:
        return old is new
    return old.step_m == new.step_m and np.array_equal(old.density_per_m, new.density_per_m)


def _rows_differ(
    old_first: IndexArray, new_first: IndexArray, columns: Sequence[tuple[FloatArray, FloatArray]]
) -> BoolArray:
    """The beams whose rows, `first` ... of each, are others in one of the columns (old, new), shape (n,)."""
    counts = np.diff(new_first)
    differs = np.asarray(np.diff(old_first) != counts)
    # Compare row by row in the beams that have equally many.
    beam = np.repeat(np.arange(len(counts)), counts)
    mine, theirs = np.flatnonzero(~differs[beam]), np.flatnonzero(np.repeat(~differs, np.diff(old_first)))
    for old, new in columns:
        differs[beam[mine[old[theirs] != new[mine]]]] = True
    return differs


def _merged(old: Scan, new: Scan, light: Light, differs: BoolArray) -> Scan:
    """The echoes of the beams that differ from `new`, those of the others from `old`, in order of beam and echo."""
    keys = light.layer.astype(np.int64) << 32 | light.point
    changed = keys[differs]
    kept = old.take(~np.isin(old.layer.astype(np.int64) << 32 | old.point, changed))
    both = joined([kept, new])
    return both.take(np.lexsort((both.echo_number, both.point, both.layer)))
