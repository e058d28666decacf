"""Figures as SVG text, written by hand: small and quick, since a page has dozens, and coloured by the page's CSS."""

from lidarcheck.figures.svg.figure import figure_svg, svg_file

__all__ = ["figure_svg", "svg_file"]
