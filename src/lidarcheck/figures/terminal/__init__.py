"""Figures as text for a terminal. Only this package imports plotext."""

from lidarcheck.figures.terminal.canvas import open_frame
from lidarcheck.figures.terminal.text import course_text, figure_text

__all__ = ["course_text", "figure_text", "open_frame"]
