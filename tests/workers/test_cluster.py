"""What four commands find on one process, on four, and on real workers of a real scheduler is the same to the bit."""

import dataclasses
import itertools
import os
import re
import shutil
import signal
import socket
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from calibrate_kit import Truth, write_case
from cluster_kit import Farm, until
from explain_kit import MODEL, ideal_scan
from explain_kit import write_case as small_case
from lidarcheck import __version__
from lidarcheck.calibration.parameters.workflow import Request, calibrate
from lidarcheck.cases.case import load_case
from lidarcheck.cli import main
from lidarcheck.cli.bench.cluster import costs
from lidarcheck.effects import catalogue
from lidarcheck.errors import LidarcheckError, UsageError, WorkerError
from lidarcheck.explain.workflow import explain
from lidarcheck.figures.files.outputs import json_text
from lidarcheck.formats import save_ideal
from lidarcheck.harness.check import check
from lidarcheck.harness.frames import FrameBatch
from lidarcheck.model import load_model
from lidarcheck.workers import Processes, Shared, WorkerPool
from lidarcheck.workers import cluster as cluster_module
from lidarcheck.workers.identity import Identity, identity

pytest.importorskip("distributed", reason="dask is not installed: pip install 'lidarcheck[cluster]'")
ROOT = Path(__file__).resolve().parents[2]
TINY = """
description = "a wall, seen by few beams"
model = "model.toml"

[[beams]]
shape = "wall"
layers = [250, 259]
points = [470, 489]
x_m = 12.0
turn_deg = 0.0
material = 2

[[kpis]]
kpi = "area_mean"
tolerance = 1.0

[[kpis]]
kpi = "area_distance"
tolerance = 1.0
"""


@pytest.fixture(scope="module")
def farm(tmp_path_factory):
    """A scheduler, as yet without workers."""
    there = Farm(tmp_path_factory.mktemp("farm"))
    try:
        yield there
    finally:
        there.close()


@pytest.fixture(scope="module")
def cluster(farm):
    """The scheduler with three workers."""
    farm.add(3)
    with cluster_module.Cluster(farm.address) as pool:
        until(lambda: workers_of(pool) == 3)
        yield pool


@pytest.fixture(scope="module")
def processes():
    with Processes(4) as pool:
        yield pool


