"""How ci/freeze judges two results: the same, near, or different, and where."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

CLOSE = 0.1
"""Of a number's interval: what a number may move and still say the same."""
ROUNDING = 1e-9
"""Of a number without an interval: what another order of the same sums may do to a fit."""
SOURCE = "frames.json/source"
"""A hash of lidarcheck's own source, which is another after every change."""
CANDIDATES = 4


@dataclass(frozen=True)
class Difference:
    """A place that differs; `near` where the number stays within its tolerance."""

    path: str
    words: str
    near: bool = False

    def __str__(self) -> str:
        return f"{self.path}: {self.words}"


def judge(item: str, old: Mapping[str, Any], new: Mapping[str, Any]) -> tuple[str, list[str]]:
    """The level and what there is to say. Only the fits may be near: their numbers have intervals."""
    every = [one for one in differences(old, new) if not one.path.endswith(SOURCE)]
    if not every:
        return "same", []
    heart = {"explain": _answer, "calibrate": _fitted, "bloom": _fitted, "ghosts": _fitted}.get(item)
    if heart is None or old["codes"] != new["codes"]:
        return "different", [str(one) for one in every]
    core = list(differences(heart(old), heart(new)))
    if not core:  # the same numbers, so there is no reason for anything else to differ by more than rounding
        return "near" if all(one.near for one in every) else "different", [str(one) for one in every]
    level = "near" if all(one.near for one in core) else "different"
    lines = [str(one) for one in core]
    if item == "explain" and level == "different":
        lines += [*_alternatives("then", old), *_alternatives("now", new)]
    said = {one.words for one in core}
    return level, [*lines, *(f"with it, {one}" for one in every if one.words not in said)]


def differences(old: Any, new: Any, path: str = "") -> Iterator[Difference]:
    """All places where two JSON values differ."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        yield from _of_tables(old, new, path)
    elif isinstance(old, list) and isinstance(new, list):
        if len(old) != len(new):
            yield Difference(path, f"{len(old)} entries, now {len(new)}")
        for k, (one, other) in enumerate(zip(old, new, strict=False)):
            yield from differences(one, other, f"{path}/{k}")
    elif _number(old) and _number(new):
        if not (old == new or (math.isnan(old) and math.isnan(new))):
            near = abs(new - old) <= ROUNDING * max(abs(old), abs(new))
            yield Difference(path, f"{old!r}, now {new!r}{_relative(old, new)}", near)
    elif type(old) is not type(new) or old != new:
        yield Difference(path, f"{_short(old)}, now {_short(new)}")


def _of_tables(old: Mapping[str, Any], new: Mapping[str, Any], path: str) -> Iterator[Difference]:
    values = _with_interval(old, new)
    for key in [*old, *(key for key in new if key not in old)]:
        place = f"{path}/{key}".lstrip("/")
        if key not in old or key not in new:
            yield Difference(place, "is new" if key in new else "is gone")
        elif key in values and old[key] != new[key]:
            width = old["high"] - old["low"]
            moved = abs(new[key] - old[key]) / width if width > 0 else math.inf
            words = f"{old[key]!r}, now {new[key]!r}{_relative(old[key], new[key])}, {moved:.3g} of its interval"
            yield Difference(place, words, near=moved <= CLOSE)
        else:
            yield from differences(old[key], new[key], place)


def _with_interval(old: Mapping[str, Any], new: Mapping[str, Any]) -> tuple[str, ...]:
    """The keys of a number and its interval, where a table is that."""
    for value in ("value", "y"):
        keys = (value, "low", "high")
        if all(_number(one.get(key)) and math.isfinite(one[key]) for one in (old, new) for key in keys):
            return keys
    return ()


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _relative(old: float, new: float) -> str:
    size = max(abs(old), abs(new))
    return f" (relative {abs(new - old) / size:.2g})" if math.isfinite(old) and math.isfinite(new) and size else ""


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 100 else f"{text[:97]}..."


def _fitted(result: Mapping[str, Any]) -> dict[str, Any]:
    """The fitted numbers with their intervals where a command fits, else all that it says for programs."""
    report = {key: value.get("result", value) for key, value in result["json"].items()}
    return {key: {part: value[part] for part in ("parameters", "rows") if part in value} or value
            for key, value in report.items()}  # fmt: skip


def _answer(result: Mapping[str, Any]) -> dict[str, Any]:
    """What explain has answered: verdict, names, parameters and the gap, each with its interval."""
    report = result["json"].get("out/report.json")
    if report is None:
        return {"codes": result["codes"]}
    gap = report["gap"]
    around = {
        key: {"value": gap[key], "low": low, "high": high} for key, (low, high) in gap.get("intervals", {}).items()
    }
    return {
        "verdict": report["verdict"],
        "names": [effect["name"] for effect in report["effects"]],
        "parameters": {effect["name"]: effect["parameters"] for effect in report["effects"]},
        "gap": around,
    }


def _alternatives(when: str, result: Mapping[str, Any]) -> Iterator[str]:
    """What explain had to choose from: another of two that tie is no fault."""
    report = result["json"].get("out/report.json", {"effects": [], "candidates": []})
    for effect in report["effects"]:
        others = ", ".join(map(str, effect["equivalent_to"])) or "none"
        yield f"{when}: {effect['name']}, confidence {effect['confidence']:.2f}, equivalents: {others}"
    best = sorted(report["candidates"], key=lambda one: -one["gain"])[:CANDIDATES]
    if best:
        yield f"{when}, candidates: " + "; ".join(f"{c['name']} gain {c['gain']:.4g} {c['verdict']}" for c in best)
