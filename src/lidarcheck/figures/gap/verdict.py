"""The verdict of the gap workflow in a sentence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lidarcheck.explain.report.explanation import Explanation, Finding
from lidarcheck.explain.report.wording import closed_words, form_words
from lidarcheck.figures.words import amount

__all__ = ["Verdict", "verdict_of"]


@dataclass(frozen=True, slots=True)
class Verdict:
    """The headline, the sentence below it, and how it looks: good, bad or plain."""

    headline: str
    sentence: str
    tone: str


def verdict_of(explanation: Explanation) -> Verdict:
    """What was found, in words."""
    gap, known = explanation.gap, [one for one in explanation.findings if one.name != "unknown"]
    frames = _frames(explanation.split.get("verify", ()))
    size = f"{amount(gap.before.value)} (90 %: {amount(gap.before.low)} to {amount(gap.before.high)})"
    floor = f"chance alone makes {amount(gap.floor.value)}"
    if explanation.verdict == "no_gap":
        sentence = f"On {frames} measured and simulated echoes are {size} apart; {floor}."
        return Verdict(f"No gap: nothing is missing {explanation.nothing_more or 'in the model'}", sentence, "good")
    closed = f"On {frames}, which no fit has seen, {_share(gap.closed)} of the gap closes"
    sentence = f"{closed}: from {size} to {amount(gap.after.value)}, where {floor}."
    missing = f"{_list([_named(one) for one in known])} {'is' if len(known) == 1 else 'are'} missing in the model"
    if explanation.verdict == "explained":
        differs = form_words([one.name for one in known], gap.classifier)
        return Verdict(missing if known else "The gap is explained", f"{sentence} {differs}".rstrip(), "good")
    if known and len(known) == len(explanation.findings):
        found = (
            f"{_list([_named(one) for one in known])} {'was' if len(known) == 1 else 'were'} found, but most is unknown"
        )
        both = closed_words(explanation.closed_seen, gap)
        return Verdict(found[0].upper() + found[1:], f"Less than half of the gap closes: {both}. {sentence}", "plain")
    besides = f"{missing}, and something that no catalogue has" if known else ""
    sentence += " What describes the unknown part is empirical: it repeats the data and names no cause."
    return Verdict(besides or "Something is missing that no catalogue has", sentence, "plain")


def _named(one: Finding) -> str:
    return f"{one.name} (or {' or '.join(one.equivalent_to)})" if one.equivalent_to else one.name


def _list(names: Sequence[str]) -> str:
    """a, b and c."""
    return " and ".join([", ".join(names[:-1]), *names[-1:]] if len(names) > 1 else names)


def _share(part: float) -> str:
    return f"{amount(100.0 * part)} %"


def _frames(numbers: Sequence[int]) -> str:
    if not numbers:
        return "no frame"
    return f"frame{'' if len(numbers) == 1 else 's'} {_list([str(n) for n in numbers])}"
