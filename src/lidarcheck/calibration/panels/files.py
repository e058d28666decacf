"""Panels from files: which frames and ideal scans show one scene, and where a result came from."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from lidarcheck.calibration.panels.workflow import Arrangement, PanelFrame
from lidarcheck.cases.source import Named, ideal_of, scan_of
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.kpi.scenes import same_scene
from lidarcheck.kpi.variant import OneVariant
from lidarcheck.model import Model, simulate
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = ["arrangements_of", "provenance"]

_SEEDS = 2**64


def arrangements_of(
    measured: Sequence[Named],
    ideals: Sequence[Named],
    simulated: Sequence[Named],
    model: Model | None,
    seed: int,
    placement: Placement = AS_IT_IS,
    sensor: Sensor | None = None,
) -> Iterator[Arrangement]:
    """The frames by the scene that they show: those of ideal scans that say the same belong together.

    A frame of another variant than the model's, or than the frames before, is refused when it is read. `placement`:
    what is declared of the measured files; `sensor`: what measured, else the model's.
    """
    own = sensor if model is None else model.sensor
    variant = OneVariant(model, sensor)
    real = [_frame(path, variant, own, placement) for path in measured]
    if len(ideals) < 2:
        scene = ideal_of(ideals[0], own) if ideals else None
        made = (
            [_frame(path, variant, own) for path in simulated]
            if scene is None or model is None
            else _made(scene, model, seed, real)
        )
        yield Arrangement(scene, real, made)
        return
    for scene, members in _scenes(ideals, own):
        if model is not None:
            made = _made(scene, model, seed + members[0], [real[i] for i in members])
        else:
            made = [_frame(simulated[i], variant, own) for i in members] if simulated else []
        yield Arrangement(scene, [real[i] for i in members], made)


def _scenes(ideals: Sequence[Named], sensor: Sensor | None) -> list[tuple[IdealScan, list[int]]]:
    """The scenes that differ, each with the numbers of its ideal scans."""
    scenes: list[tuple[IdealScan, list[int]]] = []
    for i, path in enumerate(ideals):
        one = ideal_of(path, sensor)
        members = next((members for other, members in scenes if same_scene(one, other)), None)
        if members is None:
            scenes.append((one, [i]))
        else:
            members.append(i)
    return scenes


def _frame(path: Named, variant: OneVariant, sensor: Sensor | None, placement: Placement = AS_IT_IS) -> PanelFrame:
    def load() -> Scan:
        scan = scan_of(path, placement, sensor)
        variant.check(scan, str(path))
        return scan

    return PanelFrame(str(path), load)


def _made(scene: IdealScan, model: Model, seed: int, real: Sequence[PanelFrame]) -> list[PanelFrame]:
    """As many simulated frames as real ones, the seed counted up."""
    seeds = [(seed + i) % _SEEDS for i, _ in enumerate(real)]
    return [PanelFrame(f"simulated, seed {s}", partial(simulate, scene, model, seed=s)) for s in seeds]


def provenance(origin: Mapping[str, Sequence[Named]], command: str, seed: int | None = None) -> dict[str, str]:
    """The files with the beginnings of their SHA-256, and the command."""
    said = {
        kind: ", ".join(f"{path} {hashlib.sha256(Path(path).read_bytes()).hexdigest()[:16]}" for path in paths)
        for kind, paths in origin.items()
        if paths
    }
    if seed is not None:
        said["seed"] = f"{seed}, counted up"
    return {**said, "command": command}
