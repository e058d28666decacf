"""The page of a vehicle comparison: a table and the histograms of each distance."""

from __future__ import annotations

import math
from collections.abc import Mapping

from lidarcheck.calibration.vehicles.compare import AtDistance, VehicleComparison
from lidarcheck.calibration.vehicles.merge import Merged
from lidarcheck.figures.data import Cloud, Distribution, Page, Section, Table
from lidarcheck.figures.pages.thinning import thinned_cloud
from lidarcheck.figures.words import number
from lidarcheck.kpi.comparison import FeatureGap

__all__ = ["distributions", "merge_page", "page"]


def page(result: VehicleComparison, provenance: Mapping[str, str] | None = None) -> Page:
    """The result as people read it."""
    sections = [_overview(result)]
    for at, figures in zip(result.distances, distributions(result), strict=True):
        clouds = {n: thinned_cloud(cloud) for n, cloud in zip(_SIDES, at.clouds, strict=True)}
        words = (
            f"Real: {at.real.how}, {at.real.extent.words()}. Simulated: {at.simulated.how}, "
            f"{at.simulated.extent.words()}.",
        )
        sections.append(
            Section(_title(result, at), words, (), (*figures, Cloud(f"{_title(result, at)}, points", clouds)))
        )
    return Page("Vehicles", _summary(result), tuple(sections), provenance or {})


_SIDES = ("real", "simulated")


def _title(result: VehicleComparison, at: AtDistance) -> str:
    return f"{result.vehicle} at {at.distance_m:.0f} m"


def distributions(result: VehicleComparison) -> list[tuple[Distribution, ...]]:
    """A row of figures for each distance, one for each feature."""
    return [
        tuple(
            Distribution(
                f"{_title(result, at)}, {name}", name, gap.unit, dict(zip(_SIDES, at.samples[name], strict=True)), True
            )
            for name, gap in at.features.items()
        )
        for at in result.distances
    ]


def _summary(result: VehicleComparison) -> str:
    worst = [(_relative(gap), at, name, gap) for at in result.distances for name, gap in at.features.items()]
    share, at, name, gap = max(worst, key=lambda entry: entry[0])
    where = ", ".join(f"{d.distance_m:.0f}" for d in result.distances)
    distance = f"{number(gap.wasserstein)} {gap.unit}".strip()
    return (
        f"{result.vehicle} at {where} m: the largest difference is of {name} at {at.distance_m:.0f} m, "
        f"{100.0 * share:.0f} % of the mean (Wasserstein {distance})."
    )


def _relative(gap: FeatureGap) -> float:
    """Wasserstein distance over the mean, so that features compare; 0 where there is none."""
    mean = 0.5 * (abs(gap.mean_measured) + abs(gap.mean_simulated))
    return gap.wasserstein / mean if mean > 0.0 else 0.0


def _overview(result: VehicleComparison) -> Section:
    counts = ("n real", "n sim", "beams real", "beams sim", "detection ratio", "detected real", "detected sim")
    seen = Table(
        "Echoes on the vehicle",
        ("distance [m]", *counts),
        tuple(
            (
                f"{at.distance_m:.1f}", str(at.real.echoes), str(at.simulated.echoes), str(at.real.beams),
                str(at.simulated.beams), number(at.detection_ratio), number(at.detection_real),
                number(at.detection_simulated),
            )
            for at in result.distances
        ),
        right=("distance [m]", *counts),
    )  # fmt: skip
    header = ("distance [m]", "feature", "wasserstein", "ks", "ks by chance", "js", "dvm_bias", "dvm_scatter", "unit")
    rows = tuple(
        (f"{at.distance_m:.1f}", name, *_kpis(gap, at.ks_chance[name]), gap.unit)
        for at in result.distances
        for name, gap in at.features.items()
    )
    words = tuple(f"Not compared: {name}, {why}." for name, why in result.left_out.items())
    gaps = Table("Real against simulated", header, rows, right=("distance [m]", *header[2:8]))
    return Section("All distances", words, (seen, gaps))


def _kpis(gap: FeatureGap, chance: float) -> tuple[str, ...]:
    values = (gap.wasserstein, gap.ks, chance, gap.js, gap.dvm_bias, gap.dvm_scatter)
    return tuple(number(value) for value in values)


def merge_page(merged: Merged, title: str, provenance: Mapping[str, str] | None = None) -> Page:
    """What was merged, in words, and its views."""
    x, y = merged.offset_m
    beside = "to the right" if y <= 0.0 else "to the left"
    words = f"{merged.n_real} real and {merged.n_simulated} simulated points, the simulated ones {abs(y):g} m {beside}"
    words += f" and {abs(x):g} m {'behind' if x > 0.0 else 'before'}" if x else ""
    moved = math.sqrt(sum(v * v for v in merged.aligned_m))
    rows = (
        ("real", str(merged.n_real), merged.how_real, "where it was"),
        (
            "simulated",
            str(merged.n_simulated),
            merged.how_simulated,
            f"centroid moved {moved:.2f} m onto the real one's",
        ),
    )
    table = Table("", ("side", "points", "cut out", "place"), rows, right=("points",))
    suggested = f"Suggested offset: X {merged.suggested_m[0]:g} m, Y {merged.suggested_m[1]:g} m."
    real, simulated = merged.clouds
    cloud = Cloud(title, {"real": real, "simulated": simulated})
    return Page(title, f"{words}.", (Section("Merged", (suggested,), (table,), (cloud,)),), provenance or {})
