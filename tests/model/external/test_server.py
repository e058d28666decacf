"""A model that stays up: what it is asked, what it may answer, and what becomes of it when something goes wrong."""

import dataclasses
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from external_kit import IDEAL, gone, refusal
from lidarcheck.errors import ExternalModelError
from lidarcheck.model.external import Request, residents, run_requests, stop_external_models
from lidarcheck.model.spec import External

pytestmark = pytest.mark.usefixtures("trusting")

SERVER = """\
import json, os, subprocess, sys, time
open("../started", "a").write(f"{os.getpid()}\\n")

def say(answer):
    print(json.dumps(answer), flush=True)

def mark(what):
    open("../marks", "a").write(f"{what}\\n")

def simulate(run):
    names, *rows = [line.split() for line in open(run["ideal"]).read().lstrip("/").splitlines()]
    text = "RANGE Layer Point EchoNumber WIDTH AREA PEAK\\n"
    for row in rows[1:]:
        beam = dict(zip(names, row))
        if float(beam["Distance"]) > 0:
            area = run["parameters"].get("gain", 1.0)
            text += f"{beam['Distance']} {beam['Layer']} {beam['Point']} {len(row)} "
            text += f"{run['frame']} {area} {run['seed']}\\n"
    open(run["scan"], "w").write(text)

GREETING
for line in sys.stdin:
    asked = json.loads(line)
    for run in asked["runs"]:
        RUN
    ANSWER
"""
GREETING, RUN, ANSWER = 'say({"lidarcheck": 1})', "simulate(run)", 'say({"id": asked["id"]})'


@pytest.fixture
def server(tmp_path: Path) -> Callable[..., External]:
    """A server that is usual but for one piece of it."""

    (tmp_path / "program").mkdir()

    def made(greeting: str = GREETING, run: str = RUN, answer: str = ANSWER, timeout_s: float = 20.0) -> External:
        text = SERVER.replace("GREETING", greeting).replace("RUN", run).replace("ANSWER", answer)
        (tmp_path / "program" / "server.py").write_text(text)
        return External((sys.executable, "-S", "server.py"), tmp_path / "program", timeout_s=timeout_s, server=True)

    return made


def lines(file: Path) -> list[str]:
    return file.read_text().splitlines()


def test_one_process_answers_all_runs(server, tmp_path):
    external = server()
    requests = [Request(IDEAL, seed, frame=7, parameters={"gain": 2.5}) for seed in (3, 4, 5)]
    scans = run_requests(external, requests, jobs=1)
    assert [scan.peak.tolist() for scan in scans] == [[3.0, 3.0], [4.0, 4.0], [5.0, 5.0]]
    assert scans[0].range_m == pytest.approx([20.0, 33.5])
    assert (scans[0].area.tolist(), scans[0].width_ns.tolist()) == ([2.5, 2.5], [7.0, 7.0])
    run_requests(external, requests, jobs=1)
    assert len(lines(tmp_path / "started")) == 1


def test_a_request_holds_as_many_runs_as_the_server_takes(server, tmp_path):
    other = dataclasses.replace(IDEAL, distance_m=np.array([1.0, 2.0, 3.0]))
    requests = [Request(IDEAL, seed) for seed in range(5)] + [Request(other)]
    marks = "mark((len(asked['runs']), len({run['ideal'] for run in asked['runs']})))"
    scans = run_requests(server('say({"lidarcheck": 1, "batch": 4})', answer=f"{marks}; {ANSWER}"), requests, jobs=1)
    assert lines(tmp_path / "marks") == ["(4, 1)", "(2, 2)"]
    assert scans[5].range_m == pytest.approx([1.0, 2.0, 3.0])
    assert [scan.peak[0] for scan in scans] == [0, 1, 2, 3, 4, 0]


def test_side_by_side_there_is_a_process_for_each_job(server, tmp_path):
    requests = [Request(IDEAL, seed) for seed in range(12)]
    scans = run_requests(server(run="simulate(run); time.sleep(0.1)"), requests, jobs=2)
    assert [scan.peak[0] for scan in scans] == list(range(12))
    assert len(lines(tmp_path / "started")) == 2


