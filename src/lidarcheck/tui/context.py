"""The second line of the interface: what is looked at, the number now, and whether the last edit has helped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

from lidarcheck.session.session import CURRENT
from lidarcheck.tui.engine import Known
from lidarcheck.tui.widgets.lines import Line, printable
from lidarcheck.tui.widgets.themes import Role

if TYPE_CHECKING:
    from lidarcheck.calibration.number.number import Number, Step

__all__ = [
    "Context",
    "context_line",
    "course_of",
    "groups_line",
    "number_text",
    "step_text",
    "step_words",
    "value_text",
]

BEFORE_FROM, COURSE_FROM = 100, 116
"""Columns from which on the number before stands in the line, and its course and the state."""
_MOST_COURSE, _NARROW, _FILE_GOES = 20, 79, 9
_WHY, _BESIDE_WHY = 30, 50
"""Columns that a state with a reason has at least, and those that are left for all else."""
_LEVELS = ".-=#"


@dataclass(frozen=True)
class Context:
    """What the line says. `file`: the table's, with `unsaved` edits; `place`: which of how many distances; `kind`: of
    the number; `course`: the numbers after each edit, the last one now; `is_baseline`: all is of the baseline.
    """

    file: str = ""
    unsaved: int = 0
    model: str = ""
    measurement: str = ""
    place: str = ""
    kind: str = ""
    known: Known = field(default_factory=Known)
    course: tuple[float, ...] = ()
    is_baseline: bool = False


class _Part(NamedTuple):
    """Some words of the line. `goes`: in which order parts are left out where there is no room, 0 for never; `first`:
    it begins one of the groups that strokes are between; `short`: what is tried before it is left out.
    """

    text: str
    role: Role
    goes: int
    first: bool = False
    short: str = ""


def context_line(context: Context, width: int) -> Line:
    """The line for so many columns: whole words and numbers, and of these as many as there is room for."""
    parts = [part for part in [*_looked_at(context, width), *_number(context, width)] if part.text]
    while _length(parts) > width and (going := [part for part in parts if part.goes]):
        part = min(going, key=lambda part: part.goes)
        at = parts.index(part)
        parts[at : at + 1] = [part._replace(text=part.short, short="", goes=_FILE_GOES)] if part.short else []
    while len(parts) > 1 and _length(parts) > width:
        parts.pop(0)  # a number is whole or not there, and its state stays longest
        parts[0] = parts[0]._replace(text=parts[0].text.lstrip())
    return _joined(parts)


def groups_line(groups: Sequence[tuple[str, Role]], width: int) -> Line:
    """Groups of words with strokes between them, as many of the first ones as there is room for."""
    parts = [_Part(printable(text), role, 1, first=True) for text, role in groups if text]
    while len(parts) > 1 and _length(parts) > width:
        parts.pop()
    return _joined(parts)


def _length(parts: Sequence[_Part]) -> int:
    return sum(len(text) for text, _ in _joined(parts))


def _looked_at(context: Context, width: int) -> list[_Part]:
    file = printable(context.file)
    model = context.model if width >= BEFORE_FROM else context.model.removesuffix(".toml")
    unsaved = f"*{context.unsaved}" if context.unsaved else ""
    baseline = _Part("BASELINE", "edited", 0, first=True)
    return [
        *([baseline] if context.is_baseline else []),
        _Part(file, "title", 3, True, file.rpartition(".")[0]),
        _Part(unsaved, "edited", 7),
        _Part(printable(model), "text", 2),
        _Part(printable(context.measurement), "title", 0, first=True),
        _Part(context.place, "text", 5),
    ]


def _number(context: Context, width: int) -> list[_Part]:
    known, number = context.known, context.known.number
    wide = width >= BEFORE_FROM
    state = _Part(_short(known.state, max(_WHY, width - _BESIDE_WHY)), "edited", 0)
    if number is None:
        return [state._replace(first=True)]
    parts = [_Part(f"{context.kind} {number_text(number)} sd", "focus", 0, first=True)]
    if wide:
        before = f" before {number_text(known.before)}" if known.before is not None else ""
        step = f"({step_text(known.step)})" if known.step is not None else ""
        parts += [_Part(before, "text", 5), _Part(step, _role(known.step), 5)]
        start = f" start {number_text(known.start)}" if known.start is not None else ""
    else:
        words = "" if known.step is None else step_text(known.step)
        parts.append(_Part(f" {words}" if _says_all(known.step) else f" edit {words}" if words else "", "text", 5))
        start = f" start {known.since_start.difference:+.2f}" if known.since_start is not None else ""
    if width >= COURSE_FROM:
        course = _Part(course_of(context.course), "dim", 1, first=True)
        return [*parts, _Part(start, "text", 4), course, state._replace(first=True)]
    return [*parts, state._replace(text=f" {state.text}") if known.state != CURRENT else _Part(start, "text", 4)]


def _short(state: str, room: int) -> str:
    """A state whose reason is long, cut between words: Overview has it in full."""
    return state if len(state) <= room else f"{state[: room - 2].rpartition(' ')[0]} .."


def _joined(parts: Sequence[_Part]) -> Line:
    """The parts with blanks between them, and strokes between groups."""
    found: list[tuple[str, Role]] = []
    for part in parts:
        if found:
            found.append((" | " if part.first else " ", "dim"))
        found.append((part.text, part.role))
    return tuple(found)


def number_text(number: Number | None) -> str:
    """The value to two digits behind the point, fewer of a large one; with a tilde where it is expected."""
    if number is None:
        return "-"
    return f"{'' if number.exact else '~'}{value_text(number.value)}"


def value_text(value: float) -> str:
    """A number of standard deviations."""
    return f"{value:.2f}" if abs(value) < 10 else f"{value:.1f}" if abs(value) < 100 else f"{value:.0f}"


def step_text(step: Step | None) -> str:
    """By how much a number has changed, and what that is called: `-0.47 better`."""
    if step is None:
        return ""
    return step.word if _says_all(step) else f"{step.difference:+.2f} {step.word}"


def _says_all(step: Step | None) -> bool:
    """Whether the word alone says it."""
    return step is not None and step.word not in ("better", "worse", "same")


def _is_small(step: Step) -> bool:
    return step.word.startswith("same")


def _role(step: Step | None) -> Role:
    return "focus" if step is not None and step.is_said else "text"


def course_of(values: Sequence[float]) -> str:
    """The last numbers as levels between the least and the most of them."""
    last = list(values)[-_MOST_COURSE:]
    if len(last) < 2:
        return ""
    low, high = min(last), max(last)
    if high <= low:
        return _LEVELS[0] * len(last)
    return "".join(_LEVELS[min(int((v - low) / (high - low) * len(_LEVELS)), len(_LEVELS) - 1)] for v in last)


def step_words(edit: str, known: Known, at: str, others: Sequence[tuple[str, Known]], pending: str) -> str:
    """What an edit did, for the line of events. `edit`: which; `at`: the distance that is seen; `others`: those of its
    set, with what is known of them; `pending`: how far those are that are not known yet.
    """
    from lidarcheck.calibration.number.number import in_words

    if known.state != CURRENT or known.step is None or known.number is None:
        return ""
    found = {at: known.step} | {name: one.step for name, one in others if one.state == CURRENT and one.step is not None}
    steps = {name: replace(step, word="same") if _is_small(step) else step for name, step in found.items()}
    waiting = [name for name, one in others if name not in steps]
    words = in_words(steps)
    if len(steps) == 1 and not waiting:
        beyond = " beyond chance" if known.step.is_said else ""
        took = f"{known.number.sample}, {known.number.seconds:.1f} s"
        values = f"{number_text(known.before)} -> {number_text(known.number)} sd at {at}, "
        return f"{edit}: {'' if _says_all(known.step) else values}{words}{beyond} ({took})"
    rest = f", not yet known at {' and '.join(waiting)}{f' ({pending})' if pending else ''}" if waiting else ""
    everywhere = " everywhere" if not waiting else f" at {at}" if len(steps) == 1 else ""
    said = f"{edit}: {words}{rest}" if " at " in words else f"{edit}: {words}{everywhere}{rest}"
    numbers = f"; {number_text(known.before)} -> {number_text(known.number)} sd at {at}"
    return said + numbers if len(said) + len(numbers) <= _NARROW and not _says_all(known.step) else said
