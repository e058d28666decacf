"""The copy of the source that errors are put into, what its scenarios run of it, and what is known on the disk."""

from __future__ import annotations

import collections
import hashlib
import json
import os
import queue
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

from mutants_sites import Mutant

Pair = tuple[str, str]
Bench = TypeVar("Bench")
Thing = TypeVar("Thing")
Found = TypeVar("Found")
WORKER = Path(__file__).with_name("mutants_worker.py")
COMPILING_S = 120.0
LEAST_S = 60.0
WAITING = 20.0
LONGEST_S = 86_400.0
AT_ONCE = 12
"""What a scenario may take, in seconds of the processor, beside what it takes in the right source; how much longer than
its processor time a run may take beside others, and the longest that is waited for one; and how many scenarios are
traced before they are kept."""


class Scratch:
    """A copy of source, scenarios and goldens: a file of it is mutated and mended again; and compiled kernels of it."""

    def __init__(self, root: Path, number: int = 0) -> None:
        self.root = root
        self.place = root / ".lidarcheck" / (f"mutants-{number}" if number else "mutants")
        self.source = self.place / "src"
        for part in ("src", "scenarios", "goldens"):
            shutil.rmtree(self.place / part, ignore_errors=True)
            # With its times: compiled kernels are looked for by them.
            shutil.copytree(root / part, self.place / part, ignore=shutil.ignore_patterns("__pycache__"))
        (root / ".lidarcheck" / ".gitignore").write_text("*\n", encoding="utf-8")
        self.hash = source_hash(self.source / "lidarcheck")
        self.kernels = self.place / f"kernels-{self.hash}"
        for other in set(self.place.glob("kernels*")) - {self.kernels}:
            shutil.rmtree(other)
        self.spans: dict[str, list[tuple[str, int, int]]] = {}
        self.spans = self._spans()
        self.imports = imports_of(self.source / "lidarcheck")

    def environment(self) -> dict[str, str]:
        return {**os.environ, "PYTHONPATH": str(self.source), "LIDARCHECK_CACHE": str(self.place / "cache")}

    def _spans(self) -> dict[str, list[tuple[str, int, int]]]:
        """Of each kernel, the file and lines of it and of all that it calls."""
        files = [path for path in (self.source / "lidarcheck/model").rglob("*.py") if compiled(path.read_bytes())]
        names = [".".join(path.relative_to(self.source).with_suffix("").parts) for path in files]
        tasks = [{"name": name} for name in names if ".cuda." not in name]
        code, lines, errors = self.work("kernels", None, tasks, WAITING * COMPILING_S)
        if code:
            sys.exit(f"error: the right source does not run: {errors[-2000:]}")
        spans: dict[str, list[tuple[str, int, int]]] = {}
        for line in lines:
            spans[line["name"]] = spans.get(line["name"], []) + line["spans"]
        return spans

    def work(
        self, what: str, mutant: Mutant | None, tasks: Sequence[dict[str, Any]], limit_s: float
    ) -> tuple[int, list[dict[str, Any]], str]:
        """(exit code, lines, errors) of the worker with the mutant in the source."""
        # Kernels that the error does not reach are not compiled again.
        fresh = [kernel for kernel in self.spans if mutant is None or not self._reaches(mutant, kernel)]
        kernels = self.kernels / ("marked" if what == "trace" else "plain")
        given = json.dumps({"kernels": str(kernels), "fresh": fresh, "tasks": tasks})
        code, output, errors = self.run([str(WORKER), what], mutant, given, limit_s)
        return code, [json.loads(line) for line in output.splitlines()], errors

    def run(self, command: Sequence[str], mutant: Mutant | None, given: str, limit_s: float) -> tuple[int, str, str]:
        """(exit code, output, errors) of a Python command with the mutant in the source; -9 where it hangs."""
        file = self.source / "lidarcheck" / (mutant.file if mutant else "__init__.py")
        text, times = file.read_bytes(), file.stat()
        try:
            if mutant is not None:
                file.write_bytes(mutant.applied(text))
            run = subprocess.run(
                [sys.executable, *command],
                cwd=self.root,
                env=self.environment(),
                input=given,
                capture_output=True,
                text=True,
                timeout=min(limit_s, LONGEST_S),
                check=False,
            )
            if run.returncode == -signal.SIGINT:
                raise KeyboardInterrupt  # Otherwise a run that somebody breaks off says that the model crashes.
            return run.returncode, run.stdout, run.stderr
        except subprocess.TimeoutExpired:
            return -9, "", "it hangs"
        finally:
            file.write_bytes(text)
            os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
            shutil.rmtree(self.place / "cache", ignore_errors=True)

    def _reaches(self, mutant: Mutant, kernel: str) -> bool:
        """Whether a kernel has the error, or calls what has it."""
        spans = self.spans.get(kernel, ())
        if mutant.inside:
            return any(f == mutant.file and a <= mutant.lines[1] and mutant.lines[0] <= b for f, a, b in spans)
        return not self.importers(mutant.file).isdisjoint(file for file, _, _ in spans)

    def importers(self, file: str) -> set[str]:
        """The file, those that import it, and those that import these."""
        found, waiting = {file}, [file]
        while waiting:
            one = waiting.pop()
            new = [name for name, others in self.imports.items() if one in others and name not in found]
            found.update(new)
            waiting += new
        return found