def test_an_ideal_scan_in_the_place_of_another_is_not_mistaken(server):
    external = server()
    for distance in np.arange(1.0, 21.0):
        ideal = dataclasses.replace(IDEAL, distance_m=np.array([distance, 0.0, 0.0]))
        [scan] = run_requests(external, [Request(ideal)])
        assert scan.range_m == pytest.approx([distance])


def test_columns_that_differ_make_another_file(server):
    ideal = dataclasses.replace(IDEAL, share=np.ones(3))
    first, second = run_requests(server(), [Request(ideal), Request(ideal, columns=("Share",))], jobs=1)
    assert (first.extra["EchoNumberRaw"][0], second.extra["EchoNumberRaw"][0]) == (5, 6)


BAD = [
    (
        {"answer": f"print('Simulating\\x1b[1m 3 beams'); {ANSWER}"},
        "wrote to its standard output what is no answer: 'Simulating\\\\x1b[1m 3 beams'; let it print answers alone; "
        "anything else belongs to standard error",
    ),
    ({"greeting": "print('Model 1.3', flush=True)"}, "'Model 1.3'; let it print {\"lidarcheck\": 1} first"),
    ({"greeting": "say({'lidarcheck': 2})"}, 'greeted with {"lidarcheck": 2}; let it print {"lidarcheck": 1} first'),
    ({"greeting": "say({'lidarcheck': 1, 'bach': 2})"}, 'greeted with {"lidarcheck": 1, "bach": 2}; let it print'),
    (
        {"greeting": "say({'lidarcheck': 1, 'batch': 0})"},
        "says that a request may hold 0 runs; let batch be a whole number from 1 to 1000",
    ),
    (
        {"answer": "say({'id': asked['id'] - 1})"},
        "answered request 0 when 1 was asked; let it answer each request, with its id, before it reads the next",
    ),
    ({"answer": "say({'ok': 1})"}, 'answered with the keys ok; let it answer {"id": N}'),
    ({"answer": 'print(\'{"id": 1}\\n{"id": 2}\', flush=True)'}, "wrote to its standard output what nobody asked"),
    ({"answer": "say({'id': 1, 'error': 'no licence\\nleft'})"}, "refused a run: no licence\\nleft"),
    ({"run": "pass"}, "wrote no scan; let it write its echoes to {scan}"),
    ({"run": "open(run['scan'], 'w').write('X Y Z\\n1 2\\n')"}, "wrote a malformed scan: "),
    (
        {"greeting": "sys.exit('no licence')"},
        'ended with exit code 1 before it had answered (it said: "no licence"); run it by hand',
    ),
    (
        {"answer": "print(end='{'); print('out of\\nmemory', file=sys.stderr, flush=True); os.kill(os.getpid(), 9)"},
        'was killed by SIGKILL before it had answered (it said: "memory"); run it by hand',
    ),
    ({"answer": "os.close(1); time.sleep(60)"}, "closed its standard output before it had answered"),
    ({"answer": "print(end='x' * 3000000); time.sleep(60)"}, "wrote a line of more than 1048576 bytes"),
]


@pytest.mark.parametrize(("piece", "said"), BAD)
def test_what_a_server_must_not_do(piece, said, server, tmp_path):
    line = refusal(server(**piece))
    assert line.startswith("error: the external model ")
    assert said in line
    assert line.isprintable()
    residents.end_all()
    assert all(gone(int(pid)) for pid in lines(tmp_path / "started"))


@pytest.mark.parametrize("piece", ["greeting", "run"])
def test_one_that_hangs_is_killed_with_all_that_it_started(piece, server, tmp_path):
    hang = "mark(subprocess.Popen(['sleep', '60']).pid); time.sleep(60)"
    assert "took longer than 3 s; raise timeout_s or make it faster" in refusal(server(**{piece: hang}, timeout_s=3.0))
    assert all(gone(int(pid)) for pid in (*lines(tmp_path / "started"), *lines(tmp_path / "marks")))


