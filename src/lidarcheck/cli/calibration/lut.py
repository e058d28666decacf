"""`lidarcheck lut`: show blooming tables, and edit several of their cells at once."""

from __future__ import annotations

import builtins
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lidarcheck.cli.core.options import Flag, JsonFlag, Quiet, Whole
from lidarcheck.cli.core.outputs import alone, as_it_was, check_writable, json_text, same_file
from lidarcheck.cli.core.terminal import Column, emit, hush, note, table
from lidarcheck.errors import InputError, UsageError

if TYPE_CHECKING:
    from lidarcheck.formats.lut import Axis, LutFile

__all__ = ["add", "remove", "scale", "set", "show", "smooth", "undo"]

UNDO = ".undo"
"""What the name of the file ends in that keeps the table as it was before the last edit."""

File = Annotated[Path, Parameter(help="The INI file with PostPro.LUT_blooming_X and _Y, or LUT_bloomingH_X and _Y.")]
Table = Annotated[str | None, Parameter(name="--table", help="vertical or horizontal; needed where the file has both.")]
Out = Annotated[
    Path | None, Parameter(help="Write the edited file here; by default it replaces FILE, which FILE.undo keeps.")
]
DryRun = Annotated[bool, Flag, Parameter(help="Show what would change and write nothing.")]
Keep = Annotated[
    bool,
    Flag,
    Parameter(help="Write the file without any edit: the same bytes."),
]
TrueY = Annotated[bool, Flag, Parameter(help="Values are Y, 0 to 1, not scaled 0 to 1000.")]
Rows = Annotated[
    list[str] | None,
    Parameter(name="--rows", negative=(), help="Rows by number, from 0 as `lut show` has them: 3, 5..9 or 0,5..9."),
]
At = Annotated[
    list[str] | None,
    Parameter(
        name="--x", negative=(), allow_leading_hyphen=True, help="Rows by X: 20, -33..-10 or 0,20..60; may be repeated."
    ),
]


def show(file: File, /, *, json: JsonFlag = False, quiet: Quiet = False) -> int:
    """Show the tables of a file."""
    hush(quiet)
    from lidarcheck.formats.lut import load_lut

    _print(load_lut(file), json)
    return 0


def set(
    file: File,
    /,
    *,
    rows: Annotated[
        list[str] | None,
        Parameter(name="--row", negative=(), help="ROWS=VALUE, rows by number: 3=512 or 5..9=0; may be repeated."),
    ] = None,
    at: Annotated[
        list[str] | None,
        Parameter(
            name="--at",
            negative=(),
            allow_leading_hyphen=True,
            help="X=VALUE, rows by X: -20=400 or 20..60=512; may be repeated.",
        ),
    ] = None,
    x: Annotated[
        list[str] | None,
        Parameter(
            name="--x",
            negative=(),
            help="ROW=X, another X of a row, between those of the rows around it: 3=-45; may be repeated.",
        ),
    ] = None,
    table: Table = None,
    true_y: TrueY = False,
    keep: Keep = False,
    out: Out = None,
    dry_run: DryRun = False,
    json: JsonFlag = False,
    quiet: Quiet = False,
) -> int:
    """Set cells of a table, on the editor's scale."""
    hush(quiet)
    from lidarcheck.calibration.blooming.lut_edit import moved_to, rows_at, rows_by_number, set_rows, table_of
    from lidarcheck.formats.lut import load_lut

    edits = [(option, edit) for option, given in (("--row", rows), ("--at", at), ("--x", x)) for edit in given or ()]
    if keep == bool(edits):
        what = "--keep writes without edits" if keep else "nothing is set"
        fix = "leave out --row, --at and --x" if keep else "use --row ROWS=VALUE, --at X=VALUE or --x ROW=X"
        raise UsageError(what, fix=fix)
    before = after = load_lut(file)
    for option, edit in edits:
        where, equals, value = edit.partition("=")
        if not equals:
            raise UsageError(f"{option} {edit} has no value", fix=f"write {option} {edit}=VALUE")
        axis = table_of(after, table)
        chosen = (rows_at if option == "--at" else rows_by_number)(after, axis, where)
        if option != "--x":
            after = set_rows(after, axis, chosen, value.strip(), true_y=true_y)
            continue
        if len(chosen) > 1:
            raise UsageError(f"--x {edit} names several rows", fix="give each row an X of its own")
        after = moved_to(after, axis, chosen[0], value.strip())
    return _finish(before, after, file, out, dry_run=dry_run, json=json)


