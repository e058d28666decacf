"""What the worker process computes for a session: kept by its key, with its state in words, and never too late."""

import os
import threading
import time

import pytest

from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.session.node import Node
from lidarcheck.session.session import CURRENT, OLD, Session
from lidarcheck.session.worker import Worker
from tui_kit import LUT

ENTRY = "worker_entries:"


@pytest.fixture(scope="module")
def worker():
    one = Worker(warm=())
    yield one
    one.close()


@pytest.fixture
def session(worker):
    return Session(worker=worker)


@pytest.fixture
def table(tmp_path):
    (tmp_path / "a.ini").write_bytes(LUT.encode())
    file = EditedLut(tmp_path / "a.ini", tmp_path)
    yield file
    file.close()


def content_of(path, **more):
    return Node("content", 1, path.name, (path,), entry=f"{ENTRY}content", arguments=(path,), **more)


def wanted(session, node, **how):
    """Have it computed, and wait for it."""
    done, found = threading.Event(), []
    ticket = session.want(node, on_done=lambda made: (found.append(made), done.set()), **how)
    if ticket is not None:
        assert done.wait(60.0)
        return found[0]
    return session.known(node, how.get("inputs"))


def until(true):
    end = time.monotonic() + 60.0
    while not true():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_it_is_the_same_as_when_it_is_computed_here_and_has_the_same_key(session, table):
    session.hold(table)
    node = content_of(table.path)
    made = wanted(session, node)
    assert made.value == LUT.encode()
    assert session.status(node) == (CURRENT, made)
    here = Session().compute(node)
    assert (here.value, here.key, here.files) == (made.value, made.key, made.files)
    table.set("vertical", [1], "400")
    assert session.status(node)[0] == f"{OLD}, of edit 0"
    assert wanted(session, node).value == table.content
    assert session.want(node) is None  # known
    session.undo()
    assert session.want(node) is None
    assert session.status(node) == (CURRENT, made)


def test_a_path_spelled_otherwise_is_the_same_file(session, table, monkeypatch):
    monkeypatch.chdir(table.path.parent)
    other = table.path.parent / "there"
    other.symlink_to(table.path.parent)
    keys = {
        content_of(path).key(session.inputs())
        for path in (table.path, other / "a.ini", table.path.relative_to(table.path.parent))
    }
    assert len(keys) == 1


def test_what_it_was_at_the_start_and_before_is_asked_for_alike(session, table):
    session.hold(table)
    node = content_of(table.path)
    table.set("vertical", [1], "400")
    before = table.content
    table.set("vertical", [2], "401")
    assert wanted(session, node, inputs=session.start()).value == LUT.encode()
    assert wanted(session, node, inputs=session.before()).value == before
    assert session.status(node)[0] == f"{OLD}, of edit 1"
    assert wanted(session, node).value == table.content
    assert [session.known(node, inputs).edit for inputs in (session.start(), session.before(), session.inputs())] == [
        0,
        1,
        2,
    ]


def test_its_state_while_it_is_computed_replaced_and_stopped(session, worker, tmp_path):
    def slow(name):
        return Node(
            "slow", 1, name, (), entry=f"{ENTRY}gated", arguments=(str(tmp_path / name), str(tmp_path / "told"))
        )

    one, other, last = map(slow, ("one", "other", "last"))
    ticket = session.want(one, lane="number")
    assert session.status(one)[0].startswith("computing")
    until(lambda: session.status(one)[0] == "computing 0/8 seeds")
    assert session.want(one, lane="number") is ticket
    session.want(other, lane="number")
    assert session.status(one) == ("", None)
    assert session.status(other)[0].startswith("computing")
    worker.cancel_lane("number")
    assert session.status(other) == ("", None)
    (tmp_path / "last").touch()
    assert wanted(session, last).value == "through"


def test_what_fails_is_said_and_can_be_asked_for_again(session, tmp_path):
    node = content_of(tmp_path / "not_there.csv")
    assert wanted(session, node) is None
    word = session.status(node)[0]
    assert word.startswith("failed: ")
    assert "not_there.csv" in word
    (tmp_path / "not_there.csv").write_text("now")
    assert wanted(session, node).value == b"now"
    bad = Node("bad", 1, "", (), entry=f"{ENTRY}faulty", arguments=("any",))
    assert wanted(session, bad) is None
    assert session.status(bad)[0] == "failed: internal error, RuntimeError: something else"


def test_a_file_that_changes_meanwhile_or_is_read_past_its_edits_gives_nothing(session, table):
    session.hold(table)
    gate, told = table.path.parent / "gate", table.path.parent / "told"
    node = Node("slow", 1, "", (table.path,), entry=f"{ENTRY}gated", arguments=(str(gate), str(told)))
    done = threading.Event()
    session.want(node, on_done=lambda _made: done.set())
    until(told.exists)
    table.path.write_bytes(LUT.replace("our", "my").encode())
    gate.touch()
    assert done.wait(60.0)
    assert session.known(node) is None
    table.reload()
    table.set("vertical", [1], "400")
    assert wanted(session, node) is None
    assert "has edits that are not saved" in session.status(node)[0]


def test_a_result_says_what_it_was_computed_from(session, table):
    session.hold(table)
    node = content_of(table.path, command="lidarcheck gap a.ini --at 69", facts=(("sample", "7 200 beams x 8"),))
    assert session.describe(node)[0] == "state    not computed yet"
    table.set("vertical", [1], "400")
    made = wanted(session, node)
    real = os.path.realpath(table.path)
    lines = session.describe(node)
    assert lines[:4] == [
        "state    current",
        f"files    {real}  {made.files[real][:12]}  edited, not saved",
        "edit     1, vertical X -120: set 400",
        "sample   7 200 beams x 8",
    ]
    assert lines[4].startswith("took     ")
    assert lines[5:] == [
        f"key      {made.key[:24]}",
        "command  lidarcheck gap a.ini --at 69",
        "         it reads the saved files: save first, to make the same",
    ]
    table.save()
    assert "save first" not in "\n".join(session.describe(node))
    table.set("vertical", [1], "401")
    assert "now another" in session.describe(node)[1]
    assert session.describe(node)[0] == "state    OLD, of edit 1"
