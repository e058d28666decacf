"""Worker pools on this machine: order, laziness, shared things, and workers that are killed."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from lidarcheck.errors import UsageError, WorkerError
from lidarcheck.formats.table import counted
from lidarcheck.workers import Processes, Shared, Threads, WorkerPool
from lidarcheck.workers.identity import arithmetic, source_of_results
from lidarcheck.workers.keeping import kept


@pytest.fixture(scope="module")
def two():
    with Processes(2) as pool:
        yield pool


def pools(two):
    return WorkerPool(), two


def test_results_come_in_the_order_of_the_tasks(two):
    with Threads(3) as threads:
        for pool in (WorkerPool(), threads, two):
            assert [*pool.map(pow, ((2, k) for k in range(20)))] == [2**k for k in range(20)]
            assert pool.submit(pow, 2, 5)() == 32


@pytest.mark.parametrize("kind", [WorkerPool, lambda: Threads(3)])
def test_tasks_are_taken_a_few_at_a_time(kind):
    taken = []

    def tasks():
        for k in range(1000):
            taken.append(k)
            yield (-k,)

    with kind() as pool:
        results = pool.map(abs, tasks())
        assert next(results) == 0
        assert len(taken) <= 2 * pool.jobs + 2
        results.close()
    assert len(taken) <= 2 * pool.jobs + 2


def test_a_held_thing_stands_for_itself_and_goes_with_its_last_owner(two):
    held = Shared(np.arange(10.0))
    for pool in pools(two):
        assert [*pool.map(np.dot, ((held, held) for _ in range(3)))] == [285.0] * 3
        assert pool.submit(np.sum, held)() == 45.0
    files = list(os.scandir(two._files.name))
    assert len(files) == 1
    del held
    assert not list(os.scandir(two._files.name))
    with pytest.raises(TypeError, match="shared things stand among the arguments"):
        [*two.map(len, [([Shared(1)],), ([Shared(2)],)])]


def test_a_worker_keeps_a_thing_and_forgets_the_oldest():
    asked = []

    def content(key):
        asked.append(key)
        return __import__("pickle").dumps(key)

    for key in ("a", "b", "c", "d", "a", "e", "a", "b"):
        assert kept(f"test {key}", lambda key=key: content(key)) == key
    assert asked == ["a", "b", "c", "d", "e", "b"]


def test_what_a_task_raises_is_raised_here(two):
    with Threads(2) as threads:
        for pool in (*pools(two), threads):
            with pytest.raises(ZeroDivisionError):
                [*pool.map(divmod, [(1, 1), (1, 0), (1, 1)])]
            assert [*pool.map(counted, [(1, "row"), (2, "row")])] == ["1 row", "2 rows"]


def test_threads_hurry_what_is_under_way_when_interrupted():
    hurried = []

    def slow():
        while not hurried:
            time.sleep(0.01)

    def stop():
        yield ()
        raise UsageError("enough")

    with pytest.raises(UsageError), Threads(2, hurry=lambda: hurried.append(1)) as pool:
        [*pool.map(slow, stop())]
    assert hurried


def test_a_killed_process_is_replaced_and_its_task_done_again():
    with Processes(2) as pool:
        held = Shared(100)
        results = pool.map(sum_after, ((held, k, 0.02) for k in range(12)))
        assert next(results) == 100
        for process in [*pool._running._processes.values()][:1]:
            os.kill(process.pid, signal.SIGKILL)
        assert [*results] == [100 + k for k in range(1, 12)]
        with pytest.raises(
            WorkerError, match="worker processes were killed 3 times in the same work; was memory short"
        ):
            [*pool.map(os._exit, [(1,), (1,)])]


def sum_after(start, k, seconds):
    time.sleep(seconds)
    return start + k


def test_the_source_and_the_arithmetic_have_one_hash_each():
    assert arithmetic() == arithmetic()
    assert len(source_of_results()) == 64


def test_an_interrupt_while_a_thread_begins_waits_for_its_task_and_hurries_it():
    """The pool then knows nothing of the thread, which may begin what takes long after the first hurry."""
    begun, hurried, ended = threading.Event(), threading.Event(), threading.Event()

    def slow() -> None:
        begun.set()
        hurried.wait(timeout=30.0)
        ended.set()

    hurries = []

    def hurry() -> None:
        hurries.append(1)
        if len(hurries) == 3:
            hurried.set()

    def interrupted() -> None:
        with Threads(2, hurry=hurry) as pool:
            pool.submit(slow)
            assert begun.wait(timeout=30.0)
            pool._pool._threads.clear()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert ended.is_set()
    assert len(hurries) >= 3


INTERRUPTED_ELSEWHERE = """
import signal, sys, threading, time
from lidarcheck.workers import Processes, Threads

over = threading.Event()

def sleep():
    time.sleep(1)
    # The thread that gets the signal is not the one that waits: as if it had come just before the wait.
    signal.pthread_kill(threading.get_ident(), signal.SIGINT)
    return over.wait(30)

def main():
    # A background job of a shell inherits that SIGINT is ignored, and the tests may be one.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    begin = time.monotonic()
    try:
        if sys.argv[1] == "threads":
            with Threads(1, hurry=over.set) as pool:
                list(pool.map(sleep, [()]))
        else:
            threading.Timer(1, sleep).start()
            with Processes(2) as pool:
                list(pool.map(time.sleep, [(30.0,)]))
    except KeyboardInterrupt:
        over.set()
        print(time.monotonic() - begin)

if __name__ == "__main__":
    main()
"""


@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_a_signal_that_wakes_nobody_still_ends_the_wait(kind, tmp_path):
    script = tmp_path / "interrupted.py"
    script.write_text(INTERRUPTED_ELSEWHERE)
    ended = subprocess.run([sys.executable, script, kind], capture_output=True, text=True, timeout=60, check=True)
    assert float(ended.stdout) < 20
