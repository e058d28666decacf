"""A whole measured frame beside the model's: cover, KPIs of each object and sector, and where the two disagree most.

The ideal scan says what every beam meets. Run through the model, with the effects that are asked for, it gives a
simulated frame, and with other random numbers a second one: what these two differ by is chance, and the measure of what
measured and simulated differ by.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.scenes.checks import check_frame, check_pairing, grouping
from lidarcheck.calibration.scenes.frame import SceneFrame
from lidarcheck.calibration.scenes.groups import groups_of, labels_of, sector_edges
from lidarcheck.calibration.scenes.parts import (
    Part,
    SectorMap,
    by_layer,
    finite,
    layer_angles_deg,
    parts_of,
    sectors_of,
)
from lidarcheck.calibration.scenes.rank import Ranking, rank
from lidarcheck.calibration.scenes.units import (
    FEATURES,
    Units,
    Values,
    features_in,
    joined_units,
    joined_values,
    units_of,
    values_of,
)
from lidarcheck.calibration.scenes.words import Disagreement, disagreement
from lidarcheck.errors import UsageError
from lidarcheck.formats.plain import plain
from lidarcheck.kpi.compare import feature_gap
from lidarcheck.kpi.comparison import FeatureGap
from lidarcheck.kpi.overlap import RADIUS_M, Overlap, overlap
from lidarcheck.kpi.scenes import number_of_scenes
from lidarcheck.scan import Scan

__all__ = ["MOST_SECTORS", "SceneComparison", "compare_scene"]

SECTORS = (12, 6)
MOST_SECTORS = 100
FLOOR_EVERY = 10


@dataclass(frozen=True)
class SceneComparison:
    """What a scene comparison found.

    `by`: what the parts are, "object", "material" or "surface". `scenes`: how many the frames show, by their ideal
    scans; maps and parts hold them together. `overlap`: of each frame; `overlap_floor`: of two
    simulations of the first, looked at from a tenth of the points, None without a second. `features`: over all echoes
    from a surface. `disagreements`: the largest first; `more`: groups that also stand out and are not listed;
    `bound_z`, `tests`: of `scene_compare_rank`. `layer_echo`: by layer (from 0) the share of beams with an echo,
    measured and simulated; NaN without beams; `layer_deg`: their elevations. `worst_points`: of the first
    disagreement, both sides, shape (n, 3) [m].
    """

    by: str
    frames: int
    scenes: int
    beams: int
    echoes_measured: int
    echoes_simulated: int
    has_floor: bool
    overlap: tuple[Overlap, ...]
    overlap_floor: Overlap | None
    features: Mapping[str, FeatureGap]
    parts: tuple[Part, ...]
    sectors: SectorMap
    disagreements: tuple[Disagreement, ...]
    more: int
    bound_z: float
    tests: int
    layer_echo: FloatArray = field(repr=False)
    layer_deg: FloatArray = field(repr=False)
    worst_points: tuple[FloatArray, FloatArray] = field(repr=False)
    left_out: Mapping[str, str] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """The result for JSON, without the points."""
        document: dict[str, Any] = plain(replace(self, worst_points=(np.zeros(0), np.zeros(0))))
        del document["worst_points"]
        return document


def compare_scene(
    frames: Sequence[SceneFrame],
    *,
    by: str | None = None,
    sectors: tuple[int, int] = SECTORS,
    radius_m: float = RADIUS_M,
    names: Mapping[int, str] | None = None,
    materials: Mapping[int, str] | None = None,
) -> SceneComparison:
    """Compare measured frames with what a model shows of the same scene; frames of one scene are taken together.

    `by`: what a part is; by default the objects, else the materials, else connected surfaces, whichever the ideal scan
    tells apart. `sectors`: columns of azimuth, rows of elevation. `names`, `materials`: of objects and materials by
    number, for words. `InputError` names the file of what does not belong together.
    """
    if not frames:
        raise UsageError("there is no frame to compare", fix="give a measured frame and its ideal scan")
    if min(sectors) < 1 or max(sectors) > MOST_SECTORS:
        raise UsageError(f"{sectors[0]} by {sectors[1]} sectors", fix=f"use 1 to {MOST_SECTORS} along either axis")
    for frame in frames:
        check_frame(frame)
    with ThreadPoolExecutor(1) as beside:
        # Two fifths of the time, most of it outside of Python: it takes the core that the rest leaves idle.
        covers = beside.submit(_covers, frames, radius_m)
        found = _without_covers(frames, by, sectors, names or {}, materials or {})
    near, floor = covers.result()
    return replace(found, overlap=near, overlap_floor=floor)


def _without_covers(
    frames: Sequence[SceneFrame],
    by: str | None,
    sectors: tuple[int, int],
    names: Mapping[int, str],
    materials: Mapping[int, str],
) -> SceneComparison:
    """All of the comparison but for the overlap of the clouds."""
    kind = grouping([frame.ideal for frame in frames], by)
    units, (m, a, b) = _values(frames, kind)
    edges = sector_edges(units, *sectors)
    numbers = {} if kind == "surface" else names if kind == "object" else materials
    kinds = groups_of(units, kind, edges, numbers, materials)
    ranking = rank(m, a, b, kinds)
    own = set(m.of) & set(a.of) - {f.name for f in FEATURES}
    return SceneComparison(
        by=kind,
        frames=len(frames),
        scenes=number_of_scenes(frame.ideal for frame in frames),
        beams=int(np.count_nonzero(units.first)),
        echoes_measured=sum(len(frame.measured) for frame in frames),
        echoes_simulated=sum(len(frame.simulated) for frame in frames),
        has_floor=b is not None,
        overlap=(),
        overlap_floor=None,
        features=_features(m, a),
        parts=parts_of(kinds[1], units, m, a, ranking),
        sectors=sectors_of(units, edges, m, a, ranking),
        disagreements=tuple(disagreement(found, units, m, a, b) for found in ranking.findings),
        more=ranking.more,
        bound_z=ranking.bound_z,
        tests=ranking.tests,
        layer_echo=by_layer(units, m, a),
        layer_deg=layer_angles_deg(units),
        worst_points=_worst(frames, units, ranking),
        left_out={
            f.name: f"not in every scan: {f.column}"
            for f in FEATURES
            if (f.name not in m.of or f.name not in a.of) and not (own and f.column)
        },
    )


def _values(frames: Sequence[SceneFrame], by: str) -> tuple[Units, tuple[Values, Values, Values | None]]:
    """The units of all frames and the values measured, simulated and simulated again."""
    parts: list[Units] = []
    values: tuple[list[Values], list[Values], list[Values]] = ([], [], [])
    for number, frame in enumerate(frames):
        units = units_of(frame.ideal, labels_of(frame.ideal, by), number)
        parts.append(units)
        pairings = []
        for scan, kept in zip((frame.measured, frame.simulated, frame.again), values, strict=True):
            if scan is not None:
                shown, pairing = values_of(units, frame.ideal, scan)
                kept.append(shown)
                pairings.append(pairing)
        check_pairing(frame, pairings[0], pairings[1])
    m, a, b = values
    return joined_units(parts), (joined_values(m), joined_values(a), joined_values(b) if len(b) == len(a) else None)


def _covers(frames: Sequence[SceneFrame], radius_m: float) -> tuple[tuple[Overlap, ...], Overlap | None]:
    """How well each frame covers its simulation, and a simulation another one."""
    near = tuple(overlap(_xyz(f.measured), _xyz(f.simulated), radius_m=radius_m) for f in frames)
    return near, _floor(frames[0], radius_m)


def _floor(frame: SceneFrame, radius_m: float) -> Overlap | None:
    if frame.again is None:
        return None
    return overlap(_xyz(frame.simulated), _xyz(frame.again), radius_m=radius_m, every=FLOOR_EVERY)


def _xyz(scan: Scan) -> FloatArray:
    return np.stack([scan.x_m, scan.y_m, scan.z_m], axis=-1)


def _features(m: Values, a: Values) -> dict[str, FeatureGap]:
    """Distances of the distributions, over all units that have an echo."""
    return {
        f.name: feature_gap(finite(m.of[f.name]), finite(a.of[f.name]), unit=f.unit)
        for f in features_in(m, a)
        if not f.counts
    }


def _worst(frames: Sequence[SceneFrame], units: Units, ranking: Ranking) -> tuple[FloatArray, FloatArray]:
    """Echoes, measured and simulated, on the beams of the first finding that is a part of the frame, shapes (n, 3)."""
    found = next((f for f in ranking.findings if f.kind != "frame"), None)
    if found is None:
        return np.zeros((0, 3)), np.zeros((0, 3))
    frame = int(np.bincount(units.frame[found.units]).argmax())
    own = found.units & (units.frame == frame)
    beams = np.unique(units.layer[own] << 32 | units.point[own])
    clouds = []
    for scan in (frames[frame].measured, frames[frame].simulated):
        on = np.isin(scan.layer.astype(np.int64) << 32 | scan.point, beams)
        clouds.append(_xyz(scan.take(on)))
    return clouds[0], clouds[1]
