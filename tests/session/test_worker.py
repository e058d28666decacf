"""The process that computes beside the interface: order, replacing, cancelling, its death, its silence, its end."""

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from lidarcheck.session import worker as worker_module
from lidarcheck.session.worker import Worker
from lidarcheck.session.worker_process import COMPILES
from tui_kit import ROOT

ENTRY = "worker_entries:"


class Heard:
    """What came of requests, in the order in which it came."""

    def __init__(self):
        self.outcomes, self.progress, self._changed = [], [], threading.Condition()

    def done(self, name):
        def tell(outcome):
            with self._changed:
                self.outcomes.append((name, outcome))
                self._changed.notify_all()

        return tell

    def far(self, done, of, now):
        with self._changed:
            self.progress.append((done, of, now))
            self._changed.notify_all()

    def wait(self, number=1):
        with self._changed:
            assert self._changed.wait_for(lambda: len(self.outcomes) >= number, 60.0), self.outcomes
        return [outcome for _, outcome in self.outcomes]

    def wait_far(self, what):
        with self._changed:
            assert self._changed.wait_for(lambda: what in self.progress, 60.0), self.progress


def until(true, seconds=60.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.005)


@pytest.fixture(scope="module")
def worker():
    one = Worker(warm=())
    yield one
    one.close()


@pytest.fixture
def heard():
    return Heard()


def test_an_answer_tells_what_was_read_and_edits_are_read_in_their_files_place(worker, heard, tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("on the disk")
    for edited in ({}, {os.path.realpath(path): b"as shown"}):
        worker.submit(f"{ENTRY}content", (path,), edited, heard.far, heard.done("read"))
    disk, shown = heard.wait(2)
    assert (disk.value, shown.value) == (b"on the disk", b"as shown")
    assert disk.files == {os.path.realpath(path): (11, path.stat().st_mtime_ns)}
    assert (disk.taken, shown.taken) == (frozenset(), {os.path.realpath(path)})
    assert disk.failed == ""
    assert disk.seconds > 0.0


def test_it_is_one_process_nicer_than_this_one_that_holds_what_it_has(worker, heard):
    for _ in range(3):
        worker.submit(f"{ENTRY}counted", ("held",), None, None, heard.done("held"))
    found = [outcome.value for outcome in heard.wait(3)]
    assert [times for times, _, _ in found] == [1, 2, 3]
    assert {process for _, process, _ in found} == {worker.pid}
    assert {nice for _, _, nice in found} == {os.nice(0) + 5}


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        ("input", "a.ini: is not a table; name another"),
        ("any", "internal error, RuntimeError: something else"),
        ("pack", "internal error, "),
    ],
)
def test_a_fault_is_the_requests_alone(worker, heard, kind, says):
    worker.submit(f"{ENTRY}faulty", (kind,), None, None, heard.done("bad"))
    worker.submit(f"{ENTRY}no_such", (), None, None, heard.done("none"))
    worker.submit(f"{ENTRY}add", (lambda: None, 1), None, None, heard.done("not packed"))
    worker.submit(f"{ENTRY}add", (1, 2), None, None, heard.done("good"))
    bad, none, packed, good = heard.wait(4)
    assert bad.failed.startswith(says)
    assert "no_such" in none.failed
    assert packed.failed.startswith("cannot be handed to the worker process")
    assert (good.value, good.failed) == (3, "")


def test_a_callback_that_fails_leaves_the_worker_at_work(worker, heard, caplog):
    def fail(*_):
        raise RuntimeError("the pane is gone")

    worker.submit(f"{ENTRY}add", (1, 2), None, fail, fail)
    worker.submit(f"{ENTRY}add", (3, 4), None, None, heard.done("good"))
    assert heard.wait()[0].value == 7
    assert "the pane is gone" in caplog.text


def test_the_newest_of_a_lane_takes_the_place_of_one_that_waits_and_ends_the_one_that_runs(worker, heard, tmp_path):
    gate, told = tmp_path / "gate", tmp_path / "told"
    first = worker.submit(f"{ENTRY}gated", (str(gate), str(told)), None, heard.far, heard.done("first"), lane="number")
    heard.wait_far((0, 8, "seeds"))
    later = [
        worker.submit(f"{ENTRY}add", (number, 0), None, heard.far, heard.done(number), lane="number")
        for number in range(5)
    ]
    other = worker.submit(f"{ENTRY}add", (9, 0), None, None, heard.done("other"), lane="another", priority=1)
    assert [outcome.value for outcome in heard.wait(2)] == [4, 9]
    assert [name for name, _ in heard.outcomes] == [4, "other"]
    assert not any(ticket.live for ticket in (first, *later, other))
    # It gave up between two seeds: the gate was never opened, and nobody waits for it.
    assert told.read_text() == "runs\n"
    until(lambda: not worker.busy)


def test_the_lowest_priority_goes_first_and_what_is_cancelled_is_not_heard_of(worker, heard, tmp_path):
    gate = tmp_path / "gate"
    worker.submit(f"{ENTRY}gated", (str(gate), str(tmp_path / "told")), None, heard.far, heard.done("gate"))
    heard.wait_far((0, 8, "seeds"))
    for priority in (3, 1, 2, 1):
        worker.submit(f"{ENTRY}add", (priority, 0), None, None, heard.done(priority), priority=priority)
    gone = worker.submit(f"{ENTRY}add", (0, 0), None, None, heard.done("gone"), lane="x")
    worker.cancel(gone)
    worker.submit(f"{ENTRY}add", (0, 0), None, None, heard.done("gone"), lane="x")
    worker.cancel_lane("x")
    gate.touch()
    heard.wait(5)
    assert [name for name, _ in heard.outcomes] == ["gate", 1, 1, 2, 3]


