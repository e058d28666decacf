"""What a run has found, in the place of what a file says: the new text, made out before anybody agrees to it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lidarcheck.calibration.blooming.lut_edit import LutChange, changes, table_of, taken_over
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.lut import LutFile, LutTable, load_lut
from lidarcheck.formats.source import read_source
from lidarcheck.reading import reading
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.session.edited_model import EditedModel, LineChange, ModelText, line_changes
from lidarcheck.session.own_files import content_hash
from lidarcheck.session.runs import Run

__all__ = [
    "ModelTakeover",
    "TableTakeover",
    "fitted_table",
    "model_takeover",
    "result_file",
    "run_takeover",
    "table_takeover",
]


@dataclass(frozen=True)
class TableTakeover:
    """A fitted table, for the rows of an open file. `diff`: what changes there; `missing`: how many rows of the file
    the fit has nothing for.
    """

    file: EditedLut
    fitted: LutFile
    axis: str
    rows: tuple[int, ...] | None
    what: str
    diff: tuple[LutChange, ...]
    missing: int

    def make(self) -> bool:
        """Take it over, as one edit; whether that changes anything."""
        axis = table_of(self.file.current, self.axis)
        return self.file.take(axis, self.fitted, self.what, self.rows)


@dataclass(frozen=True)
class ModelTakeover:
    """A fitted model, as the new text of an open file. `rewritten`: why its comments and layout could not be kept."""

    file: EditedModel
    before: bytes
    content: bytes
    rewritten: str
    what: str
    diff: tuple[LineChange, ...]

    def make(self) -> bool:
        """Take it over, as one edit; whether that changes anything. `UsageError` where the file is another by now."""
        if self.file.content != self.before or self.file.changed_on_disk():
            raise UsageError("has changed meanwhile", file=self.file.path, fix="look at the difference again")
        return self.file.take(self.content, self.what)


def result_file(run: Run, root: Path) -> Path:
    """The file that a run is to be taken over from; `UsageError` where its record names one outside of the project."""
    path = root / run.takes["fitted"]
    if not path.resolve().is_relative_to(root.resolve()):
        raise UsageError(f"{path} is not in {root}, where it was run", fix="run it again")
    return path


def fitted_table(run: Run, root: Path) -> LutTable:
    """The table that a run has fitted."""
    fitted = load_lut(result_file(run, root))
    return fitted.tables[table_of(fitted, run.takes["axis"])]


def table_takeover(file: EditedLut, run: Run, root: Path) -> TableTakeover:
    """What taking a run's table over into the file, as it is shown, changes."""
    fitted = load_lut(result_file(run, root))
    axis = table_of(file.current, run.takes["axis"])
    rows = tuple(int(row) for row in run.takes.get("rows", "").split(",") if row) or None
    after = taken_over(file.current, axis, fitted, rows)
    there = set(fitted.tables[table_of(fitted, axis)].x.tolist())
    missing = sum(x not in there for x in file.current.tables[axis].x.tolist())
    diff = tuple(changes(file.current, after))
    return TableTakeover(file, fitted, axis, rows, f"take over {_called(run)}", diff, missing)


def model_takeover(file: EditedModel, source: Path, fitted: Path, what: str, before: str = "") -> ModelTakeover:
    """What taking a fitted model over into the file, as it is shown, changes.

    `source`: the model's file that the command read, or a copy of it that is still so; `before`: its SHA-256 then,
    empty where nobody noted it. `UsageError` where the file is another now.
    """
    from lidarcheck.model import load_model
    from lidarcheck.model.files.write import rewritten_text

    with reading({}):  # the text that is edited is the disk's: so must be the model that it is compared with
        was = read_source(source)
        if file.content != was or (before and content_hash(was) != before):
            fix = "take back what changed, or run it again"
            raise UsageError("has changed since it was read for this", file=file.path, fix=fix)
        text, rewritten = rewritten_text(source, load_model(fitted), source)
    content = text.encode()
    return ModelTakeover(file, was, content, rewritten, what, tuple(line_changes(file.current, ModelText(content))))


def run_takeover(file: EditedModel, run: Run, root: Path) -> ModelTakeover:
    """The same of a run's record."""
    source = root / run.takes.get("source", run.takes["model"])
    fitted = result_file(run, root)
    if not fitted.is_file():
        raise InputError("there is no such file", file=fitted, fix="run it again")
    return model_takeover(file, source, fitted, f"take over {_called(run)}", run.takes.get("before", ""))


def _called(run: Run) -> str:
    return f"{run.name}, run {run.number}"