def add(
    file: File,
    /,
    *,
    after: Annotated[
        list[str] | None,
        Parameter(
            name="--after",
            negative=(),
            help="A new row behind each of these, X and Y between those around it: 3 or 5..9; may be repeated.",
        ),
    ] = None,
    at: Annotated[
        list[str] | None,
        Parameter(
            name="--at",
            negative=(),
            allow_leading_hyphen=True,
            help="X or X=VALUE, a new row at that X: -40 or -40=450; may be repeated.",
        ),
    ] = None,
    table: Table = None,
    true_y: TrueY = False,
    out: Out = None,
    dry_run: DryRun = False,
    json: JsonFlag = False,
    quiet: Quiet = False,
) -> int:
    """Add rows to a table; Y is on the line through the rows around them unless it is given."""
    hush(quiet)
    from lidarcheck.calibration.blooming.lut_edit import added_at, inserted, rows_by_number, table_of
    from lidarcheck.formats.lut import load_lut

    if not (after or at):
        raise UsageError("nothing is added", fix="use --after ROWS or --at X")
    before = edited = load_lut(file)
    axis = table_of(before, table)
    behind = [row for text in after or () for row in rows_by_number(before, axis, text)]
    for row in sorted(builtins.set(behind), reverse=True):  # from the end, so that earlier rows keep their numbers
        edited = inserted(edited, axis, row)
    for text in at or ():
        where, _, value = text.partition("=")
        edited = added_at(edited, axis, where.strip(), value.strip(), true_y=true_y)
    return _finish(before, edited, file, out, dry_run=dry_run, json=json)


def remove(
    file: File,
    /,
    *,
    rows: Rows = None,
    x: At = None,
    table: Table = None,
    out: Out = None,
    dry_run: DryRun = False,
    json: JsonFlag = False,
    quiet: Quiet = False,
) -> int:
    """Take rows out of a table; one must stay."""
    hush(quiet)
    from lidarcheck.calibration.blooming.lut_edit import table_of, without_rows
    from lidarcheck.formats.lut import load_lut

    if not (rows or x):
        raise UsageError("nothing is taken out", fix="use --rows ROWS or --x RANGES")
    before = load_lut(file)
    axis = table_of(before, table)
    after = without_rows(before, axis, _picked(before, axis, rows, x))
    return _finish(before, after, file, out, dry_run=dry_run, json=json)


def scale(
    file: File,
    /,
    *,
    by: Annotated[
        int | None,
        Whole,
        Parameter(allow_leading_hyphen=True, help="Steps on the editor's scale, 0.007 decades each: 20 or -20."),
    ] = None,
    factor: Annotated[float | None, Parameter(help="A factor on Y itself, as 1.5; instead of --by.")] = None,
    rows: Rows = None,
    x: At = None,
    table: Table = None,
    clip: Annotated[bool, Flag, Parameter(help="Stop at the ends of the scale instead of refusing.")] = False,
    keep: Keep = False,
    out: Out = None,
    dry_run: DryRun = False,
    json: JsonFlag = False,
    quiet: Quiet = False,
) -> int:
    """Move cells of a table up or down, all of them unless some are chosen."""
    hush(quiet)
    from lidarcheck.calibration.blooming.lut_edit import multiplied, shifted, table_of
    from lidarcheck.formats.lut import load_lut

    if (by is not None) + (factor is not None) + keep != 1:
        raise UsageError("one of --by, --factor and --keep is needed", fix="use --by STEPS or --factor F")
    before = after = load_lut(file)
    if not keep:
        axis = table_of(before, table)
        picked = _picked(before, axis, rows, x)
        if by is not None:
            after = shifted(before, axis, picked, by, clip=clip)
        elif factor is not None:
            after = multiplied(before, axis, picked, factor, clip=clip)
    return _finish(before, after, file, out, dry_run=dry_run, json=json)


