"""How a figure is laid out on axes, once for all backends: lines, dots, bands and cells, spans and ticks."""

from lidarcheck.figures.axes.build import KINDS, VIEWS, kinds_of, subplots_of
from lidarcheck.figures.axes.elements import Band, Dots, Line, Subplot

__all__ = ["KINDS", "VIEWS", "Band", "Dots", "Line", "Subplot", "kinds_of", "subplots_of"]
