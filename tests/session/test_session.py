"""What belongs to what is set: keys, states, the store, and any order of edits, undo, saving and reading again."""

import os
import shutil
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from budget import examples
from lidarcheck.errors import InputError, LidarcheckError
from lidarcheck.formats.lut import load_lut
from lidarcheck.formats.source import read_source
from lidarcheck.model import load_model
from lidarcheck.session.canonical import canonical, key_of
from lidarcheck.session.digests import GONE, Digests
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.session.inputs import Inputs
from lidarcheck.session.node import Cancelled, Derived, Node
from lidarcheck.session.session import CURRENT, OLD, SAVED, Session
from lidarcheck.session.store import Store
from tui_kit import LUT, ROOT

MODEL = 'variant = "SLIM"\n[[effects]]\nname = "blooming_vertical"\nlut = "a_lut.ini"\n'


def make(root):
    """A model that names a table, and a measurement."""
    root.mkdir(exist_ok=True)
    (root / "a_lut.ini").write_bytes(LUT.encode())
    (root / "model.toml").write_text(MODEL)
    (root / "data.csv").write_text("1,2,3\n")
    return root


@pytest.fixture
def root(tmp_path):
    return make(tmp_path / "project")


def shares(path):
    """What a model makes of its table: all of its Y."""
    (effect,) = load_model(path).effects
    return tuple(effect.lut.y)


def node_of(root, *, about="one", choices=None):
    return Node(
        "shares", 1, about, (root / "model.toml", root / "data.csv"),
        lambda _progress: (shares(root / "model.toml"), read_source(root / "data.csv")), choices,
    )  # fmt: skip


def opened(session, root):
    file = EditedLut(root / "a_lut.ini", root)
    session.hold(file)
    return file


def test_a_result_belongs_to_the_table_as_it_is_shown(root):
    session = Session()
    node, file = node_of(root), opened(session, root)
    assert session.status(node) == ("", None)
    first = session.compute(node)
    assert session.status(node) == (CURRENT, first)
    file.set("vertical", [3], "512")
    assert session.status(node) == (f"{OLD}, of edit 0", first)
    second = session.compute(node)
    # Computed from the edit, which is not saved: the file has the old table.
    assert second.value[0][3] == pytest.approx(10 ** (-0.007 * 488), abs=5e-8)
    assert load_lut(root / "a_lut.ini").tables["vertical"].y[3] == first.value[0][3]
    assert session.status(node) == (CURRENT, second)
    file.undo()
    assert session.status(node) == (CURRENT, first)  # at once, nothing is computed
    file.redo()
    assert session.status(node) == (CURRENT, second)
    file.save()
    assert session.status(node) == (CURRENT, second)  # the same bytes, now in the file
    file.close()


def test_a_table_that_a_model_names_counts_also_when_it_is_saved_or_changed_elsewhere(root):
    session = Session()
    node = node_of(root)
    session.compute(node)
    (root / "a_lut.ini").write_bytes(LUT.replace("0.0001000", "0.0002000", 1).encode())
    assert session.status(node)[0] == f"{OLD}, a_lut.ini changed"
    (root / "a_lut.ini").unlink()
    assert session.status(node)[0] == f"{OLD}, a_lut.ini changed"
    with pytest.raises(LidarcheckError):
        session.compute(node)
    assert session.status(node)[0].startswith("failed: ")
    assert "a_lut.ini" in session.status(node)[0]
    (root / "a_lut.ini").write_bytes(LUT.encode())
    assert session.status(node)[0] == CURRENT


def test_what_a_computation_opens_without_naming_it_counts_too(root):
    (root / "hidden.csv").write_text("4\n")
    node = Node("reads more", 1, "", (), lambda _: read_source(root / "hidden.csv"))
    session = Session()
    session.compute(node)
    assert session.status(node)[0] == CURRENT
    (root / "hidden.csv").write_text("5\n")
    assert session.status(node)[0].startswith(OLD)
    assert session.compute(node).value == b"5\n"


def test_a_program_that_reads_the_file_itself_is_no_result_of_the_edit(root):
    """An external model, or a reader that goes past the edits, must not pass for one that has seen them."""
    session = Session()
    file = opened(session, root)
    node = Node("past", 1, "", (root / "a_lut.ini",), lambda _: (root / "a_lut.ini").read_bytes())
    session.compute(node)
    file.set("vertical", [3], "512")
    with pytest.raises(InputError, match=r"not saved.*save it first"):
        session.compute(node)
    assert session.status(node)[0].startswith("failed: ")
    file.save()
    assert session.compute(node).value == (root / "a_lut.ini").read_bytes()
    file.close()


