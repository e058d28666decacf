"""`lidarcheck explain` in a process of its own: how far it is and what it finds."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lidarcheck.tui.jobs.commands import KEPT_LINES, PROGRAM, CommandProcess, first_fault, permitted_options

__all__ = ["PROGRAM", "ExplainProcess", "ExplainProgress", "command_of"]


def command_of(
    case: Path, out: Path, *, seed: str = "", exclude: str = "", program: Sequence[str] = PROGRAM
) -> list[str]:
    """The command that explains a case."""
    more = [*(["--seed", seed] if seed else []), *(["--exclude", exclude] if exclude else [])]
    more += permitted_options()
    return [*program, "explain", str(case), "--out", str(out), "--progress", "json", *more]


@dataclass
class ExplainProgress:
    """What the process has said. `steps`: how far each is, (done, of); `found`: steps' words; `said`: other lines."""

    steps: dict[str, tuple[int, int]] = field(default_factory=dict)
    now: str = ""
    part: float = 0.0
    elapsed_s: float = 0.0
    left_s: float | None = None
    found: list[tuple[str, str]] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    def take(self, line: str) -> bool:
        """A line of the process; whether it was about its progress."""
        try:
            message = json.loads(line)
            if "steps" in message:
                self.steps = {str(name): (0, 0) for name in message["steps"]}
            elif "found" in message:
                self.found.append((str(message["step"]), str(message["found"])))
            else:
                self._far(message)
        except (ValueError, TypeError, KeyError):
            self.said = [*self.said, line][-KEPT_LINES:]
            return False
        return True

    def _far(self, message: dict[str, Any]) -> None:
        name, done, of = str(message["step"]), int(message["done"]), int(message["of"])
        left = message["left_s"]
        self.part, self.elapsed_s = float(message["part"]), float(message["elapsed_s"])
        self.left_s = None if left is None else float(left)
        if name != self.now:
            names = list(self.steps)
            for before in names[: names.index(name)] if name in names else []:
                self.steps[before] = (1, 1)  # steps come in order, and some have nothing to do
        self.now = name
        self.steps[name] = (done, of)

    @property
    def fault(self) -> str:
        """The error that it ended with; empty if it said none."""
        return first_fault(self.said)


class ExplainProcess(CommandProcess[ExplainProgress]):
    """A process that explains a case."""

    def __init__(
        self,
        command: Sequence[str],
        *,
        on_progress: Callable[[], object],
        on_line: Callable[[str], object],
        on_end: Callable[[int], object],
    ) -> None:
        super().__init__(command, ExplainProgress(), on_progress=on_progress, on_line=on_line, on_end=on_end)
