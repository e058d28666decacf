"""Calibration of the model against measurements. Empty so far."""