def test_a_file_that_changes_while_it_is_read_gives_nothing(root):
    session = Session()

    def compute(_):
        found = read_source(root / "data.csv")
        (root / "data.csv").write_text("changed meanwhile\n")
        return found

    node = Node("slow", 1, "", (root / "data.csv",), compute)
    with pytest.raises(InputError, match=r"data\.csv.*changed while"):
        session.compute(node)
    assert session.current(node) is None


def test_an_edit_while_it_is_computed_gives_a_result_of_before(root):
    session = Session()
    file, begun, go = opened(session, root), threading.Event(), threading.Event()

    def compute(progress):
        found = shares(root / "model.toml")
        progress(2, 5, "working")
        begun.set()
        go.wait(20.0)
        return found

    node = Node("slow", 1, "", (root / "model.toml",), compute)
    thread = threading.Thread(target=lambda: session.compute(node))
    thread.start()
    begun.wait(20.0)
    assert session.status(node)[0] == "computing 2/5"
    file.set("vertical", [3], "512")
    assert session.status(node) == ("", None)
    go.set()
    thread.join()
    assert session.status(node)[0] == f"{OLD}, of edit 0"
    file.undo()
    assert session.status(node)[0] == CURRENT
    file.close()


def test_what_was_stopped_has_no_state(root):
    session = Session()

    def compute(_):
        raise Cancelled

    node = Node("stopped", 1, "", (root / "data.csv",), compute)
    with pytest.raises(Cancelled):
        session.compute(node)
    assert session.status(node) == ("", None)


def test_other_choices_are_another_result(root):
    session = Session()
    one, other = node_of(root, choices=("AREA", 1)), node_of(root, choices=("PEAK", 1))
    session.compute(one)
    assert session.current(one) is not None
    assert session.current(other) is None
    assert node_of(root, choices=("AREA", 1.0)).key(session.inputs()) != one.key(session.inputs())


def test_what_a_command_made_is_of_the_saved_files(root):
    session = Session()
    file = opened(session, root)
    paths = [str(root / "model.toml"), str(root / "a_lut.ini")]
    read = {path: Digests().of(path) for path in paths}
    assert session.state_of(read) == CURRENT
    file.set("vertical", [3], "512")
    assert session.state_of(read) == SAVED
    assert session.unsaved() == 1
    file.undo()
    assert session.state_of(read) == CURRENT
    file.redo()
    file.save()
    assert session.state_of(read) == f"{OLD}, a_lut.ini changed"
    assert session.state_of({}, code="another") == f"{OLD}, of another lidarcheck"
    file.close()


def test_a_change_by_another_program_is_seen_within_two_seconds(root):
    session, heard = Session(), threading.Event()
    node = node_of(root)
    session.compute(node)
    session.on_change = heard.set
    session.watch()
    try:
        time.sleep(0.1)
        assert not heard.is_set()
        (root / "data.csv").write_text("9,9,9\n")
        assert heard.wait(2.0)
        assert session.status(node)[0] == f"{OLD}, data.csv changed"
    finally:
        session.close()


def test_a_file_of_the_same_size_and_time_is_not_taken_for_the_same(root):
    path, digests = root / "data.csv", Digests()
    stat = path.stat()
    before = digests.of(path)
    path.write_text("3,2,1\n")
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    assert digests.of(path) != before
    path.unlink()
    assert digests.of(path) == GONE


def test_the_store_holds_so_many_bytes_and_the_last_used():
    store = Store(most=3_000_000)
    values = [np.full(125_000, float(i)) for i in range(4)]  # 1 MB each
    for i, value in enumerate(values[:2]):
        store.put(Derived({"figure": [value]}, str(i), {}, 0, 0.0, 0.0))
    assert store.get("0") is not None
    store.put(Derived(values[2], "2", {}, 0, 0.0, 0.0))
    assert store.get("1") is None
    assert store.get("0") is not None
    assert store.held <= 3_000_000
    store.put(Derived(np.zeros(10**6), "large", {}, 0, 0.0, 0.0))
    assert store.get("large") is not None
    assert store.get("2") is None


