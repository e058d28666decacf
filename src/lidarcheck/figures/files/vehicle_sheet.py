"""A vehicle's histograms at all distances as one picture."""

from __future__ import annotations

from pathlib import Path

from lidarcheck.calibration.vehicles.compare import VehicleComparison

__all__ = ["SHEET", "save_distances"]

SHEET = "distances.png"


def save_distances(result: VehicleComparison, path: Path, kind: str = "histogram") -> None:
    """Write a PNG with a row for each distance and a column for each feature; `kind`: one of `axes.KINDS`."""
    from lidarcheck.figures.axes import KINDS
    from lidarcheck.figures.files.pictures import save_sheet
    from lidarcheck.figures.pages.vehicles import distributions

    rows = distributions(result)
    columns = max(len(row) for row in rows)
    figures = [figure for row in rows for figure in row]
    save_sheet(figures, path, columns=columns, kind=kind if kind in KINDS else "histogram")