def smooth(
    file: File,
    /,
    *,
    rows: Rows = None,
    x: At = None,
    table: Table = None,
    out: Out = None,
    dry_run: DryRun = False,
    json: JsonFlag = False,
    quiet: Quiet = False,
) -> int:
    """Smooth cells of a table, all of them unless some are chosen."""
    hush(quiet)
    from lidarcheck.calibration.blooming.lut_edit import smoothed, table_of
    from lidarcheck.formats.lut import load_lut

    before = load_lut(file)
    axis = table_of(before, table)
    after = smoothed(before, axis, _picked(before, axis, rows, x))
    return _finish(before, after, file, out, dry_run=dry_run, json=json)


def _picked(lut: LutFile, axis: Axis, rows: Sequence[str] | None, x: Sequence[str] | None) -> list[int]:
    """The rows that --rows and --x choose; all of them without either."""
    from lidarcheck.calibration.blooming.lut_edit import rows_at, rows_by_number

    chosen = [row for text in rows or () for row in rows_by_number(lut, axis, text)]
    chosen += [row for text in x or () for row in rows_at(lut, axis, text)]
    return sorted(dict.fromkeys(chosen)) if rows or x else list(range(len(lut.tables[axis])))


def undo(file: File, /, *, json: JsonFlag = False, quiet: Quiet = False) -> int:
    """Take the last edit back; given again, it is made again."""
    hush(quiet)
    from lidarcheck.formats.lut import load_lut, save_lut

    kept, now = _kept(file), load_lut(file)
    if not kept.is_file():
        fix = f"an edit leaves {kept.name}"
        raise InputError("there is no edit to take back", file=file, fix=fix)
    earlier = load_lut(kept)
    with alone(file, now.content), as_it_was([kept, file]):
        save_lut(now, kept)
        save_lut(earlier, file)
    _show_changes(now, earlier, json)
    note(f"{file}: as it was before; lut undo again brings the edit back")
    return 0


def _kept(file: Path) -> Path:
    return file.with_name(file.name + UNDO)


def _finish(
    before: LutFile, after: LutFile, file: Path, out: Path | None, *, dry_run: bool, json: bool
) -> int:  # fmt: skip
    """Write what was edited and say what changed."""
    from lidarcheck.formats.lut import save_lut

    target = out or file
    in_place = same_file(target, file)
    changed = before.content != after.content
    if not dry_run:
        check_writable(target, option="--out")
        if in_place:
            with alone(file, before.content), as_it_was([_kept(file)]):
                if changed:
                    save_lut(before, _kept(file))
                save_lut(after, target)
        else:
            save_lut(after, target)
    _show_changes(before, after, json)
    if dry_run:
        note("nothing was written")
    elif changed and in_place:
        note(f"{file}: written; lidarcheck lut undo {file} takes it back")
    else:
        note(f"{target}: written" + ("" if changed else ", the same bytes"))
    return 0


def _show_changes(before: LutFile, after: LutFile, json: bool) -> None:
    from lidarcheck.calibration.blooming.lut_edit import changes, document

    if json:
        emit(json_text(document(after)))
        return
    found = changes(before, after)
    if not found:
        note("no cell changes")
        return
    columns = (Column("table"), *(Column(name, right=True) for name in ("row", "X", "scaled", "new", "Y", "new")))
    rows = [(c.table, str(c.row), f"{c.x:g}", *map(_cell, (*c.scaled, c.before, c.after))) for c in found]
    emit(table(columns, rows))


def _cell(value: float | None) -> str:
    """A number; a hyphen where there is no such row."""
    return "-" if value is None or value != value else f"{value:.7g}"


def _print(lut: LutFile, json: bool) -> None:
    from lidarcheck.calibration.blooming.lut_edit import document

    if json:
        emit(json_text(document(lut)))
        return
    columns: Sequence[Column] = [Column(name, right=True) for name in ("row", "X", "scaled", "Y")]
    for number, (axis, rows) in enumerate(lut.tables.items()):
        unit = "SPAD rows, positive upward" if axis == "vertical" else "columns of 0.05 deg, positive to the left"
        sys.stdout.write("\n" if number else "")
        emit(f"{axis}: X in {unit}")
        cells = [(str(i), f"{row.x:g}", str(row.scaled), f"{row.y:.7g}") for i, row in enumerate(rows.rows())]
        emit(table(columns, cells))
