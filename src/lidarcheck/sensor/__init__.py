"""Sensors as data: beams, detectors, what they report, from a file or by a shipped name; and materials."""

from lidarcheck.sensor.beams import Beams
from lidarcheck.sensor.bounds import FWHM_PER_SIGMA, LIGHT_SPEED_M_PER_NS, Bounds
from lidarcheck.sensor.document import sensor_of, shipped, shipped_names
from lidarcheck.sensor.feature import Feature
from lidarcheck.sensor.linear import Linear
from lidarcheck.sensor.material import RETRO_GAIN_MAX, Material
from lidarcheck.sensor.photon_histogram import PhotonHistogram
from lidarcheck.sensor.program import Program, StandIn
from lidarcheck.sensor.reference import VARIANTS, reference_beams
from lidarcheck.sensor.sensor import Sensor
from lidarcheck.sensor.spad_array import NonIdeal, SpadArray

__all__ = [
    "FWHM_PER_SIGMA",
    "LIGHT_SPEED_M_PER_NS",
    "RETRO_GAIN_MAX",
    "VARIANTS",
    "Beams",
    "Bounds",
    "Feature",
    "Linear",
    "Material",
    "NonIdeal",
    "PhotonHistogram",
    "Program",
    "Sensor",
    "SpadArray",
    "StandIn",
    "reference_beams",
    "sensor_of",
    "shipped",
    "shipped_names",
]
