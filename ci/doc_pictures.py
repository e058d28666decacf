"""Draws the pictures of the user guides. Run by ci/doc_pictures.

Those of the workflows are what the commands write to `pictures/`, from the projects that the pictures of the terminal
interface are made from: measurements simulated with effects that the model lacks. The others are drawn here.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from tui_project import MODEL, make_bench, make_drive, run

from lidarcheck import read_ideal, read_model, read_scan, simulate
from lidarcheck.model import expected_trace, light_of

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
REAL, SIMULATED, GREY = "#b4540a", "#0b62c4", "#8c959f"
STYLE: dict[str, Any] = {
    "axes.spines.top": False, "axes.spines.right": False, "font.size": 9, "axes.titlesize": 10,
}  # fmt: skip
NEAR, FAR = "25m", "45m"


def save(sheet: Figure, name: str) -> None:
    """The picture as docs/images/NAME.png, the same bytes each time."""
    sheet.savefig(IMAGES / f"{name}.png", dpi=100, metadata={"Software": None})


def taken(out: Path, picture: str, name: str) -> None:
    """One picture of a workflow, by the end of its name, as docs/images/NAME.png."""
    found = sorted((out / "pictures").glob(f"*{picture}.png"))
    if len(found) != 1:
        sys.exit(f"{len(found)} pictures called {picture} in {out}")
    shutil.copy(found[0], IMAGES / f"{name}.png")


# Of workflows


def compare_car(project: Path, kind: str, name: str) -> None:
    """A car's AREA at 25 m, as a plot of some kind."""
    ideal, out = project / f"cars/ideal_car_{NEAR}.parquet", project / "out"
    words = ("--vehicle", "car", "--model", MODEL, "--ideal", ideal, "--seed", 2, "--plot", kind)
    run("vehicles", "compare", project / f"cars/real_car_{NEAR}.pcd", *words, "--out", out)
    taken(out, f"area-{kind}", name)


def vehicles(project: Path) -> None:
    """Histograms."""
    compare_car(project, "histogram", "vehicles_area")


def violin(project: Path) -> None:
    """Violins."""
    compare_car(project, "violin", "pictures_violin")


def panels(project: Path) -> None:
    """Walk over the panels of a hall."""
    frames, out = sorted((project / "lab").glob("frame_*.pcd")), project / "out"
    run("panels", *frames, "--ideal", project / "lab/ideal.parquet", "--model", MODEL, "--out", out)
    taken(out, "walk-over-all-panels", "panels_walk")


def ghosts(project: Path) -> None:
    """A sign and its ghost at twice its range, from above, as `ghosts find` labels them."""
    scan, ideal, out = project / f"signs/2_{FAR}.pcd", project / "signs/2_ideal.parquet", project / "out"
    run("ghosts", "find", scan, "--ideal", ideal, "--model", MODEL, "--out", out)
    everything, found = read_scan(scan), read_scan(out / f"2_{FAR}_ghosts.pcd")
    sheet = Figure(figsize=(8.0, 2.6), layout="constrained")
    axes = sheet.subplots()
    axes.plot(everything.x_m, everything.y_m, ".", color=GREY, markersize=2, label="all echoes")
    for label, name, colour in ((1, "sign", REAL), (2, "ghost", SIMULATED)):
        of = found.extra["Label"] == label
        axes.plot(found.x_m[of], found.y_m[of], ".", color=colour, markersize=4, label=f"{name}: {np.sum(of)} echoes")
    axes.set(xlim=(0.0, 100.0), xlabel="X [m], forward", ylabel="Y [m], left", title="A sign and its ghost, from above")
    axes.legend(frameon=False, loc="upper left")
    save(sheet, "ghosts_sign")


def street(project: Path) -> None:
    """Where a street is darker than the model says."""
    real, ideal, out = project / "street/real_street.pcd", project / "street/ideal_street.parquet", project / "out"
    run("scenes", "compare", real, "--ideal", ideal, "--model", MODEL, "--out", out)
    taken(out, "area-measured-over-simulated", "comparing_scenes_area")


def blooming(project: Path) -> None:
    """AREA beside a sign, measured and as a table makes it."""
    scan, ideal, out = project / "signs/bloom.pcd", project / "signs/ideal_sign_69m.parquet", project / "out"
    model, lut = project / "scenarios/models/scenes_SLIM.toml", project / "signs/vertical_lut.ini"
    truth = project / "truth.toml"
    truth.write_text(
        f'{model.read_text(encoding="utf-8")}\n[[effects]]\nname = "blooming_vertical"\n', encoding="utf-8"
    )
    run("simulate", ideal, "--model", truth, "--out", scan, "--seed", 7)
    run("bloom", "show", scan, "--ideal", ideal, "--model", model, "--lut", lut, "--out", out)
    taken(out, "area-at-69-0-m", "blooming_area")


# Of ideas


