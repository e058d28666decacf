"""Results on the disk: there at the next start, made anew where damaged or sealed by somebody else, never too many."""

import os
import pickle
import stat
import threading

import numpy as np
import pytest

from lidarcheck.session import disk_store
from lidarcheck.session.disk_store import DiskStore
from lidarcheck.session.node import Derived, Node
from lidarcheck.session.session import CURRENT, OLD, Session
from lidarcheck.session.store import Store


@pytest.fixture(autouse=True)
def secret(tmp_path, monkeypatch):
    monkeypatch.setenv("LIDARCHECK_CACHE", str(tmp_path / "user"))


@pytest.fixture
def root(tmp_path):
    root = tmp_path / "project"
    root.mkdir()
    (root / "data.csv").write_text("1,2,3\n")
    return root


def result(key="k", value=None, seconds=2.0):
    return Derived(value, key, {"/a/file": "0" * 64}, 14, seconds, 1.5e9)


def entries(root):
    return sorted((root / ".lidarcheck/cache").glob("*.result"))


def test_what_took_long_is_there_at_the_next_start_and_is_not_in_version_control(root):
    value = {"curve": np.arange(5.0), "words": ("a", None)}
    DiskStore(root).put(result(value=value))
    found = DiskStore(root).get("k")
    assert np.array_equal(found.value["curve"], value["curve"])
    assert (found.value["words"], found.files, found.seconds, found.when) == (
        ("a", None), {"/a/file": "0" * 64}, 2.0, 1.5e9,
    )  # fmt: skip
    assert (root / ".lidarcheck/.gitignore").read_text() == "*\n"
    assert DiskStore(root).get("another") is None


def test_what_is_quick_or_cannot_be_packed_is_not_kept(root):
    store = DiskStore(root)
    store.put(result("quick", seconds=0.9))
    store.put(result("function", lambda: None))
    assert not (root / ".lidarcheck").exists()
    DiskStore(root, most=1000).put(result("large", np.zeros(1000)))
    assert entries(root) == []


@pytest.mark.parametrize("cut", [0, 5, 40, 60, -1])
def test_a_damaged_entry_is_removed(root, cut):
    store = DiskStore(root)
    store.put(result(value="good"))
    (path,) = entries(root)
    path.write_bytes(path.read_bytes()[:cut])
    assert store.get("k") is None
    assert entries(root) == []
    store.put(result(value="good"))
    content = bytearray(path.read_bytes())
    content[-3] ^= 1
    path.write_bytes(content)
    assert store.get("k") is None


def test_an_entry_under_another_ones_name_is_not_taken_for_it(root):
    store = DiskStore(root)
    store.put(result("one", "of one"))
    (path,) = entries(root)
    store.put(result("two", "of two"))
    (other,) = set(entries(root)) - {path}
    other.write_bytes(path.read_bytes())
    assert store.get("two") is None
    assert store.get("one").value == "of one"


class Trap:
    """Runs something of a stranger's when it is unpacked."""

    def __init__(self, makes):
        self.makes = makes

    def __reduce__(self):
        return os.mkdir, (str(self.makes),)


def test_what_a_stranger_has_packed_is_not_unpacked(root, tmp_path, monkeypatch):
    """An entry that comes with a project was sealed by nobody here."""
    monkeypatch.setenv("LIDARCHECK_CACHE", str(tmp_path / "stranger"))
    DiskStore(root).put(result(value=Trap(tmp_path / "sprung")))
    (path,) = entries(root)
    sealed = path.read_bytes()
    monkeypatch.setenv("LIDARCHECK_CACHE", str(tmp_path / "user"))
    trap = pickle.dumps(Trap(tmp_path / "sprung"))
    for content in (sealed, sealed[:20] + bytes(32) + trap, trap, b"", b"lidarcheck result 1\n" + bytes(32)):
        path.write_bytes(content)
        assert DiskStore(root).get("k") is None
        assert not path.exists()
    assert not (tmp_path / "sprung").exists()
    # It would have worked.
    monkeypatch.setenv("LIDARCHECK_CACHE", str(tmp_path / "stranger"))
    path.write_bytes(sealed)
    DiskStore(root).get("k")
    assert (tmp_path / "sprung").exists()


@pytest.mark.parametrize("where", [".lidarcheck", ".lidarcheck/cache"])
def test_nothing_is_written_or_removed_through_a_link(root, tmp_path, where):
    away = tmp_path / "away"
    away.mkdir()
    (away / ("0" * 64 + ".result")).write_text("somebody's")
    (root / where).parent.mkdir(exist_ok=True)
    (root / where).symlink_to(away)
    store = DiskStore(root, most=1)
    store.put(result(value="x"))
    assert store.get("k") is None
    assert "is a link" in store.fault
    assert [path.name for path in away.iterdir()] == ["0" * 64 + ".result"]


