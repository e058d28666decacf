"""`lidarcheck compare` of many frames: one after another, the KPIs over all of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarcheck.cli.core.outputs import json_text, with_origin, write_result
from lidarcheck.cli.core.terminal import columns, emit, note, number_text, progress, table

if TYPE_CHECKING:
    from lidarcheck.cases.source import FrameFile
    from lidarcheck.formats.geometry import Placement
    from lidarcheck.kpi.over_frames import FrameKpi
    from lidarcheck.model import Model
    from lidarcheck.scan import IdealScan, Scan

__all__ = ["compare_frames", "geometry_notes"]

COLUMNS = columns("KPI", "of", "frames", "median", "5 %", "95 %", "unit", right=("frames", "median", "5 %", "95 %"))


def compare_frames(
    measured: Sequence[FrameFile],
    simulated: Sequence[FrameFile],
    ideal: Path | None,
    model: Model | None,
    json: str | None,
    placement: Placement,
) -> None:
    """Compare the frames of two sides, each read and forgotten; `ideal`: of all, or one for each."""
    from lidarcheck.cases.partners import paired
    from lidarcheck.cases.source import frames_in, ideal_of, scan_of
    from lidarcheck.kpi.compare import compare
    from lidarcheck.kpi.over_frames import OverFrames

    pairs = list(zip(measured, paired(measured, simulated), strict=True))
    ideals = [] if ideal is None else frames_in(ideal)
    scenes = paired(measured, ideals) if len(ideals) > 1 else []
    common = ideal_of(ideals[0]) if len(ideals) == 1 else None
    together, each = OverFrames(), []
    with progress("comparing") as show:
        for done, (one, other) in enumerate(pairs):
            show(done, len(pairs), one.name)
            scene = ideal_of(scenes[done]) if scenes else common
            files = {"measured": str(one), "simulated": str(other)}
            scans = scan_of(one, placement), scan_of(other)
            said = geometry_notes(*scans, scene, Path(str(one)), Path(str(other)))
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
        write_result(json, json_text(with_origin({"over_frames": [kpi._asdict() for kpi in kpis], "frames": each})))
    if json != "-":
        emit(table(COLUMNS, [_row(kpi) for kpi in kpis]))
    reasons = {f"{name}: {why}" for one in each for name, why in one["left_out"].items()}
    for reason in sorted(reasons):
        note(f"not compared: {reason}")


def _row(kpi: FrameKpi) -> tuple[str, ...]:
    return kpi.kpi, kpi.of, str(kpi.frames), *map(number_text, (kpi.median, kpi.low, kpi.high)), kpi.unit
