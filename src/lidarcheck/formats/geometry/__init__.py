"""X, Y, Z held against the beams: the check, what would make them agree, and what a user declares a file to be."""

from lidarcheck.formats.geometry.placement import AS_IT_IS, Placement, Pose, parse_pose
from lidarcheck.formats.geometry.pooled import pooled, words
from lidarcheck.formats.geometry.unit import UNITS

__all__ = ["AS_IT_IS", "UNITS", "Placement", "Pose", "parse_pose", "pooled", "words"]