@dataclass(frozen=True)
class _Choice:
    name: str
    number: float


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1, 1.0), (True, 1), ("1", 1), (0.1, float(np.nextafter(0.1, 1.0))), (None, ""), ((1, 2), (2, 1)), (b"a", "a"),
        (np.zeros(2), np.zeros(3)), (np.zeros(2), np.zeros(2, dtype=np.float32)), ({"a": 1}, {"a": 2}),
        (_Choice("a", 1.0), _Choice("a", 2.0)), (Path("a"), "a"), (frozenset({1}), frozenset({2})),
        ([[1], 2], [1, [2]]),
    ],
)  # fmt: skip
def test_different_choices_are_spelled_differently(one, other):
    assert key_of("node", 1, one) != key_of("node", 1, other)
    assert key_of("node", 1, one) == key_of("node", 1, one)
    assert key_of("node", 1, one) != key_of("node", 2, one)
    with pytest.raises(TypeError):
        canonical(print)


def test_equal_choices_have_one_key():
    assert key_of("node", 1, {"a": 1, "b": (2.0, None)}) == key_of("node", 1, {"b": [2.0, None], "a": 1})


STEPS = ("edit", "insert", "remove", "undo", "redo", "save", "reload", "elsewhere", "model", "keep", "compute")


@settings(max_examples=examples(60), deadline=None)
@given(st.lists(st.tuples(st.sampled_from(STEPS), st.integers(1, 1000), st.integers(1, 8)), max_size=14))
def test_whatever_is_done_current_is_what_a_fresh_computation_gives(steps):
    """Any order of edits, undo, saving, reading again, and changes by other programs."""
    root = make(Path(os.environ.get("TMPDIR", "/tmp")) / f"lidarcheck-session-{os.getpid()}")
    try:
        session = Session()
        file, node = opened(session, root), node_of(root)
        for step, number, row in steps:
            _do(step, number, row, file, root)
            if step == "compute":
                session.compute(node)
            _holds(session, node, file, root)
        session.compute(node)
        assert session.status(node)[0] == CURRENT
        _holds(session, node, file, root)
        file.close()
    finally:
        shutil.rmtree(root)


def _do(step, number, row, file, root):
    row = min(row, len(file.current.tables["vertical"]) - 1)
    path = root / "a_lut.ini"
    if step == "edit":
        file.set("vertical", [row], str(number))
    elif step == "insert":
        file.insert("vertical", row)
    elif step == "remove":
        file.remove("vertical", [row])
    elif step == "undo":
        file.undo()
    elif step == "redo":
        file.redo()
    elif step == "save":
        file.save(overwrite=True)
    elif step == "reload":
        file.reload()
    elif step == "elsewhere":
        path.write_bytes(load_lut(path).with_scaled("vertical", 0, number).content)
    elif step == "model":
        (root / "model.toml").write_text(MODEL + f"bright_signal = {number}\n")
    elif step == "keep" and file.changed_on_disk():
        file.accept_disk()


def _holds(session, node, file, root):
    """What is called current is what is shown gives, computed by nothing of the session."""
    word, derived = session.status(node)
    if word != CURRENT:
        return
    # A file without edits is what the disk has; one with edits is what is shown.
    table = file.current if file.dirty else load_lut(root / "a_lut.ini")
    assert derived.value[0] == tuple(table.tables["vertical"].y)
    assert derived.value[1] == (root / "data.csv").read_bytes()
    fresh = Session().compute(Node("fresh", 1, "", (), node.compute)) if not file.dirty else None
    assert fresh is None or fresh.value == derived.value


BLOCKER = """
import importlib.abc, pkgutil, sys
class Blocked(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name.split(".")[0] in {"textual", "plotext", "rich", "matplotlib"}:
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Blocked())
import lidarcheck.session
for module in pkgutil.iter_modules(lidarcheck.session.__path__):
    __import__(f"lidarcheck.session.{module.name}")
    print(module.name)
"""


def test_the_sessions_modules_import_without_a_terminals_libraries():
    env = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    done = subprocess.run([sys.executable, "-c", BLOCKER], check=False, capture_output=True, text=True, env=env)
    assert done.returncode == 0, done.stderr
    assert "session" in done.stdout.split()
    assert "edited_lut" in done.stdout.split()


def test_a_key_is_the_same_in_another_process(root):
    program = (
        "import sys\nfrom pathlib import Path\nfrom lidarcheck.session.inputs import Inputs\n"
        "from lidarcheck.session.node import Node\n"
        "print(Node('shares', 1, '', (Path(sys.argv[1]),), print, ('AREA', 2.5)).key(Inputs()))"
    )
    keys = {
        subprocess.run(
            [sys.executable, "-c", program, str(root / "model.toml")], check=True, capture_output=True, text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT / "src"), "PYTHONHASHSEED": seed},
        ).stdout.strip()
        for seed in ("1", "2")
    }  # fmt: skip
    assert keys == {Node("shares", 1, "", (root / "model.toml",), print, ("AREA", 2.5)).key(Inputs())}
