"""An explanation as text, for any terminal from 60 columns up: the verdict first, then what it rests on."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence

from lidarcheck.explain.report.explanation import Alternative, Calibrated, Candidate, Explanation, Finding
from lidarcheck.explain.report.wording import classifier_words, closed_words, form_words
from lidarcheck.inference.intervals import Gap, Interval

__all__ = ["gap_bar", "report_sections", "report_text", "verdict_sentence"]

NARROWEST, WIDEST = 60, 100
SHOWN_CANDIDATES = 12
SHOWN_PLACES = 10
_WORTH_A_WORD = 0.005
"""A share of the gap that is less is nothing in whole percent."""


def report_text(explanation: Explanation, *, width: int = 80, diff: Sequence[str] = ()) -> str:
    """The whole report, no line longer than `width` (60 at least) but those of `diff`, the model's change, as given."""
    (_, verdict), *rest = report_sections(explanation, width=width, diff=diff).items()
    sections = ["\n".join(verdict), *("\n".join([title, "-" * len(title), *lines]) for title, lines in rest)]
    return "\n\n".join(sections) + "\n"


def report_sections(explanation: Explanation, *, width: int = 80, diff: Sequence[str] = ()) -> dict[str, list[str]]:
    """The lines of the report's sections by their titles, the verdict first; what has no line is left out."""
    width = min(max(width, NARROWEST), WIDEST)
    findings = enumerate(explanation.findings, 1)
    sections = {
        "Verdict": _paragraph(verdict_sentence(explanation), width, "").split("\n"),
        "What is missing": [line for i, finding in findings for line in _finding(i, finding, width)],
        "Calibrated besides": _calibrated(explanation.calibrated, width),
        "Gap on frames that no fit has seen": _gap(explanation.gap, width),
        "Where model and measurement disagree": _places(explanation, width),
        "Other explanations": _rivals(explanation.rivals, width),
        "Candidates": _candidates(explanation.candidates, width),
        "Not testable on these scenes": _named(explanation.not_testable.items(), width),
        "Left out": _named(explanation.left_out.items(), width),
        "Geometry": _paragraph(explanation.geometry, width, "").split("\n") if explanation.geometry else [],
        "What changes in the model": list(diff),
        "Steps": _named(((step.name, step.words) for step in explanation.steps), width),
        "To repeat it": _repeat(explanation, width),
    }
    return {title: lines for title, lines in sections.items() if lines}


def verdict_sentence(explanation: Explanation) -> str:
    """The verdict in words, with the share of the gap that is closed."""
    closed = f"{_percent(explanation.gap.closed)} of the gap on frames that no fit has seen"
    names = [finding.name for finding in explanation.findings if finding.name != "unknown"]
    if explanation.verdict == "no_gap":
        return (
            "NO GAP: model and measurement agree within what chance and small errors of gain, reflectances and pose "
            f"explain. Nothing is missing {explanation.nothing_more or 'that these scenes can show'}."
        )
    if explanation.verdict == "explained":
        what, them = ("one effect is", "it") if len(names) == 1 else (f"{len(names)} effects are", "them")
        calibrated = [one.gap_share for one in explanation.calibrated if math.isfinite(one.gap_share)]
        told = sum(calibrated) >= _WORTH_A_WORD
        of_it = f", {_percent(sum(calibrated))} of it by what is calibrated besides" if told else ""
        said = f"EXPLAINED: {what} missing from the model: {_and(names)}. The model with {them} closes {closed}{of_it}."
        return f"{said} {form_words(names, explanation.gap.classifier)}".rstrip()
    if names and len(names) == len(explanation.findings):
        found = f"{_and(names)} {'was' if len(names) == 1 else 'were'} found"
        both = closed_words(explanation.closed_seen, explanation.gap)
        return f"UNKNOWN: {found}, but less than half of the gap closes: {both}. The rest is something else."
    beside = f" Beside it: {_and(names)}." if names else ""
    return (
        "UNKNOWN: something is missing that no effect of the catalogue makes. The model that is written carries an "
        f"empirical term, which describes it and does not explain it.{beside} It closes {closed}."
    )


