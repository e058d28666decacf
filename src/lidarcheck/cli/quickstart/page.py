"""The page of a quick start: that of `explain`, or the laws alone, what the data can show first."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

__all__ = ["write_laws", "write_verdict"]


def write_verdict(case: Path, found: Path, page: Path, first: Sequence[str]) -> list[str]:
    """Write the page of what `explain` has found, those lines above all else; the verdict in words."""
    from lidarcheck.cases.case import load_case
    from lidarcheck.explain.files import MODEL, REPORT
    from lidarcheck.explain.report.load import load_explanation
    from lidarcheck.explain.report.text import verdict_sentence
    from lidarcheck.figures.html.explanation import write_html

    loaded = load_case(case)
    explanation = load_explanation(found / REPORT, found / MODEL, loaded.model)
    write_html(explanation, loaded, page, first=first)
    names = [f"{one.name}: {one.where}" for one in explanation.findings]
    return [verdict_sentence(explanation), *names]


def write_laws(facts: dict[str, Any], page: Path, first: Sequence[str]) -> list[str]:
    """Write a page of the laws that repeats gave; the same in words."""
    import numpy as np

    from lidarcheck.figures.data import Course, Curve, Page, Section, Table
    from lidarcheck.figures.html.page import page_html
    from lidarcheck.formats.atomic import write_text

    laws = facts["laws"]
    rows = tuple(
        (name, *(f"{one[key]:.4g}" for key in ("value", "low", "high"))) for name, one in laws["fitted"].items()
    )
    header = ("number", "value", "low", "high")
    table = Table("Fitted numbers of the sensor, with 90 % intervals", header, rows, header[1:])
    bins = laws["bins"]
    amplitude = np.array([one["amplitude"] for one in bins], dtype=np.float64)
    curves = tuple(
        Curve(name, amplitude, 1000.0 * np.array([one[key] for one in bins], dtype=np.float64), dots=dots)
        for name, key, dots in (("measured", "range_sd_m", True), ("law", "law_range_sd_m", False))
    )
    figures = (Course("Scatter of the range over the amplitude", "amplitude", "range scatter [mm]", curves),)
    section = Section("The laws of range, noise and loss", tuple(laws["notes"]), (table,), figures if len(bins) else ())
    summary = Section("What these data can show", tuple(first))
    write_text(page, page_html(Page("lidarcheck quickstart", first[0], (summary, section))))
    return [f"{name} = {value} ({low} to {high})" for name, value, low, high in rows]
