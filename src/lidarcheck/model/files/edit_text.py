"""A model file's text, edited effect by effect: all that is not touched stays as it was, byte for byte."""

from __future__ import annotations

import difflib
import os
import re
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from lidarcheck.config.toml_lines import KeyPath, locate
from lidarcheck.effects import Effect

__all__ = ["EffectEdit", "edited", "effect_lines", "shown_value", "steps", "values_in_file"]

_HEADER = re.compile(r"""\s*\[\[\s*(effects|"effects"|'effects')\s*\]\]""")
_KEY = re.compile(r"\s*[^=]+=\s*")


class EffectEdit(NamedTuple):
    """A step from one list of effects to another: an effect kept (`old` and `new`), added or taken out.

    `before`: the place in the old list that it stands in front of, its own where it is of that list.
    """

    before: int
    old: Effect | None
    new: Effect | None


class _Edit(NamedTuple):
    """Lines to put in the place of `first` ... `last - 1`, from 0."""

    first: int
    last: int
    lines: list[str]


def steps(old: Sequence[Effect], new: Sequence[Effect]) -> list[EffectEdit]:
    """How one list of effects becomes the other, in order; effects of one name are taken for the same."""
    names = [effect.name for effect in old], [effect.name for effect in new]
    found = []
    for kind, i, i_end, j, j_end in difflib.SequenceMatcher(None, *names, autojunk=False).get_opcodes():
        if kind == "equal":
            found += [EffectEdit(at, old[at], new[j + at - i]) for at in range(i, i_end)]
        else:
            found += [EffectEdit(at, old[at], None) for at in range(i, i_end)]
            found += [EffectEdit(i_end, None, effect) for effect in new[j:j_end]]
    return found


def values_in_file(effect: Effect, directory: Path) -> dict[str, Any]:
    """What a model file in that directory says of an effect: its settings, files by relative paths."""
    values = effect.settings()
    for file in effect.files():
        if file.name in values:
            values[file.name] = Path(os.path.relpath(values[file.name], directory)).as_posix()
    return values


def effect_lines(effect: Effect, directory: Path) -> list[str]:
    """The effect as a model file in that directory has it, a line a key."""
    lines = ["[[effects]]", f"name = {shown_value(effect.name)}"]
    return lines + [f"{key} = {shown_value(value)}" for key, value in values_in_file(effect, directory).items()]


def shown_value(value: Any) -> str:
    """A number, a text or a list of numbers as TOML has it; it reads as the very same value."""
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}" for c in escaped) + '"'
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(shown_value, value))}]"
    plain = value.item() if hasattr(value, "item") else value
    return repr(plain)


def edited(text: str, old: Sequence[Effect], new: Sequence[Effect], source: Path, target: Path) -> str:
    """The text of a model file with `old` effects, as one with the `new` ones in another directory.

    `source`, `target`: the directories, from which files are named. `ValueError` where the text is laid out in a way
    that cannot be edited piece by piece.
    """
    mark = "\ufeff" if text.startswith("\ufeff") else ""
    editor = _Editor(text.removeprefix(mark), source, target)
    if editor.count != len(old):
        raise ValueError("its effects are not [[effects]] tables")
    edits = [edit for step in steps(old, new) for edit in editor.edits(step)]
    return mark + editor.applied(edits)