def test_one_that_reads_nothing_is_killed(server):
    external = server(f"{GREETING}; time.sleep(60)", timeout_s=2.0)
    many = {f"number_{index}": 1.0 for index in range(5000)}  # more than a pipe holds
    assert "took longer than 2 s" in refusal(external, Request(IDEAL, parameters=many))


def test_one_that_refused_a_run_goes_on(server, tmp_path):
    refused = "say({'id': asked['id'], 'error': 'no licence'}) if run['seed'] == 1 else " + ANSWER
    external = server(answer=refused)
    assert "refused a run: no licence" in refusal(external, Request(IDEAL, 1))
    assert run_requests(external, [Request(IDEAL, 2)])[0].peak[0] == 2
    assert len(lines(tmp_path / "started")) == 1


def test_after_a_death_the_next_run_gets_a_fresh_one(server, tmp_path):
    external = server(run="sys.exit('one') if run['seed'] == 1 else simulate(run)")
    assert 'ended with exit code 1 before it had answered (it said: "one")' in refusal(external, Request(IDEAL, 1))
    [scan] = run_requests(external, [Request(IDEAL, 2)])
    assert scan.peak[0] == 2
    assert len(lines(tmp_path / "started")) == 2


def test_one_that_ended_after_its_answer_is_started_again(server, tmp_path):
    external = server(answer=f"{ANSWER}; break")
    for seed in (1, 2):
        [scan] = run_requests(external, [Request(IDEAL, seed)])
        assert scan.peak[0] == seed
        assert gone(int(lines(tmp_path / "started")[-1]))
    assert len(lines(tmp_path / "started")) == 2


def test_what_it_said_in_an_earlier_run_is_not_its_last_word(server):
    external = server(run="simulate(run); print('one', file=sys.stderr) if run['seed'] == 1 else sys.exit(4)")
    run_requests(external, [Request(IDEAL, 1)])
    assert "ended with exit code 4 before it had answered; run it by hand" in refusal(external, Request(IDEAL, 2))


def test_a_changed_program_is_started_again(server, tmp_path):
    run_requests(server(), [Request(IDEAL)])
    first = lines(tmp_path / "started")
    [scan] = run_requests(server(run="run['seed'] = 99; simulate(run)"), [Request(IDEAL)])
    assert scan.peak[0] == 99
    assert gone(int(first[0]))


def test_work_that_is_stopped_ends_its_servers(server, tmp_path):
    external = server(run="mark('asked'); time.sleep(60)")
    caught: list[ExternalModelError] = []

    def work() -> None:
        try:
            run_requests(external, [Request(IDEAL)])
        except ExternalModelError as error:
            caught.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    while not (tmp_path / "marks").exists():
        time.sleep(0.01)
    stop_external_models()
    thread.join()
    assert "was killed by SIGKILL" in str(caught[0])


def test_an_interrupt_ends_the_server_and_what_it_started(server, tmp_path):
    def interrupt() -> None:
        while not (tmp_path / "marks").exists():
            time.sleep(0.01)
        signal.raise_signal(signal.SIGINT)

    external = server(run="mark(subprocess.Popen(['sleep', '60']).pid); time.sleep(60)")
    thread = threading.Thread(target=interrupt)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            run_requests(external, [Request(IDEAL)])
    finally:
        signal.signal(signal.SIGINT, before)
    thread.join()
    assert all(gone(int(pid)) for pid in (*lines(tmp_path / "started"), *lines(tmp_path / "marks")))


def test_no_more_wait_than_there_are_cores(server, tmp_path, monkeypatch):
    monkeypatch.setattr(residents, "usable_cores", lambda: 1)
    for timeout_s in (20.0, 21.0, 22.0):  # three models
        run_requests(server(timeout_s=timeout_s), [Request(IDEAL)])
    first, second, last = map(int, lines(tmp_path / "started"))
    assert gone(first)
    assert gone(second)
    assert len(residents._idle) == 1
    assert residents._idle[0][1].group == last
