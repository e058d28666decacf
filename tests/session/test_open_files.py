"""Several files edited as one: whose edit is taken back, what it was before, and saving all of them."""

import json
import os
import subprocess
import sys

import pytest

from lidarcheck.errors import InputError, LidarcheckError
from lidarcheck.formats.lut import load_lut
from lidarcheck.session import open_files
from lidarcheck.session.edited_file import ChangedOnDisk
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.session.edited_settings import EditedSettings
from lidarcheck.session.open_files import OpenFiles
from tui_kit import LUT, ROOT

V = "vertical"


@pytest.fixture
def root(tmp_path):
    for name in ("a", "b"):
        (tmp_path / f"{name}.ini").write_bytes(LUT.encode())
    return tmp_path


class Opened:
    """Both tables and the settings of a project, as a session has them."""

    def __init__(self, root):
        self.files = OpenFiles()
        self.a, self.b = (EditedLut(root / f"{name}.ini", root) for name in ("a", "b"))
        self.s = EditedSettings(root / "Blooming_Calibration_V_SLIM.json", root, V)
        self.all = (self.a, self.b, self.s)
        for file in self.all:
            self.files.hold(file)

    def bring_back(self):
        for file in self.all:
            if file.found:
                file.bring_back()
        return self

    def crash(self):
        for file in self.all:
            file._journal.close()
            file._lock.drop()

    def contents(self):
        return [file.content for file in self.all]

    def history(self):
        return [(step.path.name[0], step.what, step.undone) for step in self.files.steps()[:-1]]

    def close(self):
        for file in self.all:
            file.close()


@pytest.fixture
def opened(root):
    one = Opened(root)
    yield one
    one.close()


def some_edits(opened):
    """Edits in turn, with what all files held before each."""
    contents = []
    for number, file in enumerate((opened.a, opened.b, opened.s, opened.a)):
        contents.append(opened.contents())
        if file is opened.s:
            file.add("120")
        else:
            file.set(V, [number + 1], str(400 + number))
    return [*contents, opened.contents()]


def test_the_last_edit_of_all_is_taken_back_and_made_again(opened):
    contents = some_edits(opened)
    names = [opened.files.undo().path.name[0] for _ in range(2)]
    assert names == ["a", "B"]
    assert opened.contents() == contents[2]
    assert opened.files.redo().path == opened.s.path
    assert opened.contents() == contents[3]
    for at in (2, 1, 0):
        assert opened.files.undo() is not None
        assert opened.contents() == contents[at]
    assert opened.files.undo() is None
    for at in (1, 2, 3, 4):
        opened.files.redo()
        assert opened.contents() == contents[at]
    assert opened.files.redo() is None


def test_an_edit_of_any_file_ends_what_could_be_made_again(opened):
    some_edits(opened)
    opened.files.undo()
    opened.files.undo()
    opened.b.set(V, [5], "333")
    assert opened.files.redo() is None
    assert opened.files.undo().what == "set 333"
    # What was dead stays dead: only the edit that was taken back just now comes again.
    assert opened.files.redo().what == "set 333"
    assert opened.files.redo() is None


def test_after_a_crash_the_order_is_as_it_was(opened, root):
    some_edits(opened)
    opened.files.undo()
    opened.files.undo()
    opened.b.set(V, [5], "333")
    opened.files.undo()
    before, contents = opened.history(), opened.contents()
    opened.crash()
    again = Opened(root).bring_back()
    assert again.history() == before
    assert again.contents() == contents
    assert [again.files.redo().what, again.files.redo()] == ["set 333", None]
    assert [again.files.undo().what for _ in range(3)] == ["set 333", "set 401", "set 400"]
    assert again.files.undo() is None
    # The next number is above all that were ever given.
    known = {step.number for step in again.files.steps()}
    again.a.set(V, [2], "777")
    assert again.files.edit > max(known)
    again.close()


