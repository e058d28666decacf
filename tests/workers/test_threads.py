"""Work of the process that explains, shared among threads."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from lidarcheck.workers import WorkerPool
from lidarcheck.workers.threads import done_by, in_threads, mapped


def test_threads_give_what_one_gives_in_the_items_order() -> None:
    together = threading.Barrier(3, timeout=10.0)

    def work(item: int) -> tuple[int, int]:
        if item < 3:
            together.wait()  # nobody passes before three are here
        return item, threading.get_ident()

    with in_threads(3):
        found = mapped(work, range(20))
    assert [item for item, _ in found] == list(range(20))
    assert len({thread for _, thread in found[:3]}) == 3


def test_items_are_taken_a_few_at_a_time() -> None:
    done, open_ = set[int](), list[int]()

    def items() -> Iterator[int]:
        for k in range(50):
            open_.append(k - len(done))
            yield k

    with in_threads(2):
        mapped(done.add, items())
    assert done == {*range(50)}
    assert max(open_) <= 5


def test_threads_of_threads_are_none_and_the_number_is_put_back() -> None:
    def inner(_: int) -> list[int]:
        return mapped(lambda _: threading.get_ident(), range(4))

    with in_threads(2):
        assert all(len(set(mine)) == 1 for mine in mapped(inner, range(3)))
    assert mapped(lambda _: threading.get_ident(), range(2)) == [threading.get_ident()] * 2


def test_an_error_ends_the_work() -> None:
    done: list[int] = []

    def work(item: int) -> None:
        if item == 1:
            raise ValueError("one")
        done.append(item)

    with in_threads(2), pytest.raises(ValueError, match="one"):
        mapped(work, range(1000))
    assert len(done) < 20


def test_a_task_that_stands_alone_is_done_here() -> None:
    class Elsewhere(WorkerPool):
        def map(self, work: object, tasks: object) -> object:  # type: ignore[override]
            return iter(["elsewhere"] * len(list(tasks)))  # type: ignore[call-overload]

    assert list(done_by(Elsewhere(), abs, [(-1,)])) == [1]
    assert list(done_by(Elsewhere(), abs, [(-1,), (-2,)])) == ["elsewhere", "elsewhere"]
    assert list(done_by(Elsewhere(), abs, [])) == []
