"""A measurement beside its targets, read and made ready once for all edits of a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lidarcheck.calibration.blooming.workflow import bare_of
from lidarcheck.calibration.number.beside import Beside, beside_targets
from lidarcheck.calibration.number.frames import Frames, seen_slots
from lidarcheck.calibration.number.light import Lights, lights_of
from lidarcheck.calibration.number.misfit import Misfit
from lidarcheck.calibration.number.request import Request
from lidarcheck.calibration.number.seen import Seen, seen_in
from lidarcheck.inference.observed.echo_view import EchoView, Slot
from lidarcheck.model.spec import Model
from lidarcheck.scan import Scan

__all__ = ["OnFrames"]


@dataclass(frozen=True)
class OnFrames:
    """Scans with ideal scans: what is simulated is the frames, whole lines of them."""

    data: Frames
    beside: Beside
    slots: tuple[Slot, ...]
    reach_m: float
    misfit: Misfit

    @classmethod
    def of(cls, data: Frames, model: Model, request: Request) -> OnFrames:
        """Find the targets and what was measured beside them."""
        bare, bright = bare_of(model, request.axis)
        reach_m = EchoView.of(model.sensor).reach_m
        beside = beside_targets(
            data, bare, request.axis, bright, reach_m, distance_m=request.distance_m, material=request.material
        )
        slots = seen_slots(data.frames, model.sensor)
        seen = seen_in([f.measured for f in data.frames], beside, slots, reach_m)
        return cls(data, beside, slots, reach_m, Misfit(beside, slots, seen, data.key))

    def lights(self, model: Model, seeds: Sequence[int]) -> Lights:
        """What the beams get with a model."""
        return lights_of(self.data, model, seeds, [self.beside.beams(i) for i in range(len(self.data.frames))])

    def seen(self, scans: Sequence[Scan]) -> Seen:
        """What is seen of the beams in scans of all frames."""
        return seen_in(scans, self.beside, self.slots, self.reach_m)
