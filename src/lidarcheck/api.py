"""Public functions whose names or arguments differ from what they call; `lidarcheck` hands them on.

What each needs is imported when it is called.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lidarcheck.calibration.parameters.workflow import Calibration
    from lidarcheck.cases.case import Case
    from lidarcheck.formats.geometry import Pose
    from lidarcheck.model.spec import Model
    from lidarcheck.scan import IdealScan, Scan
    from lidarcheck.sensor import Sensor

__all__ = ["calibrate", "read_case", "read_ideal", "read_model", "read_scan", "write_model", "write_scan"]

Path = str | PathLike[str]


def read_scan(
    path: Path, *, unit: str = "m", mirror: str = "", pose: Pose | None = None, sensor: Sensor | None = None
) -> Scan:
    """The echoes of a file in any known format, recognised by its content.

    `unit`, `mirror` (an axis), `pose` (x, y, z [m], roll, pitch, yaw [deg]): what is declared of its X, Y, Z. `sensor`:
    what measured, as a model's `sensor`; a built-in one where None. Columns that the file lacks are logged and get
    defaults. `LidarcheckError` names file and line of what is wrong, and the
    change that would help where X, Y, Z do not lie where the beams point.
    """
    from lidarcheck.formats import load_scan
    from lidarcheck.formats.geometry import Placement

    return load_scan(path, Placement(unit, mirror, pose), sensor)


def read_ideal(path: Path, *, sensor: Sensor | None = None) -> IdealScan:
    """What each beam meets, from a file in any known format; `sensor`: whose beams they are, as `read_scan` has it.

    `LidarcheckError` names file and line of what is wrong.
    """
    from lidarcheck.formats import load_ideal

    return load_ideal(path, sensor)


def read_model(path: Path) -> Model:
    """The sensor model of a TOML file. `LidarcheckError` names each fault with its line and what to do."""
    from lidarcheck.model.files.model_file import load_model

    return load_model(path)


def read_case(path: Path, *, fewest: int = 1) -> Case:
    """Measured frames, what their beams meet, and the model: a directory with `case.toml`, or that file.

    Damaged frames are left out with a warning. `LidarcheckError` where files do not fit together or fewer than `fewest`
    frames can be used. `explain` needs three frames, `calibrate` one.
    """
    from lidarcheck.cases.case import load_case

    return load_case(path, fewest=fewest)


def write_scan(scan: Scan, path: Path) -> None:
    """Write echoes in the format of the suffix; the file is there whole or not at all."""
    from lidarcheck.formats import save_scan

    save_scan(scan, path)


def write_model(model: Model, path: Path) -> None:
    """Write a model as TOML, so that `read_model` gives an equal one; the file is there whole or not at all."""
    from lidarcheck.model.files.model_file import save_model

    save_model(model, path)


def calibrate(
    case: Case,
    free: Sequence[str],
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    starts: Mapping[str, float] | None = None,
    fixed: Mapping[str, float | None] | None = None,
    rounds: int = 8,
    seed: int = 0,
    jobs: int = 1,
) -> Calibration:
    """Fit named parameters of a case's model to its frames.

    `free`: names as `lidarcheck calibrate --free` takes them, such as "signal_at_1m" or "effects.fog.mor_m". `bounds`
    and `starts`: by name. `fixed`: names that stay, each at a value or, with None, at the model's own. `rounds`: the
    most before the last fit. `jobs`: threads; they change the time, never the result. `LidarcheckError` for what is no
    parameter or cannot be fitted.
    """
    from lidarcheck.calibration.parameters.workflow import Request
    from lidarcheck.calibration.parameters.workflow import calibrate as run

    request = Request(tuple(free), bounds or {}, starts or {}, fixed or {})
    return run(case, request, seed=seed, jobs=jobs, rounds=rounds)