def _finding(number: int, finding: Finding, width: int) -> list[str]:
    lines = [f"{number}. {finding.name}: confidence {_percent(finding.confidence)}"]
    names = max((len(name) for name in finding.parameters), default=0)
    values = max((len(_number(one.value)) for one in finding.parameters.values()), default=0)
    for name, one in finding.parameters.items():
        text = f"   {name.ljust(names)}  {_number(one.value).rjust(values)}  {_span(one)}  {one.unit}".rstrip()
        lines += [text] if len(text) <= width else textwrap.wrap(text, width, subsequent_indent="      ")
    lines += _labelled("where", finding.where, width)
    if finding.equivalent_to:
        lines += _labelled("cannot be told apart from", ", ".join(finding.equivalent_to), width)
    lines += _labelled("what would separate them", finding.separated_by, width)
    if finding.effects:
        lines += _labelled("in the model as", ", ".join(effect.name for effect in finding.effects), width)
    return lines


def _labelled(label: str, words: str, width: int) -> list[str]:
    return _paragraph(f"{label}: {words}", width, "   ", "     ").split("\n") if words else []


def _calibrated(numbers: Sequence[Calibrated], width: int) -> list[str]:
    """What was fitted besides the names, and the share of the gap that each closes."""
    if not numbers:
        return []
    names = max(len(one.name) for one in numbers)
    lines = ["Within usual errors, and no finding; --no-nuisances leaves these as they were."]
    for one in numbers:
        share = f"  {100.0 * one.gap_share:z.1f} % of the gap" if math.isfinite(one.gap_share) else ""
        span = f"({_number(one.low)} ... {_number(one.high)})"
        lines.append(f"{one.name.ljust(names)}  {_number(one.was)} -> {_number(one.value)}  {span}{share}")
    return [part for line in lines for part in textwrap.wrap(line, width, subsequent_indent="    ")]


def _rivals(rivals: Sequence[Alternative], width: int) -> list[str]:
    """Other names that were tried in the place of those given: how they score against these, and why not them."""
    lines = []
    for one in rivals:
        left = f", leaves {_number(one.gap)} of the gap on the frames seen" if math.isfinite(one.gap) else ""
        lines.append(f"- {_and(one.names)}: score {one.score:+.0f}{left}; {one.why_not}")
    return [part for line in lines for part in textwrap.wrap(line, width, subsequent_indent="  ")]


def _gap(gap: Gap, width: int) -> list[str]:
    """The gap after each effect as bars from 0, the floor's place marked in each."""
    rows = [("before", gap.before), *((f"+ {name}", one) for name, one in gap.waterfall)]
    rows += [("after", gap.after), ("floor", gap.floor)]
    most = max((one.value for _, one in rows if math.isfinite(one.value)), default=0.0)
    label = min(max(len(name) for name, _ in rows), 24)
    number = max(len(_number(one.value)) for _, one in rows)
    span = max(len(_span(one)) for _, one in rows)
    room = width - label - number - span - 7
    lines = [
        f"{name[:label].ljust(label)}  {_number(one.value).rjust(number)}  {_span(one).ljust(span)} "
        f"{gap_bar(one.value, gap.floor.value, most, room)}".rstrip()
        for name, one in rows
    ]
    lines.append(
        f"closed: {_percent(gap.closed)} of what stands above the floor (marked |); 90 % intervals in brackets"
    )
    lines.append(f"classifier (2 AUC - 1): {classifier_words(gap.classifier)}")
    if gap.by_feature:
        lines += ["", *_features(gap)]
    return [part for line in lines for part in (textwrap.wrap(line, width) if len(line) > width else [line])]


def gap_bar(value: float, floor: float, most: float, room: int) -> str:
    """A bar from 0 to `most` over `room` places, the floor's place marked; empty where there is no room for one."""
    if room < 8 or most <= 0.0 or not math.isfinite(value):
        return ""
    cells = ["#"] * round(max(value, 0.0) / most * room)
    mark = min(round(max(floor, 0.0) / most * room), room - 1)
    cells += [" "] * (mark + 1 - len(cells))
    cells[mark] = "|"
    return "".join(cells)


