"""How well `explain` names what is hidden in data of other sensors and detectors. Run by ci/foreign_sensors."""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from lidarcheck.explain.benchmark.run import run_benchmark
from lidarcheck.explain.benchmark.score import NULLS, OUTSIDE, Answer

ROOT = Path(__file__).resolve().parents[1]
CASES, SEED = 60, 7
SAID = ("right", "right and more", "equivalent", "not testable", "unknown", "no gap", "wrong", "error")
"""What an answer to one hidden effect may be, in the order of the columns."""


def said(answer: Answer) -> str:
    """What an answer is worth: one of `SAID`; of nulls and of what is in no catalogue `right` is what is wanted."""
    if answer.error:
        return "error"
    if answer.kind in NULLS:
        return "right" if answer.verdict == "no_gap" else "wrong"
    if answer.kind in OUTSIDE or answer.verdict == "no_gap":
        if answer.verdict == "no_gap":
            return "not testable" if set(answer.effects) & set(answer.not_testable) else "no gap"
        return "right" if answer.right else "wrong"
    if answer.verdict == "unknown":
        return "unknown"
    if set(answer.effects) <= set(answer.names):
        return "right" if answer.right else "right and more"
    alike = {other for one in answer.found for other in one["equivalent_to"]}
    return "equivalent" if set(answer.effects) <= alike else "wrong"


def tables(answers: Sequence[Answer]) -> str:
    """Markdown: answers by sensor, and every case."""
    singles = [one for one in answers if one.kind == "single"]
    head = ("sensor", "hidden", *SAID, "closed, median", "nulls: alarms", "aliens: unknown")
    lines = [_row(head), _row(["---"] * len(head))]
    sensors = list(dict.fromkeys(one.variant for one in answers))
    for sensor in (*sensors, "all"):
        mine = [one for one in answers if sensor in ("all", one.variant)]
        count = Counter(said(one) for one in singles if one in mine)
        nulls, aliens = ([one for one in mine if one.kind in kinds] for kinds in (NULLS, OUTSIDE))
        alarms = sum(said(one) == "wrong" for one in nulls)
        known = sum(said(one) == "right" for one in aliens)
        closed = _median(one.closed for one in mine if one.kind == "single" and one.verdict == "explained")
        cells = [str(count[word] or "-") for word in SAID]
        hidden = sum(count.values())
        lines.append(_row((sensor, hidden, *cells, closed, f"{alarms} of {len(nulls)}", f"{known} of {len(aliens)}")))
    head = ("case", "sensor", "hidden", "z", "answer", "names", "closed", "seconds")
    lines += ["", _row(head), _row(["---"] * len(head))]
    lines += [_row(_case(one)) for one in answers]
    lines += ["", "Not testable, by sensor:", ""]
    for sensor in sensors:
        why: dict[str, list[str]] = {}
        for one in answers:
            if one.variant == sensor:
                for name, reason in one.not_testable.items():
                    if name not in why.setdefault(reason, []):
                        why[reason].append(name)
        parts = [f"{', '.join(sorted(names))} ({reason})" for reason, names in why.items()]
        lines.append(f"- **{sensor}**: {'; '.join(parts) or 'none'}.")
    return "\n".join(lines) + "\n"


def _case(one: Answer) -> tuple[object, ...]:
    hidden = ", ".join(one.effects) or one.kind
    z = ", ".join(f"{value:.0f}" for value in one.z.values()) or "-"
    names = "; ".join(" or ".join((f["name"], *f["equivalent_to"])) for f in one.found) or "-"
    closed = "-" if math.isnan(one.closed) or not one.found else f"{one.closed:.2f}"
    return one.number, one.variant, hidden, z, said(one), one.error or names, closed, f"{one.seconds:.0f}"


def _median(values: Iterable[float]) -> str:
    known = sorted(value for value in values if not math.isnan(value))
    return f"{known[len(known) // 2]:.2f}" if known else "-"


def _row(cells: Iterable[object]) -> str:
    return f"| {' | '.join(str(cell) for cell in cells)} |"


def run(place: Path, cases: int, seed: int, words: str, arguments: Sequence[str] | None) -> int:
    """What a command does whose generator of cases is `place`; `cases` and `seed` unless others are given."""
    parser = argparse.ArgumentParser(description=words)
    parser.add_argument("--cases", type=int, default=cases)
    parser.add_argument("--seed", type=int, default=seed)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, help="keeps each answer as soon as it is there")
    chosen = parser.parse_args(arguments)

    def on_progress(done: int, of: int, words: str) -> None:
        print(f"{done} of {of}: {words}", file=sys.stderr, flush=True)

    found = run_benchmark(
        chosen.cases, seed=chosen.seed, jobs=chosen.jobs, generator=place, out=chosen.out, on_progress=on_progress
    )
    sys.stdout.write(tables(found.answers))
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    return run(ROOT / "tests/hidden/foreign", CASES, SEED, __doc__ or "", arguments)


if __name__ == "__main__":
    raise SystemExit(main())
