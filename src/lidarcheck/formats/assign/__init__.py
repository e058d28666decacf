"""Which beam a row of a cloud belongs to: by its numbers, its place in an organised cloud, ring, time or direction."""

from lidarcheck.formats.assign.cloud import Cloud, clouds_of
from lidarcheck.formats.assign.of_sensor import assigned_to
from lidarcheck.formats.assign.order import Assigned, Known, Rows, assign

__all__ = ["Assigned", "Cloud", "Known", "Rows", "assign", "assigned_to", "clouds_of"]