def scene(project: Path) -> None:
    """A built-in scene as the sensor sees it: range and the material's light."""
    file = project / "city.parquet"
    run("scene", "city_street", "--out", file, "--no-second-hits")
    ideal = read_ideal(file)
    image = np.full((520, 960), np.nan)
    hit = ideal.distance_m > 0.0
    image[ideal.layer[hit], ideal.point[hit]] = ideal.distance_m[hit]
    sheet = Figure(figsize=(9.0, 2.6), layout="constrained")
    axes = sheet.subplots()
    how: dict[str, Any] = {"cmap": "viridis_r", "norm": "log", "interpolation": "nearest", "aspect": "auto"}
    drawn = axes.imshow(image[:, ::-1], origin="lower", extent=(60.0, -60.0, -13.0, 13.0), **how)
    axes.set(xlabel="azimuth [°], positive to the left", ylabel="elevation [°]")
    axes.set_title("city_street: distance of what each beam meets", loc="left")
    sheet.colorbar(drawn, label="distance [m]", ticks=[3, 10, 30, 100], format="%g")
    save(sheet, "scene_city_street")


def trace(project: Path) -> None:
    """The detectors of two beams over time: a dark surface and a bright one at the same range."""
    ideal, model = read_ideal(ROOT / "examples/wall_ideal.txt"), read_model(ROOT / "scenarios/models/SMART.toml")
    beam = ideal.take(np.arange(len(ideal)) == int(np.argmin(np.abs(ideal.distance_m - 20.0))))
    distance = float(beam.distance_m[0])
    sheet = Figure(figsize=(8.0, 3.0), layout="constrained")
    axes = sheet.subplots()
    for signal, name, colour in ((700.0, "dark surface", SIMULATED), (20000.0, "bright surface", REAL)):
        brighter = model.with_sensor(signal_at_1m=signal)
        counts = expected_trace(light_of(beam, brighter), brighter.sensor)[0]
        bins = np.arange(counts.size)
        axes.step(bins, counts, where="post", color=colour, label=name)
    near = 2.0 * distance / 0.299792458
    axes.axhline(9.5, color=GREY, linestyle="--", label="threshold: more than 9 detectors")
    axes.axvline(near, color=GREY, linewidth=0.8)
    axes.annotate(f"light from {distance:.1f} m", (near + 0.3, -6.0), color="#57606a", fontsize=8)
    axes.set(xlim=(near - 12.0, near + 26.0), xlabel="time [ns], a bin each", ylabel="detectors ON", title=TRACE_TITLE)
    axes.legend(frameon=False)
    save(sheet, "sensor_trace")


TRACE_TITLE = "An echo is a run of bins above the threshold: WIDTH its bins, PEAK its height, AREA its sum"


def distances(project: Path) -> None:
    """Two distribution functions, and what three KPIs measure of them."""
    ideal = read_ideal(project / f"cars/ideal_car_{NEAR}.parquet")
    sides = {
        "measured": read_scan(project / f"cars/real_car_{NEAR}.pcd"),
        "simulated": simulate(ideal, read_model(MODEL), seed=2),
    }
    grid = np.geomspace(8.0, 8000.0, 500)
    cdf = {name: np.searchsorted(np.sort(scan.area), grid, side="right") / len(scan) for name, scan in sides.items()}
    sheet = Figure(figsize=(8.0, 3.0), layout="constrained")
    axes = sheet.subplots()
    for (name, shares), colour in zip(cdf.items(), (REAL, SIMULATED), strict=True):
        axes.plot(grid, shares, color=colour, linestyle="-" if name == "measured" else "--", label=name)
    measured, simulated = cdf.values()
    axes.fill_between(grid, measured, simulated, color=GREY, alpha=0.3, label="wasserstein: the area between")
    at = int(np.argmax(np.abs(measured - simulated)))
    axes.plot([grid[at]] * 2, [measured[at], simulated[at]], color="#1f2328", label="ks: the largest difference")
    axes.set(xscale="log", xlabel="AREA (the area is meant on a linear axis)", ylabel="share of echoes up to here")
    axes.legend(frameon=False)
    save(sheet, "kpi_distances")


PICTURES: dict[str, tuple[Callable[[Path], None], Sequence[str]]] = {
    "vehicles_area": (vehicles, ["drive"]),
    "pictures_violin": (violin, ["drive"]),
    "panels_walk": (panels, ["drive"]),
    "ghosts_sign": (ghosts, ["drive"]),
    "comparing_scenes_area": (street, ["drive"]),
    "kpi_distances": (distances, ["drive"]),
    "blooming_area": (blooming, ["bench"]),
    "scene_city_street": (scene, []),
    "sensor_trace": (trace, []),
}
"""Each picture with what draws it and the project that it needs."""
MAKE = {"drive": make_drive, "bench": make_bench}


def main(wanted: list[str], keep: Path) -> None:
    """All pictures, or those that are named; projects that are in `keep` already are used again."""
    for name in wanted or PICTURES:
        if name not in PICTURES:
            sys.exit(f"error: there is no picture {name}; use {', '.join(PICTURES)}")
        draw, needs = PICTURES[name]
        for project in needs:
            if not (keep / project).exists():
                MAKE[project](keep / project)
        place = keep / needs[0] if needs else keep
        shutil.rmtree(place / "out", ignore_errors=True)
        with mpl.rc_context(STYLE):
            draw(place)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        main(sys.argv[1:], Path(scratch))
