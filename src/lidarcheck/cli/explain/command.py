"""`lidarcheck explain`: where model and measurement disagree, which effect is missing, and the model with it."""

from __future__ import annotations

import contextlib
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lidarcheck.cli.core.options import Flag, Jobs, JsonFile, MaxRows, Permitted, Quiet, Seed, up_to
from lidarcheck.cli.core.outputs import check_writable, json_text, with_origin, write_result
from lidarcheck.cli.core.terminal import emit, hush, note, progress, stage
from lidarcheck.cli.core.workers import Scheduler, workers
from lidarcheck.cli.explain.files import check_directory, check_not_read, make_directory, write_set
from lidarcheck.cli.explain.watch import JsonLines, watched
from lidarcheck.errors import UsageError
from lidarcheck.explain.files import KEPT, MODEL, PAGE, REPORT
from lidarcheck.formats.limits import limit_rows
from lidarcheck.workers.cores import usable_cores

if TYPE_CHECKING:
    from lidarcheck.cases.case import Case
    from lidarcheck.explain.report.explanation import Explanation
    from lidarcheck.workers import WorkerPool

__all__ = ["explain"]

MOST_CASES = 100_000


def explain(
    case: Annotated[Path | None, Parameter(help="The case: a directory with case.toml, or that file.")] = None,
    /,
    *,
    out: Annotated[Path | None, Parameter(help="The directory for report.json, model.toml and report.html.")] = None,
    seed: Seed = 0,
    exclude: Annotated[
        list[str] | None,
        Parameter(negative=(), help="Effects that are not to be named, with commas between them; may be repeated."),
    ] = None,
    jobs: Jobs | None = None,
    scheduler: Scheduler | None = None,
    into: Annotated[
        str | None,
        Parameter(
            help="Also propose a scenario, a new file or a name, whose golden would have caught what is missing."
        ),
    ] = None,
    json: JsonFile | None = None,
    no_html: Annotated[bool, Flag, Parameter(name="--no-html", help="Write no report.html.")] = False,
    no_nuisances: Annotated[
        bool,
        Flag,
        Parameter(
            name="--no-nuisances",
            help="Write nothing into the model but the effects that are named: reflectances and pose stay as they are.",
        ),
    ] = False,
    benchmark: Annotated[
        int | None,
        Parameter(converter=up_to(MOST_CASES), help="Run so many cases in which an effect is hidden instead."),
    ] = None,
    generator: Annotated[
        Path | None, Parameter(help="Of --benchmark: the package that makes the cases, by default tests/hidden.")
    ] = None,
    progress_as: Annotated[
        Literal["text", "json"],
        Parameter(name="--progress", help="How progress is said: text, or json for programs, a line each."),
    ] = "text",
    only: Annotated[
        str | None,
        Parameter(help="Of --benchmark: only one kind: single, pair, several, null, null_nuisance, left_out or alien."),
    ] = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Name the effect that a model lacks, and add it."""
    hush(quiet)
    limit_rows(max_rows)
    if benchmark is not None:
        others: dict[str, object] = {"CASE": case, "--exclude": exclude, "--into": into, "--no-html": no_html}
        others |= {"--no-nuisances": no_nuisances}
        others |= {"--progress": progress_as == "json", "--scheduler": scheduler}
        _refuse_beside("--benchmark", others)
        from lidarcheck.cli.explain.benchmark import benchmark as run

        cores = jobs or usable_cores()
        return run(benchmark, seed=seed, jobs=cores, json=json, generator=generator, only=only, out=out, quiet=quiet)
    if generator is not None or only is not None:
        option = "--generator" if generator is not None else "--only"
        raise UsageError(f"{option} is for --benchmark", fix="add --benchmark N, or leave it out")
    if case is None or out is None:
        missing = "CASE" if case is None else "--out"
        raise UsageError(f"lidarcheck explain needs {missing}", fix="see lidarcheck explain --help")
    names = _effects(exclude or ())
    loaded = _checked(case, out, json, into)
    with workers(scheduler, jobs) as pool, _interruptible(out):
        watch = _watched(quiet, progress_as == "json")
        found = _explained(loaded, out, seed, names, jobs, watch, no_html, pool, not no_nuisances)
    _show(found, loaded, json)
    note(f"{out}: {REPORT}, {MODEL}{'' if no_html else f', {PAGE}'}")
    if into is not None:
        _propose(into, found, loaded, jobs)
    return 0


@contextlib.contextmanager
def _interruptible(out: Path) -> Iterator[None]:
    """Say, when the work is interrupted, that nothing is lost."""
    try:
        yield
    except KeyboardInterrupt:
        if (out / KEPT).is_dir():
            note(f"interrupted: what was done is kept in {out / KEPT}; the same command goes on from there")
        raise


def _refuse_beside(option: str, others: dict[str, object]) -> None:
    for name, value in others.items():
        if value:
            raise UsageError(f"{name} does not go with {option}", fix="leave one of them out")


def _effects(exclude: Sequence[str]) -> tuple[str, ...]:
    """The effects that `--exclude` names; `UsageError` with the nearest for one that there is not."""
    from lidarcheck.effects import catalogue, find

    names = [name.strip() for text in exclude for name in text.split(",") if name.strip()]
    for name in names:
        find(name)
    if names and not set(catalogue()) - set(names):
        raise UsageError("--exclude leaves no effect to name", fix="leave some")
    return tuple(dict.fromkeys(names))


def _checked(case: Path, out: Path, json: str | None, into: str | None) -> Case:
    """The case, once it is known that all results can be written."""
    check_directory(out, case)
    if into is not None:
        _check_new(Path(into))
    from lidarcheck.cases.case import load_case

    with stage("reading the case"):
        loaded = load_case(case)
    check_not_read(out, loaded.files)
    if json is not None:
        check_writable(json, option="--json", besides=(*loaded.files, *(out / name for name in (REPORT, MODEL, PAGE))))
    make_directory(out)
    return loaded


def _check_new(scenario: Path) -> None:
    """A scenario is proposed, never replaced: a file, or a name in the nearest `scenarios` upward."""
    name = scenario.name if scenario.suffix == ".toml" else f"{scenario.name}.toml"
    places = [scenario.with_name(name)]
    if scenario.suffix != ".toml" and scenario.parent == Path():
        here = Path.cwd()
        places = [d / "scenarios" / name for d in (here, *here.parents) if (d / "scenarios").is_dir()][:1]
    for place in places:
        if place.exists():
            raise UsageError(f"{place} is there already", fix="give the scenario another name with --into")


@contextlib.contextmanager
def _watched(quiet: bool, as_json: bool) -> Iterator[tuple[Any, Any]]:
    """Who is told how far the work is, and who hears what it finds."""
    from lidarcheck.explain.progress import PROGRESS

    if as_json:
        lines = JsonLines(PROGRESS.shares, quiet=quiet)
        yield lines.on_progress, lines.on_step
    else:
        with watched(PROGRESS.shares, quiet=quiet) as on_progress:
            yield on_progress, None


def _explained(
    loaded: Case,
    out: Path,
    seed: int,
    exclude: tuple[str, ...],
    jobs: int | None,
    watch: Any,
    no_html: bool,
    pool: WorkerPool | None,
    calibrate: bool,
) -> Explanation:
    """Run the workflow, going on where an interrupted run stopped, and write what it found."""
    from lidarcheck.explain.workflow import explain as run
    from lidarcheck.workers.checkpoint import Checkpoint, checkpoint_key

    key = checkpoint_key(loaded.hashes, loaded.model, seed, exclude)
    with Checkpoint(out / KEPT, key) as checkpoint:
        if len(checkpoint):
            note(f"going on with what an interrupted run left in {out / KEPT}")
        with watch as (on_progress, on_step):
            cores = jobs or usable_cores()
            found = run(
                loaded,
                seed=seed,
                exclude=exclude,
                jobs=cores,
                pool=pool,
                on_progress=on_progress,
                on_step=on_step,
                checkpoint=checkpoint,
                calibrate=calibrate,
            )
        with stage("writing"):
            _write(found, loaded, out, no_html)
        checkpoint.discard()
    return found


def _write(found: Explanation, loaded: Case, out: Path, no_html: bool) -> None:
    from lidarcheck.explain.report.model_diff import write_model

    document = with_origin(found.to_dict(), loaded.files)
    writers: dict[str, Any] = {REPORT: lambda path: write_result(path, json_text(document))}
    if not no_html:
        from lidarcheck.figures.html.explanation import write_html

        writers[PAGE] = lambda path: write_html(found, loaded, path)
    elif (out / PAGE).exists():
        note(f"{out / PAGE} is of an earlier run")
    writers[MODEL] = lambda path: write_model(loaded.model_file, found.model, path)
    write_set(out, writers)


def _show(found: Explanation, loaded: Case, json: str | None) -> None:
    if json is not None:
        write_result(json, json_text(with_origin(found.to_dict(), loaded.files)))
    if json == "-":
        return
    from lidarcheck.explain.report.model_diff import model_diff
    from lidarcheck.explain.report.text import report_text

    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else 80
    emit(report_text(found, width=width, diff=model_diff(loaded.model, found.model)))


def _propose(into: str, found: Explanation, loaded: Case, jobs: int | None) -> None:
    """The scenario that would have caught what was missing, and its golden's proposal."""
    from lidarcheck.harness.propose.propose import propose_scenario

    there = {effect.name for effect in found.model.effects}
    names = [e.name for finding in found.findings for e in finding.effects if e.name in there]
    if not names:
        note(f"{into}: nothing is missing, so that there is no scenario to propose")
        return
    before = {effect.name: effect for effect in loaded.model.effects}
    lost = {name: found.model.with_(before[name]) for name in names if name in before}
    with progress("proposing a scenario") as show:
        proposed = propose_scenario(
            [frame.ideal.file for frame in loaded.frames],
            found.model,
            list(dict.fromkeys(names)),
            into,
            lost=lost,
            jobs=jobs,
            progress=show,
        )
    for line in proposed.lines():
        note(line)