class _Editor:
    """The lines of a model file and where its effects stand in them."""

    def __init__(self, text: str, source: Path, target: Path) -> None:
        self.source, self.target = source, target
        self.newline = "\r\n" if "\r\n" in text else "\n"
        self.lines = re.findall(r"[^\n]*\n|[^\n]+", text)
        self.at = locate(text)
        self.count = len({path[1] for path in self.at if path[0] == "effects" and len(path) > 1})
        headers = [self.header(index) for index in range(self.count)]
        if not all(_HEADER.match(self.lines[line]) for line in headers):
            raise ValueError("its effects are not [[effects]] tables")

    def header(self, index: int) -> int:
        """The line of an effect's `[[effects]]`, from 0."""
        return self.at["effects", index] - 1

    def keys(self, index: int) -> dict[str, tuple[int, int]]:
        """The lines of an effect's keys, from first to one behind the last."""
        paths: list[KeyPath] = [path for path in self.at if len(path) == 3 and path[:2] == ("effects", index)]
        return {str(path[2]): (self.at[path] - 1, self._end(self.at[path] - 1)) for path in paths}

    def block_end(self, index: int) -> int:
        """One behind the last line of an effect's keys."""
        return max((end for _, end in self.keys(index).values()), default=self.header(index) + 1)

    def edits(self, step: EffectEdit) -> Iterator[_Edit]:
        """What a step changes in the text."""
        if step.old is None and step.new is not None:
            yield self._added(step.before, step.new)
        elif step.old is not None and step.new is None:
            end = self.block_end(step.before)
            blank = end < len(self.lines) and not self.lines[end].strip()
            yield _Edit(self.header(step.before), end + blank, [])
        elif step.old is not None and step.new is not None:
            yield from self._changed(step.before, step.old, step.new)

    def applied(self, edits: Sequence[_Edit]) -> str:
        """The text with the edits."""
        lines = list(self.lines)
        if lines and edits and not lines[-1].endswith("\n"):
            lines[-1] += self.newline
        # From the end, so that places hold; of several at one place the later ones first, which go behind the others.
        for edit in sorted(edits, key=lambda edit: edit.first)[::-1]:
            lines[edit.first : edit.last] = [f"{line}{self.newline}" for line in edit.lines]
        return "".join(lines)

    def _added(self, before: int, effect: Effect) -> _Edit:
        block = effect_lines(effect, self.target)
        if before < self.count:
            place = self.header(before)
            while place > 0 and self.lines[place - 1].lstrip().startswith("#"):
                place -= 1  # what is said of the next effect stays with it
            return _Edit(place, place, [*block, ""])
        place = self.block_end(self.count - 1) if self.count else len(self.lines)
        while place < len(self.lines) and self.lines[place].lstrip().startswith("#"):
            place += 1
        return _Edit(place, place, ["", *block])

    def _changed(self, index: int, old: Effect, new: Effect) -> Iterator[_Edit]:
        was, now = values_in_file(old, self.source), values_in_file(new, self.target)
        keys = self.keys(index)
        end = self.block_end(index)
        indent = re.match(r"\s*", self.lines[end - 1].rstrip("\r\n"))
        for key, value in now.items():
            if key in was and was[key] == value:
                continue
            if key in keys:
                yield self._replaced(*keys[key], value)
            else:
                yield _Edit(end, end, [f"{indent.group() if indent else ''}{key} = {shown_value(value)}"])
        for key in keys.keys() - now.keys() - {"name"}:
            yield _Edit(*keys[key], [])

    def _replaced(self, first: int, last: int, value: Any) -> _Edit:
        line = self.lines[first].rstrip("\r\n")
        head = _KEY.match(line)
        if head is None:
            raise ValueError(f"line {first + 1} is no plain key")
        comment = _comment(line[head.end() :]) if last == first + 1 else ""
        return _Edit(first, last, [f"{head.group()}{shown_value(value)}{comment}"])

    def _end(self, first: int) -> int:
        """One behind the last line of the value that begins on a line."""
        for end in range(first + 1, len(self.lines) + 1):
            if _reads("".join(self.lines[first:end])):
                return end
        raise ValueError(f"line {first + 1} begins no value")


def _comment(rest: str) -> str:
    """What stands behind the value at the end of a line, blanks before it included."""
    for place in (match.start() for match in re.finditer("#", rest)):
        if _reads(f"key = {rest[:place]}"):
            return rest[len(rest[:place].rstrip()) :]
    return rest[len(rest.rstrip()) :]


def _reads(text: str) -> bool:
    try:
        tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return False
    return True
