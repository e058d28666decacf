"""A job of a screen of pages: what its list says of something that can be computed, and the node that computes it."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarcheck.session.node import Node, ProgressCallback

if TYPE_CHECKING:
    from lidarcheck.figures.data import Page

__all__ = ["Computed", "Job", "computed"]

_VERSION = 1


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
    `kind`: what computes it, as of all jobs of one screen.
    """

    name: str
    words: str
    files: tuple[Path, ...]
    compute: Callable[[ProgressCallback], Page | Computed]
    choices: Hashable = ()
    fault: str = ""
    notes: tuple[str, ...] = ()
    kind: str = "page"

    @property
    def node(self) -> Node:
        """What its page is computed by; the value is `Computed`."""
        return Node(
            self.kind, _VERSION, (self.name, self.choices), self.files, lambda told: computed(self.compute(told)),
            (self.name, self.choices),
        )  # fmt: skip


def computed(made: Page | Computed) -> Computed:
    """What a job gave, as `Computed`."""
    return made if isinstance(made, Computed) else Computed(made)
