"""The lines of Overview about numbers: a measurement each, the one under the cursor in full, and an edit each."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from lidarcheck.figures.words import squeezed
from lidarcheck.session.measurements import Measurement
from lidarcheck.session.session import CURRENT
from lidarcheck.tui.context import groups_line, number_text, value_text
from lidarcheck.tui.engine import NOT_YET, Known
from lidarcheck.tui.numbers import Numbers
from lidarcheck.tui.widgets.lines import Line, is_old, line, printable
from lidarcheck.tui.widgets.themes import Role

if TYPE_CHECKING:
    from lidarcheck.calibration.number.number import Number

__all__ = ["Listed", "edit_lines", "measured_lines", "screen_of", "summary"]

_KIND, _DISTANCE, _STATE, _NUMBER = 7, 7, 20, 7
_NAME = (16, 40)
_AT_ONCE = 3
"""Distances that the pane of edits has columns for."""
_OF_KIND = {"profile": "blooming", "sign": "blooming", "frames": "noise", "case": "explain"}
_OF_KIND |= dict.fromkeys(("car", "van", "truck"), "histograms")


class Listed(NamedTuple):
    """Lines with where the measurements stand among them, by their places in the list."""

    lines: list[Line]
    rows: list[int]


def screen_of(kind: str) -> str:
    """The screen that shows measurements of a kind best."""
    return _OF_KIND.get(kind, "cloud")


def measured_lines(numbers: Numbers, order: Sequence[Measurement], at: int, width: int) -> Listed:
    """Each measurement under the head of its number: misfit and gap are never one column."""
    room = max(min(width - _KIND - _DISTANCE - _STATE - 3 * _NUMBER - 8, _NAME[1]), _NAME[0])
    lines: list[Line] = []
    rows: list[int] = []
    last = None
    for number, one in enumerate(order):
        asked = numbers.asked(one)
        head = "" if asked.request is None else asked.request.kind
        if last is None or (head and head != last):
            last = head
            lines.append(_head(head, room))
        rows.append(len(lines))
        lines.append(_line(one, numbers.measured.kind(one), numbers.engine.known(asked), number == at, room))
    return Listed(lines, rows)


def _head(number: str, room: int) -> Line:
    words = f"  {'kind':{_KIND}} {'measurement':{room}} {'distance':>{_DISTANCE + 1}} {'state':{_STATE}} "
    return line(f"{words}{number or 'number':>{_NUMBER}}{'edit':>{_NUMBER}}{'start':>{_NUMBER}}", "dim")


def _line(one: Measurement, kind: str, known: Known, here: bool, room: int) -> Line:
    state = known.state or NOT_YET
    name = printable(one.name.rpartition(".")[0] or one.name)
    name = squeezed(name if len(name) <= room else name.rpartition("/")[2], room, "..")
    where = "-" if one.distance_m is None else f"{one.distance_m:g} m"
    look: Role = "dim" if is_old(known.state) or not known.state else "text"
    step, start = known.step, known.since_start
    values = [
        number_text(known.number),
        "-" if step is None else f"{step.difference:+.2f}",
        "-" if start is None else f"{start.difference:+.2f}",
    ]
    return (
        (f"{'>' if here else ' '} {kind:{_KIND}} {name:{room}} {where:>{_DISTANCE + 1}} ", "text"),
        (f"{squeezed(printable(state), _STATE, '..'):{_STATE}} ", "edited" if is_old(known.state) else "dim"),
        ("".join(f"{value:>{_NUMBER}}" for value in values), look),
    )


def summary(numbers: Numbers, order: Sequence[Measurement]) -> tuple[str, str]:
    """(what the last edit did to all of them, the mean of the numbers that are one kind with that seen)."""
    known = [(one, numbers.known(one)) for one in order]
    words: dict[str, int] = {}
    for one, what in known:
        if numbers.asked(one).request is None or (what.state == CURRENT and what.step is None):
            continue  # what was edited is not in it
        if numbers.engine.edits:
            step = what.step.word if what.state == CURRENT and what.step is not None else NOT_YET
            words[step] = words.get(step, 0) + 1
    seen = numbers.seen
    kind = "" if seen is None or (request := numbers.asked(seen).request) is None else request.kind
    values = [what.number.value for _, what in known if what.number is not None and what.number.kind == kind]
    mean = f"mean {kind} {value_text(sum(values) / len(values))}" if len(values) > 1 else ""
    return ", ".join(f"{word} at {count}" for word, count in words.items()), mean


def detail(numbers: Numbers, one: Measurement, width: int) -> Line:
    """The number of a measurement in full: by feature, what a right model leaves, and what was simulated."""
    known, whole = numbers.known(one), numbers.engine.whole(numbers.asked(one))
    number = known.number
    if number is None:
        return line(f" {numbers.project.inside(known.state)}" if known.state else " ", "dim")
    parts = " ".join(f"{name} {value_text(value)}" for name, value in number.parts.items())
    words = [f"floor {value_text(number.floor)}", number.sample, parts, f"{number.seconds:.1f} s"]
    words = [f"whole frames {value_text(whole.value)} ({whole.sample})", *words] if whole is not None else words
    return ((" ", "dim"), *groups_line([(text, "dim") for text in words], width - 1))


def edit_lines(numbers: Numbers, width: int, *, several: bool) -> tuple[str, list[Line]]:
    """(title, an edit each, the last one first): the number after it at the distance that is seen and by how much that
    has changed it, or, where `several` are asked for, the change at each distance of the set.
    """
    seen, engine = numbers.seen, numbers.engine
    if seen is None:
        return "Edits", []
    edits = engine.edits[::-1]
    columns = _near(numbers, seen) if several else [seen]
    values = [[engine.known(numbers.asked(one)).start for one in columns]]
    values += [[engine.after(numbers.asked(one), made) for one in columns] for made in edits]
    read = f"as read {time.strftime('%H:%M', time.localtime(numbers.began))}"
    said = [
        (0, read, ""),
        *((edit.number, f"{edit.about} {edit.what}".strip(), edit.path.name) for edit in edits if edit.path),
    ]
    lines: list[Line] = []
    for at, (number, what, file) in enumerate(said):
        steps = [_step(values[at][i], values[at - 1][i] if at else None) for i in range(len(columns))]
        if several:
            cells = [number_text(one) for one in values[0]] if at == 0 else steps
            lines.append(_of_several(number, cells, what, width))
        else:
            lines.append(_of_one(number, what, [number_text(values[at][0]), steps[0]], file, width))
    if several:
        heads = "".join(
            f"{numbers.measured.where(one).replace(' m', 'm')[: _NUMBER - 1]:>{_NUMBER}}" for one in columns
        )
        return heads, lines[::-1]
    return f"Edits{' ' * max(width - 43, 1)}number{'step':>{_NUMBER + 1}}  file", lines[::-1]


def _step(now: Number | None, before: Number | None) -> str:
    return "..." if now is None else "" if before is None else f"{now.value - before.value:+.2f}"


def _near(numbers: Numbers, seen: Measurement) -> list[Measurement]:
    """The distances of the set that have numbers, three at most, that which is seen among them."""
    able = [one for one in numbers.measured.set_of(seen) if numbers.asked(one).request is not None] or [seen]
    first = max(min(able.index(seen) - 1 if seen in able else 0, len(able) - _AT_ONCE), 0)
    return able[first : first + _AT_ONCE]


def _of_several(number: int, cells: Sequence[str], what: str, width: int) -> Line:
    values = "".join(f"{cell:>{_NUMBER}}" for cell in cells)
    return line(f"{number:>4}{values}  {squeezed(printable(what), max(width - len(values) - 7, 8), '..')}")


def _of_one(number: int, what: str, cells: Sequence[str], file: str, width: int) -> Line:
    room = max(width - 36, 10)
    values = "".join(f"{cell:>{_NUMBER + 1}}" for cell in cells)
    return line(f"{number:>4}  {squeezed(printable(what), room, '..'):{room}}{values}  {squeezed(file, 12, '..')}")
