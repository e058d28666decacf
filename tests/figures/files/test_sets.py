"""Results of several files take their places together or not at all."""

import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from lidarcheck.errors import InputError
from lidarcheck.figures.files.outputs import check_writable
from lidarcheck.figures.files.result_folder import check_out_dir
from lidarcheck.figures.files.sets import Folder, as_it_was, write_set

FILES = ("model.toml", "report.json")


def contents(place: Path) -> dict[str, str]:
    return {str(path.relative_to(place)): path.read_text() for path in sorted(place.rglob("*")) if path.is_file()}


def earlier(out: Path) -> dict[str, str]:
    """A set of an earlier run, and a file of the user's."""
    (out / "pictures").mkdir(parents=True)
    for name in (*FILES, "mine.txt", "pictures/01-old.png", "pictures/mine.png"):
        (out / name).write_text(f"old {name}")
    return contents(out)


def writers(fail: BaseException | None = None, at: str = "") -> tuple[dict[str, object], dict[str, Folder]]:
    def write(path: Path) -> None:
        path.write_text(f"new {path.name}")
        if path.name == at and fail is not None:
            raise fail

    folder = Folder(lambda place: write(place / "01-new.png"), re.compile(r"[0-9]+-.*\.png"))
    return dict.fromkeys(FILES, write), {"pictures": folder}


