"""Whether measured frame, ideal scan and simulated frame belong together: said before they are compared."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from lidarcheck.calibration.scenes.frame import SceneFrame
from lidarcheck.errors import InputError, UsageError
from lidarcheck.kpi.pairing import Pairing, ranges
from lidarcheck.rays import Caster, Rays
from lidarcheck.scan import IdealScan, Scan

__all__ = ["GROUPINGS", "check_beams", "check_frame", "check_grouping", "check_pairing", "check_scene", "grouping"]

GROUPINGS = ("object", "material", "surface")
DOUBTFUL_ON_SURFACE, COMPARABLE, MOST_BEHIND = 0.5, 0.6, 0.25
"""Shares of a frame's echoes: from a surface below which a frame is doubtful where the simulated one has more than the
second; and behind all surfaces, above which it is of another scene."""
NEAR_SENSOR_M = 15.0
"""An echo nearer than this on a beam that meets nothing may be fog or rain."""
FEWEST_ECHOES = 100
SAMPLED_BEAMS = 2000
SAME_M, SAME_SHARE = 1.5, 0.02
"""How far a surface may lie from where the scene at rest has it: sensor and objects may move while a frame is swept."""

_log = logging.getLogger(__name__)


def check_frame(frame: SceneFrame) -> None:
    """Refuse a frame without echoes or surfaces, and echoes of other beams than the ideal scan's."""
    if not len(frame.ideal) or not np.any(frame.ideal.distance_m > 0.0):
        raise InputError("no beam meets a surface", file=_name(frame.ideal_file), fix="name the frame's ideal scan")
    for side, scan, file in (
        ("measured", frame.measured, frame.file),
        ("simulated", frame.simulated, frame.simulated_file),
    ):
        if not len(scan):
            raise InputError(f"the {side} frame holds no echoes", file=_name(file), fix="check the file or the model")
        check_beams(scan, frame.ideal, side, file)


def check_beams(scan: Scan, ideal: IdealScan, side: str, file: str) -> None:
    """Refuse echoes on beams that the ideal scan does not have."""
    layers, points = ideal.beams.layers, ideal.beams.points
    fired = np.zeros((layers + 1, points + 1), dtype=np.bool_)
    fired[ideal.layer, ideal.point] = True
    known = (scan.layer >= 0) & (scan.layer < layers) & (scan.point >= 0) & (scan.point < points)
    strange = ~fired[np.where(known, scan.layer, layers), np.where(known, scan.point, points)]
    if not strange.any():
        return
    row = int(np.flatnonzero(strange)[0])
    what = (
        f"{int(strange.sum())} of {len(scan)} {side} echoes are on beams that the ideal scan does not have, the first "
    )
    what += f"on Layer {scan.layer[row]}, Point {scan.point[row]}; they span {_span(scan.layer, scan.point)}, "
    what += f"the ideal scan's {_span(ideal.layer, ideal.point)}"
    fix = "compare with the ideal scan of the same frame and beam grid, which has a row for every fired beam"
    raise InputError(what, file=_name(file), fix=fix)


def _span(layer: np.ndarray, point: np.ndarray) -> str:
    return f"layers {layer.min()} to {layer.max()} and points {point.min()} to {point.max()}"


