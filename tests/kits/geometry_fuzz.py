"""Scans of the scenarios made wrong, or left right, at random; and what the tool says of each.

A wrong is silent where nothing is refused, warned of, doubted, or said to be not checked: neither where the file is
read nor where it meets its ideal scan.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.cases.same_scene import Surfaces, compare_scenes
from lidarcheck.errors import InputError
from lidarcheck.formats.geometry.placement import rotation
from lidarcheck.formats.geometry.unit import METRES
from lidarcheck.formats.scans import scan_from_table
from lidarcheck.formats.table import Table
from lidarcheck.harness.scenario.scenario import Scenario, load_scenario
from lidarcheck.model.chain import simulate
from lidarcheck.rays import Rays
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import reference_beams
from reference_grid import beam_directions

NOTICEABLE_LAYERS = 0.2
"""A layer that is off by less, once the whole is turned to fit, lies at the limit of what is warned of."""
FEWEST_ROWS = 300
FRAME_S, SPEED_M_S = 0.04, 20.0
MOVING = ("scene_city_street", "scene_highway", "scene_wet_road")
"""Scenes that the sensor is driven through for the ideal scan of a wrong frame."""


@dataclass(frozen=True)
class Trial:
    """One scan that was tried: what was made of which example, what was said, and whether it was right."""

    kind: str
    example: str
    outcome: str
    said: str = ""


@dataclass(frozen=True)
class Example:
    """A scenario, simulated. `frames`: ideal scans and scans of a drive, where the scene can be driven through."""

    name: str
    ideal: IdealScan
    scan: Scan
    frames: tuple[tuple[IdealScan, Scan], ...] = ()


@cache
def example(path: Path) -> Example | None:
    """A scenario, simulated with seed 0; None where it shows too few echoes, or another sensor than the built-in ones,
    in whose steps the wrongs are."""
    scenario = load_scenario(path)
    if scenario.ideal.beams != reference_beams():
        return None
    scan = simulate(scenario.ideal, scenario.model, seed=0, scene=scenario.scene)
    frames = _drive(scenario) if path.stem.startswith(MOVING) else ()
    return Example(path.stem, scenario.ideal, scan, frames) if len(scan) >= FEWEST_ROWS else None


def _drive(scenario: Scenario) -> tuple[tuple[IdealScan, Scan], ...]:
    """Three frames of a scene that the sensor is driven through, over the whole sweep: ideal scan and echoes."""
    assert scenario.scene is not None
    layer, point = (a.ravel() for a in np.meshgrid(np.arange(60, 460, 8), np.arange(0, 960, 8), indexing="ij"))
    n, frames = len(layer), []
    for k in range(3):
        origin = np.tile([SPEED_M_S * FRAME_S * k, 0.0, 0.0], (n, 1))
        rays = Rays(origin, beam_directions(layer, point), np.zeros(n), np.zeros(n, dtype=np.int32))
        hits = scenario.scene.cast(rays)
        ideal = IdealScan(layer, point, hits.distance_m, hits.material_id, np.clip(hits.incidence_deg, 0.0, 90.0))
        frames.append((ideal, simulate(ideal, scenario.model, seed=0, frame=k)))
    return tuple(frames)


def table_of(scan: Scan, xyz: FloatArray, decimals: int, *, bare: bool = False) -> Table:
    columns = dict(zip("XYZ", np.round(xyz, decimals).T, strict=True))
    if not bare:
        columns |= {"Layer": scan.layer, "Point": scan.point}
    columns |= {"EchoNumber": scan.echo_number, "PEAK": scan.peak, "AREA": scan.area, "WIDTH": scan.width_ns}
    return Table({name: np.ascontiguousarray(column) for name, column in columns.items()})


def xyz_of(scan: Scan) -> FloatArray:
    return np.stack([scan.x_m, scan.y_m, scan.z_m], axis=-1)


def right(one: Example, rng: np.random.Generator) -> Trial:
    """Some rows of an example, in some order, rounded to some decimals, in some unit that is declared."""
    scan = some_rows(one.scan, rng)
    decimals = int(rng.integers(3, 7))
    return judged("right", one, table_of(scan, xyz_of(scan), decimals), one.ideal)


def some_rows(scan: Scan, rng: np.random.Generator) -> Scan:
    """A run of the scan's rows of at least `FEWEST_ROWS`, now and then shuffled."""
    n = int(rng.integers(FEWEST_ROWS, len(scan) + 1))
    start = int(rng.integers(0, len(scan) - n + 1))
    rows = np.arange(start, start + n)
    return scan.take(rng.permutation(rows) if rng.random() < 0.3 else rows)


