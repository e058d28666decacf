"""Signs and ghosts from files: datasets by their names, scans held against their ideal scans and their model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from lidarcheck.calibration.echoes import place_of
from lidarcheck.calibration.ghosts.data import check_expected
from lidarcheck.calibration.ghosts.workflow import GhostScan, find_ghosts
from lidarcheck.cases.source import Named, scan_of
from lidarcheck.errors import InputError
from lidarcheck.formats import save_scan
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.kpi.variant import check_variant
from lidarcheck.model import load_model, simulate
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = ["dataset_names", "find_in", "find_simulated", "load_ghost_model", "stripped_files", "stripped_name"]


def dataset_names(scans: Sequence[Named]) -> list[str]:
    """A name for each dataset: that of its file without suffix, numbered where several have the same."""
    stems = [path.name.split(".")[0] or path.name for path in scans]
    seen: dict[str, int] = {}
    names = []
    for stem in stems:
        seen[stem] = seen.get(stem, 0) + 1
        names.append(stem if stems.count(stem) == 1 else f"{stem}_{seen[stem]}")
    return names


def stripped_name(name: str) -> str:
    """The file of a dataset's signs and ghosts alone."""
    return f"{name}_ghosts.pcd"


def stripped_files(stripped: Mapping[str, Scan], sensor: Sensor | None = None) -> dict[str, Callable[[Path], object]]:
    """What writes the signs and ghosts of each dataset, by the name of its file; `sensor`: whose files they are."""
    return {stripped_name(name): partial(save_scan, scan, sensor=sensor) for name, scan in stripped.items()}


def load_ghost_model(path: Path) -> Model:
    """A model, of whatever sensor or program."""
    return load_model(path)


def find_in(
    path: Named,
    name: str,
    *,
    ideal: IdealScan | None = None,
    model: Model | None = None,
    expected_m: Sequence[float] = (),
    bright: float | None = None,
    placement: Placement = AS_IT_IS,
    sensor: Sensor | None = None,
) -> GhostScan:
    """What a scan, placed as declared, shows; `sensor`: what measured, else the model's.

    `InputError` where it is not what the ideal scan and the model say.
    """
    sensor = sensor if model is None else model.sensor
    scan = scan_of(path, placement, sensor)
    if sensor is not None:
        check_variant(scan, sensor, str(path))
    view = None if ideal is None else _view(ideal)
    try:
        found = find_ghosts(scan, name=name, sensor=sensor, above=bright, expected_m=expected_m, view=view)
        if ideal is not None and model is not None:
            check_expected(found, ideal, model)
    except InputError as error:
        raise InputError(error.what, file=str(path), line=error.line, fix=error.fix) from error
    return found


def find_simulated(
    found: GhostScan, ideal: IdealScan, model: Model, *, bright: float | None = None, seed: int = 0
) -> GhostScan:
    """The same search in what the model makes of the ideal scan."""
    scan = simulate(ideal, model, seed=seed)
    return find_ghosts(scan, name=f"the simulation of {found.name}", sensor=found.sensor, above=bright)


def _view(ideal: IdealScan) -> tuple[int, int, int, int]:
    """First and last row, first and last column of beams as they stand that were fired."""
    row, column = place_of(ideal.beams, ideal.layer, ideal.point)
    return (int(row.min()), int(row.max()), int(column.min()), int(column.max()))
