"""Somebody else's model as a Python function: it runs in a process of its own, which stays up.

Ideal tables go to `module_worker` and echo tables come back as a JSON object in a line and the bytes of its columns.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.config.words import printable
from lidarcheck.errors import ExternalModelError
from lidarcheck.formats.table import Table
from lidarcheck.model.external import module_worker
from lidarcheck.model.external.echoes import echoes_of_table
from lidarcheck.model.external.exchange import Request, sent
from lidarcheck.model.external.process import Groups, last_words, name_of
from lidarcheck.model.external.resident import Resident
from lidarcheck.model.spec import External
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor

__all__ = ["ModuleProcess"]


class ModuleProcess(Resident):
    """A process that has loaded the function. `ExternalModelError` when it cannot be found or loaded."""

    def __init__(self, external: External, groups: Groups) -> None:
        command = [sys.executable, "-P", module_worker.__file__, str(external.directory), external.module]
        super().__init__(command, external, groups)

    def _greet(self) -> None:
        self._answer()

    def run(self, requests: Sequence[Request], sensor: Sensor | None) -> list[Scan]:
        """The echoes that the function gives."""
        self._child.forget_words()
        return [self._scan(request, sensor) for request in requests]

    def _scan(self, request: Request, sensor: Sensor | None) -> Scan:
        asked = {
            "seed": request.seed,
            "frame": request.frame,
            "ini": None if self._external.ini is None else str(self._external.ini),
            "parameters": {name: float(value) for name, value in request.parameters.items()},
        }
        self._answered = False
        self._pipe.send(module_worker.packed(asked, sent(request).columns), self._external.timeout_s)
        return echoes_of_table(Table(self._answer()), self._external, sensor, last_words(self._child.log))

    def _answer(self) -> Mapping[str, npt.NDArray[Any]]:
        """The columns that come back."""
        seconds = self._external.timeout_s
        answer = json.loads(self._pipe.line(seconds))
        if "error" in answer:
            self._answered = True
            raise self._raised(answer)
        columns = {}
        for name, kind, rows in answer["columns"]:
            dtype = np.dtype(kind)
            columns[name] = np.frombuffer(self._pipe.take(rows * dtype.itemsize, seconds), dtype)
        self._answered = True
        return columns

    def _raised(self, answer: Mapping[str, Any]) -> ExternalModelError:
        """What went wrong in there, where the function's own text says so."""
        what = f"the external model {name_of(self._external)} {printable(answer['error'])[:300]}"
        file = answer.get("file")
        return ExternalModelError(what, file=file and Path(file), line=answer.get("line"), fix=answer.get("fix", ""))
