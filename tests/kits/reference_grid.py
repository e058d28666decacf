"""The built-in sensors' grid by its formulas, as tests name beams of it."""

import numpy as np

from lidarcheck.sensor import reference_beams

LAYERS, POINTS = 520, 960


def elevation_deg(layer):
    """Elevation of a layer [deg]; same shape."""
    return (np.asarray(layer, dtype=np.float64) - 259.5) * 0.05


def azimuth_deg(point):
    """Azimuth of a point column [deg], positive to the left; same shape."""
    return (np.asarray(point, dtype=np.float64) - 479.5) * 0.125


def layer_of(elevation):
    """Nearest layer of an elevation [deg]; may lie outside 0 ... 519."""
    return np.rint(np.asarray(elevation, dtype=np.float64) / 0.05 + 259.5).astype(np.int32)


def point_of(azimuth):
    """Nearest point column of an azimuth [deg]; may lie outside 0 ... 959."""
    return np.rint(np.asarray(azimuth, dtype=np.float64) / 0.125 + 479.5).astype(np.int32)


def beam_directions(layer, point):
    """Unit vectors of beams, shape (n, 3), in the sensor frame."""
    return reference_beams().directions(layer, point)


def cos_sin(index, axis):
    """Cosine and sine of the indices' angles."""
    beams = reference_beams()
    return (beams.elevation if axis == "layer" else beams.azimuth).cos_sin(index)
