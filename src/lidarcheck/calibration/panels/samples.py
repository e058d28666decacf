"""The echoes that lie on panels, gathered frame by frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.calibration.echoes import ways
from lidarcheck.calibration.panels.find import Panel
from lidarcheck.calibration.panels.image import strongest
from lidarcheck.formats.geometry import pooled
from lidarcheck.scan import Scan
from lidarcheck.scan import joined as rows_of_all
from lidarcheck.sensor import Sensor

__all__ = ["MOST_ECHOES", "PanelSamples", "Sampler", "joined"]

MOST_ECHOES = 1_000_000
"""Echoes of one panel that are held. Beyond it every other beam goes; the counts of detections keep all beams."""


@dataclass(frozen=True)
class PanelSamples:
    """What a number of frames show of one panel.

    `scan`: the echoes on it, one a beam and frame, the strongest; `frame`, `beam` (n,): the frame, counted from 0, and
    the beam, as index into the panel's. `expected_m` (n,): where geometry says that the beam meets it. `trials`,
    `detected`: beams that were fired, in all frames, and those of them with an echo. `detected_in` (frames,): per
    frame. `kept_beams`: every how manieth beam is held, 1 for all.
    """

    scan: Scan
    frame: IndexArray
    beam: IndexArray
    expected_m: FloatArray
    trials: int
    detected: int
    detected_in: IndexArray
    kept_beams: int

    @property
    def residual_m(self) -> FloatArray:
        """The way from the beam's origin minus the expected one, to a tenth of a millimetre, shape (n,)."""
        return np.round(ways(self.scan), 4) - self.expected_m


class Sampler:
    """Takes frames one at a time and keeps of each what lies on a panel."""

    def __init__(
        self, panels: Sequence[Panel], window_m: float, shape: tuple[int, int], sensor: Sensor | None = None
    ) -> None:
        self.panels = tuple(panels)
        self.window_m = window_m
        self._shape, self._sensor = shape, sensor
        self._panel = np.full(shape, -1, dtype=np.int32)
        self._beam = np.zeros(shape, dtype=np.int32)
        self._expected_m = np.zeros(shape)
        for i, panel in enumerate(panels):
            at = (panel.layer, panel.point)
            self._panel[at], self._beam[at], self._expected_m[at] = i, np.arange(len(panel.layer)), panel.expected_m
        self._parts: list[list[tuple[int, IndexArray, Scan]]] = [[] for _ in panels]
        self._detected: list[list[int]] = [[] for _ in panels]
        self._trials = [0] * len(panels)
        self._every = [1] * len(panels)
        self.frames = 0

    def add(self, scan: Scan) -> int:
        """The echoes of one more frame; returns how many beams of panels it detects."""
        layers, points = self._shape
        known = (scan.layer >= 0) & (scan.point >= 0) & (scan.layer < layers) & (scan.point < points)
        layer, point = np.where(known, scan.layer, 0), np.where(known, scan.point, 0)
        panel = np.where(known, self._panel[layer, point], -1)
        off = np.abs(ways(scan) - self._expected_m[layer, point])
        rows = np.flatnonzero((panel >= 0) & (off <= self.window_m))
        on = scan.take(rows)
        best = strongest(on, sensor=self._sensor)
        on, of = on.take(best), panel[rows][best]
        beam = self._beam[on.layer, on.point].astype(np.int64)
        for i, one in enumerate(self.panels):
            fired = scan.fired
            self._trials[i] += len(one.layer) if fired is None else int(fired.has(one.layer, one.point).sum())
            mine = np.flatnonzero(of == i)
            self._detected[i].append(len(mine))
            mine = mine[beam[mine] % self._every[i] == 0]
            self._parts[i].append((self.frames, beam[mine], on.take(mine)))
            self._thin(i)
        self.frames += 1
        return len(on)

    def _thin(self, i: int) -> None:
        """Drop every other beam while there is more than is held."""
        while sum(len(beam) for _, beam, _ in self._parts[i]) > MOST_ECHOES:
            self._every[i] *= 2
            kept = ((frame, beam, scan, beam % self._every[i] == 0) for frame, beam, scan in self._parts[i])
            self._parts[i] = [(frame, beam[keep], scan.take(keep)) for frame, beam, scan, keep in kept]

    def samples(self) -> tuple[PanelSamples, ...]:
        """What was gathered so far, panel by panel."""
        return tuple(self._of(i) for i in range(len(self.panels)))

    def _of(self, i: int) -> PanelSamples:
        panel, parts = self.panels[i], self._parts[i]
        beam = np.concatenate([np.zeros(0, dtype=np.int64), *(beam for _, beam, _ in parts)])
        frame = np.repeat([f for f, _, _ in parts], [len(b) for _, b, _ in parts]).astype(np.int64)
        detected = np.array(self._detected[i], dtype=np.int64)
        return PanelSamples(
            scan=joined([scan for _, _, scan in parts]),
            frame=frame,
            beam=beam,
            expected_m=panel.expected_m[beam],
            trials=self._trials[i],
            detected=int(detected.sum()),
            detected_in=detected,
            kept_beams=self._every[i],
        )


def joined(scans: Sequence[Scan]) -> Scan:
    """The rows of all scans, with the extra columns that all of them have."""
    if not scans:
        nothing = np.zeros(0, dtype=np.int32)
        return Scan.from_beams(nothing, nothing, np.zeros(0))
    return replace(rows_of_all(scans), geometry=pooled(scan.geometry for scan in scans))
