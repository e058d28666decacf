"""What sensors that are no SPAD arrays show beside a bright target, as people read it and as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.blooming.beside import BesideTarget
from lidarcheck.figures.data import Course, Page, Section, Table
from lidarcheck.figures.pages.blooming_courses import beside_course, beside_curve
from lidarcheck.figures.words import number

__all__ = ["beside_document", "beside_page"]

_OFFSET = {"vertical": "offset_layers", "horizontal": "offset_points"}
_MOST_ROWS = 48


def beside_page(
    real: Sequence[BesideTarget], made: Sequence[BesideTarget | None], provenance: Mapping[str, str]
) -> Page:
    """The page of measured profiles and, where there is one, what is simulated."""
    sections = []
    for one, other in zip(real, made, strict=True):
        name = f"{one.distance_m:.1f} m"
        words = f"{one.name}: offsets are counted in beams from the target's nearest one, which is 0."
        figures = tuple(_course(name, one, other, feature) for feature in one.features)
        sections.append(Section(f"Profile at {name}", (words,), (_table(one, other),), figures))
    beside = sum(int(one.echoes[one.offset != 0.0].sum()) for one in real)
    at = ", ".join(f"{one.distance_m:.1f}" for one in real)
    summary = f"The target at {at} m has {beside} echoes beside it at its range."
    return Page(f"Beside the target, {real[0].axis}", summary, tuple(sections), provenance)


def beside_document(real: Sequence[BesideTarget], made: Sequence[BesideTarget | None]) -> dict[str, Any]:
    """The numbers for JSON."""
    profiles = [
        {"measured": _numbers(one), "simulated": None if other is None else _numbers(other)}
        for one, other in zip(real, made, strict=True)
    ]
    return {"axis": real[0].axis, "profiles": profiles}


def _numbers(one: BesideTarget) -> dict[str, Any]:
    columns = {_OFFSET[one.axis]: one.offset, "echoes": one.echoes, "range_m": one.range_m, **one.features}
    return {"name": one.name, "distance_m": one.distance_m, **columns}


def _table(one: BesideTarget, other: BesideTarget | None) -> Table:
    """A row an offset, those nearest to the target where there are many."""
    rows = np.sort(np.argsort(np.abs(one.offset), kind="stable")[:_MOST_ROWS])
    sides = [one] if other is None else [one, other]
    both = [f"{name} {side}" for name in one.features for side in ("real", "simulated")]
    names = both if other is not None else list(one.features)
    header = (_OFFSET[one.axis], "echoes", "range [m]", *names)
    values = [_at(side, one.offset, name) for name in one.features for side in sides]
    cells = tuple(
        (
            *(f"{one.offset[i]:g}", str(int(one.echoes[i])), number(one.range_m[i], ".2f")),
            *(number(column[i], ".4g") for column in values),
        )
        for i in rows
    )
    return Table("", header, cells, header)


def _at(side: BesideTarget, offset: FloatArray, feature: str) -> FloatArray:
    """A side's feature at those offsets, NaN where it has none."""
    found = dict(zip(side.offset.tolist(), side.features.get(feature, np.full(len(side.offset), np.nan)), strict=True))
    return np.array([found.get(one, np.nan) for one in offset.tolist()])


def _course(name: str, one: BesideTarget, other: BesideTarget | None, feature: str) -> Course:
    sides = {"real": one} if other is None else {"real": one, "simulated": other}
    curves = tuple(
        beside_curve(side, profile, feature) for side, profile in sides.items() if feature in profile.features
    )
    return beside_course(f"{feature} beside the target at {name}", feature, one.axis, curves)