def _features(gap: Gap) -> list[str]:
    kinds = {n: [math.nan if v is None else v for v in v3] for n, v3 in gap.by_kind.items()}
    by_name: dict[str, Sequence[float]] = {**gap.by_feature, **kinds}
    names = max(len(name) for name in (*by_name, "by feature"))
    head = f"{'by feature'.ljust(names)}  {'before':>10} {'after':>10} {'floor':>10}"
    rows = (f"{name.ljust(names)}  " + " ".join(f"{_number(v):>10}" for v in v3) for name, v3 in by_name.items())
    return [head, *rows]


def _places(explanation: Explanation, width: int) -> list[str]:
    shown = explanation.where[:SHOWN_PLACES]
    lines = [part for w in shown for part in _paragraph(f"- {w.words}", width, "", "  ").split("\n")]
    more = len(explanation.where) - len(shown)
    return [*lines, f"and {more} more in report.json"] if more > 0 else lines


def _candidates(candidates: Sequence[Candidate], width: int) -> list[str]:
    if not candidates:
        return []
    shown = sorted(candidates, key=lambda c: (c.round, -_finite(c.gain)))[:SHOWN_CANDIDATES]
    names = max(len("effect"), *(len(c.name) for c in shown))
    head = f"{'round':5} {'effect'.ljust(names)} {'gain':>8} {'needed':>8} {'pull':>6} {'closed':>6}"
    lines = [f"{head}  verdict"] if len(head) + len("  verdict") <= width else [head, "        verdict"]
    for c in shown:
        head = f"{c.round:5d} {c.name.ljust(names)} {_short(c.gain):>8} {_short(c.needed):>8} {_short(c.pull):>6} "
        head += f"{_percent(c.closed) if math.isfinite(c.closed) else '-':>6}  "
        fate = c.verdict + (f", as {c.start}" if c.start else "")
        fate += f" (like {', '.join(c.equivalent_to)})" if c.equivalent_to else ""
        room = max(width - len(head), 12)
        words = textwrap.wrap(fate, room) or [""]
        if len(head) + max(map(len, words)) > width:
            words, head = ["", *textwrap.wrap(fate, width - 8)], head.rstrip()
            lines += [head, *(f"        {word}" for word in words[1:])]
            continue
        lines += [(head + words[0]).rstrip(), *(" " * len(head) + word for word in words[1:])]
    more = len(candidates) - len(shown)
    return [*lines, f"and {more} more in report.json"] if more > 0 else lines


def _repeat(explanation: Explanation, width: int) -> list[str]:
    split = "; ".join(f"{name}: {', '.join(map(str, frames))}" for name, frames in explanation.split.items())
    seeds = ", ".join(f"{name} {seed}" for name, seed in explanation.seeds.items())
    lines = [f"frames of {split}"] if split else []
    lines += [f"seeds: {seeds}"] if seeds else []
    lines += [f"SHA-256 of {len(explanation.hashes)} files in report.json"] if explanation.hashes else []
    return [part for line in lines for part in textwrap.wrap(line, width, subsequent_indent="  ")]


def _named(items: Iterable[tuple[str, str]], width: int) -> list[str]:
    return [part for name, why in items for part in _paragraph(f"{name}: {why}", width, "", "  ").split("\n")]


def _paragraph(text: str, width: int, first: str, later: str | None = None) -> str:
    return textwrap.fill(text, width, initial_indent=first, subsequent_indent=first if later is None else later)


def _span(one: Interval) -> str:
    return f"({_number(one.low)} ... {_number(one.high)})"


def _number(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else "-"


def _short(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "-"


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %" if math.isfinite(share) else "-"


def _finite(value: float) -> float:
    return value if math.isfinite(value) else -math.inf


def _and(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else list(names))
