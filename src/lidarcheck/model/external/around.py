"""Effects around somebody else's program: what runs before it, the program, what runs behind it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from lidarcheck.effects.shared.reflectance import reflectance_of
from lidarcheck.errors import ExternalModelError
from lidarcheck.formats.ideals import table_from_ideal
from lidarcheck.model.external.command import names_in
from lidarcheck.model.external.handed import handed
from lidarcheck.model.external.process import failure
from lidarcheck.model.external.reads import readied
from lidarcheck.model.external.running import Request, run_requests
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Run, Surfaces
from lidarcheck.scan import IdealScan, Light, Scan
from lidarcheck.sensor import Program

__all__ = ["alone", "bare_run", "program_echoes", "run_alone", "seed_of_frame"]

_SEEDS = 2**31
"""Seeds that every program can hold."""


def alone(model: Model, ideal: IdealScan) -> bool:
    """Whether the program gets the ideal scan as it is: nothing stands around it, and nobody asks what it reads."""
    program = model.sensor
    if model.effects or not isinstance(program, Program) or program.reads is not None:
        return False
    return program.known == model.materials and reflectance_of(ideal) is None


def run_alone(ideal: IdealScan, model: Model, seed: int, frame: int) -> Scan:
    """The program's echoes of an ideal scan as it is."""
    assert model.external is not None
    columns = tuple(table_from_ideal(ideal).names)
    program = model.sensor
    settings = dict(program.settings) if isinstance(program, Program) else {}
    request = Request(ideal, seed_of_frame(model, seed, frame), frame, settings, columns)
    with _named(model):
        return run_requests(model.external, [request], program)[0]


def program_echoes(lights: Sequence[tuple[Light, Run]]) -> list[Scan]:
    """The program's echoes of the light of some frames, in their order, side by side: one model, any seeds."""
    if not lights:
        return []
    model = lights[0][1].model
    assert model.external is not None
    requests = [_request(light, run) for light, run in lights]
    with _named(model):
        scans = run_requests(model.external, requests, lights[0][1].sensor)
        for request, scan in zip(requests, scans, strict=True):
            _check_beams(request.ideal, scan, model)
    return scans


def bare_run(program: Program, light: Light, seed: int, frame: int) -> Run:
    """The run of light that comes from no surface of an ideal scan."""
    model = readied(Model(program, program.known, external=program.runs))
    nothing = np.empty(0, dtype=np.int32)
    ideal = IdealScan(nothing, nothing, np.empty(0), nothing, np.empty(0), beams=light.beams)
    return Run(seed, frame, model, model.sensor, ideal, None, Surfaces(ideal))


def _request(light: Light, run: Run) -> Request:
    program = run.sensor
    assert isinstance(program, Program)
    ideal, columns = handed(light, run)
    seed = seed_of_frame(run.model, run.seed, run.frame)
    return Request(ideal, seed, run.frame, dict(program.settings), columns)


def seed_of_frame(model: Model, seed: int, frame: int) -> int:
    """The seed that the program gets: the run's own, or one of the frame's own where it knows no frames."""
    program, external = model.sensor, model.external
    assert external is not None
    reads = program.reads if isinstance(program, Program) else None
    knows = "frame" in names_in(external.command) if reads is None else "Frame" in reads
    if frame == 0 or knows:
        return seed
    return int.from_bytes(hashlib.sha256(f"{seed} {frame}".encode()).digest()[:8], "big") % _SEEDS


def _check_beams(ideal: IdealScan, scan: Scan, model: Model) -> None:
    """`ExternalModelError` for an echo of a beam that the program was not handed."""
    assert model.external is not None
    key, asked = (table.layer.astype(np.int64) << 32 | table.point for table in (scan, ideal))
    other = np.flatnonzero(~np.isin(key, asked))
    if len(other):
        row = int(other[0])
        what = f"wrote an echo of Layer {scan.layer[row]}, Point {scan.point[row]}, a beam that it was not handed"
        raise failure(what, model.external, "", "let it write Layer and Point as they stand in its ideal scan")


@contextmanager
def _named(model: Model) -> Iterator[None]:
    """Failures name the model's file."""
    try:
        yield
    except ExternalModelError as error:
        error.file = error.file or (None if model.file is None else str(model.file))
        raise
