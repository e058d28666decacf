"""The checkpoint: what was done is there again, exactly, for the same work only, and for one run at a time."""

import math
import os
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest

from lidarcheck.errors import InputError, UsageError
from lidarcheck.workers.checkpoint import Checkpoint, checkpoint_key


def test_what_was_put_is_there_for_the_next_run(tmp_path):
    with Checkpoint(tmp_path / "n", "k") as first:
        assert first.get("a") is None
        first.put("a", {"x": [1, 2.5], "s": "ü\n", "none": None})
        first.put("b", 3)
    with Checkpoint(tmp_path / "n", "k") as second:
        assert len(second) == 2
        assert second.get("a") == {"x": [1, 2.5], "s": "ü\n", "none": None}
        assert second.get("b") == 3


def test_numbers_come_back_as_the_same_bits(tmp_path):
    values = np.concatenate(
        [np.random.default_rng(3).standard_normal(200) * 10.0 ** np.arange(-100, 100), [-0.0, 5e-324]]
    )
    with Checkpoint(tmp_path / "n", "k") as first:
        first.put("v", values)
        first.put("odd", [math.inf, -math.inf, math.nan])
    with Checkpoint(tmp_path / "n", "k") as second:
        assert np.array(second.get("v")).tobytes() == values.tobytes()
        assert second.get("odd")[:2] == [math.inf, -math.inf]
        assert math.isnan(second.get("odd")[2])


def test_put_returns_what_get_will_give(tmp_path):
    with Checkpoint(tmp_path / "n", "k") as book:
        assert book.put("v", {"t": (1, np.float64(2.5)), "a": np.arange(3)}) == {"t": [1, 2.5], "a": [0, 1, 2]}
        got = book.get("v")
        got["t"].append(9)
        assert book.get("v") == {"t": [1, 2.5], "a": [0, 1, 2]}


def test_the_last_value_of_a_name_counts(tmp_path):
    with Checkpoint(tmp_path / "n", "k") as first:
        first.put("a", 1)
        first.put("a", 2)
    with Checkpoint(tmp_path / "n", "k") as second:
        assert second.get("a") == 2


@pytest.mark.parametrize("value", [{1: 2}, object(), {"a": {2, 3}}])
def test_what_cannot_come_back_is_refused(tmp_path, value):
    with Checkpoint(tmp_path / "n", "k") as book, pytest.raises(TypeError):
        book.put("a", value)


def test_other_work_starts_afresh(tmp_path, caplog):
    with Checkpoint(tmp_path / "n", "k") as first:
        first.put("a", 1)
    with Checkpoint(tmp_path / "n", "other") as second:
        assert second.get("a") is None
        second.put("b", 2)
    with Checkpoint(tmp_path / "n", "other") as third:
        assert third.get("b") == 2
    assert not caplog.records


def test_a_line_that_was_cut_off_costs_only_itself(tmp_path):
    with Checkpoint(tmp_path / "n", "k") as first:
        first.put("a", 1)
        first.put("b", list(range(50)))
    file = tmp_path / "n" / "notebook.jsonl"
    file.write_bytes(file.read_bytes()[:-20])
    with Checkpoint(tmp_path / "n", "k") as second:
        assert second.get("a") == 1
        assert second.get("b") is None
        second.put("c", 3)
    with Checkpoint(tmp_path / "n", "k") as third:
        assert (third.get("a"), third.get("b"), third.get("c")) == (1, None, 3)


@pytest.mark.parametrize("damage", [b"", b"no notebook\n", b"\x00\xff\n\n", None])
def test_a_damaged_checkpoint_starts_afresh(tmp_path, damage, caplog):
    with Checkpoint(tmp_path / "n", "k") as first:
        first.put("a", 111)
    file = tmp_path / "n" / "notebook.jsonl"
    file.write_bytes(file.read_bytes().replace(b"111", b"112") if damage is None else damage)
    with Checkpoint(tmp_path / "n", "k") as second:
        assert second.get("a") is None
        second.put("a", 5)
    with Checkpoint(tmp_path / "n", "k") as third:
        assert third.get("a") == 5
    assert ("is damaged" in caplog.text) == (damage != b"")


def test_it_is_gone_when_all_is_done(tmp_path):
    book = Checkpoint(tmp_path / "out" / ".explain", "k")
    book.put("a", 1)
    book.discard()
    assert list((tmp_path / "out").iterdir()) == []
    book.discard()
    with Checkpoint(tmp_path / "out" / ".explain", "k") as again:
        assert again.get("a") is None


def test_two_at_once_are_refused(tmp_path):
    with Checkpoint(tmp_path / "n", "k"), pytest.raises(UsageError, match=r"another run works in .*; wait"):
        Checkpoint(tmp_path / "n", "k")
    Checkpoint(tmp_path / "n", "k").close()


def test_the_lock_of_a_dead_process_is_no_obstacle(tmp_path):
    program = (
        "import sys, time; from pathlib import Path; from lidarcheck.workers.checkpoint import Checkpoint\n"
        "n = Checkpoint(Path(sys.argv[1]), 'k'); n.put('a', 7); print('ready', flush=True); time.sleep(60)"
    )
    process = subprocess.Popen([sys.executable, "-c", program, str(tmp_path / "n")], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    with pytest.raises(UsageError, match="another run"):
        Checkpoint(tmp_path / "n", "k")
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()
    with Checkpoint(tmp_path / "n", "k") as book:
        assert book.get("a") == 7


def test_threads_put_and_get(tmp_path):
    book = Checkpoint(tmp_path / "n", "k")

    def work(i):
        for j in range(20):
            book.put(f"{i}.{j}", [i, j] * 20)

    threads = [threading.Thread(target=work, args=(i,)) for i in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    book.close()
    with Checkpoint(tmp_path / "n", "k") as again:
        assert all(again.get(f"{i}.{j}") == [i, j] * 20 for i in range(6) for j in range(20))


def test_a_place_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot keep what is done"):
        Checkpoint(tmp_path / "file" / "n", "k")


def test_a_full_disk_is_said(tmp_path):
    book = Checkpoint(tmp_path / "n", "k")
    real = book._stream

    class Full:
        def write(self, _):
            raise OSError(28, "No space left on device")

        def close(self):
            real.close()

    book._stream = Full()
    with pytest.raises(InputError, match="cannot keep what is done: No space left on device; free some space"):
        book.put("a", 1)
    assert book.get("a") is None
    book.close()


def test_a_closed_checkpoint_takes_nothing(tmp_path):
    book = Checkpoint(tmp_path / "n", "k")
    book.close()
    book.close()
    with pytest.raises(UsageError, match="closed"):
        book.put("a", 1)


def test_the_key_knows_everything_that_matters():
    base = ({"a.txt": "00", "b.txt": "11"}, "model", 0, ("fog", "rain"))
    key = checkpoint_key(*base)
    assert key == checkpoint_key({"b.txt": "11", "a.txt": "00"}, "model", 0, ("rain", "fog"))
    others = [
        checkpoint_key({"a.txt": "01", "b.txt": "11"}, *base[1:]),
        checkpoint_key(base[0], "other", *base[2:]),
        checkpoint_key(*base[:2], 1, base[3]),
        checkpoint_key(*base[:3], ("fog",)),
    ]
    assert len({key, *others}) == 5
