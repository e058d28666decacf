"""What somebody else's program understands of what it is handed: said in its model file, else tried once and kept."""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace

import numpy as np

from lidarcheck.effects.shared.reflectance import reflectance_of
from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.atomic import write_text
from lidarcheck.jit import base_directory
from lidarcheck.model.external.exchange import Request
from lidarcheck.model.external.probe import TRIALS, echoes_as_rows, probe_request, probe_scan
from lidarcheck.model.external.running import run_requests
from lidarcheck.model.spec import READS, External, Model
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Program
from lidarcheck.trust.program_text import hash_of
from lidarcheck.trust.programs import require_trust

__all__ = ["Found", "found_out", "readied", "seedless"]

_VERSION = 1
"""Of the trials: what other ones found is tried anew."""
_NO_REFLECTANCE = "the ideal scans have a Reflectance of their own, and the program reads neither that nor Share"
_ANEW = (
    "its echoes differ from run to run with one seed, so that nobody can find out what it reads: write `reads` in "
    "[external]"
)
_NO_BEAMS = "the sensor has no beams of its own to try the program on: write `reads` in [external]"
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Found:
    """What trials found: the words that the program reads, the features that it reports, and why no more is known."""

    reads: tuple[str, ...] = ()
    tells: tuple[str, ...] | None = None
    why: str = ""


def readied(model: Model, ideals: Iterable[IdealScan] = ()) -> Model:
    """The model with what its program reads, found out where its file does not say; the same for any other model.

    `ideals`: what it is to be handed; where they have a `Reflectance` that the program cannot be told, no effect of
    light can be shown. `ExternalModelError` where the program is not trusted or does not run at all.
    """
    program, external = model.sensor, model.external
    if external is None or not isinstance(program, Program):
        return model
    if program.reads is None:
        found = found_out(external, program)
        program = replace(program, reads=found.reads, tells=found.tells, unlit=found.why)
    told = program.understands("Share") or program.understands("Reflectance")
    if not told and not program.unlit and any(_has_reflectance(ideal) for ideal in ideals):
        program = replace(program, unlit=_NO_REFLECTANCE)
    return model if program is model.sensor else replace(model, sensor=program)


def seedless(model: Model) -> bool:
    """Whether it is known of the model's program that it ignores its seed."""
    return isinstance(model.sensor, Program) and not model.sensor.understands("Seed")


def _has_reflectance(ideal: IdealScan) -> bool:
    own = reflectance_of(ideal)
    return own is not None and bool(np.isfinite(own).any())


def found_out(external: External, program: Program) -> Found:
    """What trials say, or said when this very program was tried before. Nothing is run that the user does not trust."""
    require_trust(external)
    key = _key(external, program)
    kept = _kept(key)
    if kept is None:
        kept = _tried(external, program)
        _keep(key, kept)
        words = ", ".join(kept.reads) or "nothing beyond the ideal scan"
        _log.info("%s was tried: it reads %s", " ".join(external.command) or external.module, words)
    return kept


def _tried(external: External, program: Program) -> Found:
    """The program run on a small scan, twice for every value that is tried."""
    if not program.beams.lattice or not program.known:
        return Found(why=_NO_BEAMS if program.known else "[materials] is empty")
    ideal = probe_scan(program)
    plain = probe_request(ideal, "seed", 11, program.settings)
    one, again = run_requests(external, [plain, plain], program)
    tells = tuple(one.feature_names)
    if not np.array_equal(echoes_as_rows(one), echoes_as_rows(again)):
        return Found((), tells, _ANEW)
    answers = {word: _differs(external, program, ideal, trial) for word, trial in TRIALS.items()}
    reads = {word for word in READS if answers.get(word)}
    if answers["down"] and answers["up"]:
        reads = (reads | {"Share"}) - {"Parts"}
    return Found(tuple(word for word in READS if word in reads), tells)


def _differs(
    external: External, program: Program, ideal: IdealScan, trial: tuple[tuple[str, float], tuple[str, float]]
) -> bool:
    """Whether the echoes tell two values apart, and are the same each time; a run that fails tells nothing."""
    requests: list[Request] = [probe_request(ideal, *one, program.settings) for one in (*trial, *trial)]
    try:
        first, other, again, anew = (echoes_as_rows(scan) for scan in run_requests(external, requests, program))
    except LidarcheckError:
        return False
    return bool(np.array_equal(first, again) and np.array_equal(other, anew) and not np.array_equal(first, other))


def _key(external: External, program: Program) -> str:
    """Of the program as it is now, and of what it is tried on."""
    tried = [
        _VERSION, hash_of(external), sorted(program.settings.items()), program.beams.key, program.min_range_m,
        program.max_range_m, sorted((i, repr(m)) for i, m in program.known.items()),
    ]  # fmt: skip
    return hashlib.sha256(json.dumps(tried, default=repr).encode()).hexdigest()


def _kept(key: str) -> Found | None:
    with contextlib.suppress(OSError, RuntimeError, ValueError, TypeError, KeyError):
        found = json.loads((base_directory() / "programs" / f"{key}.json").read_text(encoding="utf-8"))
        tells = found["tells"]
        return Found(tuple(found["reads"]), None if tells is None else tuple(tells), str(found["why"]))
    return None


def _keep(key: str, found: Found) -> None:
    """For the next command; where nothing can be written, each tries anew."""
    with contextlib.suppress(OSError, RuntimeError, LidarcheckError):
        place = base_directory() / "programs"
        place.mkdir(parents=True, exist_ok=True)
        write_text(place / f"{key}.json", json.dumps(asdict(found)) + "\n")
