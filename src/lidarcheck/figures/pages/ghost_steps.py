"""How signs and ghosts were told from all else, step by step: what each step holds, as counts and as clouds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import IndexArray
from lidarcheck.calibration.ghosts.search import SEARCH_M
from lidarcheck.calibration.ghosts.workflow import GHOST, SIGN, GhostScan
from lidarcheck.figures.data import Cloud, Section, Table
from lidarcheck.figures.pages.thinning import thinned

__all__ = ["ExtractionStep", "steps_of", "steps_section"]


MOST_SHOWN = 20_000
"""Points of a group that a cloud gets; more would not show."""
MOST_CLUSTERS = 5


@dataclass(frozen=True)
class ExtractionStep:
    """A step of the extraction: `words`: what it does; `groups`: name to the rows of the scan that it holds."""

    title: str
    words: str
    groups: Mapping[str, IndexArray]


def steps_of(found: GhostScan) -> tuple[ExtractionStep, ...]:
    """The steps from all points to signs and ghosts alone, in their order."""
    told = found.brightness
    return (
        ExtractionStep("all points", "All echoes of the scan.", {"all": np.arange(len(found.scan))}),
        ExtractionStep(
            "what is bright",
            f"Returns whose {told.column} is {told.above:.0f} or more ({told.why}).",
            {"bright": np.flatnonzero(found.bright)},
        ),
        _bright_clusters(found),
        ExtractionStep(
            "the sign found",
            "Clusters that are compact, and have a ghost or stand where no ordinary surface is so bright; with the "
            "fainter echoes amid them.",
            {f"sign {i} at {sign.range_m:.2f} m": sign.rows for i, sign in enumerate(found.signs, start=1)},
        ),
        _search(found),
        _dense(found),
        ExtractionStep(
            "what is left",
            "Signs and ghosts alone: one echo a beam around the densest place, where there are more than chance gives.",
            {name: np.flatnonzero(found.label == label) for name, label in (("sign", SIGN), ("ghost", GHOST))},
        ),
    )


def _bright_clusters(found: GhostScan) -> ExtractionStep:
    number = int(found.cluster.max(initial=0))
    groups = {f"cluster {i}": np.flatnonzero(found.cluster == i) for i in range(1, min(number, MOST_CLUSTERS) + 1)}
    if number > MOST_CLUSTERS:
        groups[f"{number - MOST_CLUSTERS} smaller ones"] = np.flatnonzero(found.cluster > MOST_CLUSTERS)
    groups["in none"] = np.flatnonzero(found.bright & (found.cluster == 0))
    return ExtractionStep("clusters of it (DBSCAN)", "Bright returns that hang together over beams and range.", groups)


def _search(found: GhostScan) -> ExtractionStep:
    low, high = SEARCH_M
    words = f"Echoes on the sign's own beams from {-low:g} m before to {high:g} m beyond twice its range."
    return ExtractionStep(
        "the search at twice the range", words, {"sign": _joined(found, "rows"), "at 2R": _joined(found)}
    )


def _dense(found: GhostScan) -> ExtractionStep:
    """Clusters are numbered over all signs, the largest first."""
    parts = sorted((rows for sign in found.signs for rows in sign.clusters), key=len, reverse=True)
    groups = {f"cluster {i}": rows for i, rows in enumerate(parts[:MOST_CLUSTERS], start=1)}
    if len(parts) > MOST_CLUSTERS:
        groups[f"{len(parts) - MOST_CLUSTERS} smaller ones"] = np.unique(np.concatenate(parts[MOST_CLUSTERS:]))
    clustered = np.concatenate([np.zeros(0, dtype=np.int64), *parts])
    groups["in none"] = np.setdiff1d(_joined(found), clustered)
    return ExtractionStep("clusters there (DBSCAN)", "Of these, the echoes that lie densely in range.", groups)


def _joined(found: GhostScan, of: str = "searched") -> IndexArray:
    return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(getattr(sign, of) for sign in found.signs)]))


def steps_section(found: GhostScan) -> Section:
    """The steps with their counts, and a cloud of each."""
    steps = steps_of(found)
    words = tuple(f"{i}. {step.words}" for i, step in enumerate(steps, start=1))
    rows = tuple(
        ("" if more else str(i), "" if more else step.title, name, str(len(held)))
        for i, step in enumerate(steps, start=1)
        for more, (name, held) in enumerate(step.groups.items())
    )
    header = ("step", "shows", "of which", "echoes")
    xyz = np.column_stack([found.scan.x_m, found.scan.y_m, found.scan.z_m])
    clouds = tuple(
        Cloud(
            f"{found.name}: step {i} of {len(steps)}, {step.title}",
            {f"{name}: {len(held)}": xyz[thinned(held, MOST_SHOWN)] for name, held in step.groups.items() if len(held)},
        )
        for i, step in enumerate(steps, start=1)
    )
    return Section(f"{found.name}: step by step", words, (Table("", header, rows, ("step", "echoes")),), clouds)
