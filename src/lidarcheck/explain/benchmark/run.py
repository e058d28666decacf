"""The benchmark of the gap workflow: cases in which a generator hid effects, sealed until the answer is there."""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import hashlib
import importlib
import importlib.util
import json
import logging
import math
import multiprocessing
import os
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from lidarcheck.errors import InputError, LidarcheckError, UsageError
from lidarcheck.explain.benchmark.score import Answer, Score, score
from lidarcheck.explain.report.explanation import Explanation
from lidarcheck.workers.parent import end_with_parent
from lidarcheck.workers.waiting import as_they_end

if TYPE_CHECKING:
    pass

__all__ = ["KINDS", "Benchmark", "find_generator", "load_generator", "run_benchmark"]

KINDS = ("null", "null_nuisance", "single", "pair", "several", "left_out", "alien")
WORKFLOW = "lidarcheck.explain.workflow:explain"
CASES = "cases.jsonl"
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

_log = logging.getLogger(__name__)
ProgressCallback = Callable[[int, int, str], object]


@dataclass(frozen=True)
class Benchmark:
    """What was run and how good it was. `answers` in the order of the cases."""

    seed: int
    only: str | None
    generator: Path
    answers: tuple[Answer, ...]
    score: Score

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "seed": self.seed,
            "only": self.only,
            "score": self.score.to_dict(),
            "cases": [answer.to_dict() for answer in self.answers],
        }


def find_generator(start: Path | None = None) -> Path:
    """The nearest `tests/hidden` package, here or in a directory above; `UsageError` when there is none."""
    here = (start or Path.cwd()).absolute()
    for directory in (here, *here.parents):
        if (directory / "tests/hidden/__init__.py").is_file():
            return directory / "tests/hidden"
    fix = "run it in a checkout of lidarcheck, or name the package with --generator"
    raise UsageError(f"there is no tests/hidden, which makes the cases, in {here} or above", fix=fix)


def load_generator(directory: Path) -> ModuleType:
    """The package in that directory; `InputError` when it is none or lacks what is needed."""
    file = directory.resolve() / "__init__.py"
    if not file.is_file():
        raise InputError("is not a Python package", file=directory, fix="name the directory of a generator of cases")
    # Under its own name: what it has compiled and cached asks for modules by the name that they had then.
    name = file.parent.name
    module = sys.modules.get(name)
    if module is None or module.__file__ != str(file):
        if module is not None and not hasattr(module, "write_case"):
            name = f"lidarcheck_cases_{hashlib.sha256(str(file).encode()).hexdigest()[:12]}"
        module = _imported(name, file)
    missing = [part for part in ("plan", "write_case", "CaseOrder") if not hasattr(module, part)]
    if missing:
        raise InputError(f"has no {', '.join(missing)}", file=file, fix="name a generator of cases")
    return module


def _imported(name: str, file: Path) -> ModuleType:
    """A package by its file, in the place of another one of that name."""
    for old in [one for one in sys.modules if one == name or one.startswith(f"{name}.")]:
        del sys.modules[old]
    spec = importlib.util.spec_from_file_location(name, file, submodule_search_locations=[str(file.parent)])
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        del sys.modules[name]
        if not isinstance(error, Exception):
            raise
        raise InputError(f"cannot be imported: {error}", file=file, fix="name a generator of cases") from error
    return module


def run_benchmark(
    n: int,
    *,
    seed: int = 0,
    only: str | None = None,
    jobs: int = 1,
    generator: Path | None = None,
    out: Path | None = None,
    on_progress: ProgressCallback | None = None,
    explain: str = WORKFLOW,
) -> Benchmark:
    """Run the first `n` cases of a seed, each in one process, `jobs` side by side, and judge the answers.

    `out`: a directory whose `cases.jsonl` keeps each answer as soon as it is there; what it holds of the same
    generator, program, seed and kind is not run again. `on_progress(done, of, words)` after each case. `explain`: what
    answers, as "module:function" of the signature of the workflow's. A case that ends in an error counts as answered
    wrongly. `UsageError` for a kind that there is not.
    """
    if only is not None and only not in KINDS:
        raise UsageError(f"there is no kind of case {only!r}", fix=f"use one of {', '.join(KINDS)}")
    place = generator or find_generator()
    orders = load_generator(place).plan(n, seed, only)
    key = _key(place, seed, only, explain)
    done: dict[int, Answer] = {}
    with _kept(out, key, done) as keep, _scratch() as scratch:
        rest = [order for order in orders if order.number not in done]
        tasks = [(str(place), dataclasses.asdict(order), explain, scratch) for order in rest]
        if on_progress is not None and len(rest) < len(orders):
            on_progress(len(orders) - len(rest), len(orders), "kept by an earlier run")
        for answer in _answers(tasks, jobs):
            keep(answer)
            done[answer.number] = answer
            if on_progress is not None:
                on_progress(
                    sum(order.number in done for order in orders), len(orders), f"case {answer.number}, {answer.kind}"
                )
    answers = tuple(done[order.number] for order in orders)
    return Benchmark(seed, only, place, answers, score(answers))


def _scratch() -> tempfile.TemporaryDirectory[str]:
    """One directory for all cases, so that those of workers that are ended go with it."""
    return tempfile.TemporaryDirectory(prefix="lidarcheck-cases-", ignore_cleanup_errors=True)


