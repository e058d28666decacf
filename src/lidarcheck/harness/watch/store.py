"""What earlier runs found, by hashes of all that it depends on: a run that was broken off goes on where it was."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.harness.goldens.provenance import parameters_hash, source_hash
from lidarcheck.harness.layout import Layout
from lidarcheck.harness.scenario_run import ScenarioRun

__all__ = ["Outcome", "OutcomeStore"]

_FILE = "sensitivity.jsonl"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What one scenario made of one model: the KPI that fell out, empty if none did, and its numbers.

    `old`, `new`: golden and now, None where there is no number; `limit`: what would have been caught at least;
    `verdict`: the KPI's; `seconds`: what it took.
    """

    kpi: str = ""
    unit: str = ""
    old: float | None = None
    new: float | None = None
    smallest: float | None = None
    verdict: str = ""
    seconds: float = 0.0

    @property
    def red(self) -> bool:
        """Whether the scenario falls out."""
        return bool(self.kpi)


class OutcomeStore:
    """Outcomes in `.lidarcheck/sensitivity.jsonl` of a project, a line each, appended as they are found.

    The key is the hash of the source, the scenario, its goldens and the changed model's numbers. How many KPIs share
    the error budget is not in it: a golden more moves the limits by less than their own rounding.
    """

    def __init__(self, layout: Layout) -> None:
        self._file = layout.private() / _FILE
        self._source = source_hash()
        self._known: dict[str, Outcome] = {}
        for line in self._lines():
            try:
                entry = json.loads(line)
                key = entry.pop("key")
                self._known[key] = Outcome(**entry)
            except (ValueError, KeyError, TypeError, AttributeError):
                continue  # a line that an interrupt cut off is found anew

    def key(self, case: ScenarioRun) -> str:
        """The hash of all that a case's outcome depends on."""
        layout, name = case.layout, case.scenario.name
        goldens = [_content(layout.golden(name)), _content(layout.release(name))]
        parts = [self._source, case.scenario.content_hash, *goldens, parameters_hash(case.model)]
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()

    def get(self, key: str) -> Outcome | None:
        """What is known under that key."""
        return self._known.get(key)

    def put(self, key: str, outcome: Outcome) -> None:
        """Keep an outcome, on the disk at once."""
        self._known[key] = outcome
        try:
            with self._file.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"key": key, **asdict(outcome)}) + "\n")
        except OSError as error:
            what = f"cannot keep what was found: {error.strerror or error}"
            raise InputError(what, file=self._file, fix="make room, or make it writable") from error

    def _lines(self) -> list[str]:
        try:
            text = self._file.read_text(encoding="utf-8", errors="replace")
        except FileNotFoundError:
            return []
        except OSError as error:
            what = f"cannot read what earlier runs found: {error.strerror or error}"
            raise InputError(what, file=self._file, fix="delete it") from error
        if text and not text.endswith("\n"):
            self._file.write_text(text[: text.rfind("\n") + 1], encoding="utf-8")
        return text.splitlines()


def _content(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
