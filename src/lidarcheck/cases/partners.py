"""Which frames of several sources belong together: by name, else by number, by time, or by their order."""

from __future__ import annotations

import re
from collections.abc import Hashable, Mapping, Sequence
from itertools import pairwise

from lidarcheck.cases.source import FrameFile
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.table import counted

__all__ = ["beside", "paired"]

SAME_TIME = 0.25
"""Two frames are of one moment where their times differ by less than that part of the shortest time between frames."""


def paired(frames: Sequence[FrameFile], others: Sequence[FrameFile]) -> list[FrameFile]:
    """For each of the frames its partner among the others, each of which is one's.

    Two files belong together whatever they are called. `InputError` names the frame that has no partner.
    """
    if len(frames) == len(others) == 1:
        return list(others)
    if _of_one_dataset(frames, others):
        return list(others)
    mine, theirs = _names(frames), _names(others)
    if mine.keys() & theirs.keys():
        return _matched(mine, theirs, "give the frames the same names on both sides")
    if times := _same_times(frames, others):
        return times
    if _ranked(frames) or _ranked(others):
        if len(frames) != len(others):
            what = f"{counted(len(others), 'frame')} for the {len(frames)} of {frames[0].path}, which only order pairs"
            raise InputError(what, file=others[0].path, fix="give as many frames on both sides")
        return list(others)
    numbers, other_numbers = _numbers(frames), _numbers(others)
    if len(numbers) == len(frames) and len(other_numbers) == len(others):
        return _matched(numbers, other_numbers, "give the frames the same numbers on both sides")
    return _matched(mine, theirs, "give the frames the same names or numbers on both sides")


def beside(groups: Sequence[Sequence[FrameFile]], found: Sequence[Sequence[FrameFile]], option: str) -> list[FrameFile]:
    """For each frame of each group its partner among those that `option` names: one group for all, or one for each.

    A group of a single frame is the partner of all. Where everything named is a single frame, they come back
    as they are, in their order, for the command to count. `UsageError` for another number of groups.
    """
    if all(len(group) == 1 for group in (*groups, *found)):
        return [one[0] for one in found]
    if len(found) == len(groups):
        return [other for group, one in zip(groups, found, strict=True) for other in _for_group(group, one)]
    together = [frame for group in groups for frame in group]
    if len(found) == 1:
        return _for_group(together, found[0])
    if len(groups) == 1:
        return paired(together, [frame for one in found for frame in one])
    fix = f"give --{option} one for all, or one for each, in their order"
    raise UsageError(f"{len(found)} for --{option} and {len(groups)} scans", fix=fix)


def _for_group(frames: Sequence[FrameFile], others: Sequence[FrameFile]) -> list[FrameFile]:
    return [others[0]] * len(frames) if len(others) == 1 else paired(frames, others)


def _matched(mine: Mapping[Hashable, FrameFile], theirs: Mapping[Hashable, FrameFile], fix: str) -> list[FrameFile]:
    """The others in the order of mine, where both have the same keys."""
    for one, other in ((mine, theirs), (theirs, mine)):
        alone = [frame for name, frame in one.items() if name not in other]
        if alone:
            place = next(iter(other.values())).path
            more = f", nor have {len(alone) - 1} more" if len(alone) > 1 else ""
            where = place.parent if len({frame.path for frame in other.values()}) > 1 else place
            raise InputError(f"has no frame beside it in {where}{more}", file=str(alone[0]), fix=fix)
    return [theirs[name] for name in mine]


def _of_one_dataset(frames: Sequence[FrameFile], others: Sequence[FrameFile]) -> bool:
    """Whether a data set says what belongs together: both sides are all of its frames, in its order."""
    files = {None if frame.declared is None else frame.declared.file for frame in (*frames, *others)}
    return len(frames) == len(others) and len(files) == 1 and None not in files


def _ranked(frames: Sequence[FrameFile]) -> bool:
    """Whether only their order in one file numbers the frames."""
    return frames[0].frames.way in ("time", "order")


def _same_times(frames: Sequence[FrameFile], others: Sequence[FrameFile]) -> list[FrameFile]:
    """The partners by time, where both sides were told apart by it and each frame has one of its time; else none."""
    if len(frames) != len(others) or any(one.frames.way != "time" for one in (*frames, *others)):
        return []
    mine, theirs = ([one.frames.values[one.index] for one in side] for side in (frames, others))
    apart = min(b - a for a, b in pairwise(sorted(mine)))
    order = {time: i for i, time in enumerate(theirs)}
    nearest = [min(order, key=lambda time, of=of: abs(time - of)) for of in mine]  # type: ignore[misc]
    if any(abs(a - b) > SAME_TIME * apart for a, b in zip(mine, nearest, strict=True)):
        return []
    return [others[order[time]] for time in nearest]


def _names(frames: Sequence[FrameFile]) -> dict[Hashable, FrameFile]:
    """The frames by their names without suffix; `InputError` where two have one."""
    found: dict[Hashable, FrameFile] = {}
    for frame in frames:
        if (other := found.setdefault(frame.stem, frame)) is not frame:
            raise InputError(f"is named as {other}", file=str(frame), fix="give the frames different names")
    return found


def _numbers(frames: Sequence[FrameFile]) -> dict[Hashable, FrameFile]:
    """The frames by the number in their column, or the last in their names; fewer where that tells not all apart."""
    digits = [re.findall(r"\d+", frame.stem) for frame in frames]
    return {int(found[-1]): frame for found, frame in zip(digits, frames, strict=True) if found}
