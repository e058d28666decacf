"""Mistakes of the readout, made where the model places and numbers its echoes, turn the shipped goldens red."""

import dataclasses
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lidarcheck.harness.check import check
from lidarcheck.kpi import direction
from lidarcheck.model.exact import listing, report
from lidarcheck.scan import Scan
from lidarcheck.sensor import grid, reference_beams
from places import ROOT

NAMES = ("directions_SMART", "directions_SLIM", "numbers_SMART", "numbers_SLIM")
ScanOf = Callable[..., Scan]


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scenarios of the readout with the goldens that are shipped."""
    root = tmp_path_factory.mktemp("project")
    for folder in ("models", "ideals"):
        shutil.copytree(ROOT / "scenarios" / folder, root / "scenarios" / folder)
    (root / "goldens").mkdir()
    for name in NAMES:
        for folder in ("scenarios", "goldens"):
            shutil.copy(ROOT / folder / f"{name}.toml", root / folder)
    return root


def failing(project: Path, name: str) -> set[str]:
    """The KPIs that the gate fails, by name."""
    found = check([project / "scenarios" / f"{name}.toml"])
    failed = {kpi.name for scenario in found.scenarios for kpi in scenario.kpis if kpi.fails}
    assert found.exit_code == int(bool(failed)), found.problems
    return failed


def columns(**altered: Callable[[Scan], Any]) -> Callable[[ScanOf], ScanOf]:
    """A readout that writes those columns otherwise."""

    def mutate(scan_of: ScanOf) -> ScanOf:
        def mutant(*args: Any) -> Scan:
            scan = scan_of(*args)
            return dataclasses.replace(scan, **{name: of(scan) for name, of in altered.items()})

        return mutant

    return mutate


def floored(scan_of: ScanOf) -> ScanOf:
    """Ranges cut off, where they should be rounded."""

    def mutant(echoes: Any, light: Any, asked: Any, rounded: bool, share: Any) -> Scan:
        scan = scan_of(echoes, light, asked, False, share)
        step = asked.range_resolution_m
        factor = np.floor(scan.range_m / step) * step / scan.range_m
        return dataclasses.replace(scan, x_m=factor * scan.x_m, y_m=factor * scan.y_m, z_m=factor * scan.z_m)

    return mutant


def doubled_step(scan_of: ScanOf) -> ScanOf:
    def mutant(echoes: Any, light: Any, asked: Any, *more: Any) -> Scan:
        step_m = 2.0 * asked.range_resolution_m
        return scan_of(echoes, light, dataclasses.replace(asked, range_resolution_m=step_m), *more)

    return mutant


def backwards(scan: Scan) -> Any:
    """The numbers of each beam in the opposite order."""
    key = scan.layer.astype(np.int64) * 1000 + scan.point
    ends = np.array([(scan.echo_number[key == one].min(), scan.echo_number[key == one].max()) for one in key])
    return ends.sum(axis=1) - scan.echo_number


READOUTS = {
    "Y mirrored": (
        columns(y_m=lambda scan: -scan.y_m),
        "directions",
        {"direction_scatter_azimuth", "position_bias_y.left"},
    ),
    "Z mirrored": (
        columns(z_m=lambda scan: -scan.z_m),
        "directions",
        {"direction_scatter_elevation", "position_bias_z.upper"},
    ),
    "layers numbered from the top": (
        columns(layer=lambda scan: 519 - scan.layer),
        "directions",
        {"direction_scatter_elevation", "direction_bias_elevation.upper"},
    ),
    "numbers from 0": (
        columns(echo_number=lambda scan: scan.echo_number - 1),
        "numbers",
        {"echo_number_share.number_1", "echo_number_share.number_2", "echo_number_share.number_3"},
    ),
    "numbers in reverse order": (columns(echo_number=backwards), "numbers", {"echo_order"}),
    "ranges cut off": (floored, "numbers", {"range_residual_mean"}),
    "the step of ranges doubled": (doubled_step, "numbers", {"range_quantisation_step"}),
    "PEAK in steps of 2": (
        columns(peak=lambda scan: 2.0 * np.floor(scan.peak / 2.0)),
        "numbers",
        {"peak_quantisation_step"},
    ),
    "AREA in steps of 4": (
        columns(area=lambda scan: 4.0 * np.rint(scan.area / 4.0)),
        "numbers",
        {"area_quantisation_step"},
    ),
    "WIDTH in halves": (
        columns(width_ns=lambda scan: scan.width_ns - 0.5 * (scan.layer % 2)),
        "numbers",
        {"width_quantisation_step"},
    ),
}
"""What the readout does, the scenario that sees it, and KPIs that must."""
ALONE = ("layers numbered from the top", "ranges cut off")
"""Mistakes that others hide, or that hide them."""


@pytest.mark.parametrize("name", NAMES)
def test_the_readout_as_it_is_is_green(project: Path, name: str) -> None:
    assert failing(project, name) == set()


@pytest.mark.parametrize("mistake", READOUTS)
def test_a_mistake_of_the_readout_is_red(project: Path, monkeypatch: pytest.MonkeyPatch, mistake: str) -> None:
    mutate, scenario, seen = READOUTS[mistake]
    monkeypatch.setattr(listing, "scan_of", mutate(listing.scan_of))
    assert seen <= failing(project, f"{scenario}_SMART")


@pytest.mark.parametrize("scenario", ["directions", "numbers"])
def test_both_variants_see_the_mistakes(project: Path, monkeypatch: pytest.MonkeyPatch, scenario: str) -> None:
    every = [name for name, (_, of, _) in READOUTS.items() if of == scenario and name not in ALONE]
    for name in every:
        monkeypatch.setattr(listing, "scan_of", READOUTS[name][0](listing.scan_of))
    assert set().union(*(READOUTS[name][2] for name in every)) <= failing(project, f"{scenario}_SLIM")


def forget() -> None:
    """Tables of directions are worked out again."""
    for table in (
        grid._table,
        report._angles,
        *(table for table in vars(direction).values() if hasattr(table, "cache_clear")),
    ):
        table.cache_clear()


@pytest.mark.parametrize(("axis", "angle"), [("layer", "elevation"), ("point", "azimuth")])
def test_a_table_that_is_half_a_beam_off_is_red(
    project: Path, monkeypatch: pytest.MonkeyPatch, axis: str, angle: str
) -> None:
    half = {"layer": 0.5, "point": 0.0} if axis == "layer" else {"layer": 0.0, "point": 0.5}
    layers, points = (np.arange(n) + half[name] for name, n in (("layer", 520), ("point", 960)))
    off = report.angles_of(reference_beams(), layers, points)
    monkeypatch.setattr(report, "_angles", lambda beams: off)
    for variant in ("SMART", "SLIM"):
        assert f"direction_bias_{angle}" in failing(project, f"directions_{variant}")


@pytest.mark.parametrize(
    ("formula", "by_deg", "seen"),
    [("elevation", 0.025, "position_bias_z"), ("azimuth", 0.0625, "position_bias_y")],
)
def test_where_all_know_a_wrong_direction_the_surface_points_tell(
    project: Path, monkeypatch: pytest.MonkeyPatch, formula: str, by_deg: float, seen: str
) -> None:
    right, wrong = grid.Axis.angle_deg, getattr(reference_beams(), formula)
    with monkeypatch.context() as patch:
        patch.setattr(grid.Axis, "angle_deg", lambda axis, index: right(axis, index) + by_deg * (axis == wrong))
        forget()
        failed = failing(project, "directions_SLIM")
    forget()
    assert seen in failed
    assert not any(name.startswith("direction_") for name in failed)


def test_the_surface_points_are_those_of_the_beams() -> None:
    """By the formulas themselves, since the file stands for what no table of the code may change."""
    rows = np.loadtxt(ROOT / "scenarios/ideals/spread_beams.txt", skiprows=2)
    up, left = np.deg2rad((rows[:, 0] - 259.5) * 0.05), np.deg2rad((rows[:, 1] - 479.5) * 0.125)
    unit = np.stack([np.cos(left) * np.cos(up), np.sin(left) * np.cos(up), np.sin(up)], axis=1)
    assert np.abs(rows[:, 5:] - unit * rows[:, 2:3]).max() < 1e-5
    # Layers and points lie alike on either side, so that reversed ones meet a beam that is there.
    beams = {(int(layer), int(point)) for layer, point in rows[:, :2]}
    assert beams == {(519 - layer, point) for layer, point in beams} == {(layer, 959 - point) for layer, point in beams}