def mirror(one: Example, rng: np.random.Generator) -> Trial:
    sign = np.ones(3)
    sign[rng.integers(3)] = -1.0
    return wrong("mirror", one, rng, lambda s: xyz_of(s) * sign)


def axes(one: Example, rng: np.random.Generator) -> Trial:
    order = rng.permutation(3)
    if np.array_equal(order, np.arange(3)):
        order = np.array([1, 0, 2])
    signs = rng.choice([-1.0, 1.0], 3)
    return wrong("axes", one, rng, lambda s: xyz_of(s)[:, order] * signs)


def unit(one: Example, rng: np.random.Generator) -> Trial:
    name = str(rng.choice(["mm", "cm", "ft", "in"]))
    return wrong(f"unit {name}", one, rng, lambda s: xyz_of(s) / METRES[name])


def layers(one: Example, rng: np.random.Generator) -> Trial:
    how = str(rng.choice(["layers from the top", "points from the left", "layers shuffled", "layer + 1", "point - 1"]))
    order = rng.permutation(520).astype(np.int32)
    changes: dict[str, Callable[[Scan], Scan]] = {
        "layers from the top": lambda s: replace(s, layer=519 - s.layer),
        "points from the left": lambda s: replace(s, point=959 - s.point),
        "layers shuffled": lambda s: replace(s, layer=order[s.layer]),
        "layer + 1": lambda s: replace(s, layer=s.layer + 1),
        "point - 1": lambda s: replace(s, point=np.maximum(s.point - 1, 0)),
    }
    return wrong(how, one, rng, xyz_of, renumber=changes[how])


def half_beam(one: Example, rng: np.random.Generator) -> Trial:
    kind, turn = (
        ("half a column", rotation(0.0, 0.0, 0.0625))
        if rng.random() < 0.5
        else ("half a layer", rotation(0.0, 0.025, 0.0))
    )
    return wrong(kind, one, rng, lambda s: xyz_of(s) @ turn.T)


def pose(one: Example, rng: np.random.Generator) -> Trial:
    turn, move = rotation(*rng.uniform(-20.0, 20.0, 3)), rng.uniform(-2.0, 2.0, 3)
    return wrong("pose", one, rng, lambda s: (xyz_of(s) - move) @ turn)


def elevation(one: Example, rng: np.random.Generator) -> Trial:
    shift, scale = float(rng.choice([-1.0, 1.0])) * float(rng.uniform(0.1, 2.0)), float(rng.uniform(1.03, 1.3))
    flip = rng.random() < 0.5
    # Of a few layers a scale is a turn but for a tenth of their spacing, which no check can tell from noise.
    layers = np.ptp(one.scan.layer)
    flip = flip or (scale - 1.0) * layers < 2.0 * NOTICEABLE_LAYERS

    def changed(scan: Scan) -> FloatArray:
        xyz = xyz_of(scan)
        up = np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1]))
        up = up + np.deg2rad(shift) if flip else up * scale
        around, r = np.arctan2(xyz[:, 1], xyz[:, 0]), scan.range_m
        return np.stack([r * np.cos(up) * np.cos(around), r * np.cos(up) * np.sin(around), r * np.sin(up)], axis=-1)

    return wrong("elevation shifted" if flip else "elevation scaled", one, rng, changed)


