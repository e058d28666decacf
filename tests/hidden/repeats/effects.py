"""What the foreign sensors' generator has not: beams that shake from column to column, and rain."""

import numpy as np

from hidden.foreign.chain import Effect, Frame
from hidden.foreign.detectors import Shine
from hidden.foreign.device import Beams, Device
from hidden.foreign.effects import FORMS
from hidden.forms import Draw


def shaken(beams: Beams, size_deg: float, rng: np.random.Generator) -> Beams:
    """The beams as they are fired while the head shakes: each column is turned by angles of its own."""
    _, column = np.unique(beams.point, return_inverse=True)
    yaw, pitch = size_deg * rng.standard_normal((2, int(column.max()) + 1))
    up, left = beams.elevation_deg + pitch[column], beams.azimuth_deg + yaw[column]
    return Beams(beams.layer, beams.point, up, left, beams.head_deg, beams.time_s, beams.first_deg)


def vibration(draw: Draw, device: Device) -> Effect:
    """Where the beams look is changed before they are cast: the effect itself only says by how much."""
    return Effect("vibration", {"random_deg": draw.level(0.05, 0.12, 0.3)}, {})


def rain(draw: Draw, device: Device) -> Effect:
    """Drops before the surfaces, the nearer the stronger their echo, and a little extinction."""
    share, weaker = draw.level(0.01, 0.03, 0.08), draw.level(0.0005, 0.001, 0.003)

    def light(shine: Shine, frame: Frame) -> None:
        shine.signal = shine.signal * np.exp(-2.0 * weaker * shine.range_m)
        low, high = max(frame.device.gate_m[0], 1.0), 25.0
        beam = np.flatnonzero(frame.rng.random(len(frame.beams)) < share)
        at = low + (high - low) * frame.rng.random(len(beam)) ** 1.5
        free = (shine.surface_m[beam] <= 0) | (at < shine.surface_m[beam])
        beam, at = beam[free], at[free]
        strength = 0.6 if frame.device.detector == "spad_array" else 2.0 * float(shine.threshold.mean())
        size = frame.rng.exponential(size=len(beam))
        shine.added(beam, at, strength * (0.3 + 2.0 * size) * (6.0 / (6.0 + at)))

    return Effect("rain", {"share": share, "extinction_per_m": weaker}, {}, light=light)


OF_REPEATS = {**FORMS, "vibration": vibration, "rain": rain}
