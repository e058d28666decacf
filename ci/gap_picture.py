"""Draws what `explain` does to one case: a missing effect, found, and the gap before and after. Run by ci/gap_picture.

The case is made by tests/hidden, an independent simulator that shares no code with the model.
"""

from __future__ import annotations

import itertools
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lidarcheck import Case, IdealScan, Model, Scan, read_case, read_model, simulate
from lidarcheck.cli import main as lidarcheck
from lidarcheck.kpi.pairing import pair_with_ideal

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "images" / "gap.svg"
SEED = 1
MEASURED, BEFORE, AFTER, FLOOR = "#1f2328", "#b4540a", "#0b62c4", "#8c959f"
FEATURES = {
    "range": "range", "area": "AREA", "peak": "PEAK", "width": "WIDTH", "detected": "detected", "other": "other echoes",
}  # fmt: skip
FEWEST = 60
"""So many echoes make a median worth drawing."""
FloatArray = npt.NDArray[np.float64]


def make_case(directory: Path) -> None:
    """Six frames with a walk error of medium strength that the model lacks."""
    sys.path.insert(0, str(ROOT / "tests"))
    from hidden.cases import write_case
    from hidden.orders import CaseOrder

    write_case(CaseOrder(0, "single", 20, ("walk_error",), "medium", "SLIM", "mixed"), directory)


def medians(frames: list[tuple[IdealScan, Scan]], edges: FloatArray) -> FloatArray:
    """The median range residual [m] of the echoes in each bin of AREA, shape (n_bins,), NaN where there are too few."""
    area, residual = [], []
    for ideal, scan in frames:
        pairing = pair_with_ideal(ideal, scan)
        area.append(scan.area[pairing.of_surface])
        residual.append(pairing.residual_m[pairing.of_surface])
    areas, residuals = np.concatenate(area), np.concatenate(residual)
    inside = [residuals[(areas >= low) & (areas < high)] for low, high in itertools.pairwise(edges)]
    return np.array([np.median(one) if one.size >= FEWEST else np.nan for one in inside])


def draw_ranges(axes: Axes, case: Case, found: Model, verify: list[int]) -> None:
    """How far ranges are off over AREA, on the frames that no fit has seen."""
    frames = [frame for frame in case.frames if frame.number in verify]
    edges = np.geomspace(60.0, 4500.0, 16)
    middle = np.sqrt(edges[:-1] * edges[1:])
    sides: dict[str, tuple[str, Model | None]] = {
        "measured": (MEASURED, None), "model before": (BEFORE, case.model), "model after": (AFTER, found),
    }  # fmt: skip
    for name, (colour, model) in sides.items():
        scans = [f.measured if model is None else simulate(f.ideal, model, seed=SEED, frame=f.number) for f in frames]
        y = 100.0 * medians([(f.ideal, scan) for f, scan in zip(frames, scans, strict=True)], edges)
        line = {"measured": "o", "model before": "--", "model after": "-"}[name]
        axes.plot(middle, y, line, color=colour, label=name, markersize=4, linewidth=1.6)
    axes.set_xscale("log")
    axes.set_xlabel("AREA of the echo")
    axes.set_ylabel("range − true range, median [cm]")
    axes.set_title("The model's ranges are off …", loc="left")
    axes.legend(frameon=False)


def draw_gap(axes: Axes, report: dict[str, Any]) -> None:
    """The gap of each feature and of all, before and after, with the floor."""
    gap = report["gap"]
    rows = {FEATURES.get(name, name.replace("_", " ")): values for name, values in gap["by_feature"].items()}
    rows["all"] = {name: gap[name] for name in ("before", "after", "floor")}
    for i, values in enumerate(rows.values()):
        axes.barh(i - 0.18, values["before"], 0.34, color=BEFORE, label="before" if i == 0 else None)
        axes.barh(i + 0.18, values["after"], 0.34, color=AFTER, label="after" if i == 0 else None)
        axes.plot([values["floor"]] * 2, [i - 0.38, i + 0.38], color=FLOOR, label="floor: chance" if i == 0 else None)
    axes.set_yticks(range(len(rows)), list(rows))
    axes.invert_yaxis()
    axes.set_xlabel("distance from the measurement [sd of one beam]")
    axes.set_title(f"… {words(report)}", loc="left")
    axes.legend(frameon=False, loc="lower right")


def words(report: dict[str, Any]) -> str:
    """What was found, in a line."""
    names = " and ".join(effect["name"] for effect in report["effects"])
    return f"{names} is missing; with it the gap closes by {100.0 * report['gap']['closed']:.0f} %"


def main(keep: Path) -> None:
    """Make, explain and draw the case; what is in the directory already is kept."""
    case, found = keep / "case", keep / "found"
    if not case.exists():
        make_case(case)
    if not found.exists() and lidarcheck(["explain", str(case), "--out", str(found), "--seed", str(SEED), "-q"]) != 0:
        sys.exit("explain failed")
    report = json.loads((found / "report.json").read_text(encoding="utf-8"))
    style: dict[str, Any] = {
        "axes.spines.top": False, "axes.spines.right": False, "font.size": 9, "axes.titlesize": 10,
        "svg.hashsalt": "gap",
    }  # fmt: skip
    with mpl.rc_context(style):
        sheet = Figure(figsize=(10.0, 3.6), layout="constrained")
        left, right = sheet.subplots(1, 2)
        draw_ranges(left, read_case(case), read_model(found / "model.toml"), report["split"]["verify"])
        draw_gap(right, report)
        sheet.savefig(PICTURE, metadata={"Date": None})


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as scratch:
            main(Path(scratch))
