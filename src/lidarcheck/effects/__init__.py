"""Effects: one file each, found by being here."""

from lidarcheck.effects.base import Effect
from lidarcheck.effects.finding import catalogue, check_order, empirical_terms, find, make, with_role

__all__ = ["Effect", "catalogue", "check_order", "empirical_terms", "find", "make", "with_role"]
