"""What an earlier run of the gap workflow has left: the explanation again, from its report and its model."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lidarcheck.effects.finding import find
from lidarcheck.errors import InputError, UsageError
from lidarcheck.explain.report.explanation import (
    Alternative,
    Calibrated,
    Candidate,
    Explanation,
    Finding,
    SearchStep,
    Standout,
)
from lidarcheck.formats.limits import RESULT_BYTES, check_bytes
from lidarcheck.inference.intervals import ClassifierGap, Gap, Interval
from lidarcheck.model.files.model_file import load_model
from lidarcheck.model.spec import Model

__all__ = ["changed_since", "load_explanation"]


def load_explanation(report: Path, model: Path, before: Model) -> Explanation:
    """The explanation of a report.json, the model that it wrote, and the case's model at that time.

    `InputError` where the report cannot be read or is none; as `load_model` for the model.
    """
    try:
        check_bytes(report.stat().st_size, report, RESULT_BYTES)
        document = json.loads(report.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot read: {error.strerror}", file=report, fix="explain the case again") from error
    except ValueError as error:
        raise InputError("this is not JSON", file=report, fix="explain the case again") from error
    after = load_model(model)
    try:
        return _explanation(document, before, after)
    except (KeyError, TypeError, ValueError, AttributeError, UsageError) as error:
        raise InputError("this is no report of `explain`", file=report, fix="explain the case again") from error


def changed_since(directory: Path, hashes: Mapping[str, str]) -> list[str]:
    """Which files of a case are not what they were, or are gone, by their names in its directory."""
    changed = []
    for name, digest in hashes.items():
        try:
            with (directory / name).open("rb") as stream:
                same = hashlib.file_digest(stream, "sha256").hexdigest() == digest
        except OSError:
            same = False
        if not same:
            changed.append(name)
    return changed


def _explanation(document: Mapping[str, Any], before: Model, after: Model) -> Explanation:
    return Explanation(
        verdict=str(document["verdict"]),
        findings=tuple(_finding(one, before, after) for one in document["effects"]),
        not_testable=dict(document["why_not_testable"]),
        gap=_gap(document["gap"]),
        model=after,
        steps=tuple(SearchStep(one["step"], one["found"]) for one in document["steps"]),
        where=tuple(Standout(**one) for one in document["where"]),
        candidates=tuple(_candidate(one) for one in document["candidates"]),
        split={name: tuple(frames) for name, frames in document["split"].items()},
        seeds=dict(document["seeds"]),
        hashes=dict(document["hashes"]),
        left_out=dict(document["left_out"]),
        geometry=str(document.get("geometry", "")),
        ideals_from=str(document.get("ideals_from", "")),
        # Reports of earlier versions lack what follows.
        closed_seen=document["gap"].get("closed_seen"),
        calibrated=tuple(
            Calibrated(**{**one, "gap_share": _value(one["gap_share"])}) for one in document.get("calibrated", ())
        ),
        rivals=tuple(
            Alternative(tuple(one["names"]), float(one["score"]), _value(one["gap"]), str(one["why_not"]))
            for one in document.get("rivals", ())
        ),
    )


def _finding(one: Mapping[str, Any], before: Model, after: Model) -> Finding:
    """A finding with its parameters' units, and what the model got for it."""
    name = str(one["name"])
    if name == "unknown":
        units: dict[str, str] = {}
        effects = tuple(effect for effect in after.effects if effect not in before.effects)
    else:
        units = {parameter.name: parameter.unit for parameter in find(name).parameters()}
        effects = tuple(effect for effect in after.effects if effect.name == name)
    return Finding(
        name=name,
        parameters={key: Interval(**value, unit=units.get(key, "")) for key, value in one["parameters"].items()},
        confidence=float(one["confidence"]),
        equivalent_to=tuple(one["equivalent_to"]),
        where=str(one["where"]),
        separated_by=str(one["separated_by"]),
        effects=effects,
    )


def _gap(one: Mapping[str, Any]) -> Gap:
    spans = {name: [float(end) for end in one["intervals"][name]] for name in ("before", "after", "floor")}
    before, after, floor = (Interval(float(one[name]), low, high) for name, (low, high) in spans.items())
    features = {
        name: (float(v["before"]), float(v["after"]), float(v["floor"])) for name, v in one["by_feature"].items()
    }
    waterfall = tuple((str(w["effect"]), Interval(w["value"], w["low"], w["high"])) for w in one["waterfall"])
    low, high = one["intervals"].get("closed", (-1.0, 1.0))  # not in reports of earlier versions
    classifier = ClassifierGap(**one.get("classifier", {}))
    kinds = {name: (v["before"], v["after"], v["floor"]) for name, v in one.get("by_kind", {}).items()}
    return Gap(before, after, floor, features, waterfall, (float(low), float(high)), classifier, kinds)


def _candidate(one: Mapping[str, Any]) -> Candidate:
    return Candidate(**{**one, "closed": _value(one["closed"]), "equivalent_to": tuple(one["equivalent_to"])})


def _value(number: float | None) -> float:
    """NaN for what was not known."""
    return math.nan if number is None else float(number)
