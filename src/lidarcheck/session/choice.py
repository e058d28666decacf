"""What the user looks at, chosen once: every screen is a view of it, so that going to another screen keeps it."""

from __future__ import annotations

from collections.abc import Callable, MutableMapping, Sequence
from pathlib import Path
from typing import Literal

from lidarcheck.session.project import Project

__all__ = ["PARTS", "Choice", "Part"]

Part = Literal["model", "lut", "axis", "measurement", "feature", "target"]
PARTS: tuple[Part, ...] = ("model", "lut", "axis", "measurement", "feature", "target")
"""What is chosen: the model's, the table file's and a measurement's name within the project, the table's direction, a
quantity of echoes, and the number of the target's material. The distance is that of the measurement; the settings are
those of the model's variant and the table's direction."""


class Choice:
    """One choice for all screens. It lives in the mapping that the state keeps for the next start.

    `features`: the quantities of echoes that there are to choose from, those of the project's sensors. `on_change`:
    hears which part is another now.
    """

    def __init__(self, kept: MutableMapping[str, str]) -> None:
        self._kept = kept
        self.features: tuple[str, ...] = ()
        self.on_change: Callable[[Part], object] = lambda _part: None

    def of(self, part: Part) -> str:
        """What was chosen; empty where nothing was."""
        return self._kept.get(part, "")

    def choose(self, part: Part, value: str) -> bool:
        """Choose; whether it is another one than before."""
        if self.of(part) == value:
            return False
        self._kept[part] = value
        self.on_change(part)
        return True

    # What it is for the screens

    def feature(self, among: Sequence[str]) -> str:
        """The feature that is looked at, of those that a screen has; the first where none of them was chosen."""
        feature = self.of("feature")
        return feature if feature in among else among[0]

    def next_feature(self, among: Sequence[str]) -> None:
        """Go to the feature after this one, of those that a screen has."""
        self.choose("feature", among[(among.index(self.feature(among)) + 1) % len(among)])

    @property
    def target(self) -> int | None:
        """The number of the target's material; None for the only retro-reflector there is."""
        target = self.of("target")
        return int(target) if target.isdigit() else None

    def measured(self, project: Project) -> Path | None:
        """The file of the measurement that is chosen, of a set of frames the first; None where it is not there."""
        name = self.of("measurement")
        return next((entry.path for entry in project.entries if entry.name == name), None) if name else None

    def choose_measured(self, path: Path, project: Project) -> bool:
        """Choose the measurement that a file of the project belongs to; whether it is another one."""
        name = next((entry.name for entry in project.entries if entry.path == path), "")
        return bool(name) and self.choose("measurement", name)
