"""`lidarcheck compare` of many frames: one after another, the KPIs over all of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.cli.core.terminal import columns, note, number_text, progress
from lidarcheck.cli.scans.compare_results import chance_cells, say, write
from lidarcheck.cli.scans.fail_on import Condition, Value, outcomes

if TYPE_CHECKING:
    from lidarcheck.cases.source import FrameFile
    from lidarcheck.formats.geometry import Placement
    from lidarcheck.kpi.chance.verdict import Verdict
    from lidarcheck.kpi.over_frames import FrameKpi
    from lidarcheck.model import Model
    from lidarcheck.scan import IdealScan, Scan
    from lidarcheck.sensor import Sensor

__all__ = ["compare_frames", "geometry_notes"]

COLUMNS = columns(
    *("KPI", "of", "median", "chance", "unit", "verdict", "frames", "5 %", "95 %"),
    right=("median", "chance", "frames", "5 %", "95 %"),
)


def compare_frames(
    measured: Sequence[FrameFile],
    simulated: Sequence[FrameFile],
    ideal: Path | None,
    model: Model | None,
    sensor: Sensor | None,
    placement: Placement,
    conditions: Sequence[Condition],
    out: Path | None,
    json: str | None,
) -> int:
    """Compare the frames of two sides, each read and forgotten; `ideal`: of all, or one for each; `sensor`: of all.

    The exit code: 1 where a condition is met. What chance gives is over all frames' rows together.
    """
    from lidarcheck.cases.partners import paired
    from lidarcheck.cases.source import frames_in, ideal_of, scan_of, without_masked
    from lidarcheck.kpi.chance.verdict import ChanceTest
    from lidarcheck.kpi.compare import compare
    from lidarcheck.kpi.over_frames import OverFrames
    from lidarcheck.kpi.scenes import same_scene
    from lidarcheck.kpi.variant import OneVariant

    pairs = list(zip(measured, paired(measured, simulated), strict=True))
    ideals = [] if ideal is None else frames_in(ideal, "ideal")
    scenes = paired(measured, ideals) if len(ideals) > 1 else []
    common = ideal_of(ideals[0], sensor) if len(ideals) == 1 else None
    together, each, test, variant = OverFrames(), [], ChanceTest(), OneVariant(model, sensor if model is None else None)
    first, others = common, 0
    with progress("comparing") as show:
        for done, (one, other) in enumerate(pairs):
            show(done, len(pairs), one.name)
            scene = ideal_of(scenes[done], sensor) if scenes else common
            first = scene if first is None else first
            others += scene is not None and first is not None and not same_scene(first, scene)
            files = {"measured": str(one), "simulated": str(other)}
            scans = scan_of(one, placement, sensor), without_masked(one, scan_of(other, sensor=sensor))
            for scan, file in zip(scans, files.values(), strict=True):
                variant.check(scan, file)
            said = geometry_notes(*scans, scene, Path(str(one)), Path(str(other)))
            found = compare(*scans, scene, model=model, sensor=sensor, files=files, look=test.add)
            together.add(found)
            each.append({**files, **found.to_dict(), "geometry": said})
    for said in [text for one in each for text in one["geometry"]]:
        note(said)
    verdict, kpis = test.verdict(), together.kpis()
    left_out = {name: why for one in each for name, why in one["left_out"].items()}
    failed = outcomes(conditions, [Value(k.kpi, _own(k), k.median) for k in kpis], verdict, left_out)
    words = [f"{others} of {len(pairs)} frames show another scene than the first: each KPI is of all of them."]
    frames = {"other_scenes": others, "over_frames": [kpi._asdict() for kpi in kpis], "frames": each}
    document = {**frames, "chance": verdict.to_dict(), "fail_on": failed}
    write(out, json, document, [_record(kpi, verdict) for kpi in kpis], verdict)
    if json != "-":
        say(
            COLUMNS,
            [_row(kpi, verdict) for kpi in kpis],
            verdict,
            [f"{n}: {w}" for n, w in left_out.items()],
            failed,
            words if others else (),
        )
    return int(any(one.met for one in failed))


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


def _own(kpi: FrameKpi) -> str:
    """What the KPI is of, as in a single comparison."""
    return kpi.of.removeprefix("measured ")


def _record(kpi: FrameKpi, verdict: Verdict) -> dict[str, object]:
    """A line of the CSV."""
    chance, word = chance_cells(verdict, kpi.kpi, _own(kpi))
    found = verdict.kpis.get((kpi.kpi, _own(kpi)))
    return {**kpi._asdict(), "chance_95": chance, "verdict": word, "why": "" if found is None else found.not_judged}


def _row(kpi: FrameKpi, verdict: Verdict) -> tuple[str, ...]:
    chance, word = chance_cells(verdict, kpi.kpi, _own(kpi))
    median, chance_text, low, high = map(number_text, (kpi.median, chance, kpi.low, kpi.high))
    return kpi.kpi, kpi.of, median, chance_text, kpi.unit, word, str(kpi.frames), low, high
