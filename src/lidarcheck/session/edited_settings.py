"""The settings of one variant along one direction being edited, value by value."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.calibration.blooming.settings_edit import (
    KEYS,
    SettingChange,
    edited_settings,
    settings_changes,
    with_distance,
    without_distance,
)
from lidarcheck.errors import UsageError
from lidarcheck.formats.lut import Axis
from lidarcheck.formats.settings import (
    SETTINGS_VARIANTS,
    Setting,
    Settings,
    default_settings,
    limits_of,
    load_settings,
    parse_settings,
    settings_content,
    settings_name,
)
from lidarcheck.reading import state_of_file
from lidarcheck.session.edited_file import EditedFile, journal_of

if TYPE_CHECKING:
    from lidarcheck.session.project import Project

__all__ = ["EditedSettings", "left_behind", "settings_path"]

_AXES: tuple[Axis, Axis] = ("vertical", "horizontal")


class EditedSettings(EditedFile[Settings]):
    """A settings file, edited; where there is none the edits begin with the defaults, and saving makes it."""

    NOUN = "value"

    def __init__(self, path: Path, root: Path, axis: Axis) -> None:
        self.axis = axis
        self.there = False
        super().__init__(path, root)

    @property
    def in_force(self) -> Settings:
        """What a model is run with: the edited settings; the defaults as such where there is no file and no edit."""
        return self.current if self.there or self.dirty else default_settings(self.axis)

    def rows(self) -> list[tuple[Setting, str]]:
        """Each value of each distance: (setting, key)."""
        return [(setting, key) for setting in self.current.entries for key in KEYS[self.axis]]

    def value(self, row: tuple[Setting, str]) -> float:
        """The value of a row."""
        return float(getattr(row[0], KEYS[self.axis][row[1]]))

    def edited(self) -> list[bool]:
        """Whether each row differs from what was saved."""
        changes = settings_changes(self.saved, self.current)
        changed = {(change.distance_m, change.key) for change in changes}
        old, new = self.saved.entries, self.current.entries
        # A change is named by the distance as it was; entries keep their places unless there are more or fewer.
        named = old if len(old) == len(new) else new
        return [(setting.distance_m, key) in changed for setting in named for key in KEYS[self.axis]]

    def set(self, rows: Sequence[int], value: str) -> bool:
        """Rows get a value; whether that changed anything. `ConfigError` where it is out of range."""
        return self._each(rows, f"set {value}", lambda _now: value)

    def nudge(self, rows: Sequence[int], steps: int) -> bool:
        """Rows move by whole steps."""
        return self._each(rows, f"nudge {steps:+d}", lambda now: f"{now + steps:.10g}")

    def add(self, distance: str) -> bool:
        """Settings for one more distance [m], as those of the nearest one."""
        self._check("Distance", distance)
        return self._make(f"add {distance} m", f"{distance} m", lambda now: with_distance(now, float(distance)))

    def remove(self, distance_m: float) -> bool:
        """No settings for a distance any more."""
        return self._make(
            f"take out {distance_m:g} m", f"{distance_m:g} m", lambda now: without_distance(now, distance_m)
        )

    def save(self, *, overwrite: bool = False) -> int:
        """As every file; it is there then."""
        number = super().save(overwrite=overwrite)
        self.there = True
        return number

    def _check(self, key: str, value: str) -> None:
        """Refuse what a key cannot have, with what it can."""
        low, high = limits_of(self.axis)[key]
        what, unit = ("a number", " m") if key == "Distance" else ("a whole number", "")
        try:
            number = float(value) if key == "Distance" else int(value)
        except ValueError:
            number = math.nan
        if not low <= number <= high:
            raise UsageError(f"{key} = {value} is out of range", fix=f"use {what} from {low:g} to {high:g}{unit}")

    def _each(self, rows: Sequence[int], what: str, new: Callable[[float], str]) -> bool:
        self._check_editable()
        chosen = [self.rows()[row] for row in rows]
        for row in chosen:
            self._check(row[1], new(self.value(row)))

        def make(now: Settings) -> Settings:
            # A distance that moves is another name for its row: it comes last.
            for row in sorted(chosen, key=lambda row: row[1] == "Distance"):
                now = edited_settings(now, f"{row[0].distance_m!r}:{row[1]}={new(self.value(row))}")
            return now

        about = ", ".join(f"{setting.distance_m:g} m {key}" for setting, key in chosen)
        return self._make(what, about, make)

    def _make(self, what: str, about: str, make: Callable[[Settings], Settings]) -> bool:
        self._check_editable()
        return self._edit(self._parse(settings_content(make(self.current), self.path)), what, about)

    def _load(self) -> Settings:
        self.there = state_of_file(self.path) is not None
        if self.there:
            return load_settings(self.path, self.axis)
        return self._parse(settings_content(default_settings(self.axis), self.path))

    def _parse(self, content: bytes) -> Settings:
        return parse_settings(content, self.path, self.axis)

    def _hash_of_saved(self) -> str:
        return super()._hash_of_saved() if self.there else ""

    def _differences(self, before: Settings, after: Settings) -> list[SettingChange]:
        return settings_changes(before, after)


def settings_path(project: Project, axis: Axis, variant: str) -> Path:
    """The project's settings of a variant along an axis, sound or not; where they would be, if there are none."""
    name = settings_name(axis, "SMART" if variant == "SMART" else "SLIM")
    found = (e.path for e in project.of("settings", sound=False) if e.path.name.lower() == name.lower())
    return next(found, project.root / name)


def left_behind(project: Project) -> tuple[Axis, str] | None:
    """(axis, variant) of settings whose edits an earlier session did not save."""
    for axis in _AXES:
        for variant in SETTINGS_VARIANTS:
            if journal_of(settings_path(project, axis, variant), project.root).exists():
                return axis, variant
    return None
