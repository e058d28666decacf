"""Effects that do much the same: relatives and special cases, as the effects themselves say."""

from __future__ import annotations

import math

from lidarcheck.effects.search import Probe, search_spec

__all__ = ["are_related", "enough_for", "is_confused", "is_special_case"]

_NEARLY_ALL, _MOST = 0.85, 0.75
"""A special case that explains this part of what the other does is the better name. A view that wanders also follows
what another missing effect does: beside a tail of the pulse, a true motion explained 0.83 of what it did. Of what was
truly at random, a motion explained 0.09 and 0.42."""


def are_related(one: str, other: str) -> bool:
    """Whether two effects change the same features in the same way."""
    return one != other and not search_spec(one).groups.isdisjoint(search_spec(other).groups)


def is_confused(one: str, other: str) -> bool:
    """Whether one of two effects says that it is taken for the other, or that the other may imitate it."""
    said = (set(search_spec(a).confused_with) | set(search_spec(a).imitated_by) for a in (one, other))
    return any(b in names for b, names in zip((other, one), said, strict=True))


def is_special_case(name: str, other: Probe) -> bool:
    """Whether another effect, started in such a way, can do all or most of what this one does."""
    spec = search_spec(name)
    return spec.special_case_of == other.name or (other.strikes_anew and spec.lasting_case_of == other.name)


def enough_for(name: str, other: Probe) -> float:
    """What part of what another effect explains, started in such a way, is enough to be the better name: infinite for
    one that is no special case of it."""
    if not is_special_case(name, other):
        return math.inf
    return _MOST if other.strikes_anew else _NEARLY_ALL
