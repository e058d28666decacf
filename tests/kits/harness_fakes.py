"""A project with scenarios that cost nothing to measure, for the harness's tests."""

import hashlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from lidarcheck.harness.kpis.spec import KpiSpec, SeedMeasurement
from lidarcheck.model.spec import Model
from lidarcheck.sensor import Sensor

SPECS = (
    KpiSpec("area_mean", "mean", "ns", "target", 1.0),
    KpiSpec("detection", "proportion", "", "higher", 0.01, low=0.8),
    KpiSpec("area_distance", "distance", "ns", "lower", 1.0, feature="area"),
)


class Project:
    """A directory with scenario files; `shift` moves every area, `lost` detections, `stream` the random numbers."""

    def __init__(self, root: Path, names: tuple[str, ...] = ("one", "two")) -> None:
        self.root = root
        self.specs: tuple[KpiSpec, ...] = SPECS
        self.shift, self.lost, self.stream, self.version = 0.0, 0.0, 0, "v1"
        self.model = Model(Sensor.of("SMART"))
        self.seeds: list[int] = []
        (root / "scenarios").mkdir(parents=True, exist_ok=True)
        for name in names:
            self.file(name).write_text("# a scenario\n", encoding="utf-8")

    def file(self, name: str) -> Path:
        return self.root / "scenarios" / f"{name}.toml"

    def golden(self, name: str) -> Path:
        return self.root / "goldens" / f"{name}.toml"

    def proposal(self, name: str) -> Path:
        return self.root / ".lidarcheck" / "proposals" / f"{name}.toml"

    def load(self, path: Path) -> SimpleNamespace:
        return SimpleNamespace(
            files=(),
            name=path.stem,
            description="made up",
            path=path,
            model=self.model,
            kpis=self.specs,
            forget=lambda: None,
            content_hash=hashlib.sha256(f"{self.version} {self.specs}".encode()).hexdigest(),
        )

    def measure(self, scenario: SimpleNamespace, model: Model, seed: int) -> SeedMeasurement:
        self.seeds.append(seed)
        key = hashlib.sha256(f"{scenario.name} {seed} {self.stream}".encode()).digest()
        rng = np.random.default_rng(int.from_bytes(key[:8], "big"))
        gain = model.sensor.signal_at_1m / 6000.0
        area = rng.normal(100.0, 10.0, 500) * gain + self.shift
        seen = rng.binomial(1000, 0.95 - self.lost)
        digest = hashlib.sha256(area.tobytes() + bytes([seen % 256])).hexdigest()
        everything = {"area_mean": float(area.mean()), "detection": seen / 1000, "new": 1.0}
        values = {spec.name: everything[spec.name] for spec in self.specs if spec.kind != "distance"}
        return SeedMeasurement(values, {"detection": 1000}, {"area": area}, digest)

    @property
    def stand_ins(self) -> dict:
        return {"measure": self.measure, "load": self.load}
