"""The library on disk: kept, found again, repaired, shared by processes, and no larger than it may be."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from fast_kit import small_library
from fast_library_kit import TINY, areas, light
from lidarcheck.model import echoes_of
from lidarcheck.model.fast import library, store
from lidarcheck.sensor import Sensor

SENSOR = Sensor.of("SMART")
CHILD = """
import sys
from pathlib import Path
sys.path.insert(0, {tests!r})
from fast_library_kit import TINY, areas
from fast_kit import small_library
with small_library(Path(sys.argv[1]), TINY):
    print(areas())
"""


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Path]:
    with small_library(tmp_path, TINY):
        yield tmp_path


def forget() -> None:
    library._libraries.clear()


def files(place: Path) -> list[Path]:
    return sorted(place.rglob("*.npz"))


def test_what_was_filled_is_read_again(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cold = areas()
    assert len(files(place)) == 2
    forget()
    monkeypatch.setattr(library, "fill_block", lambda *_: pytest.fail("filled again"))
    assert areas() == cold


def test_blocks_are_the_same_in_whichever_order_they_are_filled(place: Path) -> None:
    whole = areas((0.3, 40.0, 3.0))
    forget()
    for path in files(place):
        path.unlink()
    for signal in (40.0, 3.0, 0.3):
        areas((signal,))
    assert areas((0.3, 40.0, 3.0)) == whole


@pytest.mark.parametrize("damage", ["cut", "flipped", "empty", "other", "foreign"])
def test_a_damaged_file_is_filled_again(place: Path, damage: str) -> None:
    cold = areas()
    forget()
    first, second = files(place)
    whole = first.read_bytes()
    broken = {
        "cut": whole[: len(whole) // 2],
        "flipped": whole[:5000] + bytes([whole[5000] ^ 1]) + whole[5001:],
        "empty": b"",
        "other": second.read_bytes()[:100],
    }
    if damage == "foreign":
        store.save(first, {"words": np.zeros(3, dtype=np.uint64)})
    else:
        first.write_bytes(broken[damage])
    assert areas() == cold
    assert first.read_bytes() == whole


def test_rows_that_are_not_there_are_refused(place: Path) -> None:
    """A file whose digest fits but whose words point beyond its own table is no library's."""
    cold = areas()
    forget()
    for path in files(place):
        arrays = store.load(path)
        assert arrays is not None
        store.save(path, arrays | {name: arrays[name][:0] for name in ("held", "centre", "width", "area", "peak")})
    assert areas() == cold


def test_a_cache_that_cannot_be_written_costs_time_alone(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("no directory")
    store._note.cache_clear()
    with small_library(tmp_path / "good", TINY):
        expected = areas()
    with small_library(blocked, TINY):
        assert areas() == expected
        forget()
        assert areas() == expected
    notes = [record for record in caplog.records if "set LIDARCHECK_CACHE" in record.message]
    assert len(notes) == 1


def test_files_that_were_not_used_for_longest_go(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    areas((0.3,))
    (oldest,) = files(place)
    size = oldest.stat().st_size
    monkeypatch.setattr(store, "MOST_BYTES", int(2.5 * size))
    areas((3.0, 12.0))
    assert len(files(place)) <= 2
    assert not oldest.exists()
    assert areas((0.3, 3.0)) == areas((0.3, 3.0))


def test_two_processes_may_fill_at_once(tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-c",
        CHILD.format(tests=str(Path(__file__).resolve().parents[2] / "kits")),
        str(tmp_path),
    ]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) for _ in range(2)]
    said = [process.communicate(timeout=300) for process in running]
    assert [process.returncode for process in running] == [0, 0], said
    assert said[0][0] == said[1][0]
    with small_library(tmp_path, TINY):
        assert said[0][0].decode().strip() == str(areas())
    assert not list(tmp_path.rglob("*.part"))


def test_a_changed_pulse_or_sensor_has_a_library_of_its_own(place: Path) -> None:
    areas((0.3,))
    shorter = Sensor.of("SMART", pulse_fwhm_ns=4.0)
    echoes_of(light((0.3,)), shorter, seed=1, fidelity="fast")
    assert len(files(place)) == 2
    dimmer = Sensor.of("SMART", signal_at_1m=10.0, peak_saturation=100, range_resolution_m=0.05)
    echoes_of(light((0.3,)), dimmer, seed=1, fidelity="fast")
    assert len(files(place)) == 2
