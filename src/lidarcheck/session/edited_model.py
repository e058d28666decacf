"""A model's file being edited: its text as a whole, which only a sound model may replace."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import SequenceMatcher

from lidarcheck.formats.source import read_source
from lidarcheck.reading import read_so_far, reading
from lidarcheck.session.edited_file import EditedFile

__all__ = ["EditedModel", "LineChange", "ModelText", "line_changes"]


@dataclass(frozen=True)
class ModelText:
    """The bytes of a model's file."""

    content: bytes

    def lines(self) -> list[str]:
        """As text, a line each without its end."""
        return self.content.decode("utf-8").splitlines()


@dataclass(frozen=True)
class LineChange:
    """A line that differs: its number from 1 in the text that has it, and what it was and is; None for no line."""

    number: int
    before: str | None
    after: str | None


class EditedModel(EditedFile[ModelText]):
    """A model's file, edited."""

    NOUN = "line"

    def take(self, content: bytes, what: str) -> bool:
        """The whole text in the place of what is shown, as one edit; whether that changes anything.

        `ConfigError` where it is no model; nothing is changed then.
        """
        self._check_editable()
        return self._edit(self._parse(content), what)

    def _load(self) -> ModelText:
        return self._parse(read_source(self.path))

    def _parse(self, content: bytes) -> ModelText:
        from lidarcheck.model.files.model_file import load_model

        outer = read_so_far()
        edited = {**(outer.edited if outer else {}), os.path.realpath(self.path): content}
        with reading(edited):
            load_model(self.path)
        return ModelText(content)

    def _differences(self, before: ModelText, after: ModelText) -> list[LineChange]:
        return list(line_changes(before, after))


def line_changes(before: ModelText, after: ModelText) -> Iterator[LineChange]:
    """The lines that differ, in the file's order; a line that stands in the place of another is one change."""
    old, new = before.lines(), after.lines()
    for kind, start, end, new_start, new_end in SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if kind == "equal":
            continue
        both = min(end - start, new_end - new_start)
        for i in range(both):
            yield LineChange(new_start + i + 1, old[start + i], new[new_start + i])
        yield from (LineChange(i + 1, old[i], None) for i in range(start + both, end))
        yield from (LineChange(i + 1, None, new[i]) for i in range(new_start + both, new_end))
