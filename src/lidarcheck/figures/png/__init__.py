"""What matplotlib draws: figures as PNG files, and the plots on the page of a check. Only this package imports it."""

from lidarcheck.figures.png.figure import write_png

__all__ = ["write_png"]
