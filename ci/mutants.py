"""Puts errors into the model and the effects, one at a time, and says which of them `lidarcheck check` notices.

    ci/mutants                          # 150 errors, drawn by --seed 0
    ci/mutants --seed 7 --only fog      # others, in files in whose path the word occurs
    ci/mutants --jobs 2                 # two at a time
    ci/mutants --tests                  # what the scenarios let pass is also given to the tests
    ci/mutants --unrun                  # puts none in: which lines that can have one no scenario runs

The errors (`mutants_sites.py`): another comparison, another constant, another operator or sign, a line dropped, two
arguments swapped. Each is judged by the scenarios that run its line, cheapest first, until one is red: paired seeds,
then fresh ones, as the gate does. The fast path's files are judged by the scenarios on that path. Verdicts:

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
import signal
import sys
import time
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from mutants_sites import KINDS, Mutant, drawn, piles
from mutants_source import WAITING, Kept, Runs, Scratch, compiled, side_by_side, source_hash

ROOT = Path(__file__).resolve().parents[1]
SURVIVED = ("identical", "changed")
TESTING_S = 1800.0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0, help="which errors are drawn")
    parser.add_argument("--count", type=int, default=150, help="how many")
    parser.add_argument("--only", default="", help="errors in files in whose path this occurs")
    parser.add_argument("--tests", action="store_true", help="give what survives to the tests of the model and effects")
    parser.add_argument(
        "--unrun", action="store_true", help="list the lines with possible errors that no scenario runs"
    )
    parser.add_argument("--jobs", type=int, default=1, help="how many at a time, each in its own copy of the source")
    parser.add_argument("--root", type=Path, default=ROOT, help="the checkout whose source and scenarios are used")
    args = parser.parse_args()
    excused = equivalents(Path(__file__).with_name("mutants.toml"))
    places = [Scratch(args.root.resolve(), number) for number in range(max(args.jobs, 1))]
    benches = [Bench(place, Runs(place, places)) for place in places]
    if args.unrun:
        return unrun(benches[0], args.only, excused)
    mutants = drawn(benches[0].place.source / "lidarcheck", args.seed, args.count, args.only)
    kept = Kept(args.root.resolve() / ".lidarcheck" / "mutants.json")
    counts: collections.Counter[str] = collections.Counter()
    alive = []
    for number, (mutant, found) in enumerate(all_judged(mutants, benches, kept, excused, args.tests), start=1):
        counts[found["verdict"]] += 1
        print(
            f"{number}/{len(mutants)} {found['verdict']:10} {found['seconds']:6.1f} s  {mutant}{told(found)}",
            flush=True,
        )
        alive += [f"{mutant}{told(found)}"] if found["verdict"] in SURVIVED else []
    print(*(f"survived: {text}" for text in alive), in_words(counts), sep="\n")
    return int(bool(alive))


class Bench(NamedTuple):
    """A copy of the source, and what each scenario runs of it: one error at a time."""

    place: Scratch
    runs: Runs


def all_judged(
    mutants: Sequence[Mutant], benches: Sequence[Bench], kept: Kept, excused: set[tuple[str, str, str]], tests: bool
) -> Iterator[tuple[Mutant, dict[str, Any]]]:
    """Each error with its verdict, in their order; as many at a time as there are benches."""

    def one(bench: Bench, mutant: Mutant) -> dict[str, Any]:
        found = judged(mutant, bench.place, bench.runs, kept)
        if found["verdict"] in SURVIVED and is_excused(mutant, excused):
            found = {**found, "verdict": "equivalent"}
        if tests and found["verdict"] in SURVIVED:
            found = {**found, **tested(mutant, bench.place, kept)}
        return found

    yield from zip(mutants, side_by_side(benches, one, mutants), strict=True)


def unrun(bench: Bench, only: str, excused: set[tuple[str, str, str]]) -> int:
    """Tell which lines with possible errors no scenario runs, and what part of the errors drawn stands in them."""
    ran, shares, rows = bench.runs.lines(), [], set()
    for pile in piles(bench.place.source / "lidarcheck", only).values():
        for of_file in pile:
            some = [mutant for mutant in of_file if mutant.inside and not is_excused(mutant, excused)]
            missed = [m for m in some if ran[m.file].isdisjoint(range(m.lines[0], m.lines[1] + 1))]
            rows |= {(m.file, m.row, m.line) for m in missed}
            shares.append(len(missed) / len(of_file) / max(len(pile), 1))
    print(*(f"{file}:{row}: {line}" for file, row, line in sorted(rows)), sep="\n")
    print(f"{100.0 * sum(shares) / len(KINDS):.1f} % of the errors drawn stand in lines that no scenario runs")
    return int(bool(rows))


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
    code, lines, errors = place.work("judge", mutant, tasks, WAITING * sum(task["limit_s"] for task in tasks))
    if lines and lines[-1]["found"] == "red":
        name = lines[-1]["name"]
        return {"verdict": "killed", "by": f"{name} {dict(pairs)[name]}: {lines[-1]['kpi']}"}
    if code:
        last = errors.strip().splitlines() or [str(code)]
        return {"verdict": "broken", "by": "it hangs" if code == -signal.SIGPROF else last[-1][:160]}
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
    for names in tests_of(mutant, place.root):
        if failing := red_test(names, None, place, kept):
            sys.exit(f"error: {failing} fails in the right source; run the tests of {' '.join(names)} first")
        if failing := red_test(names, mutant, place, kept):
            return {"verdict": "by tests", "by": failing}
    return {}


def tests_of(mutant: Mutant, root: Path) -> list[tuple[str, ...]]:
    """The tests of the model and effects: first those that name the mutant's module, then all of its room."""
    room, _, rest = mutant.file.partition("/")
    module = f"lidarcheck.{mutant.file.removesuffix('.py').replace('/', '.')}"
    files = [path for folder in ("effects", "model") for path in sorted((root / "tests" / folder).rglob("test_*.py"))]
    near = tuple(path.relative_to(root).as_posix() for path in files if f"{module} " in path.read_text("utf-8"))
    inner = f"tests/{room}/{rest.partition('/')[0]}"
    return [names for names in (near, (inner,), (f"tests/{room}",)) if names and (root / names[0]).exists()]


