"""A job of a screen of pages: something to compute from files of the project, its page, and the pages that are kept."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lidarcheck.figures.data import Page

__all__ = ["Cancelled", "Computed", "Job", "Pages", "ProgressCallback", "computed", "state_of"]

ProgressCallback = Callable[[int, int, str], object]
"""Gets (done, of, what now); raises `Cancelled` when nobody waits any more."""

_MOST_PAGES = 12


class Cancelled(Exception):
    """Somebody has stopped the work."""


@dataclass(frozen=True)
class Computed:
    """A page with the numbers behind it: `document` for result.json, `result` for what else a screen does with them."""

    page: Page
    document: Any = None
    result: Any = None


@dataclass(frozen=True)
class Job:
    """Something that can be computed.

    `name`: in the list, the same at the next start. `words`: what is beside it there. `files`: what it is made from.
    `compute`: gives the page, as `Computed` where its numbers can be exported. `choices`: all else that the page
    depends on. `fault`: why it cannot be computed, empty where it can. `notes`: what is left out, a line each.
    """

    name: str
    words: str
    files: tuple[Path, ...]
    compute: Callable[[ProgressCallback], Page | Computed]
    choices: Hashable = ()
    fault: str = ""
    notes: tuple[str, ...] = ()

    def key(self) -> Hashable:
        """What its page depends on: the files as they are now, and the choices."""
        return (self.name, state_of(self.files), self.choices)


def computed(made: Page | Computed) -> Computed:
    """What a job gave, as `Computed`."""
    return made if isinstance(made, Computed) else Computed(made)


class Pages:
    """The last pages that were computed, so that going back to one computes nothing."""

    def __init__(self) -> None:
        self._kept: OrderedDict[Hashable, Computed] = OrderedDict()

    def made(self, job: Job) -> Computed | None:
        """What was computed of a job whose files and choices are what they were."""
        key = job.key()
        if key in self._kept:
            self._kept.move_to_end(key)
        return self._kept.get(key)

    def of(self, job: Job) -> Page | None:
        """The page of such a job."""
        made = self.made(job)
        return None if made is None else made.page

    def keep(self, key: Hashable, made: Page | Computed) -> None:
        """Something that was computed."""
        self._kept[key] = computed(made)
        while len(self._kept) > _MOST_PAGES:
            self._kept.popitem(last=False)


def state_of(files: Sequence[Path]) -> tuple[tuple[str, int, int], ...]:
    """Names, sizes and times of files, which differ when one was written again; zeros for one that is gone."""
    found = []
    for path in files:
        try:
            stat = path.stat()
            found.append((str(path), stat.st_size, stat.st_mtime_ns))
        except OSError:
            found.append((str(path), 0, 0))
    return tuple(found)
