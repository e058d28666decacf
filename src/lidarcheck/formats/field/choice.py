"""What the user chooses in recordings on the command line: the topic, and the sensor's frame.

One thing a process, as permissions are: whoever opens a recording asks here. A frame that is found remembers its own,
so that workers need not.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Choice", "choose", "chosen"]


@dataclass(frozen=True, slots=True)
class Choice:
    """`topic`: of recordings that are named without one; `frame`: the sensor's, in their static transforms."""

    topic: str = ""
    frame: str = ""


_now = Choice()


def chosen() -> Choice:
    """What was chosen in this process."""
    return _now


def choose(choice: Choice) -> None:
    """Choose this from now on, and nothing else."""
    global _now
    _now = choice
