"""`lidarcheck compare` of two directories: frame after frame, the KPIs over all of them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarcheck.cli.core.outputs import json_text, write_result
from lidarcheck.cli.core.terminal import columns, emit, note, number_text, progress, table
from lidarcheck.errors import InputError

if TYPE_CHECKING:
    from lidarcheck.formats.geometry import Placement
    from lidarcheck.kpi.over_frames import FrameKpi
    from lidarcheck.model import Model
    from lidarcheck.scan import IdealScan, Scan

__all__ = ["compare_frames", "geometry_notes", "pairs_of"]

SUFFIXES = (".txt", ".csv", ".pcd", ".las", ".laz", ".ply", ".parquet")
COLUMNS = columns("KPI", "of", "frames", "median", "5 %", "95 %", "unit", right=("frames", "median", "5 %", "95 %"))


def pairs_of(measured: Path, simulated: Path) -> list[tuple[Path, Path]]:
    """The frames of two directories that have the same name but for its ending, in the order of the names.

    `InputError` where a frame of one has none in the other, or two have one name.
    """
    sides = [_frames(directory) for directory in (measured, simulated)]
    for mine, theirs, directory in ((sides[0], sides[1], simulated), (sides[1], sides[0], measured)):
        alone = sorted(set(mine) - set(theirs))
        if alone:
            what = f"has no frame beside it in {directory}"
            more = f", nor have {len(alone) - 1} more" if len(alone) > 1 else ""
            raise InputError(f"{what}{more}", file=mine[alone[0]], fix="give the frames the same names on both sides")
    return [(sides[0][name], sides[1][name]) for name in sorted(sides[0])]


def _frames(directory: Path) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for path in sorted(directory.iterdir()):
        if path.suffix.lower() in SUFFIXES and not path.name.startswith("."):
            if other := found.get(path.stem):
                raise InputError(f"is named as {other.name}", file=path, fix="keep one of the two")
            found[path.stem] = path
    if not found:
        raise InputError("holds no frame", file=directory, fix=f"name a directory of {', '.join(SUFFIXES)} files")
    return found


def compare_frames(
    measured: Path, simulated: Path, ideal: Path | None, model: Model | None, json: str | None, placement: Placement
) -> None:
    """Compare the frames of two directories, each read and forgotten; `ideal`: of all, or a directory with one each."""
    from lidarcheck.formats import load_ideal, load_scan
    from lidarcheck.kpi.compare import compare
    from lidarcheck.kpi.over_frames import OverFrames

    pairs = pairs_of(measured, simulated)
    scenes = None if ideal is None or not ideal.is_dir() else dict(pairs_of(measured, ideal))
    common = load_ideal(ideal) if ideal is not None and scenes is None else None
    together, each = OverFrames(), []
    with progress("comparing") as show:
        for done, (one, other) in enumerate(pairs):
            show(done, len(pairs), one.name)
            scene = load_ideal(scenes[one]) if scenes is not None else common
            files = {"measured": one, "simulated": other}
            scans = load_scan(one, placement), load_scan(other)
            said = geometry_notes(*scans, scene, one, other)
            found = compare(*scans, scene, model=model, files=files)
            together.add(found)
            each.append({"measured": str(one), "simulated": str(other), **found.to_dict(), "geometry": said})
    for said in [text for one in each for text in one["geometry"]]:
        note(said)
    _tell(together.kpis(), each, json)


def geometry_notes(
    measured: Scan, simulated: Scan, ideal: IdealScan | None, file: Path, simulated_file: Path
) -> list[str]:
    """What is to be said before any KPI: what was not checked, warned of, or may not belong together.

    `InputError` where the scans do not show one scene.
    """
    from lidarcheck.cases.same_scene import check_scene_of
    from lidarcheck.formats.geometry import words

    said = []
    for scan, path in ((measured, file), (simulated, simulated_file)):
        if scan.geometry.verdict != "ok":
            said.append(f"{path}: {words(scan.geometry)}")
        if ideal is not None:
            said.append(check_scene_of(scan, ideal, path, "the ideal scan"))
    said.append(check_scene_of(measured, simulated, file, str(simulated_file)))
    return [text for text in said if text]


def _tell(kpis: list[FrameKpi], each: list[dict[str, Any]], json: str | None) -> None:
    if json is not None:
        write_result(json, json_text({"over_frames": [kpi._asdict() for kpi in kpis], "frames": each}))
    if json != "-":
        emit(table(COLUMNS, [_row(kpi) for kpi in kpis]))
    reasons = {f"{name}: {why}" for one in each for name, why in one["left_out"].items()}
    for reason in sorted(reasons):
        note(f"not compared: {reason}")


def _row(kpi: FrameKpi) -> tuple[str, ...]:
    return kpi.kpi, kpi.of, str(kpi.frames), *map(number_text, (kpi.median, kpi.low, kpi.high)), kpi.unit
