"""Edit per-distance settings: a value, a distance more, a distance less; and what two of them differ by."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

from lidarcheck.config.words import nearest
from lidarcheck.errors import UsageError
from lidarcheck.formats.lut import Axis
from lidarcheck.formats.settings import Setting, Settings

__all__ = ["KEYS", "SettingChange", "edited_settings", "settings_changes", "with_distance", "without_distance"]

KEYS: dict[Axis, dict[str, str]] = {
    "vertical": {
        "Distance": "distance_m", "IndexVerMin": "index_min", "IndexVerMax": "index_max", "SegVerCenter": "center",
        "SegHor": "across",
    },
    "horizontal": {
        "Distance": "distance_m", "IndexHorMin": "index_min", "IndexHorMax": "index_max", "SegHorCenter": "center",
        "SegVer": "across",
    },
}  # fmt: skip
"""The keys of a file and the fields of a `Setting`."""


def edited_settings(settings: Settings, edit: str) -> Settings:
    """`69:IndexVerMin=777` sets a value at 69 m; a distance that is not there yet begins as the nearest one."""
    where, colon, rest = edit.partition(":")
    key, equals, text = rest.partition("=")
    if not (colon and equals):
        raise UsageError(f"--set {edit} is no setting", fix="write DISTANCE:KEY=VALUE, as 69:SegHor=440")
    fields = KEYS[settings.axis]
    if key not in fields:
        near = nearest(key, list(fields))
        raise UsageError(
            f"there is no {settings.axis} setting {key!r}",
            fix=f"did you mean {near}?" if near else f"use {', '.join(fields)}",
        )
    try:
        distance_m, value = float(where), float(text) if key == "Distance" else int(text)
    except ValueError:
        raise UsageError(f"--set {edit} is no setting", fix="DISTANCE is in metres, VALUE a whole number") from None
    entries = list(with_distance(settings, distance_m).entries)
    at = next(i for i, entry in enumerate(entries) if entry.distance_m == distance_m)
    changed: dict[str, Any] = {fields[key]: value}
    entries[at] = replace(entries[at], **changed)
    return replace(settings, entries=tuple(entries))


def with_distance(settings: Settings, distance_m: float) -> Settings:
    """The settings with some for a distance: those there are, else as those of the nearest one."""
    entries = settings.entries
    if any(entry.distance_m == distance_m for entry in entries):
        return settings
    blank = Setting(distance_m, 0, 0, 0, 0)
    nearest_entry = min(entries, key=lambda entry: abs(entry.distance_m - distance_m), default=blank)
    return replace(settings, entries=(*entries, replace(nearest_entry, distance_m=distance_m, source={})))


def without_distance(settings: Settings, distance_m: float) -> Settings:
    """The settings without those of a distance."""
    kept = tuple(entry for entry in settings.entries if entry.distance_m != distance_m)
    if len(kept) == len(settings.entries):
        known = ", ".join(f"{entry.distance_m:g}" for entry in settings.entries) or "none"
        raise UsageError(f"there is no setting for {distance_m:g} m", fix=f"there are: {known}")
    return replace(settings, entries=kept)


class SettingChange(NamedTuple):
    """A value that differs; None where one of the two has no such distance."""

    distance_m: float
    key: str
    before: float | None
    after: float | None


def settings_changes(before: Settings, after: Settings) -> list[SettingChange]:
    """The values that differ. Entries belong together by their places where there are as many, else by distance."""
    old, new = before.entries, after.entries
    if len(old) == len(new):
        pairs: list[tuple[Setting | None, Setting | None]] = list(zip(old, new, strict=True))
    else:
        of = {entry.distance_m: entry for entry in new}
        known = {entry.distance_m for entry in old}
        pairs = [(entry, of.get(entry.distance_m)) for entry in old]
        pairs += [(None, entry) for entry in new if entry.distance_m not in known]
    found = []
    for one, other in pairs:
        here = one or other
        for key, field in KEYS[before.axis].items():
            values = [None if entry is None else float(getattr(entry, field)) for entry in (one, other)]
            if here is not None and values[0] != values[1]:
                found.append(SettingChange(here.distance_m, key, *values))
    return found