def red_test(names: Sequence[str], mutant: Mutant | None, place: Scratch, kept: Kept) -> str:
    """The first of these tests that fails, from memory where source and tests are known; empty if none does."""
    files = sorted((place.root / "tests").rglob("*.py"))
    tests = hashlib.sha256(b"\0".join(path.read_bytes() for path in files)).hexdigest()[:16]
    key = f"{source_hash(place.source / 'lidarcheck', mutant)} {' '.join(names)} {tests}"
    if key not in kept.known:
        code, lines, _ = place.work("tests", mutant, [{"name": name} for name in names], TESTING_S)
        found = lines[0]["red"] if lines else f"{' '.join(names)}: {code}"
        kept.save(key, {"red": found, "mutant": str(mutant)})
    return str(kept.known[key]["red"])


def equivalents(path: Path) -> set[tuple[str, str, str]]:
    """The errors that change no result, which that file lists with the reason: file, line, and what stands there then.

    Empty instead of the last: whatever error of that line survives.
    """
    listed = tomllib.loads(path.read_text(encoding="utf-8")).get("equivalent", [])
    return {(entry["file"], entry["line"], entry.get("then", "")) for entry in listed}


def is_excused(mutant: Mutant, excused: set[tuple[str, str, str]]) -> bool:
    """Whether the error is among these, although lines move."""
    return not excused.isdisjoint({(mutant.file, mutant.line, then) for then in (mutant.then, "")})


if __name__ == "__main__":
    sys.exit(main())
