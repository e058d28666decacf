"""What tests of single effects share: surroundings without a model, ideal scans, the light of an ideal scan."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from lidarcheck.effects import Effect
from lidarcheck.model import Model, streams
from lidarcheck.model.light import light_of, surface_signal
from lidarcheck.rays import Caster
from lidarcheck.scan import IdealScan, Light, Scan
from lidarcheck.sensor import Material, Sensor

MATERIALS = {
    0: Material("black", 0.0),
    1: Material("wall", 0.4),
    2: Material("white", 1.0),
    3: Material("sign", 0.5, "retro", 1000.0),
}


@dataclass(frozen=True)
class Around:
    """Surroundings of one effect."""

    ideal: IdealScan
    sensor: Sensor = field(default_factory=lambda: Sensor.of("SMART"))
    materials: Mapping[int, Material] = field(default_factory=lambda: MATERIALS)
    purpose: str = "test"
    seed: int = 1
    scene: Caster | None = None

    @property
    def caster(self) -> Caster:
        if self.scene is not None:
            return self.scene
        raise AssertionError("no effect of the light or the readout asks what a ray meets")

    def signal(self, ideal: IdealScan) -> npt.NDArray[np.float64]:
        return surface_signal(ideal, Model(self.sensor, self.materials))

    def uniforms(self, layer: npt.ArrayLike, point: npt.ArrayLike, draws: int = 1) -> npt.NDArray[np.float64]:
        return streams.uniforms(self.seed, self.purpose, 0, layer, point, draws)


def sweep_time_s(point: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """When the built-in sensors fire a point column, from the frame's start."""
    return np.asarray(point, dtype=np.float64) * (0.030 / 959)


def wall(beams: int, distance_m: float | npt.NDArray[np.float64] = 50.0, material: int = 1) -> IdealScan:
    """That many beams, 960 a layer, on one wall met at 0 degrees."""
    layer, point = np.divmod(np.arange(beams), 960)
    return IdealScan(layer, point, np.broadcast_to(distance_m, beams), np.full(beams, material), np.zeros(beams))


def rows(*table: tuple[int, int, float, int, float], share: list[float] | None = None) -> IdealScan:
    """An ideal scan from rows of layer, point, distance, material, incidence."""
    layer, point, distance, material, incidence = (list(column) for column in zip(*table, strict=True))
    return IdealScan(*(np.array(c) for c in (layer, point, distance, material, incidence)), share=share)


def empty() -> IdealScan:
    """An ideal scan without a beam."""
    none = np.empty(0)
    return IdealScan(none, none, none, none, none)


def plain(around: Around) -> Light:
    """The light of the surroundings' ideal scan before any effect."""
    return light_of(around.ideal, Model(around.sensor, around.materials))


def lit(effect: Effect, around: Around) -> Light:
    """That light with the effect."""
    return effect.light(plain(around), around)  # type: ignore[attr-defined]


def echoes(
    key: list[tuple[int, int]], number: list[int], range_m: list[float], area: list[float] | None = None
) -> Scan:
    """A scan from beams, echo numbers and ranges, with an extra column that tells the rows apart."""
    layer, point = np.array(key, dtype=np.int32).reshape(-1, 2).T
    scan = Scan.from_beams(
        layer,
        point,
        np.array(range_m, dtype=np.float64),
        echo_number=np.array(number, dtype=np.int32),
        area=np.arange(len(number)) + 100.0 if area is None else np.array(area),
        width_ns=np.ones(len(number)),
        peak=np.ones(len(number)),
    )
    return replace(scan, extra={"mark": np.arange(len(number))})
