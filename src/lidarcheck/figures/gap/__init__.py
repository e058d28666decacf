"""The pictures of a gap as data: measured echoes against those of the model before and after, and the verdict."""

from lidarcheck.figures.gap.data import Detected, FieldMap, Histogram, Pictures, ResidualCurve
from lidarcheck.figures.gap.measure import pictures_of

__all__ = ["Detected", "FieldMap", "Histogram", "Pictures", "ResidualCurve", "pictures_of"]
