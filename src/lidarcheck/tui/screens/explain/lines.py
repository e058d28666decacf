"""What Explain shows as lines: how far a run is, what it has found so far, and the answer part by part."""

from __future__ import annotations

from lidarcheck.explain.report.text import gap_bar, report_sections
from lidarcheck.formats.table import clock_text
from lidarcheck.inference.intervals import Gap
from lidarcheck.tui.context import value_text
from lidarcheck.tui.jobs.explain_cases import CaseState
from lidarcheck.tui.jobs.explain_process import ExplainProgress
from lidarcheck.tui.widgets.lines import Line, line
from lidarcheck.tui.widgets.themes import Role

__all__ = ["answer_parts", "far_in_words", "found_lines", "gap_words", "step_lines"]

_BAR = 20


def far_in_words(progress: ExplainProgress) -> str:
    """How far the whole is: 42 %, the time so far and the time left."""
    left = "" if progress.left_s is None else f", about {clock_text(progress.left_s)} left"
    return f"{100.0 * progress.part:.0f} %, {clock_text(progress.elapsed_s)} so far{left}"


def step_lines(progress: ExplainProgress) -> list[Line]:
    """A line for each step: done, how far, or still to come."""
    lines: list[Line] = []
    names = list(progress.steps)
    past = names.index(progress.now) if progress.now in names else 0
    done, of = progress.steps.get(progress.now, (0, 0))
    past += bool(of and done >= of)
    for number, (name, (done, of)) in enumerate(progress.steps.items()):
        if number < past:
            lines.append(line(f"  done   {name}", "good"))
        elif number == past:
            share = done / of if of else 0.0
            bar = "#" * round(share * _BAR)
            lines.append(line(f"> {100.0 * share:3.0f} %  {name:30} [{bar:{_BAR}}]", "edited"))
        else:
            lines.append(line(f"         {name}", "dim"))
    return lines or [line("  starting ...", "dim")]


def found_lines(progress: ExplainProgress, width: int) -> list[Line]:
    """What was found so far, the gap after each effect as a bar, the newest last."""
    lines: list[Line] = []
    first = 0.0
    roles: dict[str, Role] = {"found": "edited", "stands out": "text"}
    for name, words in progress.found:
        bar = ""
        if name == "gap":
            value = _number(words)
            first = first or value
            room = max(width - 56, 10)
            bar = "#" * round(min(value / first, 1.0) * room) if first > 0.0 else ""
        lines.append(line(f" {name:13} {words:40} {bar}".rstrip(), roles.get(name, "dim" if not bar else "text")))
    return lines


def _number(words: str) -> float:
    try:
        return max(float(words.split()[0]), 0.0)
    except (ValueError, IndexError):
        return 0.0


def answer_parts(state: CaseState, width: int, page: str = "") -> dict[str, list[Line]]:
    """The answer's parts by their titles; the first has all of them, and says where the page with pictures is."""
    assert state.found is not None
    sections = report_sections(state.found, width=width - 1, diff=state.diff)
    verdict = [line(f" {text}", "title") for text in sections.pop("Verdict")]
    if state.changed:
        names = ", ".join(state.changed[:3]) + (f" and {len(state.changed) - 3} more" if len(state.changed) > 3 else "")
        verdict.append(line(f" {names} changed since: the answer is of what was there before", "bad"))
    parts = {title: [_shown(text) for text in lines] for title, lines in sections.items()}
    for title in parts:
        if title.startswith("Gap"):
            parts[title] += _feature_bars(state.found.gap, width)
    whole = [*verdict]
    for title, lines in parts.items():
        whole += [line(""), line(f" {title}", "title"), *lines]
    if page:
        whole += [line(""), line(f" with pictures: {page}", "dim")]
    return {"all of it": whole, **parts}


def _feature_bars(gap: Gap, width: int) -> list[Line]:
    """The gap of each feature before and after, as bars of one scale each with the floor's place marked."""
    lines: list[Line] = []
    for name, (before, after, floor) in gap.by_feature.items():
        for label, when, value in ((name, "before", before), ("", "after", after)):
            bar = gap_bar(value, floor, max(before, after, floor), min(width, 100) - 24)
            lines.append(line(f" {label:13} {when:6}  {bar}"))
    return [line(""), *lines] if lines else []


def _shown(text: str) -> Line:
    return line(f" {text}", "good" if text.startswith("+ ") else "bad" if text.startswith("- ") else "text")


def gap_words(gap: Gap) -> str:
    """Before and after, what no model goes below, and what share of the gap is closed."""
    values = f"gap {value_text(gap.before.value)} -> {value_text(gap.after.value)} sd"
    return f"{values}  floor {value_text(gap.floor.value)}  closed {100 * gap.closed:.0f} %"
