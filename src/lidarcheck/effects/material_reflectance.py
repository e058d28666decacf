"""One material returns more or less than its table entry says."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.effects.base import LightEffect, Surroundings, parameter
from lidarcheck.scan import Light

__all__ = ["MaterialReflectance"]


@dataclass(frozen=True)
class MaterialReflectance(LightEffect):
    """One material returns more or less than its table entry says.

    S' = factor S for all light that comes from a surface of `material_id`, wherever it arrives: by the lidar range
    equation S is proportional to the reflectance, and to the gain of a retro-reflector. Light that the air scatters
    back, and the background, stay as they are. A factor may mean a reflectance above 1: nothing forbids that here, as
    a table entry may be far too low. A material that no beam meets changes nothing. Identity at factor 1.
    """

    name = "material_reflectance"
    role = "reflectance"

    factor: float = parameter(
        "", low=0.0, high=100.0, typical=1.3, noticeable=0.13, meaning="factor on the material's reflectance"
    )
    material_id: int = parameter(
        "",
        low=0,
        high=2**31 - 1,
        typical=1,
        whole=True,
        noticeable=1,
        meaning="number of the material in the model's table",
    )

    def light(self, light: Light, around: Surroundings) -> Light:
        """Scale the pulses that come from that material."""
        if self.factor == 1.0:
            return light
        row = light.rows()
        affected = np.flatnonzero(row >= 0)
        affected = affected[around.ideal.material_id[row[affected]] == self.material_id]
        if not len(affected):
            return light
        signal = light.pulse_signal.copy()
        signal[affected] *= self.factor
        return replace(light, pulse_signal=signal)
