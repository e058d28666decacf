"""`lidarcheck calibrate`: fit named parameters of the model to measured frames, and write the model."""

from __future__ import annotations

import contextlib
import functools
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lidarcheck.cli.core.options import Jobs, JsonFile, MaxRows, Permitted, Quiet, Seed, up_to
from lidarcheck.cli.core.outputs import check_writable
from lidarcheck.cli.core.terminal import hush, note, progress, stage
from lidarcheck.cli.core.workers import Scheduler, workers
from lidarcheck.cli.core.workflow_output import PAGE, RESULT, Plot, check_out_dir, finish
from lidarcheck.cli.explain.files import MODEL, check_directory, check_not_read, make_directory
from lidarcheck.cli.explain.watch import clock_text
from lidarcheck.errors import UsageError
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.calibration.parameters.workflow import Calibration, Request, Round
    from lidarcheck.cases.case import Case
    from lidarcheck.workers import WorkerPool

__all__ = ["calibrate"]

KEPT = ".calibrate"
"""Where an interrupted run keeps what was done, in the output directory."""
MOST_ROUNDS = 50


def calibrate(
    case: Annotated[Path, Parameter(help="The case: a directory with case.toml, or that file.")],
    /,
    *,
    free: Annotated[
        list[str],
        Parameter(
            negative=(),
            help="What to fit, with commas between: a number of the sensor (signal_at_1m), materials.ID.reflectance or "
            ".retro_gain (ID a number, a name, or * for all), effects.NAME.PARAMETER; may be repeated.",
        ),
    ],
    out: Annotated[Path, Parameter(help="The directory for model.toml, report.html, result.json and pictures/.")],
    bounds: Annotated[
        list[str] | None, Parameter(negative=(), help="NAME=LOW..HIGH: a narrower interval; may be repeated.")
    ] = None,
    start: Annotated[
        list[str] | None, Parameter(negative=(), help="NAME=VALUE: where a free parameter begins; may be repeated.")
    ] = None,
    fix: Annotated[
        list[str] | None,
        Parameter(
            negative=(),
            help="NAME or NAME=VALUE: not to be moved, though --free has it or its effect; may be repeated.",
        ),
    ] = None,
    rounds: Annotated[
        int, Parameter(converter=up_to(MOST_ROUNDS), help="Most rounds before the last fit, 1 to 50.")
    ] = 8,
    seed: Seed = 0,
    jobs: Jobs | None = None,
    scheduler: Scheduler | None = None,
    plot: Plot | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Fit named parameters of the model to measured frames."""
    hush(quiet)
    limit_rows(max_rows)
    from lidarcheck.calibration.parameters.workflow import Request

    asked = Request(
        _names(free),
        dict(_interval(text) for text in _names(bounds or ())),
        dict(_value(text, "--start") for text in _names(start or ())),
        dict(_value(text, "--fix") if "=" in text else (text, None) for text in _names(fix or ())),
    )
    loaded = _checked(case, asked, out, json)
    with workers(scheduler, jobs) as pool:
        write = functools.partial(_write, loaded=loaded, out=out, json=json, plot=plot)
        _calibrated(loaded, asked, out, seed, jobs, rounds, write, pool)
    return 0


def _names(texts: Sequence[str]) -> tuple[str, ...]:
    return tuple(name.strip() for text in texts for name in text.split(",") if name.strip())


def _interval(text: str) -> tuple[str, tuple[float, float]]:
    name, _, ends = text.partition("=")
    low, dots, high = ends.partition("..")
    if not (name and dots):
        raise UsageError(f"--bounds {text} is no interval", fix="give NAME=LOW..HIGH, as signal_at_1m=4000..8000")
    return name.strip(), (_number(low, f"--bounds {text}"), _number(high, f"--bounds {text}"))


def _value(text: str, option: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise UsageError(f"{option} {text} has no value", fix="give NAME=VALUE, as signal_at_1m=5000")
    return name.strip(), _number(value, f"{option} {text}")


def _number(text: str, where: str) -> float:
    with contextlib.suppress(ValueError):
        value = float(text)
        if abs(value) < float("inf"):
            return value
    raise UsageError(f"{where}: {text.strip()!r} is no number", fix="give numbers as 0.25 or 3e-4")


def _checked(case: Path, asked: Request, out: Path, json: str | None) -> Case:
    """The case, once it is known that all is there, that there is something to fit, and where results go."""
    check_directory(out, case)
    from lidarcheck.calibration.parameters.workflow import prepared
    from lidarcheck.cases.case import load_case

    with stage("reading the case"):
        loaded = load_case(case, fewest=1)
    check_not_read(out, loaded.files)
    check_out_dir(out, loaded.files)
    if json is not None:
        check_writable(json, option="--json", besides=(*loaded.files, *(out / name for name in (RESULT, PAGE, MODEL))))
    for words in prepared(loaded, asked)[2].values():
        note(words)
    make_directory(out)
    return loaded


def _calibrated(
    loaded: Case,
    asked: Request,
    out: Path,
    seed: int,
    jobs: int | None,
    rounds: int,
    write: Callable[[Calibration], None],
    pool: WorkerPool | None,
) -> None:
    """Run the loop, going on where an interrupted run stopped, and `write` what it found; only then is that let go."""
    from lidarcheck.calibration.parameters.workflow import calibrate as run
    from lidarcheck.workers.checkpoint import Checkpoint, checkpoint_key
    from lidarcheck.workers.cores import usable_cores

    key = checkpoint_key(loaded.hashes, loaded.model, seed, [repr(asked)])
    with Checkpoint(out / KEPT, key) as checkpoint:
        if len(checkpoint):
            note(f"going on with what an interrupted run left in {out / KEPT}")
        with _course(rounds) as (told, watched, seen):
            try:
                found = run(
                    loaded, asked, seed=seed, jobs=jobs or usable_cores(), pool=pool, rounds=rounds, progress=told,
                    on_round=watched, checkpoint=checkpoint,
                )  # fmt: skip
            except KeyboardInterrupt:
                _say_best(seen, loaded, asked, out)
                raise
        write(found)
        checkpoint.discard()


@contextlib.contextmanager
def _course(rounds: int) -> Iterator[tuple[Callable[[str], None], Callable[[Round, float | None], None], list[Round]]]:
    """What is told of the work: a line a round, and on a terminal what is being done."""
    seen: list[Round] = []
    with progress("") as show:

        def told(words: str) -> None:
            show(max(len(seen) - 1, 0), rounds + 1, words)

        def watched(one: Round, left_s: float | None) -> None:
            if not seen:
                note(f"held out: distance of model and measurement; two runs of one model are {one.floor:.4f} apart")
            seen.append(one)
            for line in _lines(one, left_s):
                note(line)

        yield told, watched, seen


def _lines(one: Round, left_s: float | None) -> list[str]:
    left = "" if left_s is None else f", at most {clock_text(left_s)} left"
    values = "  ".join(f"{name} {value:.5g}" for name, value in one.values.items())
    head = f"round {one.number:<2} held out {one.held_out.value:.4f}  fitted {one.fit.value:.4f}  "
    text = f"{head}{values}  ({clock_text(one.seconds)}{left})"
    width = shutil.get_terminal_size().columns if sys.stderr.isatty() else 200
    return textwrap.wrap(text, max(width, 40), subsequent_indent="         ", break_on_hyphens=False)


def _say_best(seen: Sequence[Round], loaded: Case, asked: Request, out: Path) -> None:
    """Write the model with the best numbers so far, and say that they are not the last."""
    if len(seen) < 2:
        note("interrupted before the first round was done; nothing is written")
        return
    from lidarcheck.calibration.parameters.parameters import with_values
    from lidarcheck.calibration.parameters.workflow import prepared
    from lidarcheck.model.files.write import write_model

    best = min(seen, key=lambda one: one.held_out.value)
    write_model(loaded.model_file, with_values(prepared(loaded, asked)[0], best.values), out / MODEL)
    note(
        f"interrupted: {out / MODEL} has the best numbers so far, of round {best.number}, without intervals; "
        f"what was done is kept in {out / KEPT}, and the same command goes on from there"
    )


def _write(found: Calibration, loaded: Case, out: Path, json: str | None, plot: str | None) -> None:
    from lidarcheck.explain.report.model_diff import model_diff
    from lidarcheck.figures.pages.parameters import document, page
    from lidarcheck.model.files.write import write_model

    diff = model_diff(loaded.model, found.model)
    sources = {"case": str(loaded.directory), "seed": str(found.seed)}
    provenance = {**sources, **{name: f"sha256 {digest}" for name, digest in found.hashes.items()}}
    files = {MODEL: lambda place: write_model(loaded.model_file, found.model, place)}
    finish(page(found, diff, provenance), document(found), out=out, json=json, plot=plot, files=files)
    note(f"{out / MODEL}: the model with the fitted numbers")