def _answers(tasks: Sequence[tuple[str, dict[str, Any], str, str]], jobs: int) -> Iterator[Answer]:
    """The answers as they come, in any order."""
    if jobs == 1 or len(tasks) < 2:
        for task in tasks:
            yield _answer(*task)
        return
    with _one_thread_each():
        pool = ProcessPoolExecutor(
            min(jobs, len(tasks)), mp_context=multiprocessing.get_context("spawn"), initializer=_as_worker
        )
        try:
            yield from as_they_end([pool.submit(_answer, *task) for task in tasks])
        except BaseException as error:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.terminate()
            if isinstance(error, BrokenProcessPool):
                raise UsageError("a worker process has died", fix="was memory short? use fewer --jobs") from error
            raise
        pool.shutdown()


def _as_worker() -> None:
    """The process that started the workers ends them and says what there is to say."""
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")


@contextlib.contextmanager
def _hushed() -> Iterator[None]:
    """Warnings about files that nobody will see help nobody."""
    logger = logging.getLogger("lidarcheck")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


@contextlib.contextmanager
def _one_thread_each() -> Iterator[None]:
    """Workers that start now take one core each, since there are as many as cores."""
    old = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in old.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _answer(place: str, order_fields: Mapping[str, Any], explain: str, where: str) -> Answer:
    """Write one case, explain it, and only then open its seal."""
    from lidarcheck.cases.case import load_case
    from lidarcheck.formats.plain import plain

    module = load_generator(Path(place))
    order = module.CaseOrder(**order_fields)
    name, _, function = explain.partition(":")
    with _hushed(), tempfile.TemporaryDirectory(dir=where) as scratch:
        sealed = module.write_case(order, Path(scratch) / "case")
        start = time.perf_counter()
        error = ""
        report: dict[str, Any] = {"verdict": "unknown", "effects": [], "gap": {}}
        found = None
        try:
            run = getattr(importlib.import_module(name), function)
            case = load_case(Path(scratch) / "case")
            found = run(case, exclude=order.exclude, jobs=1)
            report = plain(found.to_dict())
        except LidarcheckError as problem:
            error = " ".join(problem.lines()).replace(scratch, "").strip()
        except Exception as problem:  # noqa: BLE001 - a case that fails is a wrong answer, not the end of the benchmark
            error = f"{type(problem).__name__}: {problem}"
        seconds = time.perf_counter() - start
    told = _told_apart(found)
    gc.collect()  # labs and what crews hold of them refer to each other: some 200 MB a case
    truth = sealed.open(report)
    closed = report["gap"].get("closed")
    return Answer(
        number=order.number,
        kind=order.kind,
        strength=order.strength,
        variant=order.variant,
        scene=order.scene,
        effects=tuple(truth.effects),
        observable=_by_effect(truth.observable, truth.effects),
        comparable=dict(truth.comparable),
        verdict="error" if error else str(report["verdict"]),
        found=tuple(report["effects"]),
        closed=math.nan if closed is None else float(closed),
        seconds=seconds,
        told_before=told[0],
        told_after=told[1],
        z=_by_effect(truth.z, truth.effects),
        exclude=tuple(order.exclude),
        error=error,
        gap=report["gap"],
        steps=tuple(report.get("steps", ())),
        not_testable=report.get("why_not_testable", {}),
    )


def _told_apart(found: Any) -> tuple[float, float]:
    """2 AUC - 1 of a classifier on frames that no fit has seen, with the case's model and with the explained one; NaN
    where none could be asked."""
    if not isinstance(found, Explanation):
        return math.nan, math.nan
    figure = found.gap.classifier
    before, after = (math.nan if one is None else one for one in (figure.before, figure.after))
    return before, after


def _by_effect(values: Any, effects: Sequence[str]) -> dict[str, Any]:
    """Values by effect, from a dictionary or from a sequence in the effects' order."""
    return dict(values) if isinstance(values, Mapping) else dict(zip(effects, values, strict=True))


def _key(place: Path, seed: int, only: str | None, explain: str) -> dict[str, Any]:
    from lidarcheck.workers.checkpoint import checkpoint_key

    files = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(place.glob("*.py"))}
    return {"seed": seed, "only": only, "explain": explain, "of": checkpoint_key(files, None, 0)}


@contextlib.contextmanager
def _kept(out: Path | None, key: Mapping[str, Any], done: dict[int, Answer]) -> Iterator[Callable[[Answer], None]]:
    """Yield what keeps an answer; `done` gets those that an interrupted run of the same `key` has kept."""
    if out is None:
        yield lambda _answer: None
        return
    file = out / CASES
    try:
        out.mkdir(exist_ok=True)
        length = _read(file, key, done)
        if not length and file.exists():
            _log.warning("%s is of another benchmark, or of another version: it is now %s.old", file, file.name)
            file.replace(file.with_name(f"{CASES}.old"))
        with file.open("r+b" if length else "wb") as stream:
            stream.truncate(length)
            stream.seek(length)

            def write(row: Mapping[str, Any]) -> None:
                stream.write(json.dumps(row).encode() + b"\n")
                stream.flush()

            if not length:
                write(key)
            yield lambda answer: write(answer.to_dict())
    except OSError as error:
        raise InputError(f"cannot write: {error.strerror or error}", file=file, fix="choose another --out") from error


def _read(file: Path, key: Mapping[str, Any], done: dict[int, Answer]) -> int:
    """Take over the answers of the same key; the length of the whole lines, 0 where there is nothing to take over."""
    if not file.is_file():
        return 0
    content = file.read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    try:
        rows = [json.loads(line) for line in whole.splitlines()]
        if not rows or rows[0] != key:
            return 0
        done.update((answer.number, answer) for answer in map(Answer.of, rows[1:]))
    except (ValueError, TypeError, KeyError):
        done.clear()
        return 0
    return len(whole)
