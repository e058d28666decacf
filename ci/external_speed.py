"""How long runs of somebody else's model take by the way in which it is run: Markdown, a row a model and a way."""

import argparse
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from lidarcheck.model import load_model, simulate
from lidarcheck.model.external import Request, residents, run_requests
from lidarcheck.model.spec import Model
from lidarcheck.permissions import Permissions, granted
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Sensor

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
WAYS = (
    ("C, a start a run", "own_model_c/model.toml"),
    ("C, a server", "own_model_c/server.toml"),
    ("Python, a module", "own_model_python/model.toml"),
)
LAYERS, POINTS = 20, 100


def ideal_of(sensor: Sensor) -> IdealScan:
    """Beams of a panel that comes near from beam to beam."""
    layer, point = (a.ravel() for a in np.meshgrid(np.arange(LAYERS), np.arange(400, 400 + POINTS), indexing="ij"))
    n = len(layer)
    far, material = np.linspace(60.0, 5.0, n), np.full(n, 3)
    return IdealScan(
        layer=layer, point=point, distance_m=far, material_id=material, incidence_deg=np.zeros(n), beams=sensor.beams
    )


def seconds_of(model: Model, runs: int, jobs: int) -> tuple[float, float]:
    """Of the first run, which may start a process, and of the others in all."""
    assert model.external is not None
    ideal = ideal_of(model.sensor)
    begun = time.perf_counter()
    run_requests(model.external, [Request(ideal)], model.sensor, jobs=1)
    first = time.perf_counter()
    requests = [Request(ideal, seed, columns=("Share",)) for seed in range(1, runs + 1)]
    run_requests(model.external, requests, model.sensor, jobs=jobs)
    ended = time.perf_counter()
    residents.end_all()
    return first - begun, ended - first


def seconds_of_own(model: Model, runs: int) -> tuple[float, float]:
    """The same of the detector that lidarcheck has for such a sensor, on one core."""
    ideal, begun = ideal_of(model.sensor), time.perf_counter()
    simulate(ideal, model, seed=0, threads=1)
    first = time.perf_counter()
    for seed in range(1, runs + 1):
        simulate(ideal, model, seed=seed, threads=1)
    return first - begun, time.perf_counter() - first


def row(name: str, first_s: float, others_s: float, runs: int) -> str:
    return f"| {name} | {first_s * 1e3:.0f} ms | {others_s:.1f} s | {others_s / runs * 1e3:.1f} ms |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=1)
    chosen = parser.parse_args()
    print(f"| {LAYERS * POINTS} beams, {chosen.runs} runs, {chosen.jobs} at a time | first run | all others | one |")
    print("|---|---|---|---|")
    with tempfile.TemporaryDirectory() as place, granted(Permissions(trust=True)):
        shutil.copytree(EXAMPLES, place, dirs_exist_ok=True)
        subprocess.run(["make", "-s", "-B", "-C", Path(place) / "own_model_c"], check=True)
        for name, file in WAYS:
            first, others = seconds_of(load_model(Path(place) / file), chosen.runs, chosen.jobs)
            print(row(name, first, others, chosen.runs), flush=True)
        model = load_model(Path(place) / WAYS[0][1])
    first, others = seconds_of_own(
        Model(getattr(model.sensor, "described", model.sensor), model.materials), chosen.runs
    )
    print(row("lidarcheck's own `linear`", first, others, chosen.runs))


if __name__ == "__main__":
    main()
