"""A measurement beside its targets, read and made ready once for all edits of a table."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from lidarcheck.calibration.blooming.workflow import bare_of
from lidarcheck.calibration.number.beside import Beside, beside_targets
from lidarcheck.calibration.number.frames import Frames, seen_slots
from lidarcheck.calibration.number.light import Lit, lit, scans_of
from lidarcheck.calibration.number.misfit import Misfit
from lidarcheck.calibration.number.models import said_of
from lidarcheck.calibration.number.request import Request
from lidarcheck.calibration.number.seen import Seen, seen_in
from lidarcheck.inference.observed.echo_view import EchoView, Slot
from lidarcheck.model.spec import Model
from lidarcheck.sensor import Program

__all__ = ["OnFrames", "Shown"]


@dataclass(frozen=True)
class Shown:
    """What a model shows of the beams beside the targets, before it is simulated: `scans` gives each seed's; `alike`: a
    hash of what it depends on."""

    alike: str
    seen: Callable[[int], Seen]


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

    def shown(self, model: Model, seeds: Sequence[int]) -> Shown:
        """What a model shows with these seeds."""
        if isinstance(model.sensor, Program):
            scans = scans_of(self.data.frames, self.data.surfaces, model, seeds)
            made = iter(scans)
            alike = hashlib.sha256(repr((said_of(model), seeds)).encode()).hexdigest()
            return Shown(alike, lambda _k: seen_in(next(made), self.beside, self.slots, self.reach_m))
        lights = self._lights(model, seeds)
        alike = hashlib.sha256(" ".join(one.alike for one in lights).encode()).hexdigest()
        return Shown(alike, lambda k: seen_in([one.scan(k) for one in lights], self.beside, self.slots, self.reach_m))

    def _lights(self, model: Model, seeds: Sequence[int]) -> list[Lit]:
        frames = zip(self.data.frames, self.data.surfaces, strict=True)
        return [lit(f, s, model, seeds, self.beside.beams(i)) for i, (f, s) in enumerate(frames)]
