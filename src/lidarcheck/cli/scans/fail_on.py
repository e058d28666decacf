"""`--fail-on`: conditions under which a comparison fails, `any` or `KPI[:FEATURE]>NUMBER`."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from lidarcheck.config.words import nearest, shown
from lidarcheck.errors import UsageError

if TYPE_CHECKING:
    from lidarcheck.kpi.chance.verdict import Verdict

__all__ = ["Condition", "Outcome", "Value", "conditions_of", "outcomes"]

ANY = "any"
KPIS = (
    "echoes", "dvm_bias", "dvm_scatter", "wasserstein", "ks", "energy", "js", "percentile_5", "percentile_50",
    "percentile_95", "histogram_residual", "histogram_distance", "detection_probability", "false_alarms",
    "walk_offset", "direction_bias", "direction_scatter", "position_bias_x", "position_bias_y", "position_bias_z",
    "echo_number_share", "ghost", "blooming_profile", "paired_range", "overlap", "chamfer",
)  # fmt: skip
"""What a comparison's lines are called."""
_FORM = re.compile(r"(?P<kpi>\w+)\s*(?::\s*(?P<of>[^>]+?))?\s*>\s*(?P<most>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")


class Condition(NamedTuple):
    """`text` as it was given; `kpi` empty for `any`; `of` empty for each line of the KPI."""

    text: str
    kpi: str = ""
    of: str = ""
    most: float = math.nan


class Value(NamedTuple):
    """A line of a comparison: the KPI, what it is of, its value."""

    kpi: str
    of: str
    value: float


class Outcome(NamedTuple):
    """Whether a condition is met, and by what, in words."""

    condition: str
    met: bool
    by: str


def conditions_of(texts: Iterable[str]) -> list[Condition]:
    """The conditions; `UsageError` for one that cannot be read, and for a KPI that there is none of."""
    return [_condition(" ".join(text.split())) for text in texts]


def _condition(text: str) -> Condition:
    if text == ANY:
        return Condition(text)
    found = _FORM.fullmatch(text)
    if found is None:
        fix = "write any, or KPI>NUMBER, or KPI:FEATURE>NUMBER, in quotes: 'wasserstein:AREA>20'"
        raise UsageError(f"--fail-on {shown(text)} is no condition", fix=fix)
    kpi = found["kpi"]
    if kpi not in KPIS:
        near = nearest(kpi, (*KPIS, ANY))
        fix = f"did you mean {near}?" if near else f"there are {', '.join(KPIS)}"
        raise UsageError(f"--fail-on {shown(text)}: there is no KPI {kpi}", fix=fix)
    if not math.isfinite(most := float(found["most"])):
        raise UsageError(f"--fail-on {shown(text)} has no limit", fix="write a finite number")
    return Condition(text, kpi, found["of"] or "", most)


def outcomes(
    conditions: Sequence[Condition], values: Sequence[Value], verdict: Verdict, left_out: Mapping[str, str]
) -> list[Outcome]:
    """What became of each condition. A difference counts by its magnitude.

    `left_out`: what was not compared, and why. `UsageError` where a condition cannot be checked: a gate that holds
    because nothing was compared would hold for ever.
    """
    return [_of_any(verdict) if not one.kpi else _of_kpi(one, values, left_out) for one in conditions]


def _of_any(verdict: Verdict) -> Outcome:
    if not verdict.judged:
        raise UsageError("--fail-on any: no KPI could be judged", fix="compare more beams or frames, or give a limit")
    out = verdict.standing_out
    return Outcome(ANY, bool(out), f"{len(out)} of {verdict.judged} stand out")


def _of_kpi(condition: Condition, values: Sequence[Value], left_out: Mapping[str, str]) -> Outcome:
    own = [one for one in values if one.kpi == condition.kpi]
    asked = [one for one in own if not condition.of or _plain(one.of) == _plain(condition.of)]
    if not asked:
        raise _absent(condition, own, left_out)
    known = [one for one in asked if math.isfinite(one.value)]
    if not known:
        raise UsageError(f"--fail-on {shown(condition.text)}: it is not defined here", fix="leave the condition out")
    worst = max(known, key=lambda one: abs(one.value))
    return Outcome(condition.text, abs(worst.value) > condition.most, f"{_named(worst)} is {worst.value:.4g}")


def _absent(condition: Condition, own: Sequence[Value], left_out: Mapping[str, str]) -> UsageError:
    what = f"--fail-on {shown(condition.text)}"
    for name, why in left_out.items():
        if {condition.of, condition.kpi} & {*name.split(", ")}:
            asked = condition.of if condition.of in name.split(", ") else condition.kpi
            return UsageError(f"{what}: {asked} was not compared: {why}", fix="give that, or leave it out")
    if not own:
        return UsageError(f"{what}: {condition.kpi} was not compared", fix="give --ideal, which it needs")
    near = nearest(condition.of, [one.of for one in own])
    fix = f"did you mean {near}?" if near else f"there are {', '.join(one.of for one in own)}"
    return UsageError(f"{what}: {condition.kpi} has no {shown(condition.of)}", fix=fix)


def _plain(of: str) -> str:
    """Typed on a keyboard: a hyphen for the dash of a span, any case, blanks anywhere."""
    return of.replace("–", "-").replace(" ", "").lower()


def _named(one: Value) -> str:
    return f"{one.kpi} {one.of}".strip()
