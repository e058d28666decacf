"""Fitting named parameters of the model to measured frames: what `lidarcheck calibrate` does."""
