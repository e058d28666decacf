"""Plots: curves, histograms and points as cells of a terminal, with a readout, zoom and pan; `plot` is the widget."""
