"""Effects that do much the same: kin, special cases of others, and what strikes at random."""

from __future__ import annotations

import math

__all__ = ["AT_RANDOM", "RELATED", "SPECIAL_CASES", "are_related", "enough_for", "is_special_case"]

RELATED = (
    {"range_offset", "range_scale", "walk_error", "motion"},
    {"signal_gain", "material_reflectance", "incidence_falloff", "layer_gain", "blockage"},
    {"ambient_light", "dark_counts", "threshold", "afterpulsing"},
    {"boresight", "vibration", "motion", "beam_divergence"},
    {"crosstalk", "afterpulsing", "dead_time", "pulse_shape", "signal_gain"},
)
"""Effects that change the same features in the same way, more or less."""
SPECIAL_CASES = {"layer_gain": "signal_gain", "vibration": "boresight"}
"""Effects that can do all that another one does, and more: gains that are alike in all layers, a view that is turned
alike in all columns. They also take up what is not quite right elsewhere."""
AT_RANDOM = ("random", "wander", "free phase")
"""Kinds of start that turn the view otherwise in every frame."""
_LASTING = {"vibration": "motion"}
"""Special cases of what strikes at random: a view that wanders follows any turn that lasts."""
_NEARLY_ALL, _MOST = 0.85, 0.75
"""A special case that explains this part of what the other does is the better name. A view that wanders also follows
what another missing effect does: beside a tail of the pulse, a true motion explained 0.83 of what it did. Of what was
truly at random, a motion explained 0.09 and 0.42."""


def are_related(one: str, other: str) -> bool:
    """Whether two effects change the same features in the same way."""
    return one != other and any(one in related and other in related for related in RELATED)


def is_special_case(name: str, other: str, variant: str) -> bool:
    """Whether another effect, started in such a way, can do all or most of what this one does."""
    return name == SPECIAL_CASES.get(other) or (variant in AT_RANDOM and name == _LASTING.get(other))


def enough_for(name: str, other: str, variant: str) -> float:
    """What part of what another effect explains, started in such a way, is enough to be the better name: infinite for
    one that is no special case of it."""
    if not is_special_case(name, other, variant):
        return math.inf
    return _MOST if variant in AT_RANDOM else _NEARLY_ALL
