"""Calibration of the model against measurements: panels, blooming, ghosts, vehicles, scenes, fits of parameters."""
