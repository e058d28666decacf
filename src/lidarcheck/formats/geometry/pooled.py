"""Several files together: what each alone has too few rows for, all of them may confirm."""

from __future__ import annotations

from collections.abc import Iterable

from lidarcheck.beams import Geometry
from lidarcheck.formats.geometry.check import FEWEST_JUDGED, PASSED

__all__ = ["pooled", "words"]


def pooled(parts: Iterable[Geometry]) -> Geometry:
    """The geometry of all parts together: checked where their judged rows are enough and 99 % of them passed.

    One part that was not checked for another reason than too few rows leaves the whole unchecked; a warning stays.
    """
    each = list(parts)
    if len(each) == 1:
        return each[0]
    rows, judged, passed, outside = (sum(getattr(part, name) for part in each) for name in Geometry._fields[1:5])
    unit = bool(each) and all(part.unit_checked for part in each)
    yaw = all(part.yaw_checked for part in each)
    without = next((part for part in each if part.verdict == "not checked" and not part.judged), None)
    other = next((part for part in each if part.judged and part.passed < PASSED * part.judged), None)
    if not each or without or other or judged < FEWEST_JUDGED:
        worst = without or other
        note = worst.note if worst else f"{judged} of {rows} rows can be judged, {FEWEST_JUDGED} are needed"
        return Geometry("not checked", rows, judged, passed, outside, note, unit, yaw)
    warning = next((part.note for part in each if part.verdict == "warning"), "")
    return Geometry("warning" if warning else "ok", rows, judged, passed, outside, warning, unit, yaw)


def words(geometry: Geometry) -> str:
    """What the output says of it, in one line."""
    unit = "" if geometry.unit_checked else "; unit not checked"
    if geometry.verdict == "not checked":
        return f"geometry not checked: {geometry.note}{unit}"
    share = 100.0 * geometry.passed / geometry.judged
    fits = f"geometry checked: {share:.1f} % of {geometry.judged} judged rows lie where their beams point"
    fits += "" if geometry.yaw_checked else ", yaw not checked (columns do not repeat)"
    return f"{fits}; warning: {geometry.note}{unit}" if geometry.note else f"{fits}{unit}"