def test_a_journal_of_an_older_version_is_read(opened, root):
    some_edits(opened)
    opened.a.undo()
    opened.crash()
    for path in (root / ".lidarcheck/tui").glob("*.journal"):
        records = [json.loads(line) for line in path.read_text().splitlines()]
        for record in records:
            record.pop("n", None)
        path.write_text("".join(json.dumps(record) + "\n" for record in records))
    again = Opened(root).bring_back()
    assert again.contents() == opened.contents()
    again.a.set(V, [3], "555")
    assert again.files.undo().what == "set 555"
    while again.files.undo():
        pass
    assert [file.dirty for file in again.all] == [False] * 3
    again.close()


def test_what_it_was_at_the_start_before_and_at_the_baseline(opened, root, monkeypatch):
    files, real = opened.files, {name: os.path.realpath(root / f"{name}.ini") for name in "ab"}
    assert files.start().edited == files.before().edited == {}
    opened.a.set(V, [1], "400")
    first = opened.a.content
    opened.a.save()
    opened.a.set(V, [2], "401")
    opened.b.set(V, [3], "402")
    assert files.inputs().edited == {real["a"]: opened.a.content, real["b"]: opened.b.content}
    # The file was saved since: what it was at the start is no longer what the disk has.
    assert files.start().edited == {real["a"]: LUT.encode()}
    assert files.before().edited == {real["a"]: opened.a.content}
    files.undo()
    assert files.before().edited == {}  # the saved content of a, which the disk has
    files.pin()
    files.undo()
    assert files.baseline() == files.before()
    assert files.before().edited[real["a"]] != first
    files.unpin()
    assert files.baseline() is None
    assert files.before().edited == {real["a"]: LUT.encode()}
    # Settings that no file has are nothing that could have been there at the start.
    assert os.path.realpath(opened.s.path) not in files.start().edited


def test_edits_of_the_same_rows_within_a_moment_are_one_step(opened, monkeypatch):
    now_s = [100.0]
    monkeypatch.setattr(open_files.time, "monotonic", lambda: now_s[0])
    files, real = opened.files, os.path.realpath(opened.a.path)
    for _ in range(5):
        now_s[0] += 1.5
        opened.a.nudge(V, [1], 1)
    assert files.before().edited == {}
    assert {step.burst for step in files.steps()[:-1]} == {1}
    held = opened.a.content
    opened.a.nudge(V, [2], 1)  # another row
    assert files.before().edited == {real: held}
    held = opened.a.content
    now_s[0] += 2.5
    opened.a.nudge(V, [2], 1)  # later
    assert files.before().edited == {real: held}
    files.undo()
    held = opened.a.content
    opened.a.nudge(V, [2], 1)  # what is taken back ends a step
    assert files.before().edited == {real: held}


def test_numbers_are_kept_beside_edits(opened):
    opened.a.set(V, [1], "400")
    opened.files.note("sign_69m", 1.84)
    opened.files.note("sign_69m", 3.9, edit=0)
    opened.files.undo()
    opened.files.note("sign_157m", 2.0)
    steps = opened.files.steps()
    assert [(step.number, step.what, step.undone) for step in steps] == [(1, "set 400", True), (0, "as read", False)]
    assert [step.numbers for step in steps] == [{"sign_69m": 1.84}, {"sign_69m": 3.9, "sign_157m": 2.0}]
    assert steps[0].about == "vertical X -120"
    assert opened.files.apply(opened.b, lambda file: file.set(V, [1], "401")).path == opened.b.path
    assert opened.files.apply(opened.b, lambda file: file.set(V, [1], "401")) is None


