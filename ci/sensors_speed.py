"""How fast beams of other sensors are simulated: ratios to the built-in grid, measured side by side in one process."""

import argparse
import statistics
import time
import tomllib
from importlib import resources

import numpy as np

from lidarcheck.model import simulate
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Linear, Material, PhotonHistogram, Sensor, sensor_of, shipped

MATERIALS = {1: Material("grey", 0.3)}
RANGES_M = (5.0, 60.0)


def channels_of(layers: int, columns: int) -> dict[str, object]:
    """Channels with an azimuth offset and an origin of their own, as a turning head has them."""
    at = np.arange(layers)
    return {
        "kind": "channels",
        "elevation_deg": np.linspace(-22.0, 22.0, layers).round(3).tolist(),
        "azimuth_offset_deg": (3.0 * np.sin(at)).round(3).tolist(),
        "origin_m": 0.0167,
        "range_offset_m": 0.0167,
        "columns": columns,
        "azimuth_deg": {"first": 180.0, "last": -180.0},
    }


def irregular(beams: int) -> dict[str, np.ndarray]:
    """Beams in a rose, as prisms draw it."""
    turn = np.arange(beams) * 2.0 * np.pi * 0.6180339887
    radius = np.sqrt((np.arange(beams) + 0.5) / beams)
    columns = {"Layer": np.zeros(beams), "Point": np.arange(beams)}
    columns["elevation_deg"] = 12.5 * radius * np.sin(turn)
    columns["azimuth_deg"] = 60.0 * radius * np.cos(turn)
    columns["time_s"] = np.linspace(0.0, 0.1, beams, endpoint=False)
    return columns


def with_beams(name: str, beams: dict[str, object], table: dict[str, np.ndarray] | None = None) -> Sensor:
    file = resources.files("lidarcheck").joinpath(f"sensors/{name}.toml")
    document = {**tomllib.loads(file.read_text("utf-8")), "beams": beams}
    if table is not None or beams["kind"] == "channels":
        document["sweep"] = {"direction": "right"} if beams["kind"] == "channels" else {"order": "table"}
    return sensor_of(document, name, columns=None if table is None else lambda _: table)


def ideal_of(sensor: Sensor) -> IdealScan:
    """Every beam meets something, one surface each."""
    layer, point = sensor.beams.every()
    distance = (
        np.linspace(*RANGES_M, len(layer)) if not isinstance(sensor, PhotonHistogram) else np.full(len(layer), 0.6)
    )
    n = len(layer)
    return IdealScan(layer, point, distance, np.ones(n, dtype=np.int32), np.zeros(n), beams=sensor.beams)


def cases() -> list[tuple[str, Sensor, str]]:
    """What is measured: its name, the sensor, the fidelity."""
    heads, rose = channels_of(128, 2048), irregular(600_000)
    table = {"kind": "table", "file": "beams.csv"}
    return [
        ("grid, spad_array, fast", shipped("SLIM"), "fast"),
        ("128 x 2048 channels, spad_array, fast", with_beams("SLIM", heads), "fast"),
        ("600 000 irregular beams, spad_array, fast", with_beams("SLIM", table, rose), "fast"),
        ("grid, spad_array, exact", shipped("SLIM"), "exact"),
        ("128 x 2048 channels, spad_array, exact", with_beams("SLIM", heads), "exact"),
        ("600 000 irregular beams, spad_array, exact", with_beams("SLIM", table, rose), "exact"),
        ("128 x 2048 channels, linear", with_beams("XT32", heads), "exact"),
        ("600 000 irregular beams, linear", with_beams("XT32", table, rose), "exact"),
        ("64 x 64 zones, photon_histogram", with_beams("TMF8820", {
            "kind": "grid", "layers": 64, "points": 64,
            "elevation_deg": {"first": -14.5, "step": 0.46}, "azimuth_deg": {"first": -14.5, "step": 0.46},
        }), "exact"),
    ]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--threads", type=int, default=1)
    given = parser.parse_args()
    made = [(name, sensor, ideal_of(sensor), fidelity) for name, sensor, fidelity in cases()]
    rates: dict[str, list[float]] = {name: [] for name, *_ in made}
    for turn in range(given.rounds + 1):
        for name, sensor, ideal, fidelity in made:
            start = time.perf_counter()
            simulate(ideal, Model(sensor, MATERIALS), seed=turn, threads=given.threads, fidelity=fidelity)
            if turn:  # the first one compiles and fills libraries
                rates[name].append(len(ideal) / (time.perf_counter() - start))
    reference = {"fast": rates[made[0][0]], "exact": rates[made[3][0]]}
    print(f"{given.rounds} rounds, {given.threads} threads; beams a second, and over the grid's of the same path:")
    for name, sensor, _, fidelity in made:
        own = "fast" if isinstance(sensor, Linear | PhotonHistogram) else fidelity
        ratios = [a / b for a, b in zip(rates[name], reference[own], strict=True)]
        print(f"  {name:45} {statistics.median(rates[name]):12,.0f}   {statistics.median(ratios):7.3f}")


if __name__ == "__main__":
    main()
