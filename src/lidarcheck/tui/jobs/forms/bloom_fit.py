"""The form of `bloom fit`: which distances, with which model, and which rows are to be taken over."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lidarcheck.errors import UsageError
from lidarcheck.formats.lut import Axis
from lidarcheck.session.project import Project
from lidarcheck.session.runs import Plan
from lidarcheck.tui.jobs.forms.form import CommandForm, Field, Values, as_argument, chosen, option, text_of
from lidarcheck.tui.jobs.profiles import Dataset

__all__ = ["FitBench", "bloom_fit_form"]

_ALL, _TABLE = "all rows", "the table alone"
_FREE = (_TABLE, "pulse", "tail", "brightness", "pulse,tail", "pulse,brightness")


@dataclass(frozen=True)
class FitBench:
    """What Blooming shows. `at`: the dataset under the hand; `table`: the file, `content` with the edits that are not
    saved, None without; `settings`: where settings say the target's place, in the same way; `marked`: the rows that are
    marked.
    """

    project: Project
    datasets: Sequence[Dataset]
    at: Dataset
    model: Path
    table: Path
    axis: Axis
    content: bytes | None = None
    settings: Path | None = None
    settings_content: bytes | None = None
    target: int | None = None
    marked: tuple[int, ...] = ()


def bloom_fit_form(bench: FitBench) -> CommandForm:
    """The form, filled with what is seen."""
    marked = f"{len(bench.marked)} marked" if bench.marked else ""
    rows = (_ALL, *([f"rows {_listed(bench.marked)}, {marked}"] if marked else []))
    models = tuple(entry.name for entry in bench.project.of("model"))
    fields = (
        Field("scans", "distances", tuple(one.name for one in bench.datasets), True, "fitted together"),
        Field("model", "model", models),
        Field("free", "also fitted", _FREE, about="pulse: its length; tail: its tail; brightness: the target's"),
        Field("smoothness", "smoothness", about="a weight above 0; empty: chosen by leaving out distances"),
        Field("rows", "taken over", rows, about="asked about when the fit is there"),
    )
    values = {
        "scans": tuple(one.name for one in bench.datasets if _alike(one, bench.at)),
        "model": (as_argument(bench.model, bench.project),),
        "free": (_TABLE,),
        "smoothness": ("",),
        "rows": (rows[-1],),
    }
    return CommandForm(
        "Fit the table", fields, values, lambda given, directory: _plan(bench, given, directory),
        lambda given: [bench.project.root / text_of(given, "model")], (bench.table,),
    )  # fmt: skip


def _alike(one: Dataset, at: Dataset) -> bool:
    """Whether two datasets are of one kind at other distances, by their names, and can be fitted together."""
    names = (re.sub(r"\d+(?:[._]\d+)?", "#", dataset.name) for dataset in (one, at))
    return len(set(names)) == 1 and (one.ideal is None) == (at.ideal is None)


def _listed(rows: Sequence[int]) -> str:
    few = ",".join(map(str, rows[:3]))
    return few if len(rows) <= 3 else f"{few}.."


def _plan(bench: FitBench, values: Values, directory: str) -> Plan:
    names = chosen(values, "scans", "a distance")
    datasets = [one for one in bench.datasets if one.name in names]
    without = [one for one in datasets if one.ideal is None]
    if without and len(without) < len(datasets):
        what = f"{without[0].name} has no ideal scan, and others have one"
        raise UsageError(what, fix="fit those with, or those without")
    project, copies = bench.project, {}
    table = as_argument(bench.table, project)
    if bench.content is not None:
        table = f"{directory}/input/{bench.table.name}"
        copies[table] = bench.content
    settings = ""
    if any(one.by_settings for one in datasets) and bench.settings is not None:
        settings = as_argument(bench.settings, project)
        if bench.settings_content is not None:
            settings = f"{directory}/input/{bench.settings.name}"
            copies[settings] = bench.settings_content
    out, free = f"{directory}/out", text_of(values, "free")
    ideals = [as_argument(one.ideal, project) for one in datasets if one.ideal is not None]
    step = (
        *("bloom", "fit", *(as_argument(one.path, project) for one in datasets)),
        *(("--ideal", *ideals) if ideals else ()),
        *("--model", chosen(values, "model", "a model")[0], "--lut", table, "--axis", bench.axis),
        *option("--settings", settings),
        *option("--target", "" if bench.target is None else str(bench.target)),
        *option("--free", "" if free == _TABLE else free),
        *option("--smoothness", text_of(values, "smoothness").strip()),
        *("--out", out),
    )
    rows = "" if text_of(values, "rows") == _ALL else ",".join(map(str, bench.marked))
    takes = {"table": as_argument(bench.table, project), "axis": bench.axis, "rows": rows}
    takes["fitted"] = f"{out}/{bench.table.name}"
    return Plan("bloom fit", (step,), f"{out}/result.json", takes, copies)