def workers_of(pool):
    return len(pool._client.nthreads())


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A directory with ideal scans and a model, two small cases, and a scenario."""
    place = tmp_path_factory.mktemp("inputs")
    for k in range(2):
        save_ideal(ideal_scan(k), place / f"ideal{k}.txt")
    (place / "model.toml").write_text(MODEL.format(variant="SMART"))
    (place / "tiny.toml").write_text(TINY)
    small_case(place / "case", frames=3)
    where = {"frames": 2, "layers": range(210, 306, 6), "points": range(430, 526, 4), "scene": "lab"}
    write_case(Truth({"signal_at_1m": 4800.0}, seed=3, **where), place / "lab")
    return place


def frames(inputs, out, pool, told=lambda *_: None):
    run = FrameBatch([inputs / "ideal0.txt"], load_model(inputs / "model.toml"), out, 9, ".pcd", seed=5)
    assert run.run(pool, told).simulated == 9
    return {path.name: path.read_bytes() for path in out.iterdir()}


def checked(inputs, out, pool):
    found = check([inputs / "tiny.toml"], pool=pool).to_dict()
    assert len(found["scenarios"][0]["kpis"][0]["paired"]) == 8
    return json_text({**found, "seconds": None})


def calibrated(inputs, out, pool):
    found = calibrate(load_case(inputs / "lab", fewest=1), Request(("signal_at_1m",)), rounds=1, pool=pool)
    rounds = [dataclasses.replace(one, seconds=0.0) for one in found.rounds]
    return json_text([found.parameters, rounds, found.samples, found.misfit, found.floor, found.warnings])


def explained(inputs, out, pool):
    others = [name for name in catalogue() if name not in ("signal_gain", "range_offset")]
    return json_text(explain(load_case(inputs / "case"), exclude=others, pool=pool).to_dict())


def simulate_at(address, inputs, out, *more):
    where = ["--model", str(inputs / "model.toml"), "--out", str(out), "--frames", "2"]
    return main(["simulate", str(inputs / "ideal0.txt"), *where, "--scheduler", address, *more])


def a_free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


COMMANDS = ["simulate a b --model m --out o", "check", "calibrate c --free f --out o", "explain c --out o"]
BAD = ["127.0.0.1:8786", "tcp://127.0.0.1", "tcp://:8786", "tcp://host:0", "tcp://host:65536", "http://host:8786", ""]


@pytest.mark.parametrize(("command", "address"), [*zip(itertools.cycle(COMMANDS), BAD, strict=False)])
def test_what_is_no_address_is_refused(command, address, capsys):
    assert main([*command.split(), f"--scheduler={address}"]) == 2
    fix = "give tcp://HOST:PORT, as tcp://127.0.0.1:8786, or tls://HOST:PORT"
    assert capsys.readouterr().err == f"error: --scheduler {address} is no address of a scheduler; {fix}\n"


def test_where_nobody_listens_is_said_with_how_to_start_a_scheduler(inputs, tmp_path, capsys):
    address = f"tcp://127.0.0.1:{a_free_port()}"
    assert simulate_at(address, inputs, tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert said.startswith(f"error: there is no scheduler at {address}: connection refused; start one with `dask sch")
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_who_listens_and_says_nothing_is_not_waited_for(inputs, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(cluster_module, "_CONNECT_S", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        assert simulate_at(address, inputs, tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert said.startswith(f"error: no scheduler of dask answers at {address}: no answer within 1.2 s; start ")
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_without_dask_the_command_that_installs_it_is_said(inputs, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert simulate_at("tcp://127.0.0.1:1", inputs, tmp_path / "out") == 2
    said = 'error: --scheduler needs dask, which is not installed; pip install "lidarcheck[cluster]"\n'
    assert capsys.readouterr().err == said


@pytest.mark.usefixtures("trusting")
def test_jobs_and_an_external_model_do_not_go_with_a_cluster(inputs, tmp_path, capsys):
    assert simulate_at("tcp://127.0.0.1:1", inputs, tmp_path / "out", "--jobs", "2") == 2
    assert "--jobs does not go with --scheduler" in capsys.readouterr().err
    model = tmp_path / "model.toml"
    model.write_text('[external]\ncommand = ["true", "{scan}"]\n')
    command = ["simulate", *(str(inputs / f"ideal{k}.txt") for k in range(2)), "--model", str(model)]
    assert main([*command, "--out", str(tmp_path / "out"), "--scheduler", "tcp://127.0.0.1:1"]) == 2
    assert "is an external program, which is on this machine alone; leave out --scheduler" in capsys.readouterr().err
    (tmp_path / "one.toml").write_text(TINY.replace('"model.toml"', '"model.toml"').replace("wall, seen", "wall"))
    with pytest.raises(UsageError, match="the scenario one runs an external model, which is on this machine alone"):
        check([tmp_path / "one.toml"], pool=WorkerPool())


def test_a_scheduler_without_workers_is_said_and_how_to_start_some(farm, inputs, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(cluster_module, "_CONNECT_S", 1.0)
    assert simulate_at(farm.address, inputs, tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert said.startswith(f"error: the scheduler at {farm.address} has no workers; start some with `dask worker tcp:")
    assert not (tmp_path / "out").exists()


@pytest.mark.long
@pytest.mark.parametrize("work", [frames, checked, calibrated, explained])
def test_the_same_bits_on_one_process_on_four_and_on_a_cluster(work, inputs, tmp_path, processes, cluster):
    pools = {"one": WorkerPool(), "four": processes, "cluster": cluster}
    one, four, many = (work(inputs, tmp_path / name, pool) for name, pool in pools.items())
    assert one == four
    assert one == many


def test_whether_there_is_a_gpu_is_asked_where_the_work_is_done(farm, cluster, inputs, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(
        "lidarcheck.model.cuda.simulate.check_cuda", lambda: pytest.fail("asked on the caller's machine")
    )
    code = simulate_at(farm.address, inputs, tmp_path / "there", "--device", "cuda")
    said = capsys.readouterr().err.strip()
    assert code == 0 or (code == 2 and said.startswith("error: no GPU can be used: ") and "\n" not in said)


def test_the_command_writes_what_it_writes_without_a_cluster(farm, cluster, inputs, tmp_path, capsys):
    assert simulate_at(farm.address, inputs, tmp_path / "there", "--format", "txt") == 0
    where = ["--model", str(inputs / "model.toml"), "--out", str(tmp_path / "here"), "--frames", "2"]
    assert main(["simulate", str(inputs / "ideal0.txt"), *where, "--jobs", "1", "--format", "txt"]) == 0
    there, here = ({path.name: path.read_bytes() for path in (tmp_path / n).iterdir()} for n in ("there", "here"))
    assert sorted(here) == ["frames.json", "ideal0_000000.txt", "ideal0_000001.txt"]
    assert there == here


def test_the_cost_of_a_task_and_of_a_held_thing_is_measured(processes, cluster):
    before = cluster.batch_s
    short, task, held = costs(cluster, processes, tasks=10, size=1_000_000, repeats=2)
    cluster.batch_s = before
    assert short.name == "cluster_short_task_ms"
    assert (task.name, task.unit, held.name, held.unit) == ("cluster_task_ms", "ms", "cluster_held_1mb_ms", "ms")
    for figure in (short, task, held):
        assert 0.0 < figure.best <= figure.median
        assert figure.against[0].ratio == pytest.approx(figure.against[0].best / figure.best)


def test_an_error_in_a_task_is_the_one_that_its_caller_would_see(cluster, inputs, tmp_path, capsys):
    (tmp_path / "bad.txt").write_text("Layer Point Distance MaterialID IncidenceAngle\n250 480 10.0 7 0.0\n")
    ideals = [inputs / "ideal0.txt", tmp_path / "bad.txt"]
    run = FrameBatch(ideals, load_model(inputs / "model.toml"), tmp_path / "out", None, ".pcd")
    said = []
    for pool in (WorkerPool(), cluster):
        with pytest.raises(LidarcheckError) as caught:
            run.run(pool)
        said.append(str(caught.value))
        assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["frames.json", "ideal0.pcd"]
        shutil.rmtree(tmp_path / "out")
    assert said[0] == said[1]
    assert "material 7" in said[0]


def test_a_worker_of_another_version_is_refused(farm, cluster, tmp_path, inputs, capsys):
    package = tmp_path / "other/lidarcheck"
    shutil.copytree(ROOT / "src/lidarcheck", package, ignore=shutil.ignore_patterns("__pycache__"))
    init = package / "__init__.py"
    init.write_text(init.read_text().replace(__version__, "0.0.1"))
    [other] = farm.add(1, PYTHONPATH=str(package.parent))
    until(lambda: workers_of(cluster) == 4)
    assert simulate_at(farm.address, inputs, tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert re.match(r"error: the worker tcp://127\.0\.0\.1:\d+ on \S+ would find other numbers: ", said)
    assert f"it has lidarcheck 0.0.1 (here {__version__}), lidarcheck's source" in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()
    # Nor does it take part where it comes later.
    with pytest.raises(WorkerError, match=r"a worker on \S+ would find other numbers: it has lidarcheck 0\.0\.1"):
        [*cluster.map(time.sleep, [(0.2,)] * 12)]
    other.kill()
    other.wait()
    farm.workers.remove(other)
    until(lambda: workers_of(cluster) == 3)


def test_a_worker_that_is_killed_in_the_middle_loses_nothing(farm, cluster, inputs, tmp_path):
    expected = frames(inputs, tmp_path / "here", WorkerPool())

    def told(done, of, name):
        if done == 1:
            farm.kill(1)

    assert frames(inputs, tmp_path / "there", cluster, told) == expected
    assert workers_of(cluster) == 2


def test_all_workers_killed_in_the_middle_lose_nothing_once_there_are_others(farm, cluster, inputs, tmp_path):
    held = Shared(np.arange(1000))
    results = cluster.map(np.sum, itertools.repeat((held,), 60))
    assert next(results) == 499500
    farm.kill()
    farm.add(3)
    assert [*results] == [499500] * 59


def test_a_scheduler_that_hangs_is_not_waited_for(farm, cluster, monkeypatch):
    monkeypatch.setattr(cluster_module, "_ANSWER_S", 0.5)
    farm.scheduler.send_signal(signal.SIGSTOP)
    try:
        with pytest.raises(WorkerError, match="does not answer: no answer within"):
            cluster._look(now=True)
    finally:
        farm.scheduler.send_signal(signal.SIGCONT)
    until(lambda: workers_of(cluster) == 3)


def test_what_ends_all_workers_or_the_scheduler_ends_in_one_line(farm, cluster, monkeypatch):
    until(lambda: workers_of(cluster) == 3)
    with pytest.raises(
        WorkerError, match=r"the same task has ended 3 workers, the last of them tcp://127\.0\.0\.1:\d+"
    ):
        [*cluster.map(os._exit, [(1,)])]
    monkeypatch.setattr(cluster_module, "NO_WORKERS_S", 1.0)
    with pytest.raises(WorkerError, match=f"the scheduler at {farm.address} has had no workers for 1 s; start workers"):
        [*cluster.map(abs, [(-1,)])]

    def tasks():
        for number in range(5):
            if number == 3:
                farm.scheduler.kill()
            yield (number,)

    with pytest.raises(WorkerError, match=f"the scheduler at {farm.address} was lost; see whether it still runs"):
        [*cluster.map(abs, tasks())]


def test_who_differs_is_said_by_name():
    me = identity()
    other = Identity("bench7", {**me.found, "numpy": "1.0", "arithmetic": "0123"})
    assert (
        other.differences(me)
        == f"numpy 1.0 (here {me.found['numpy']}), arithmetic 0123 (here {me.found['arithmetic']})"
    )
    assert me.differences(me) == ""
