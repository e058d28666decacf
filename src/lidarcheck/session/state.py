"""What the interface remembers from one start to the next: screen, theme, what was selected."""

from __future__ import annotations

import contextlib
import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from lidarcheck.errors import InputError
from lidarcheck.session.own_files import own_directory, own_file

__all__ = ["State", "load_state", "save_state"]


@dataclass
class State:
    """`selected`: what each list had under its cursor, by the list's name."""

    screen: str = ""
    theme: str = ""
    marks: str = ""
    log: bool = False
    selected: dict[str, str] = field(default_factory=dict)


def load_state(root: Path) -> State:
    """The state that the last session left; a new one where there is none that can be read."""
    state = State()
    with contextlib.suppress(OSError, ValueError):
        found: Any = json.loads((own_directory(root) / "state.json").read_text(encoding="utf-8"))
        if isinstance(found, dict):
            state.screen, state.theme = str(found.get("screen", "")), str(found.get("theme", ""))
            state.marks = str(found.get("marks", ""))
            state.log = found.get("log") is True
            selected = found.get("selected")
            if isinstance(selected, dict):
                state.selected = {str(name): str(value) for name, value in selected.items()}
    return state


def save_state(state: State, root: Path) -> None:
    """Keep the state. A project that cannot be written is no reason to fail: the next start is a fresh one."""
    with contextlib.suppress(InputError, OSError):
        from lidarcheck.formats.atomic import write_text

        write_text(own_file(root, "state.json"), json.dumps(asdict(state), indent=1) + "\n")