def test_those_that_were_not_read_for_longest_go_first_and_nothing_else(root):
    store = DiskStore(root, most=50_000)
    for number in range(4):
        store.put(result(str(number), bytes(10_000)))
        (path,) = [path for path in entries(root) if path.stat().st_mtime > 1e6]
        os.utime(path, (number + 1, number + 1))
    assert store.get("0") is not None  # it is the last used now
    (root / ".lidarcheck/cache/notes.txt").write_text("mine" * 20_000)
    for number in (4, 5):
        store.put(result(str(number), bytes(10_000)))
    assert [number for number in range(6) if store.get(str(number)) is not None] == [0, 3, 4, 5]
    assert (root / ".lidarcheck/cache/notes.txt").exists()


def test_two_interfaces_on_one_project_do_not_disturb_each_other(root):
    """Each keeps, looks for and removes entries while the other does."""
    faults = []

    def work(number):
        store = DiskStore(root, most=30_000)
        try:
            for turn in range(40):
                key = str((turn * number) % 7)
                store.put(result(key, key.encode() * 5_000))
                found = store.get(str(turn % 7))
                assert found is None or found.value == str(turn % 7).encode() * 5_000
            assert store.fault == ""
        except BaseException as fault:  # noqa: BLE001 - told where it is looked at
            faults.append(fault)

    threads = [threading.Thread(target=work, args=(number,)) for number in (1, 3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert faults == []
    assert sum(path.stat().st_size for path in entries(root)) <= 36_000
    assert {path.suffix for path in (root / ".lidarcheck/cache").iterdir()} == {".result"}


def test_a_full_disk_is_no_reason_to_fail(root, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    store = DiskStore(root)
    monkeypatch.setattr("lidarcheck.formats.atomic._sync", full)
    store.put(result(value="x"))
    assert "No space left on device" in store.fault
    assert list((root / ".lidarcheck/cache").iterdir()) == []
    monkeypatch.undo()


def test_whatever_is_wrong_with_the_disk_a_result_is_there_and_it_is_said_once(root, monkeypatch, caplog):
    def broken(_self, _key):
        raise RuntimeError("something else")

    monkeypatch.setattr(DiskStore, "get", broken)
    session = Session(Store(disk=DiskStore(root)))
    for number in range(3):
        assert session.compute(Node("number", 1, number, (), lambda _, number=number: number, number)).value == number
    assert caplog.text.count("RuntimeError: something else") == 1


def test_the_secret_is_this_users_alone(root, tmp_path):
    DiskStore(root).put(result(value="x"))
    (secret,) = (tmp_path / "user").glob("*.secret")
    assert stat.S_IMODE(secret.stat().st_mode) == 0o600
    secret.chmod(0o644)  # others may have it by now
    store = DiskStore(root)
    assert store.get("k") is None
    assert "can be read by others" in store.fault
    assert len(entries(root)) == 1


def test_several_that_begin_at_once_have_one_secret(tmp_path):
    found, go = [], threading.Barrier(8)

    def begin():
        go.wait()
        found.append(disk_store._secret_of_user())

    threads = [threading.Thread(target=begin) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 8
    assert len(set(found)) == 1
    assert len(list((tmp_path / "user").iterdir())) == 1


def test_a_session_finds_it_and_it_is_current_only_for_the_same_inputs(root, monkeypatch):
    monkeypatch.setattr(disk_store, "WORTH_S", -1.0)
    made = []

    def node(root):
        path = root / "data.csv"
        return Node("content", 1, "", (path,), lambda _: made.append(1) or path.read_bytes())

    first = Session(Store(disk=DiskStore(root)))
    first.compute(node(root))
    again = Session(Store(disk=DiskStore(root)))
    assert again.status(node(root)) == ("", None)
    assert again.compute(node(root)).value == b"1,2,3\n"
    assert again.status(node(root))[0] == CURRENT
    assert made == [1]
    (root / "data.csv").write_text("4,5,6\n")
    assert again.status(node(root))[0].startswith(OLD)
    assert again.compute(node(root)).value == b"4,5,6\n"
    assert made == [1, 1]
    # What memory has no room for comes back from the disk.
    small = Session(Store(most=1, disk=DiskStore(root)))
    small.compute(node(root))
    small.compute(Node("another", 1, "", (), lambda _: bytes(1000)))
    assert small.store.get(node(root).key(small.inputs())) is None
    assert small.compute(node(root)).value == b"4,5,6\n"
    assert made == [1, 1]
