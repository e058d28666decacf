"""Puts errors into the model and the effects, one at a time, and says which of them `lidarcheck check` notices.

    ci/mutants                          # 150 errors, drawn by --seed 0
    ci/mutants --seed 7 --only fog      # others, in files in whose path the word occurs
    ci/mutants --tests                  # what the scenarios let pass is also given to the tests

The errors (`mutants_sites.py`): another comparison, another constant, another operator or sign, a line dropped, two
arguments swapped. Each is judged by the scenarios that run its line, cheapest first, until one is red: paired seeds,
then fresh ones, as the gate does. The fast path is judged by the scenarios without effects on that path. Verdicts:

    killed      a KPI fails
    broken      the model crashes, hangs, or does not compile
    identical   survived: every scenario's echoes are the same bit for bit
    changed     survived: echoes change, and nothing is red
    equivalent  survived, and `mutants.toml` says why no result can change

Prints a line a mutant, the survivors last; exit code 1 where one survives. What is known is kept in
`.lidarcheck/mutants.json`, by the mutated source and by the scenarios and goldens that judged it, so that an
interrupted run goes on, and a new scenario is asked only about survivors. cosmic-ray and mutmut run tests in the
place of scenarios, and know nothing of compiled kernels, whose cache must not outlive the error.
"""

from __future__ import annotations

import argparse
import collections
import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mutants_sites import Mutant, drawn

ROOT = Path(__file__).resolve().parents[1]
WORKER = Path(__file__).with_name("mutants_worker.py")
SURVIVED = ("identical", "changed")
COMPILING_S = 900.0
LEAST_S = 60.0
TESTING_S = 1800.0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0, help="which errors are drawn")
    parser.add_argument("--count", type=int, default=150, help="how many")
    parser.add_argument("--only", default="", help="errors in files in whose path this occurs")
    parser.add_argument("--tests", action="store_true", help="give what survives to the tests of the model and effects")
    parser.add_argument("--root", type=Path, default=ROOT, help="the checkout whose source and scenarios are used")
    args = parser.parse_args()
    place = Scratch(args.root.resolve())
    runs = Runs(place)
    mutants = drawn(place.source / "lidarcheck", args.seed, args.count, args.only)
    kept = Kept(place.root / ".lidarcheck" / "mutants.json")
    excused = equivalents(Path(__file__).with_name("mutants.toml"))
    counts: collections.Counter[str] = collections.Counter()
    alive = []
    for number, mutant in enumerate(mutants, start=1):
        found = judged(mutant, place, runs, kept)
        if found["verdict"] in SURVIVED and name_of(mutant) in excused:
            found = {**found, "verdict": "equivalent"}
        if args.tests and found["verdict"] in SURVIVED:
            found = {**found, **tested(mutant, place, kept)}
        counts[found["verdict"]] += 1
        print(
            f"{number}/{len(mutants)} {found['verdict']:10} {found['seconds']:6.1f} s  {mutant}{told(found)}",
            flush=True,
        )
        alive += [f"{mutant}{told(found)}"] if found["verdict"] in SURVIVED else []
    print(*(f"survived: {text}" for text in alive), in_words(counts), sep="\n")
    return int(bool(alive))


def told(found: dict[str, Any]) -> str:
    """What decided."""
    return f"  [{found['by']}]" if found.get("by") else ""


def in_words(counts: collections.Counter[str]) -> str:
    """The figures of a run; equivalents count neither way."""
    total = sum(counts.values()) - counts["equivalent"]
    by_scenarios = counts["killed"] + counts["broken"]
    text = f"{by_scenarios} of {total} killed by scenarios ({100.0 * by_scenarios / max(total, 1):.1f} %), "
    text += f"{counts['broken']} of them broken"
    if counts["by tests"]:
        both = by_scenarios + counts["by tests"]
        text += f"; {both} by scenarios and tests ({100.0 * both / max(total, 1):.1f} %)"
    return text + f"; {counts['identical']} identical, {counts['changed']} changed; {counts['equivalent']} equivalent"


