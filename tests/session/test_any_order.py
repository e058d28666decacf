"""Whatever is done in whatever order: what is called current is what a fresh computation gives, and undo is exact."""

import contextlib
import os
import shutil

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import worker_entries
from budget import examples
from lidarcheck.errors import LidarcheckError
from lidarcheck.formats import atomic
from lidarcheck.reading import reading
from lidarcheck.session import disk_store
from lidarcheck.session.disk_store import DiskStore
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.session.edited_settings import EditedSettings
from lidarcheck.session.node import Node
from lidarcheck.session.session import CURRENT, Session
from lidarcheck.session.store import Store
from lidarcheck.session.ticket import Outcome, Ticket
from tui_kit import LUT

MODEL = 'variant = "SLIM"\n[[effects]]\nname = "blooming_vertical"\nlut = "{}.ini"\n'
SETTINGS = "Blooming_Calibration_V_SLIM.json"


class LateWorker:
    """Reads at once or only when it is told to answer, and answers then; for what `want` asks of a worker."""

    def __init__(self):
        self.waiting = []

    def submit(self, entry, arguments, edited, on_progress, on_done, *, on_gone, lane, priority):
        ticket = Ticket(0, lane, (priority, 0), ())
        ticket.on_done, ticket.on_gone = on_done, on_gone
        for one, _, _ in self.waiting:
            if one.lane == lane:
                self.cancel(one)
        read = lambda: _outcome(arguments, edited, on_progress)  # noqa: E731
        self.waiting.append((ticket, read, None if len(self.waiting) % 2 else read()))
        return ticket

    def cancel(self, ticket):
        if ticket.live:
            ticket.live = False
            ticket.on_gone()

    def answer(self):
        if self.waiting:
            ticket, read, outcome = self.waiting.pop(0)
            outcome = outcome or read()
            if ticket.live:
                ticket.live = False
                ticket.on_done(outcome)


def _outcome(arguments, edited, on_progress):
    with reading(edited) as read:
        try:
            value = worker_entries.of_table(*arguments, progress=on_progress)
        except LidarcheckError as error:
            return Outcome(failed=str(error))
    return Outcome(value, "", 2.0, dict(read.files), frozenset(read.taken))


class Bench:
    """A project with two models and their tables, settings and data, open in a session that can end and begin again."""

    def __init__(self, root):
        self.root = root
        root.mkdir()
        for name in ("a", "b"):
            (root / f"{name}.ini").write_bytes(LUT.encode())
            (root / f"{name}.toml").write_text(MODEL.format(name))
        (root / "data.csv").write_text("1\n")
        self.begin()

    def begin(self):
        self.worker = LateWorker()
        self.session = Session(Store(disk=DiskStore(self.root)), self.worker)
        self.tables = [EditedLut(self.root / f"{name}.ini", self.root) for name in ("a", "b")]
        self.settings = EditedSettings(self.root / SETTINGS, self.root, "vertical")
        for file in self.files:
            if file.found:
                file.bring_back()
            self.session.hold(file)

    @property
    def files(self):
        return [*self.tables, self.settings]

    @property
    def contents(self):
        return [file.content for file in self.files]

    def end(self, *, killed):
        for file in self.files:
            if killed:
                file._journal.close()
                file._lock.drop()
            else:
                file.close()

    def nodes(self):
        others = (self.root / "data.csv", self.root / SETTINGS)
        for name in ("a", "b"):
            model, table = self.root / f"{name}.toml", self.root / f"{name}.ini"
            arguments = (model, table, others)
            yield Node("table", 1, name, (model, table, *others), entry="worker_entries:of_table", arguments=arguments)

    def holds(self):
        """Computed by nothing of the session: from what is shown of files with edits, else from the disk."""
        for node in self.nodes():
            word, derived = self.session.status(node)
            if word == CURRENT:
                with reading({os.path.realpath(file.path): file.content for file in self.files if file.dirty}):
                    assert derived.value == worker_entries.of_table(*node.arguments, progress=lambda *_: None)


EDITS = ("set", "set", "insert", "remove", "settings")
STEPS = (
    *EDITS, "undo", "undo", "redo", "save", "save them", "disk full", "reload", "keep", "elsewhere", "data", "model",
    "gone", "a directory", "back", "compute", "compute", "want", "want", "answer", "answer", "cancel",
    "pin", "end", "kill",
)  # fmt: skip