def compiled(source: bytes) -> bool:
    return b"@kernel" in source or b"@inlined" in source


def imports_of(package: Path) -> dict[str, set[str]]:
    """Of each file of the model and the effects those that it imports, as paths below the package."""
    files = {
        path.relative_to(package).as_posix(): path
        for part in ("effects", "model")
        for path in (package / part).rglob("*.py")
    }
    found: dict[str, set[str]] = {}
    for name, path in files.items():
        words = set()
        for line in path.read_text(encoding="utf-8").splitlines():
            first, _, rest = line.strip().partition(" ")
            if first in ("from", "import") and rest.startswith("lidarcheck."):
                module, _, things = rest.partition(" import ")
                words |= {
                    module,
                    *(f"{module}.{thing.split()[0]}" for thing in things.strip("(").split(",") if thing.split()),
                }
        paths = {f"{word.removeprefix('lidarcheck.').replace('.', '/')}.py" for word in words}
        found[name] = paths & files.keys()
    return found


def side_by_side(
    benches: Sequence[Bench], work: Callable[[Bench, Thing], Found], things: Sequence[Thing]
) -> Iterator[Found]:
    """`work(bench, thing)` of each thing, in their order; as many at a time as there are benches, one on each."""
    free: queue.SimpleQueue[Bench] = queue.SimpleQueue()
    for bench in benches:
        free.put(bench)

    def one(thing: Thing) -> Found:
        bench = free.get()
        try:
            return work(bench, thing)
        finally:
            free.put(bench)

    with ThreadPoolExecutor(len(benches)) as pool:
        yield from pool.map(one, things)