class Scratch:
    """A copy of source, scenarios and goldens: a file of it is mutated and mended again; and compiled kernels of it."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.place = root / ".lidarcheck" / "mutants"
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
        _, lines, _ = self.work("kernels", None, tasks, COMPILING_S)
        return {line["name"]: line["spans"] for line in lines}

    def work(
        self, what: str, mutant: Mutant | None, tasks: Sequence[dict[str, Any]], limit_s: float
    ) -> tuple[int, list[dict[str, Any]], str]:
        """(exit code, lines, errors) of the worker with the mutant in the source."""
        # Kernels that the error does not reach are not compiled again.
        stale = [kernel for kernel in self.spans if mutant and self._reaches(mutant, kernel)]
        given = json.dumps({"kernels": str(self.kernels), "stale": stale, "tasks": tasks})
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
                timeout=limit_s,
                check=False,
            )
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


class Kept:
    """What is known, on the disk after each mutant."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.known: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}

    def save(self, key: str, found: dict[str, Any]) -> None:
        self.known[key] = found
        self.path.parent.mkdir(parents=True, exist_ok=True)
        new = self.path.with_suffix(".new")
        new.write_text(json.dumps(self.known, indent=1), encoding="utf-8")
        new.replace(self.path)


class Runs:
    """What each scenario runs of the right source: lines, seconds, echoes; known again while nothing has changed."""

    def __init__(self, place: Scratch) -> None:
        self.place = place
        self.source = place.hash
        self.digests = {path.stem: self._digest(path) for path in sorted((place.place / "scenarios").glob("*.toml"))}
        kept = Kept(place.root / ".lidarcheck" / "mutants-lines.json")
        pairs = [(name, fidelity) for fidelity in ("exact", "fast") for name in self.digests]
        keys = {pair: f"{self.source} {self.digests[pair[0]]} {pair[1]}" for pair in pairs}
        new = [pair for pair in pairs if keys[pair] not in kept.known]
        if new:
            print(f"{len(new)} scenarios run in the right source, to know what they run", flush=True)
            tasks = [self._task(name, fidelity, LEAST_S + COMPILING_S, []) for name, fidelity in new]
            code, lines, errors = place.work("trace", None, tasks, 1e5)
            if code:
                sys.exit(f"error: the scenarios cannot be run: {errors[-2000:]}")
            found = {(line["name"], line["fidelity"]): line for line in lines}
            for pair in new:
                kept.save(keys[pair], found.get(pair, {}))
        known = {pair: kept.known[keys[pair]] for pair in pairs}
        bad = [name for (name, fidelity), run in known.items() if run and not run["holds"] and fidelity == "exact"]
        if bad:
            sys.exit(f"error: {', '.join(bad)}: not what the golden says; run lidarcheck check first")
        self.known = {pair: run for pair, run in known.items() if run and run["holds"]}

    def _digest(self, scenario: Path) -> str:
        """Of a scenario, its golden, the models beside it and the files that it names."""
        golden, text = self.place.place / "goldens" / scenario.name, scenario.read_text(encoding="utf-8")
        beside = sorted(scenario.parent.glob("*/**/*"))
        files = [scenario, golden, *(path for path in beside if path.suffix == ".toml" or path.name in text)]
        return hashlib.sha256(b"\0".join(path.read_bytes() for path in files if path.is_file())).hexdigest()[:16]

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
        exact = [pair for pair in touching if pair[1] == "exact"]
        return sorted(exact or touching, key=lambda pair: float(self.known[pair]["seconds"]))

    def _importers(self, file: str) -> set[str]:
        return {name for name, others in self.place.imports.items() if file in others}

    def tasks(self, pairs: Sequence[tuple[str, str]], compiling: bool) -> list[dict[str, Any]]:
        """For the worker."""
        limits = [LEAST_S + 60.0 * self.known[pair]["seconds"] + (COMPILING_S if compiling else 0.0) for pair in pairs]
        return [
            self._task(*pair, limit_s, self.known[pair]["digests"]) for pair, limit_s in zip(pairs, limits, strict=True)
        ]


def source_hash(package: Path, mutant: Mutant | None = None) -> str:
    """Of the source that gives echoes, with the mutant in it."""
    digest = hashlib.sha256()
    paths = [path for part in ("elementary", "effects", "model") for path in (package / part).rglob("*.py")]
    for path in sorted([*paths, package / "scan.py", package / "sensor.py", *(package / "sensors").glob("*.toml")]):
        name, text = path.relative_to(package).as_posix(), path.read_bytes()
        digest.update(name.encode() + b"\0" + (mutant.applied(text) if mutant and mutant.file == name else text))
    return digest.hexdigest()[:32]