def bare_mirror(one: Example, rng: np.random.Generator) -> Trial:
    return wrong("mirror without beams", one, rng, lambda s: xyz_of(s) * [1.0, -1.0, 1.0], bare=True)


def wrong_frame(one: Example, rng: np.random.Generator) -> Trial:
    """The scan of the frame after (or before) the one whose ideal scan it stands beside."""
    k = int(rng.integers(2))
    (ideal, _), (_, scan) = (one.frames[k], one.frames[k + 1])
    names = {"after": Surfaces.of(one.frames[k + 1][0])}
    if rng.random() < 0.5:
        ideal, scan, names = one.frames[k + 1][0], one.frames[k][1], {"before": Surfaces.of(one.frames[k][0])}
    return judged("wrong frame", one, table_of(scan, xyz_of(scan), 5), ideal, **names)


def right_frame(one: Example, rng: np.random.Generator) -> Trial:
    neighbours = {"before": Surfaces.of(one.frames[0][0]), "after": Surfaces.of(one.frames[2][0])}
    ideal, scan = one.frames[1]
    return judged("right", one, table_of(scan, xyz_of(scan), int(rng.integers(3, 7))), ideal, **neighbours)


WRONGS = (mirror, axes, unit, layers, half_beam, pose, elevation, bare_mirror)


def wrong(
    kind: str,
    one: Example,
    rng: np.random.Generator,
    positions: Callable[[Scan], FloatArray],
    *,
    renumber: Callable[[Scan], Scan] = lambda scan: scan,
    bare: bool = False,
) -> Trial:
    scan = some_rows(one.scan, rng)
    table = table_of(renumber(scan), positions(scan), int(rng.integers(3, 7)), bare=bare)
    return judged(kind, one, table, one.ideal)


def judged(kind: str, one: Example, table: Table, ideal: IdealScan, **neighbours: Surfaces) -> Trial:
    """What is said of a table where it is read, and then where it meets its ideal scan."""
    try:
        scan = scan_from_table(table)
    except InputError as error:
        return Trial(kind, one.name, "refused", error.what)
    geometry = scan.geometry
    found = compare_scenes(scan, Surfaces.of(ideal), **neighbours)
    if found is not None and found.refused:
        return Trial(kind, one.name, "refused", found.what)
    if geometry.verdict == "warning":
        return Trial(kind, one.name, "warned", geometry.note)
    if found is not None and found.doubtful:
        return Trial(kind, one.name, "doubted", found.what)
    if geometry.verdict == "not checked":
        return Trial(kind, one.name, "not checked", geometry.note)
    if found is not None and found.untold(scan) and kind != "right":
        return Trial(kind, one.name, "untold", ", ".join(found.untold(scan)))
    return Trial(kind, one.name, "passed")


def trials(paths: Iterable[Path], wrongs: int, rights: int, seed: int) -> Iterator[Trial]:
    """So many wrongs, each kind as often, and rights, each of an example drawn at random."""
    rng = np.random.default_rng(seed)
    examples = [one for path in paths if (one := example(path)) is not None]
    moving = [one for one in examples if one.frames]
    kinds = [*WRONGS, *([wrong_frame] if moving else [])]
    for i in range(wrongs):
        kind = kinds[i % len(kinds)]
        pool = moving if kind is wrong_frame else examples
        yield kind(pool[rng.integers(len(pool))], rng)
    for i in range(rights):
        if moving and i % 10 == 9:
            yield right_frame(moving[rng.integers(len(moving))], rng)
        else:
            yield right(examples[rng.integers(len(examples))], rng)


def counted(found: Iterable[Trial]) -> Counter[tuple[str, str]]:
    return Counter((trial.kind, trial.outcome) for trial in found)
