"""A small street for tests of the gap workflow: a road, a wall, a panel, a sign that retro-reflects, and sky."""

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from lidarcheck.cases.case import Case
from lidarcheck.cases.frame import Frame
from lidarcheck.effects import Effect
from lidarcheck.model import Model, simulate
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Material, Sensor
from reference_grid import beam_directions

WALL, PANEL, ROAD, SIGN = 1, 2, 3, 4
MATERIALS = {
    WALL: Material("wall", 0.3),
    PANEL: Material("panel", 0.6),
    ROAD: Material("road", 0.15),
    SIGN: Material("sign", 0.5, "retro", 800.0),
}


def model(*effects: Effect) -> Model:
    """The sensor with these effects, in their places."""
    built = Model(Sensor.of("SMART"), MATERIALS)
    for effect in effects:
        built = built.with_(effect)
    return built


def street(
    k: int,
    *,
    layers: Iterable[int] = range(230, 290, 3),
    points: Iterable[int] = range(320, 640, 16),
    sign: bool = False,
) -> IdealScan:
    """Frame k of a drive: a wall that recedes to the right, a panel before it, the road below, sky above layer 280."""
    layer, point = (a.ravel() for a in np.meshgrid(list(layers), list(points), indexing="ij"))
    direction = beam_directions(layer, point)
    normal = np.array([1.0, 1.5, 0.0]) / np.hypot(1.0, 1.5)
    wall_m = (12.0 + 4.0 * k) / (direction @ normal)
    road_m = np.where(direction[:, 2] < 0.0, 0.4 / np.maximum(-direction[:, 2], 1e-9), np.inf)
    distance, material = np.minimum(wall_m, road_m), np.where(road_m < wall_m, ROAD, WALL)
    panel = (np.abs(point - (420 + 20 * k)) < 36) & (np.abs(layer - 262) < 10)
    distance, material = np.where(panel, 8.0 + 2.0 * k, distance), np.where(panel, PANEL, material)
    if sign:
        plate = (np.abs(point - 560) < 34) & (np.abs(layer - 270) < 6)
        distance, material = np.where(plate, 7.0 + 2.0 * k, distance), np.where(plate, SIGN, material)
    distance = np.where(layer > 280, 0.0, distance)
    cosine = np.select([material == ROAD, material == WALL], [-direction[:, 2], direction @ normal], direction[:, 0])
    incidence = np.rad2deg(np.arccos(cosine.clip(0.0, 1.0)))
    return IdealScan(layer, point, distance, material, incidence, object_id=material)


def frames(
    true: Model, count: int = 2, *, seed: int = 77, changed: Callable[[Scan], Scan] | None = None, **how: object
) -> tuple[Frame, ...]:
    """Frames that a sensor like `true` measured; `changed`: what is done to its scans by hand."""
    found = []
    for k in range(count):
        ideal = street(k, **how)  # type: ignore[arg-type]
        scan = simulate(ideal, true, seed=seed, frame=k, threads=1)
        found.append(Frame(k, ideal, changed(scan) if changed else scan, 0.1 * k))
    return tuple(found)


def case(true: Model, believed: Model, count: int = 4, **how: object) -> Case:
    """A case in memory: measured by `true`, explained from `believed`."""
    return Case(Path(), believed, Path("model.toml"), frames(true, count, **how))  # type: ignore[arg-type]


def at_ranges(scan: Scan, range_m: np.ndarray) -> Scan:
    """The same echoes at other ranges."""
    return Scan.from_beams(
        scan.layer, scan.point, range_m, echo_number=scan.echo_number, width_ns=scan.width_ns, area=scan.area,
        peak=scan.peak,
    )  # fmt: skip


def ripple(scan: Scan) -> Scan:
    """Ranges off by 0.3 m in a wave of 24 m along the range: what no effect of the catalogue does."""
    return at_ranges(scan, scan.range_m + 0.3 * np.sin(2.0 * np.pi * scan.range_m / 24.0))


def together(*scans: Scan) -> Scan:
    """The echoes of several scans in one table, as they come."""
    names = ("layer", "point", "range_m", "echo_number", "width_ns", "area", "peak")
    layer, point, range_m, number, width, area, peak = (
        np.concatenate([getattr(scan, name) for scan in scans]) for name in names
    )
    return Scan.from_beams(layer, point, range_m, echo_number=number, width_ns=width, area=area, peak=peak)


COLUMNS = ("x_m", "y_m", "z_m", "layer", "point", "echo_number", "width_ns", "area", "peak")


def same(one: Scan, other: Scan, columns: Iterable[str] = COLUMNS) -> bool:
    """Whether two scans have the same echoes, bit by bit."""
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in columns)