def test_a_late_answer_of_a_cancelled_request_is_not_handed_on(worker, heard, tmp_path):
    """It can no longer be stopped: its answer comes, after that of nobody's."""
    told = tmp_path / "told"
    ticket = worker.submit(f"{ENTRY}seeds", (1, 0.2, str(told)), None, heard.far, heard.done("late"))
    until(told.exists)
    worker.cancel(ticket)
    far = len(heard.progress)
    worker.submit(f"{ENTRY}add", (1, 1), None, None, heard.done("next"))
    heard.wait()
    assert [name for name, _ in heard.outcomes] == ["next"]
    assert len(heard.progress) == far


def test_a_process_that_dies_is_started_anew_once_then_it_is_said(worker, heard, tmp_path):
    worker.submit(f"{ENTRY}dies", (str(tmp_path / "once"),), None, None, heard.done("once"))
    worker.submit(f"{ENTRY}dies", (str(tmp_path / "always"),), None, None, heard.done("always"))
    worker.submit(f"{ENTRY}add", (1, 1), None, None, heard.done("next"))
    once, always, after = heard.wait(3)
    assert once.value == 2
    assert always.failed == "the worker process was killed (SIGKILL; was memory short?) twice; r tries again"
    assert (tmp_path / "always").read_text() == "died\ndied\n"
    assert after.value == 2


def test_a_process_that_is_killed_while_nothing_is_asked_is_there_again_when_it_is(worker, heard):
    worker.submit(f"{ENTRY}add", (1, 1), None, None, heard.done("before"))
    heard.wait()
    before = worker.pid
    os.kill(before, 9)
    worker.submit(f"{ENTRY}add", (2, 2), None, None, heard.done("after"))
    assert heard.wait(2)[1].value == 4
    assert worker.pid != before


def test_a_process_that_hangs_is_started_anew(heard, tmp_path, monkeypatch):
    monkeypatch.setattr(worker_module, "_GIVES_UP_S", 0.2)
    hasty = Worker(warm=(), patience_s=0.5)
    try:
        hasty.submit(f"{ENTRY}hangs", (str(tmp_path / "one"),), None, None, heard.done("came back"))
        assert heard.wait()[0].value == "came back"
        # One that nobody waits for any more must not keep the next from being computed.
        ticket = hasty.submit(f"{ENTRY}hangs", (str(tmp_path / "two"),), None, heard.far, heard.done("never"))
        until((tmp_path / "two").exists)
        hasty.cancel(ticket)
        hasty.submit(f"{ENTRY}add", (1, 1), None, None, heard.done("next"))
        assert heard.wait(2)[1].value == 2
    finally:
        hasty.close()


def test_compiling_is_not_hanging_and_is_said(heard, tmp_path):
    patient = Worker(warm=((f"{ENTRY}add", (1, 1)),), patience_s=0.6)
    try:
        patient.submit(f"{ENTRY}compiles", (str(tmp_path / "told"), 1.5), None, heard.far, heard.done("compiled"))
        assert heard.wait()[0].value == "compiled"
    finally:
        patient.close()
    assert (0, 1, COMPILES) in heard.progress
    assert (tmp_path / "told").read_text() == "begun\n"


def test_it_writes_nothing_to_the_terminal_and_ends_with_its_parent(tmp_path):
    program = (
        "import sys, time, os; sys.path.insert(0, sys.argv[1])\n"
        "from lidarcheck.session.worker import Worker\n"
        "def done(outcome): print(outcome.value, outcome.failed, worker.pid, flush=True)\n"
        "if __name__ == '__main__':\n"
        "    worker = Worker(warm=())\n"
        "    worker.submit('worker_entries:faulty', ('write',), None, None, done)\n"
        "    time.sleep(60)\n"
    )
    (tmp_path / "parent.py").write_text(program)
    command = [sys.executable, str(tmp_path / "parent.py"), str(ROOT / "tests/kits")]
    env = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    parent = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=env)
    quiet, child = parent.stdout.readline().split()
    assert quiet == "quiet"
    os.kill(int(child), 0)
    parent.kill()  # it has no time to end anything
    parent.wait()
    until(lambda: not _is_there(int(child)))
    assert parent.stdout.read() == ""
    parent.stdout.close()


def _is_there(process):
    """Whether a process has not ended; one that nobody has waited for yet has."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_closed_worker_has_no_process_and_answers_nothing(heard, tmp_path):
    one = Worker(warm=())
    one.submit(f"{ENTRY}gated", (str(tmp_path / "gate"), str(tmp_path / "told")), None, heard.far, heard.done("never"))
    heard.wait_far((0, 8, "seeds"))
    process = one.pid
    one.close()
    until(lambda: not _is_there(process))
    assert not one.submit(f"{ENTRY}add", (1, 1), None, None, heard.done("never")).live
    assert heard.outcomes == []
    one.close()
