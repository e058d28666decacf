"""Both sides as one cloud: where the simulated vehicle stands in it, and the file that it is written to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.tui.jobs.clouds import Clouds
from lidarcheck.tui.screens.pages.export import file_name

if TYPE_CHECKING:
    from lidarcheck.calibration.vehicles.merge import Placed

__all__ = ["Offset", "merged_name", "placed", "write_merged"]

Offset = tuple[float | None, float | None]
"""Forward and to the left [m]; None for what the vehicle's size suggests."""


def placed(clouds: Clouds, offset: Offset) -> Placed | None:
    """Where the simulated vehicle stands; None where there is no vehicle."""
    from lidarcheck.calibration.vehicles.kinds import vehicle_named
    from lidarcheck.calibration.vehicles.merge import place_vehicles

    if clouds.at is None:
        return None
    return place_vehicles(*clouds.at.cuts, vehicle_named(clouds.vehicle), x_m=offset[0], y_m=offset[1])


def merged_name(clouds: Clouds, name: str, variant: str) -> str:
    """How the file is called, by default."""
    if clouds.at is None:
        return f"{file_name(Path(name).stem)}_merged.pcd"
    kind = "_".join(filter(None, (clouds.vehicle, variant)))
    return f"{kind}_{clouds.at.distance_m:.0f}m_merged.pcd"


def write_merged(clouds: Clouds, offset: Offset, path: Path) -> str:
    """Write both vehicles as `vehicles merge` does, or both whole frames where they are; what is to be said."""
    from lidarcheck.calibration.vehicles.kinds import vehicle_named
    from lidarcheck.calibration.vehicles.merge import merge_frames, merge_vehicles
    from lidarcheck.formats.recognise import target_format, write_table

    target_format(path)
    names = ("the real scan", "the simulated scan")
    if clouds.at is not None:
        kind = vehicle_named(clouds.vehicle)
        merged = merge_vehicles(*clouds.at.cuts, kind, x_m=offset[0], y_m=offset[1], files=names)
        table, n_real, n_simulated = merged.columns, merged.n_real, merged.n_simulated
    else:
        assert clouds.simulated is not None
        table = merge_frames(clouds.real, clouds.simulated, names)
        n_real, n_simulated = len(clouds.real), len(clouds.simulated)
    write_table(table, path)
    return f"{path.name}: {n_real + n_simulated} points, Simulated is 0 for the {n_real} real ones"