def check_scene(ideal: IdealScan, scene: Caster, name: str, file: str) -> None:
    """Refuse a scene that the ideal scan was not cast from: its objects would have the names of others."""
    rows = np.flatnonzero(ideal.distance_m > 0.0)
    rows = rows[:: max(len(rows) // SAMPLED_BEAMS, 1)]
    if not len(rows):
        return
    nothing = np.zeros(len(rows))
    layer, point = ideal.layer[rows], ideal.point[rows]
    origins = ideal.beams.origins_m(layer, point)
    start = np.zeros((len(rows), 3)) if origins is None else origins
    rays = Rays(start, ideal.beams.directions(layer, point), nothing, nothing.astype(np.int64))
    there = ideal.distance_m[rows]
    share = float(np.mean(np.abs(scene.cast(rays).distance_m - there) <= SAME_M + SAME_SHARE * there))
    if share < DOUBTFUL_ON_SURFACE:
        what = f"was not cast from the scene {name}: {100.0 * share:.0f} % of its beams meet something at that distance"
        raise InputError(what, file=_name(file), fix="name its own scene with --scene, or leave that out")


def check_pairing(frame: SceneFrame, measured: Pairing, simulated: Pairing) -> None:
    """Refuse a measured frame of another scene: few echoes on surfaces, where the simulated ones are, and many behind.

    Fog and rain show echoes before the surfaces and none behind; they are compared, with a warning where they rule.
    A simulated frame of another scene is refused as well.
    """
    own, other = (float(np.mean(pairing.of_surface)) for pairing in (measured, simulated))
    _check_simulated(frame, simulated, own, other)
    if len(measured.of_surface) < FEWEST_ECHOES or other < COMPARABLE or own >= DOUBTFUL_ON_SURFACE:
        return
    behind = _behind(frame.measured, measured)
    what = f"only {100.0 * own:.0f} % of the measured echoes lie within 2 m of a surface of their beam"
    what += f" ({100.0 * other:.0f} % of the simulated)"
    if float(np.mean(behind)) > MOST_BEHIND:
        what += f", and {100.0 * float(np.mean(behind)):.0f} % behind it, or where there is none: this is another scene"
        raise InputError(what, file=_name(frame.file), fix="name the ideal scan of the same frame, scene and pose")
    _log.warning("%s: %s: is it the same frame, scene and pose as the ideal scan?", frame.file or "measured", what)


def _check_simulated(frame: SceneFrame, simulated: Pairing, own: float, other: float) -> None:
    """Refuse a simulated frame of another scene; `own`, `other`: shares from a surface, measured and simulated."""
    if len(simulated.of_surface) < FEWEST_ECHOES or own < COMPARABLE or other >= DOUBTFUL_ON_SURFACE:
        return
    behind = float(np.mean(_behind(frame.simulated, simulated)))
    if behind > MOST_BEHIND:
        what = f"only {100.0 * other:.0f} % of the simulated echoes lie within 2 m of a surface of their beam"
        what += f" ({100.0 * own:.0f} % of the measured), and {100.0 * behind:.0f} % behind it, or where there is none:"
        what += " this is another scene"
        raise InputError(what, file=_name(frame.simulated_file), fix="simulate the ideal scan that --ideal names")


def _behind(scan: Scan, pairing: Pairing) -> np.ndarray:
    """Echoes behind all surfaces of their beam, or where there is none; shape (echoes,)."""
    met = pairing.distance_m[pairing.echo_beam]
    return np.asarray(~pairing.of_surface & (ranges(scan) > np.where(met > 0.0, met, NEAR_SENSOR_M)))


def grouping(ideals: Sequence[IdealScan], by: str | None) -> str:
    """What the parts of the scene are: as asked, else the first of `GROUPINGS` that tells more than one apart."""
    check_grouping(by)
    with_objects = all(ideal.object_id is not None for ideal in ideals)
    if by == "object" and not with_objects:
        file = next(ideal.file for ideal in ideals if ideal.object_id is None)
        raise InputError("has no ObjectID", file=_name(file), fix="use --by material or --by surface")
    if by is not None:
        return by
    if with_objects and any(_several(ideal, ideal.object_id) for ideal in ideals):
        return "object"
    return "material" if any(_several(ideal, ideal.material_id) for ideal in ideals) else "surface"


def check_grouping(by: str | None) -> None:
    """Refuse what is none of `GROUPINGS`."""
    if by is not None and by not in GROUPINGS:
        raise UsageError(f"there are no parts by {by!r}", fix=f"use one of {', '.join(GROUPINGS)}")


def _several(ideal: IdealScan, numbers: np.ndarray | None) -> bool:
    return numbers is not None and len(np.unique(numbers[ideal.distance_m > 0.0])) > 1


def _name(file: str) -> str | None:
    return file or None
