"""What an action of the interface is, and why some have no twin on the command line."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["ALONE", "MOVE", "PLACE", "Action"]

PLACE = "which part of the interface is seen is not a matter of the command line"
MOVE = "moves what is pointed at; commands are given rows and names"
ALONE = "belongs to the interface alone"


class Action(NamedTuple):
    """`screen`: where it is, empty for everywhere. `keys`: the first is the one that is shown.

    `short`: one word for the footer, empty for none there. `method`: of the app or the screen, without `action_`.
    `twin`: the command that does the same, and `says`, a word of its help that shows so; or `reason`, why there is
    none.
    """

    name: str
    screen: str
    keys: tuple[str, ...]
    short: str
    help: str
    method: str
    twin: str = ""
    says: str = ""
    reason: str = ""
