"""Somebody else's model as a program that stays up: a JSON object a line on its standard input, an answer a line back.

    it says first   {"lidarcheck": 1, "batch": 4}
    it is asked     {"id": 1, "runs": [RUN, …]}
    it answers      {"id": 1}    or    {"id": 1, "error": "what is wrong"}

A RUN is {"ideal": PATH, "ini": PATH, "scan": PATH, "seed": 0, "frame": 0, "parameters": {"NAME": 1.0}}.

`batch`, 1 where it is left out, is how many runs a request may hold. A request comes when the one before is answered.
An ideal scan's path that was named before has the content that it had then. When its standard input ends, it ends.
"""

from __future__ import annotations

import itertools
import json
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lidarcheck.config.words import printable
from lidarcheck.errors import ExternalModelError
from lidarcheck.model.external.command import check_command, filled
from lidarcheck.model.external.echoes import echoes_in
from lidarcheck.model.external.exchange import Request, Run, write_ideal, write_settings
from lidarcheck.model.external.process import Groups, failure, last_words
from lidarcheck.model.external.resident import Resident
from lidarcheck.model.spec import External
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = ["PROTOCOL", "Server"]

PROTOCOL = 1
_MOST_IN_A_BATCH = 1000
_KEPT_IDEALS = 8
_GREETING = 'let it print {"lidarcheck": 1} first'
_NOISE = "let it print answers alone; anything else belongs to standard error"
_log = logging.getLogger(__name__)


class Server(Resident):
    """A running server, greeted. `ExternalModelError` when it cannot be started or says anything but a greeting."""

    def __init__(self, external: External, groups: Groups) -> None:
        for _, fault in check_command(external.command, server=True):
            raise fault
        self._numbers = itertools.count(1)
        self._ideals: dict[tuple[int, tuple[str, ...]], tuple[IdealScan, Path]] = {}
        super().__init__([filled(argument, {}) for argument in external.command], external, groups)

    def _greet(self) -> None:
        self.batch = self._greeted()
        self._answered = True

    def run(self, requests: Sequence[Request], sensor: Sensor | None) -> list[Scan]:
        """The echoes of at most `batch` requests, which are asked for in one line."""
        self._child.forget_words()
        number = next(self._numbers)
        runs = [self._placed(request, f"{number}-{index}") for index, request in enumerate(requests)]
        try:
            self._ask(number, [_asked(request, run) for request, run in zip(requests, runs, strict=True)])
            said = last_words(self._child.log)
            if said:
                _log.info("%s said: %s", self._external.command[0], said)
            return [echoes_in(run.scan, self._external, sensor, said) for run in runs]
        finally:
            for run in runs:
                run.scan.unlink(missing_ok=True)
                if run.ini != self._external.ini:
                    run.ini.unlink(missing_ok=True)

    def _placed(self, request: Request, name: str) -> Run:
        """The files of a run; the ideal scans of the last few are kept, since many runs may be of one."""
        key = id(request.ideal), request.columns
        if key not in self._ideals:
            path = self._directory / f"ideal-{name}.txt"
            write_ideal(request, path, self._external)
            self._ideals[key] = request.ideal, path
        ini = write_settings(request, self._directory / f"settings-{name}.ini", self._external, request.parameters)
        return Run(self._ideals[key][1], ini, self._directory / f"scan-{name}.txt")

    def _ask(self, number: int, runs: list[dict[str, Any]]) -> None:
        """Send a request and wait for its answer."""
        seconds = self._external.timeout_s * len(runs)
        self._answered = False
        self._pipe.send(json.dumps({"id": number, "runs": runs}).encode() + b"\n", seconds)
        answer = self._object(self._pipe.line(seconds), _NOISE)
        if set(answer) - {"id", "error"} or "id" not in answer:
            raise self._failure(f"answered with the keys {', '.join(map(printable, answer)) or '(none)'}", _NOISE_KEYS)
        if answer["id"] != number:
            what = f"answered request {printable(str(answer['id']))[:40]} when {number} was asked"
            raise self._failure(what, "let it answer each request, with its id, before it reads the next")
        if self._pipe.waiting:
            raise self._failure("wrote to its standard output what nobody asked for", _NOISE)
        self._answered = True
        if "error" in answer:
            raise self._failure(f"refused a run: {printable(str(answer['error']))[:200]}", "")
        while len(self._ideals) > _KEPT_IDEALS:
            self._ideals.pop(next(iter(self._ideals)))[1].unlink(missing_ok=True)

    def _greeted(self) -> int:
        """How many runs a request may hold."""
        greeting = self._object(
            self._pipe.line(self._external.timeout_s), f"{_GREETING}, and all else to standard error"
        )
        if greeting.get("lidarcheck") != PROTOCOL or set(greeting) - {"lidarcheck", "batch"}:
            raise self._failure(f"greeted with {printable(json.dumps(greeting))[:80]}", _GREETING)
        batch = greeting.get("batch", 1)
        if type(batch) is not int or not 1 <= batch <= _MOST_IN_A_BATCH:
            what = f"says that a request may hold {printable(json.dumps(batch))[:40]} runs"
            raise self._failure(what, f"let batch be a whole number from 1 to {_MOST_IN_A_BATCH}")
        return batch

    def _object(self, line: bytes, fix: str) -> dict[str, Any]:
        """What a line holds."""
        try:
            found = json.loads(line)
        except ValueError:
            found = None
        if not isinstance(found, dict):
            text = printable(line.decode("utf-8", errors="replace"))[:80]
            raise self._failure(f"wrote to its standard output what is no answer: {text!r}", fix)
        return found

    def _failure(self, what: str, fix: str) -> ExternalModelError:
        return failure(what, self._external, last_words(self._child.log), fix)


_NOISE_KEYS = 'let it answer {"id": N}, or {"id": N, "error": "what is wrong"}'


def _asked(request: Request, run: Run) -> dict[str, Any]:
    return {
        "ideal": str(run.ideal),
        "ini": str(run.ini),
        "scan": str(run.scan),
        "seed": request.seed,
        "frame": request.frame,
        "parameters": {name: float(value) for name, value in request.parameters.items()},
    }