def judged(mutant: Mutant, place: Scratch, runs: Runs, kept: Kept) -> dict[str, Any]:
    """The verdict of the scenarios that run the mutant's line, from memory where these have not changed."""
    key = source_hash(place.source / "lidarcheck", mutant)
    pairs = runs.of(mutant)
    now = {f"{name} {fidelity}": runs.digests[name] for name, fidelity in pairs}
    found = kept.known.get(key)
    if found and all(now.get(name) == digest for name, digest in found["judges"].items()):
        if found["verdict"] not in SURVIVED:
            return dict(found)
        pairs = [pair for pair in pairs if " ".join(pair) not in found["judges"]]
        if not pairs:
            return dict(found)
    begin = time.monotonic()
    new = verdict_of(mutant, place, runs, pairs)
    if found and new["verdict"] in SURVIVED and found["verdict"] == "changed":
        new["verdict"], new["by"] = "changed", found["by"]
    judges = [new["by"].partition(":")[0]] if new["verdict"] == "killed" else now
    new |= {
        "judges": {name: now[name] for name in judges},
        "seconds": round(time.monotonic() - begin, 1),
        "mutant": str(mutant),
        "then": mutant.then,
    }
    kept.save(key, new)
    return new


def verdict_of(mutant: Mutant, place: Scratch, runs: Runs, pairs: Sequence[tuple[str, str]]) -> dict[str, Any]:
    if not pairs:
        return {"verdict": "identical", "by": "no scenario runs it"}
    compiling = compiled((place.source / "lidarcheck" / mutant.file).read_bytes())
    tasks = runs.tasks(pairs, compiling or pairs[0][1] == "fast")
    code, lines, errors = place.work("judge", mutant, tasks, sum(task["limit_s"] for task in tasks))
    if lines and lines[-1]["found"] == "red":
        name = lines[-1]["name"]
        return {"verdict": "killed", "by": f"{name} {dict(pairs)[name]}: {lines[-1]['kpi']}"}
    if code:
        last = errors.strip().splitlines()
        return {
            "verdict": "broken",
            "by": next((line for line in last if "Timeout" in line), last[-1] if last else str(code))[:160],
        }
    changed = [line for line in lines if line["found"] == "changed"]
    if not changed:
        return {"verdict": "identical", "by": f"{len(pairs)} scenarios run it"}
    most = max(changed, key=lambda line: float(line["moved"]))
    return {
        "verdict": "changed",
        "by": f"{most['name']} moves by {most['moved']:.2g} of a tolerance, {len(changed)} change",
    }


def tested(mutant: Mutant, place: Scratch, kept: Kept) -> dict[str, Any]:
    """Whether the tests of the mutant's room notice what scenarios do not: `by tests`."""
    room, _, rest = mutant.file.partition("/")
    inner = f"tests/{room}/{rest.partition('/')[0]}"
    tests = [name for name in (inner, f"tests/{room}") if (place.root / name).is_dir()]
    key = f"tests {source_hash(place.source / 'lidarcheck', mutant)}"
    for name in tests:
        if f"{key} {name}" not in kept.known:
            command = ["-m", "pytest", "-x", "-q", "-m", "not long", "-p", "no:cacheprovider", name]
            code, output, _ = place.run(command, mutant, "", TESTING_S)
            failed = [line for line in output.splitlines() if line.startswith(("FAILED", "ERROR"))]
            red = code not in (0, 5)
            kept.save(f"{key} {name}", {"red": red, "by": failed[0][:160] if failed else name, "mutant": str(mutant)})
        if kept.known[f"{key} {name}"]["red"]:
            return {"verdict": "by tests", "by": kept.known[f"{key} {name}"]["by"]}
    return {}


def equivalents(path: Path) -> set[tuple[str, str, str]]:
    """The errors that change no result, which that file lists with the reason."""
    listed = tomllib.loads(path.read_text(encoding="utf-8")).get("equivalent", [])
    return {(entry["file"], entry["line"], entry["then"]) for entry in listed}


def name_of(mutant: Mutant) -> tuple[str, str, str]:
    """What says which error it is, although lines move."""
    return mutant.file, mutant.line, mutant.then


if __name__ == "__main__":
    sys.exit(main())
