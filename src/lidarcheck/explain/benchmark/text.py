"""A benchmark's score as tables: for the terminal and for the documentation."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

from lidarcheck.explain.benchmark.run import Benchmark
from lidarcheck.explain.benchmark.score import Answer, Share

__all__ = ["WANTED", "figures", "gate_counts", "table_markdown", "table_text"]

WANTED = {
    "singles named exactly": "≥ 95 %",
    "  weak": "≥ 75 %",
    "pairs complete": "≥ 80 %",
    "wrong abstentions": "≤ 5 %",
    "false alarms on nulls": "≤ 2 %",
    "unknowns recognised": "≥ 90 %",
    "90 % intervals cover the truth": "85 … 95 %",
    "median closed share of the gap": "≥ 0.95",
    "seconds a case, median": "≤ 30",
}
"""What each figure is to reach."""

_HEAD = ("figure", "where it shows", "95 % interval", "all cases", "to reach")


def figures(result: Benchmark) -> list[tuple[str, str, str, str, str]]:
    """The rows of the table, as text: figure, value where it shows, its interval, value of all cases, what to reach."""
    score = result.score
    rows = [
        (name, _counts(share), _interval(share), _counts(score.all_shares[name]), WANTED.get(name, ""))
        for name, share in score.shares.items()
    ]
    plain = {
        "median closed share of the gap": _number(score.closed, ".3f"),
        "classifier gap before, median": _number(score.told[0], ".3f"),
        "classifier gap after, median": _number(score.told[1], ".3f"),
        "unknowns: closed share, median": _number(score.described, ".3f"),
        "unknowns: classifier gap before": _number(score.described_told[0], ".3f"),
        "unknowns: classifier gap after": _number(score.described_told[1], ".3f"),
        "Brier score of the confidence": _number(score.brier, ".3f"),
        "seconds a case, median": _number(score.seconds[0], ".1f"),
        "seconds a case, 90 % are below": _number(score.seconds[1], ".1f"),
        "cases without an answer": str(len(score.errors)),
    }
    return rows + [(name, value, "", "", WANTED.get(name, "")) for name, value in plain.items()]


def table_text(result: Benchmark) -> str:
    """All of it in at most 80 columns of plain text."""
    rows = [
        (name, f"{value:>14}", f"{interval:>12}", f"{every:>14}") for name, value, interval, every, _ in _brief(result)
    ]
    label = max(len(name) for name, *_ in rows)
    lines = ["  ".join((f"{row[0]:{label}}", *row[1:])).rstrip() for row in rows]
    lines += ["", f"{'confidence':{label}}  {'mean':>14}  {'right':>12}"]
    for one in result.score.calibration:
        name = f"{100 * one.low:.0f} to {100 * one.high:.0f} %"
        lines.append(f"{name:{label}}  {_percent(one.confidence):>14}  {_counts(one.right):>12}")
    gates = gate_counts(result.answers)
    lines += ["", f"{'steps not taken in all cases':{label}}  {'taken in':>14}  {'right there':>12}"] if gates else []
    lines += [f"{name:{label}}  {taken:>14}  {right:>12}" for name, (taken, right) in gates.items()]
    lines += ["", *(part for answer in result.answers if not answer.right for part in _wrong(answer))]
    kind = f", only {result.only}" if result.only else ""
    return "\n".join([*lines, f"{result.score.cases} cases of seed {result.seed}{kind}"]) + "\n"


def gate_counts(answers: Sequence[Answer]) -> dict[str, tuple[int, int]]:
    """In how many cases each step was taken that not all of them take, such as one that withholds a name, and in how
    many of these the answer was right: a rule that acts on no case, or harms as often as it helps, is none."""
    by_case = [{str(step["step"]) for step in answer.steps} for answer in answers]
    names = sorted({name for steps in by_case for name in steps})
    taken = {name: [one.right for one, steps in zip(answers, by_case, strict=True) if name in steps] for name in names}
    return {name: (len(right), sum(right)) for name, right in taken.items() if len(right) < len(answers)}


def _wrong(answer: Answer) -> list[str]:
    """What was hidden and what was answered instead."""
    hidden = ", ".join(f"{name} (z {answer.z.get(name, math.nan):.0f})" for name in answer.effects) or "nothing"
    found = ", ".join(
        f"{one['name']}{''.join(f' or {other}' for other in one['equivalent_to'])}" for one in answer.found
    )
    said = f"no answer: {answer.error}" if answer.error else f"{answer.verdict}{': ' if found else ''}{found}"
    hides = f"{answer.strength} {hidden}" if answer.effects else hidden
    text = f"case {answer.number}, {answer.kind}, {answer.variant}, {answer.scene}: hides {hides}; {said}"
    return textwrap.wrap(text, 80, subsequent_indent="  ")


def _brief(result: Benchmark) -> list[tuple[str, str, str, str, str]]:
    return [("figure", "where it shows", "95 %", "all cases", ""), *figures(result)]


def table_markdown(result: Benchmark) -> str:
    """The tables of the documentation."""
    lines = [_row(_HEAD), _row(("---",) * len(_HEAD))]
    lines += [_row((name.replace("  ", "&emsp;"), *rest)) for name, *rest in figures(result)]
    head = ("confidence", "mean", "right", "95 % interval")
    lines += ["", _row(head), _row(("---",) * len(head))]
    lines += [
        _row(
            (
                f"{100 * one.low:.0f} … {100 * one.high:.0f} %",
                _percent(one.confidence),
                _counts(one.right),
                _interval(one.right),
            )
        )
        for one in result.score.calibration
    ]
    return "\n".join(lines) + "\n"


def _row(cells: tuple[str, ...]) -> str:
    return f"| {' | '.join(cells)} |"


def _counts(share: Share) -> str:
    return f"{_percent(share.value)} ({share.hits}/{share.of})" if share.of else "-"


def _interval(share: Share) -> str:
    low, high = share.interval
    return f"{100 * low:.0f} … {100 * high:.0f} %" if share.of else "-"


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"
