"""A fit of ghosts as a page: the parameters with their intervals, and each dataset beside what the model gives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lidarcheck.calibration.ghosts.fit import DatasetFit, GhostFit, GhostParameter
from lidarcheck.calibration.ghosts.workflow import GhostScan
from lidarcheck.figures.data import Course, Curve, Distribution, Figure, Page, Section, Table
from lidarcheck.figures.words import number
from lidarcheck.kpi.detection import wilson

__all__ = ["fit_document", "fit_page"]


def fit_page(fit: GhostFit, simulated: list[GhostScan], provenance: Mapping[str, str] | None = None) -> Page:
    """The fit; with scans that were `simulated` with it, one a dataset, their ghosts beside the real ones."""
    ghosts = sum(d.ghosts for d in fit.datasets)
    count = len(fit.datasets)
    told = ", ".join(f"{name} {p.value:.4g}" + ("" if p.fitted else " (left)") for name, p in fit.parameters.items())
    summary = f"{fit.effect.name}: {told}; from {ghosts} ghost echoes of {count} dataset{'s' if count != 1 else ''}."
    sections = (
        Section("Parameters", fit.warnings, (_parameters(fit),)),
        Section("Datasets", tables=(_datasets(fit),), figures=(*_courses(fit.datasets), *_histograms(fit, simulated))),
    )
    return Page("Fit of the ghost effect", summary, sections, provenance or {})


def fit_document(fit: GhostFit) -> dict[str, Any]:
    """The numbers of a fit, as `result.json` has them."""
    return {
        "effect": fit.effect.name,
        "parameters": fit.parameters,
        "datasets": fit.datasets,
        "scatter": fit.scatter,
        "warnings": fit.warnings,
    }


def _parameters(fit: GhostFit) -> Table:
    header = ("parameter", "value", "low", "high", "unit", "")
    rows = [
        (name, f"{p.value:.5g}", *(f"{end:.5g}" if p.fitted else "-" for end in (p.low, p.high)), p.unit, _remark(p))
        for name, p in fit.parameters.items()
    ]
    return Table(f"{fit.effect.name}, with 95 % intervals", header, tuple(rows), header[1:4])


def _remark(estimate: GhostParameter) -> str:
    return "" if estimate.fitted else "not told by these data"


def _datasets(fit: GhostFit) -> Table:
    header = ("dataset", "range [m]", "beams", "ghosts", "expected", "AREA", "expected", "2R + [m]", "expected", "pull")
    rows = [
        (
            *(d.name, f"{d.range_m:.2f}", str(d.beams), str(d.ghosts), f"{d.ghosts_expected:.1f}"),
            *(number(d.area, ".1f"), f"{d.area_expected:.1f}"),
            *(number(d.beyond_m, ".3f"), f"{d.beyond_expected_m:.3f}", number(d.pull, "+.1f")),
        )
        for d in fit.datasets
    ]
    return Table("Real against the fitted model", header, tuple(rows), header[1:])


def _courses(datasets: tuple[DatasetFit, ...]) -> list[Figure]:
    if len(datasets) < 2:
        return []
    ordered = sorted(datasets, key=lambda d: d.range_m)
    x = np.array([d.range_m for d in ordered])
    low, high = wilson([d.ghosts for d in ordered], [d.beams for d in ordered])
    share = [(np.array([n for n, _ in pairs]) / np.array([b for _, b in pairs])) for pairs in (
        [(d.ghosts, d.beams) for d in ordered], [(d.ghosts_expected, d.beams) for d in ordered]
    )]  # fmt: skip
    area = [np.array([d.area for d in ordered]), np.array([d.area_expected for d in ordered])]
    sign = "range of the sign [m]"
    return [
        Course(
            "Beams of the sign with a ghost", sign, "share",
            (Curve("real", x, share[0], low, high), Curve("simulated", x, share[1])),
        ),
        Course(
            "AREA of the ghosts", sign, "geometric mean of AREA",
            (Curve("real", x, area[0]), Curve("simulated", x, area[1])),
            log_y=True,
        ),
    ]  # fmt: skip


def _histograms(fit: GhostFit, simulated: list[GhostScan]) -> list[Figure]:
    figures: list[Figure] = []
    for beams, other in zip(fit.beams, simulated, strict=bool(simulated)):
        for quantity, real in (("AREA", beams.area), ("PEAK", beams.peak)):
            samples = {"real": real[np.isfinite(real)], "simulated": other.values(2, quantity)}
            if all(len(values) for values in samples.values()):
                figures.append(Distribution(f"{beams.name}: {quantity} of the ghost", quantity, "", samples))
    return figures