def test_a_set_takes_its_place_and_nothing_else_stays(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write_set(out, *writers())  # type: ignore[arg-type]
    new = {"model.toml": "new model.toml", "pictures/01-new.png": "new 01-new.png", "report.json": "new report.json"}
    assert contents(out) == new
    other = tmp_path / "other"
    earlier(other)
    (other / "model.toml").chmod(0o640)
    write_set(other, *writers())  # type: ignore[arg-type]
    assert contents(other) == {**new, "mine.txt": "old mine.txt", "pictures/mine.png": "old pictures/mine.png"}
    assert (other / "model.toml").stat().st_mode & 0o777 == 0o640
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other", "out"]


@pytest.mark.parametrize("at", [*FILES, "01-new.png"])
@pytest.mark.parametrize("fail", [OSError(28, "No space left on device"), KeyboardInterrupt(), ValueError("bug")])
@pytest.mark.parametrize("before", [True, False])
def test_what_breaks_off_changes_nothing(tmp_path: Path, at: str, fail: BaseException, before: bool) -> None:
    out = tmp_path / "out"
    old = earlier(out) if before else {}
    with pytest.raises(InputError if isinstance(fail, OSError) else type(fail)) as caught:
        write_set(out, *writers(fail, at))  # type: ignore[arg-type]
    if isinstance(fail, OSError):
        assert str(caught.value).startswith(f"error: {out}: cannot write: No space left on device; nothing was changed")
    assert (contents(out) if before else {}) == old
    assert [path.name for path in tmp_path.iterdir()] == ["out"] * before


@pytest.mark.parametrize("broken", range(7))
def test_a_rename_that_fails_is_taken_back(tmp_path: Path, broken: int, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "out"
    old = earlier(out)
    replace, calls = Path.replace, []

    def once_broken(self: Path, target: Path) -> Path:
        calls.append(target)
        if len(calls) == broken:
            raise OSError(5, "Input/output error")
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", once_broken)
    if broken in (0, 7):
        write_set(out, *writers())  # type: ignore[arg-type]
        assert len(calls) == 6
        return
    with pytest.raises(InputError, match="nothing was changed"):
        write_set(out, *writers())  # type: ignore[arg-type]
    assert contents(out) == old
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_errors_name_the_place_and_not_where_it_was_made(tmp_path: Path) -> None:
    def refuses(path: Path) -> None:
        raise InputError("cannot be", file=path, line=3, fix="do otherwise")

    with pytest.raises(InputError) as caught:
        write_set(tmp_path / "out", {"a.txt": refuses})
    assert str(caught.value) == f"error: {tmp_path / 'out' / 'a.txt'}:3: cannot be; do otherwise"


def test_a_file_may_read_one_that_was_written_before_it(tmp_path: Path) -> None:
    write_set(
        tmp_path / "out",
        {
            "lut.ini": lambda path: path.write_text("lut"),
            "model.toml": lambda path: path.write_text(f"names {path.with_name('lut.ini').read_text()}"),
        },
    )
    assert (tmp_path / "out" / "model.toml").read_text() == "names lut"


KILLED = """
import os, pathlib, signal, sys
from lidarcheck.figures.files.sets import write_set
out, at = pathlib.Path(sys.argv[1]), int(sys.argv[2])
replace, calls = pathlib.Path.replace, []
def killed(self, target):
    calls.append(target)
    if len(calls) == at:
        os.kill(os.getpid(), getattr(signal, sys.argv[3]))
    return replace(self, target)
pathlib.Path.replace = killed
write_set(out, {name: lambda path: path.write_text("new " + path.name) for name in ("model.toml", "report.json")})
"""


@pytest.mark.parametrize("at", [1, 2, 3, 4])
def test_a_run_that_was_killed_midway_is_undone_by_the_next(tmp_path: Path, at: int) -> None:
    out = tmp_path / "out"
    old = earlier(out)
    run = subprocess.run([sys.executable, "-c", KILLED, str(out), str(at), "SIGKILL"], check=False, capture_output=True)
    assert run.returncode == -signal.SIGKILL
    assert len(list(tmp_path.iterdir())) == 2
    with pytest.raises(ValueError, match="bug"):
        write_set(out, *writers(ValueError("bug"), "model.toml"))  # type: ignore[arg-type]
    assert contents(out) == old
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("at", [1, 4])
def test_an_interrupt_amid_the_exchange_waits_for_its_end(tmp_path: Path, at: int) -> None:
    out = tmp_path / "out"
    earlier(out)
    run = subprocess.run(
        [sys.executable, "-c", KILLED, str(out), str(at), "SIGINT"],
        check=False,
        capture_output=True,
        # A background job of a shell inherits that SIGINT is ignored, and the tests may be one.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert run.returncode == -signal.SIGINT
    assert {contents(out)[name] for name in FILES} == {f"new {name}" for name in FILES}
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("there", [True, False])
def test_files_are_put_back_where_a_block_fails(tmp_path: Path, there: bool) -> None:
    file = tmp_path / "a.txt"
    if there:
        file.write_text("old")
    with pytest.raises(KeyboardInterrupt), as_it_was([file]):  # noqa: PT012
        new = tmp_path / "b"
        new.write_text("new")
        new.replace(file)
        raise KeyboardInterrupt
    assert contents(tmp_path) == ({"a.txt": "old"} if there else {})


def test_read_only_places_are_refused_before_the_work_and_at_its_end(tmp_path: Path) -> None:
    out = tmp_path / "out"
    old = earlier(out)
    (out / "report.json").chmod(0o444)
    with pytest.raises(InputError, match=r"report\.json: cannot write: it is read-only; make it writable"):
        write_set(out, *writers())  # type: ignore[arg-type]
    with pytest.raises(InputError, match="cannot be replaced"):
        check_out_dir(out, files=["report.json"])
    with pytest.raises(InputError, match="is read-only; make it writable"):
        check_writable(out / "report.json", option="--json")
    assert contents(out) == old


@pytest.mark.parametrize("link", ["symlink_to", "hardlink_to"])
def test_no_output_may_be_an_input_by_whatever_name(tmp_path: Path, link: str) -> None:
    read = tmp_path / "scan.txt"
    read.write_text("x")
    getattr(tmp_path / "result.json", link)(read)
    with pytest.raises(InputError, match="would replace another file of this command"):
        check_writable(tmp_path / "result.json", option="--json", besides=[read])
    with pytest.raises(InputError, match="would replace"):
        check_out_dir(tmp_path, besides=[read])


def test_two_processes_leave_each_others_parts_alone(tmp_path: Path) -> None:
    code = (
        "import sys, time; from lidarcheck.formats.atomic import atomic_write\n"
        "with atomic_write(sys.argv[1]) as stream:\n    stream.write(b'other'); print(flush=True); sys.stdin.read()"
    )
    other = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path / "a.txt")], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert other.stdout is not None
    other.stdout.readline()
    from lidarcheck.formats.atomic import write_text

    write_text(tmp_path / "a.txt", "mine")
    assert len(list(tmp_path.glob(".*.part"))) == 1
    other.communicate()
    assert contents(tmp_path) == {"a.txt": "other"}