def do(bench, step, number, row):
    session, file, which = bench.session, bench.tables[number % 2], "ab"[number % 2]
    row = min(row, len(file.current.tables["vertical"]) - 1)
    if step == "set":
        file.set("vertical", [row], str(number))
    elif step == "insert":
        file.insert("vertical", row)
    elif step == "remove":
        file.remove("vertical", [row])
    elif step == "settings":
        bench.settings.add(str(50 + number))
    elif step in ("undo", "redo"):
        getattr(session, step)()
    elif step == "save them":
        session.save()
    elif step == "save":
        session.save(overwrite=True)
    elif step == "disk full":
        _save_on_full_disk(session)
    elif step == "reload":
        file.reload()
    elif step == "keep" and file.changed_on_disk():
        file.accept_disk()
    elif step in ("end", "kill"):
        with contextlib.suppress(LidarcheckError, OSError):
            bench.end(killed=step == "kill")
        for which in "ab":  # only a table that is there can be opened
            _outside(bench, "back", number, which)
        bench.begin()
    elif step == "pin":
        session.pin()
    else:
        _outside(bench, step, number, which)


def _outside(bench, step, number, which):
    """Other programs, and what is computed."""
    path, nodes = bench.root / f"{which}.ini", list(bench.nodes())
    if step == "data":
        (bench.root / "data.csv").write_text(f"{number % 3}\n")
    elif step == "model":
        (bench.root / f"{which}.toml").write_text(MODEL.format(which) + f"# {number % 3}\n")
    elif step == "elsewhere" and not path.is_dir():
        path.write_bytes(LUT.replace("our", f"my {number % 3}").encode())
    elif step in ("gone", "a directory") and path.is_file():
        path.unlink()
        if step == "a directory":
            path.mkdir()
    elif step == "back" and not path.is_file():
        if path.is_dir():
            path.rmdir()
        path.write_bytes(LUT.encode())
    elif step == "compute":
        bench.session.compute(nodes[number % 2])
    elif step == "want":
        inputs = [None, bench.session.start(), bench.session.before()][number % 3]
        bench.session.want(nodes[number % 2], inputs=inputs, lane=which)
    elif step == "answer":
        bench.worker.answer()
    elif step == "cancel" and bench.worker.waiting:
        bench.worker.cancel(bench.worker.waiting[0][0])


def _save_on_full_disk(session):
    def full(_path):
        raise OSError(28, "No space left on device")

    before, atomic._sync = atomic._sync, full
    try:
        session.save(overwrite=True)
    finally:
        atomic._sync = before


@pytest.fixture(scope="module")
def bench_at(tmp_path_factory):
    """A bench in an empty directory, over and over."""
    directory, patch = tmp_path_factory.mktemp("order"), pytest.MonkeyPatch()
    patch.setattr(disk_store, "WORTH_S", -1.0)
    patch.setenv("LIDARCHECK_CACHE", str(directory / "user"))

    @contextlib.contextmanager
    def begin():
        bench = Bench(directory / "project")
        try:
            yield bench
        finally:
            bench.end(killed=True)
            shutil.rmtree(bench.root)

    yield begin
    patch.undo()


ANY = st.tuples(st.sampled_from(STEPS), st.integers(1, 999), st.integers(1, 8))


@settings(max_examples=examples(90), deadline=None)
@given(steps=st.lists(ANY, min_size=4, max_size=20))
def test_what_is_called_current_is_what_a_fresh_computation_gives(bench_at, steps):
    with bench_at() as bench:
        for step, number, row in steps:
            # A step that cannot be made, as a file that is gone, is refused in words; what is shown still holds.
            with contextlib.suppress(LidarcheckError):
                do(bench, step, number, row)
            bench.holds()
        for _ in range(len(bench.worker.waiting)):
            bench.worker.answer()
            bench.holds()


REVERSIBLE = st.tuples(
    st.sampled_from((*EDITS, "undo", "undo", "redo", "save", "kill")), st.integers(1, 999), st.integers(1, 8)
)


@settings(max_examples=examples(90), deadline=None)
@given(steps=st.lists(REVERSIBLE, min_size=6, max_size=20))
def test_undo_over_all_files_gives_each_state_back_whatever_was_saved_or_killed(bench_at, steps):
    with bench_at() as bench:
        states, at, saved = [bench.contents], 0, False
        for step, number, row in steps:
            before = bench.contents
            with contextlib.suppress(LidarcheckError):
                do(bench, step, number, row)
            saved = saved or step == "save"
            if step == "kill" and saved:
                assert bench.contents == before
                return  # the edits of a file that was saved are its own, and not brought back
            if step in EDITS and bench.contents != before:
                states, at = [*states[: at + 1], bench.contents], at + 1
            elif step in ("undo", "redo"):
                at = max(min(at + (1 if step == "redo" else -1), len(states) - 1), 0)
            assert bench.contents == states[at], step