class Kept:
    """What is known, on the disk after each mutant."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._saving = threading.Lock()
        self.known: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}

    def save(self, key: str, found: dict[str, Any]) -> None:
        with self._saving:
            self.known[key] = found
            self.path.parent.mkdir(parents=True, exist_ok=True)
            new = self.path.with_suffix(".new")
            new.write_text(json.dumps(self.known, indent=1), encoding="utf-8")
            new.replace(self.path)


class Runs:
    """What each scenario runs of the right source: lines, seconds, echoes; known again while nothing has changed.

    `among`: the copies of the source in which scenarios are traced, side by side.
    """

    def __init__(self, place: Scratch, among: Sequence[Scratch]) -> None:
        self.place = place
        self.source = place.hash
        self.digests = {path.stem: self._digest(path) for path in sorted((place.place / "scenarios").glob("*.toml"))}
        kept = Kept(place.root / ".lidarcheck" / "mutants-lines.json")
        pairs = [(name, fidelity) for fidelity in ("exact", "fast") for name in self.digests]
        keys = {pair: f"{self.source} {self.digests[pair[0]]} {pair[1]}" for pair in pairs}
        new = [pair for pair in pairs if keys[pair] not in kept.known]
        if new:
            print(f"{len(new)} scenarios run in the right source, to know what they run", flush=True)
        self._trace(new, keys, kept, among)
        known = {pair: kept.known[keys[pair]] for pair in pairs}
        bad = [name for (name, fidelity), run in known.items() if run and not run["holds"] and fidelity == "exact"]
        if bad:
            sys.exit(f"error: {', '.join(bad)}: not what the golden says; run lidarcheck check first")
        self.known = {pair: run for pair, run in known.items() if run and run["holds"]}

    def _trace(self, new: Sequence[Pair], keys: dict[Pair, str], kept: Kept, among: Sequence[Scratch]) -> None:
        """Keep what these scenarios run, a few of them at a time in each copy."""

        def trace(place: Scratch, some: Sequence[Pair]) -> None:
            tasks = [self._task(*pair, LEAST_S + COMPILING_S, []) for pair in some]
            code, lines, errors = place.work("trace", None, tasks, WAITING * AT_ONCE * COMPILING_S)
            if code:
                raise SystemExit(f"error: the scenarios cannot be run: {errors[-2000:]}")
            found = {(line["name"], line["fidelity"]): line for line in lines}
            for pair in some:
                kept.save(keys[pair], found.get(pair, {}))

        list(side_by_side(among, trace, [new[start : start + AT_ONCE] for start in range(0, len(new), AT_ONCE)]))

    def _digest(self, scenario: Path) -> str:
        """Of a scenario, its golden, and the files that it names, or that these name."""
        beside, files = sorted(scenario.parent.glob("*/**/*.*")), [scenario]
        for file in files:
            text = file.read_bytes()
            files += [path for path in beside if path.name.encode() in text and path not in files]
        golden = self.place.place / "goldens" / scenario.name
        return hashlib.sha256(b"\0".join(path.read_bytes() for path in [*files, golden] if path.is_file())).hexdigest()[
            :16
        ]

    def _task(self, name: str, fidelity: str, limit_s: float, digests: Sequence[str]) -> dict[str, Any]:
        file = str(self.place.place / "scenarios" / f"{name}.toml")
        return {"name": name, "file": file, "fidelity": fidelity, "limit_s": limit_s, "digests": digests}

    def of(self, mutant: Mutant) -> list[tuple[str, str]]:
        """The scenarios, and paths, that run the mutant's line, cheapest first; the fast path where no other does."""
        files = {mutant.file} if mutant.inside else {mutant.file, *self._importers(mutant.file)}
        lines = range(mutant.lines[0], mutant.lines[1] + 1)

        def runs(run: dict[str, Any]) -> bool:
            if mutant.inside:
                return not set(lines).isdisjoint(run["lines"].get(mutant.file, ()))
            return any(file in run["lines"] for file in files)

        touching = [pair for pair, run in self.known.items() if runs(run)]
        # Who runs the exact path only imports the fast one's files.
        wanted = "fast" if mutant.file.startswith("model/fast/") else "exact"
        own = [pair for pair in touching if pair[1] == wanted]
        return sorted(own or touching, key=lambda pair: float(self.known[pair]["seconds"]))

    def lines(self) -> dict[str, set[int]]:
        """The lines of each file that some scenario runs."""
        found: dict[str, set[int]] = collections.defaultdict(set)
        for run in self.known.values():
            for file, numbers in run["lines"].items():
                found[file].update(numbers)
        return found

    def _importers(self, file: str) -> set[str]:
        return {name for name, others in self.place.imports.items() if file in others}

    def tasks(self, pairs: Sequence[tuple[str, str]], compiling: bool) -> list[dict[str, Any]]:
        """For the worker."""
        limits = [LEAST_S + 10.0 * self.known[pair]["seconds"] + (COMPILING_S if compiling else 0.0) for pair in pairs]
        return [
            self._task(*pair, limit_s, self.known[pair]["digests"]) for pair, limit_s in zip(pairs, limits, strict=True)
        ]


def source_hash(package: Path, mutant: Mutant | None = None) -> str:
    """Of the source that gives echoes, with the mutant in it."""
    digest = hashlib.sha256()
    rooms = ("elementary", "effects", "model", "sensor")
    paths = [path for room in rooms for path in (package / room).rglob("*.py")]
    for path in sorted([*paths, package / "scan.py", *(package / "sensors").glob("*.toml")]):
        name, text = path.relative_to(package).as_posix(), path.read_bytes()
        digest.update(name.encode() + b"\0" + (mutant.applied(text) if mutant and mutant.file == name else text))
    return digest.hexdigest()[:32]