def test_all_are_saved_or_none_where_one_may_not_be(opened, root):
    some_edits(opened)
    (root / "b.ini").write_bytes(LUT.replace("our", "my").encode())
    with pytest.raises(ChangedOnDisk, match=r"b\.ini"):
        opened.files.save()
    assert (root / "a.ini").read_bytes() == LUT.encode()
    assert not opened.s.path.exists()
    saved = opened.files.save(overwrite=True)
    assert [path for path, _ in saved] == [root / "a.ini", root / "b.ini", opened.s.path]
    assert not any(file.dirty for file in opened.all)
    assert load_lut(root / "a.ini").tables[V].rows()[1].scaled == 400
    # They can still be taken back, in their order.
    assert opened.files.undo().path == root / "a.ini"
    assert opened.a.dirty


FULL = r"""
import resource, signal, sys
sys.path[:0] = sys.argv[2:]
from pathlib import Path
import test_open_files as t
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
one = t.Opened(Path(sys.argv[1]))
one.a.set(t.V, [1], "400")
one.s.add("120")
one.b.set(t.V, [2], "401")
# No file may become larger than the first is: the disk is full for the second, which is longer.
one.b.current = one.b._parse(one.b.content + b"\n# " + b"x" * 3000)
resource.setrlimit(resource.RLIMIT_FSIZE, (2500, 2500))
try:
    one.files.save()
except Exception as error:
    print(type(error).__name__, error)
print([file.dirty for file in one.all])
"""


def test_a_disk_that_is_full_in_the_middle_leaves_every_file_whole(root):
    """A real process whose files may not grow: each is the old or the new one, and what is not saved stays an edit."""
    (root / "b.ini").write_bytes(LUT.encode())
    paths = [str(ROOT / "tests/session"), str(ROOT / "tests/kits"), str(ROOT / "tests")]
    env = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(root), *paths], check=False, capture_output=True, text=True, env=env
    )
    assert done.returncode == 0, done.stderr
    said, dirty = done.stdout.splitlines()
    assert said.startswith("InputError error: ")
    assert "b.ini: cannot write: File too large; a.ini is saved; nothing was changed" in said
    assert dirty == "[False, True, True]"
    assert load_lut(root / "a.ini").tables[V].rows()[1].scaled == 400
    assert (root / "b.ini").read_bytes() == LUT.encode()
    assert [path.name for path in root.iterdir() if path.suffix == ".part"] == []


@pytest.mark.parametrize("way", ["gone", "a directory", "no table"])
def test_a_file_that_goes_while_it_is_open_is_asked_about_and_nothing_is_lost(opened, root, way):
    opened.a.set(V, [1], "400")
    (root / "a.ini").unlink()
    if way == "a directory":
        (root / "a.ini").mkdir()
    elif way == "no table":
        (root / "a.ini").write_text("nothing")
    says = {"gone": "was removed", "a directory": r"cannot be read any more", "no table": "changed"}[way]
    with pytest.raises(ChangedOnDisk, match=says):
        opened.files.save()
    with pytest.raises(LidarcheckError):
        opened.a.reload()
    assert opened.a.content != LUT.encode()
    opened.a.accept_disk()
    assert opened.files.inputs().edited[os.path.realpath(root / "a.ini")] == opened.a.content
    if way == "a directory":
        with pytest.raises(InputError, match="it is a directory"):
            opened.files.save()
        (root / "a.ini").rmdir()
        opened.a.accept_disk()
    opened.files.save()
    assert load_lut(root / "a.ini").tables[V].rows()[1].scaled == 400
    assert opened.files.undo().what == "set 400"
    assert opened.a.content == LUT.encode()


def test_a_second_terminal_may_look_and_takes_over_what_was_saved(opened, root):
    other = Opened(root)
    assert all(file.read_only for file in other.all)
    opened.a.set(V, [1], "400")
    assert other.files.undo() is None
    assert other.files.inputs().edited == {}
    opened.files.save()
    opened.close()
    assert other.a.claim_again()
    assert other.a.content == (root / "a.ini").read_bytes()
    other.a.set(V, [2], "401")
    assert other.files.undo().what == "set 401"
    other.close()
