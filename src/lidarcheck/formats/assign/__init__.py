"""Which beam a row of a cloud belongs to: by its numbers, its place in an organised cloud, ring, time or direction."""

from lidarcheck.formats.assign.order import Assigned, Known, Rows, assign

__all__ = ["Assigned", "Known", "Rows", "assign"]
