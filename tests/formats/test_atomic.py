"""Files are written whole or not at all."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from lidarcheck.errors import InputError
from lidarcheck.formats.atomic import atomic_path, atomic_write, write_text


def test_a_new_file_gets_the_permissions_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "usual").touch()
    write_text(tmp_path / "a.txt", "ü\n")
    assert (tmp_path / "a.txt").read_bytes() == "ü\n".encode()
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_a_replaced_file_keeps_its_permissions(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    path.chmod(0o640)
    write_text(path, "new")
    assert path.read_text() == "new"
    assert path.stat().st_mode & 0o7777 == 0o640


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to("real.txt")
    write_text(tmp_path / "link.txt", "new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_what_breaks_off_leaves_the_old_file(tmp_path: Path, error: type[BaseException]) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(error), atomic_write(path) as stream:  # noqa: PT012 - both belong inside the block
        stream.write(b"half")
        raise error
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_is_said_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    said = "cannot write: No space left on device; nothing was changed"
    with pytest.raises(InputError, match=said), atomic_path(path):
        raise OSError(28, "No space left on device")
    assert list(tmp_path.iterdir()) == []


def test_a_device_is_not_replaced() -> None:
    with pytest.raises(InputError, match="not a regular file"):
        write_text("/dev/null", "x")


def test_a_name_as_long_as_names_may_be(tmp_path: Path) -> None:
    path = tmp_path / ("ü" * 125 + ".txt")
    write_text(path, "x")
    assert path.read_text() == "x"


def test_a_directory_that_cannot_be_synced_is_no_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def of_files_alone(descriptor: int, sync=os.fsync) -> None:
        if Path(f"/dev/fd/{descriptor}").is_dir():
            raise OSError(22, "Invalid argument")
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", of_files_alone)
    write_text(tmp_path / "a.txt", "x")
    assert (tmp_path / "a.txt").read_text() == "x"


def test_a_read_only_file_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    path.chmod(0o444)
    with pytest.raises(InputError, match=r"cannot write: it is read-only; make it writable \(chmod u\+w\), or name"):
        write_text(path, "new")
    (tmp_path / "link.txt").symlink_to(path)
    with pytest.raises(InputError, match="read-only"):
        write_text(tmp_path / "link.txt", "new")
    assert path.read_text() == "old"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.txt", "link.txt"]


def test_what_a_killed_process_left_goes_with_the_next_write(tmp_path: Path) -> None:
    code = (
        "import os, signal, sys; from lidarcheck.formats.atomic import atomic_write\n"
        "with atomic_write(sys.argv[1]) as stream:\n    stream.write(b'x'); os.kill(os.getpid(), signal.SIGKILL)"
    )
    for name in ("a.txt", "b.txt"):
        subprocess.run([sys.executable, "-c", code, str(tmp_path / name)], check=False)
    assert len(list(tmp_path.glob(".*.part"))) == 2
    (tmp_path / ".a.txt.mine.part").write_text("somebody's own")
    write_text(tmp_path / "a.txt", "new")
    assert [path.name[:7] for path in sorted(tmp_path.iterdir())] == [".a.txt.", ".b.txt.", "a.txt"]
    assert (tmp_path / ".a.txt.mine.part").exists()
