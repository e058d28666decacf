"""How long runs of somebody else's model take by the way in which it is run: Markdown, a row a model and a way.

With --explain EFFECT: how long `explain` takes around each of them, beside the detector that lidarcheck has for the
same sensor. The scenes are those of a case of tests/hidden/around; what is measured there is simulated, with that
effect, by the very model that is to be explained, so that all of them have the same to find.
"""

import argparse
import dataclasses
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from lidarcheck.cases.case import Case, load_case
from lidarcheck.effects import make
from lidarcheck.explain.workflow import explain
from lidarcheck.model import load_model, simulate
from lidarcheck.model.external import Request, residents, run_requests
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Sensor

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
WAYS = (
    ("C, a start a run", "own_model_c/model.toml"),
    ("C, a server", "own_model_c/server.toml"),
    ("Python, a module", "own_model_python/model.toml"),
)
LAYERS, POINTS = 20, 100
FRAMES = 3
HIDDEN = {"signal_gain": {"gain": 0.75}, "range_offset": {"offset_m": 0.05}, "dropout": {"share": 0.03}}
"""Effects that may be hidden."""


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


def own_model_of(model: Model) -> Model:
    """The detector that lidarcheck has for the sensor of a program."""
    return Model(getattr(model.sensor, "described", model.sensor), model.materials)


def case_of(name: str, place: Path) -> Case:
    """The scenes of a case of tests/hidden/around, whose model is an example."""
    sys.path.insert(0, str(ROOT / "tests"))
    from hidden.around.cases import write_case
    from hidden.foreign.orders import CaseOrder

    write_case(CaseOrder(1, "null", 1001, (), "medium", name, "street"), place / name, frames=FRAMES)
    return load_case(place / name)


def explained(name: str, case: Case, model: Model, hidden: str, jobs: int) -> str:
    """A row of the table: what `explain` finds of an effect around a model that is right but for it, and its time."""
    effect = make(hidden, HIDDEN[hidden])
    truth, frames = model.with_(effect), []
    for frame in case.frames:
        shown = simulate(frame.ideal, truth, seed=100 + frame.number, frame=frame.number)
        frames.append(dataclasses.replace(frame, measured=shown))
    residents.end_all()
    begun, used = time.perf_counter(), cpu_s()
    found = explain(dataclasses.replace(case, model=model, frames=tuple(frames)), jobs=jobs)
    residents.end_all()
    took = f"{time.perf_counter() - begun:.0f} s | {cpu_s() - used:.0f} s"
    return f"| {name} | {' + '.join(finding.name for finding in found.findings) or found.verdict} | {took} |"


def cpu_s() -> float:
    """Seconds of processors that this process and those that it has waited for have used."""
    return sum(os.times()[:4])


def explain_all(hidden: str, jobs: int, place: Path) -> None:
    """Prints the table of `explain`."""
    print(f"| {hidden} hidden, {jobs} at a time | found | of the clock | of processors |\n|---|---|---|---|")
    for name, words in (("own_model_c", "C, a server"), ("own_model_python", "Python, a module")):
        case = case_of(name, place)
        own = own_model_of(case.model)
        simulate(case.frames[0].ideal, own)  # kernels are loaded
        print(explained(f"lidarcheck's own `linear`, the sensor of {name}", case, own, hidden, jobs), flush=True)
        print(explained(words, case, case.model, hidden, jobs), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--explain", choices=HIDDEN, help="time explain instead, with this effect hidden")
    chosen = parser.parse_args()
    os.environ["LIDARCHECK_TRUST"] = "all"  # the programs are those of examples/, in this process and in its workers
    if chosen.explain:
        with tempfile.TemporaryDirectory() as place:
            explain_all(chosen.explain, chosen.jobs, Path(place))
        return
    print(f"| {LAYERS * POINTS} beams, {chosen.runs} runs, {chosen.jobs} at a time | first run | all others | one |")
    print("|---|---|---|---|")
    with tempfile.TemporaryDirectory() as place:
        shutil.copytree(EXAMPLES, place, dirs_exist_ok=True)
        subprocess.run(["make", "-s", "-B", "-C", Path(place) / "own_model_c"], check=True)
        for name, file in WAYS:
            first, others = seconds_of(load_model(Path(place) / file), chosen.runs, chosen.jobs)
            print(row(name, first, others, chosen.runs), flush=True)
        model = load_model(Path(place) / WAYS[0][1])
    first, others = seconds_of_own(own_model_of(model), chosen.runs)
    print(row("lidarcheck's own `linear`", first, others, chosen.runs))


if __name__ == "__main__":
    main()
