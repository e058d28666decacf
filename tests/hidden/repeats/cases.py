"""A recording: repeats of one scene, the sensor's file with all its numbers, a model, and the seal.

Its ideal scans are what beams meet; who is asked must not look at them, and estimates its own.
"""

import hashlib
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hidden.chain import Nuisance
from hidden.files import case_text, model_text, write
from hidden.foreign.cases import ideal_text
from hidden.foreign.chain import Effect, headings, measure, nominal
from hidden.foreign.detectors import Echoes
from hidden.foreign.device import SHIPPED, Beams, Device, device
from hidden.foreign.places import MATERIALS, arrange
from hidden.foreign.readout import scan_text
from hidden.forms import Draw
from hidden.rays import Scene
from hidden.sealing import Sealed, Truth

from .effects import OF_REPEATS, shaken
from .orders import CaseOrder

FRAMES = 14
NUMBERS = {
    "XT32": "signal_at_1m = 120000, near_m = 0, threshold = 5.84, noise = 1, excess = 0.02, relative = 0.03, "
    "pulse_fwhm_ns = 5, range_floor_m = 0.005, edge_factor = 1",
    "OS1-128": "signal_at_1m = 6e5, near_m = 0, threshold = 24, noise = 4, excess = 1.0, relative = 0.02, "
    "pulse_fwhm_ns = 6, range_floor_m = 0.005, edge_factor = 1",
}
"""All numbers of a `linear` detector: what a file does not say would be fitted to the recording. Weaker than the
shipped sensors, so that some surfaces are hardly seen."""


def stated(name: str) -> Device:
    """The sensor with all its numbers in a file of its own."""
    if name not in NUMBERS:
        return device(name)
    text = (SHIPPED / f"{name}.toml").read_text(encoding="utf-8")
    text = re.sub(r"(?m)^linear = \{.*\}$", f"linear = {{{NUMBERS[name]}}}", text)
    return Device("sensor.toml", tomllib.loads(text), text)


@dataclass(frozen=True)
class Setting:
    """All that the frames of a recording share."""

    order: CaseOrder
    device: Device
    hidden: tuple[Effect, ...]
    beams: Beams
    scene: Scene

    def echoes(self, frame: int) -> Echoes:
        """One repeat."""
        seed = [self.order.seed, frame, 0]
        beams = self.beams
        for effect in self.hidden:
            if effect.name == "vibration":
                beams = shaken(beams, effect.parameters["random_deg"], np.random.default_rng([*seed, 61]))
        return measure(self.scene, self.device, beams, MATERIALS, self.hidden, Nuisance(), seed)


def setting(order: CaseOrder) -> Setting:
    """Draws everything that the order leaves open, from its seed."""
    own = stated(order.variant)
    draw = Draw(np.random.default_rng([order.seed, 2]), order.strength, order.variant, tuple(MATERIALS))
    beams = own.sector(order.seed, 0)
    angle = np.deg2rad(beams.azimuth_deg)
    middle = float(np.rad2deg(np.angle(np.mean(np.exp(1j * angle)))))
    half = float(np.abs((beams.azimuth_deg - middle + 180.0) % 360.0 - 180.0).max())
    scene = arrange(order.scene, [order.seed, 0, 3], middle, half)
    return Setting(order, own, tuple(OF_REPEATS[name](draw, own) for name in order.effects), beams, scene)


def write_case(order: CaseOrder, directory: Path, frames: int = FRAMES) -> Sealed:
    """Writes a recording as a case and keeps its truth sealed; its digest lies there as `sealed.txt`."""
    s = setting(order)
    directory.mkdir(parents=True, exist_ok=True)
    write(directory, "ideal.txt", ideal_text(s.device, s.beams, nominal(s.scene, s.device, s.beams)))
    rows = []
    for k in range(frames):
        measured = f"frame_{k:02d}.txt"
        write(directory, measured, scan_text(s.echoes(k), s.beams, s.device, headings(s.beams)))
        rows.append(("ideal.txt", measured, round(k / float(s.device.document["frame_rate_hz"]), 6)))
    write(directory, s.device.name, s.device.text)
    write(directory, "model.toml", model_text(s.device.name, MATERIALS, {}))
    write(directory, "case.toml", case_text(rows))
    parameters = {e.name: e.parameters for e in s.hidden}
    comparable = {key: value for e in s.hidden for key, value in e.comparable.items()}
    known = dict.fromkeys(order.effects, True)
    names = {e.name: e.name for e in s.hidden}
    truth = Truth(order.kind, order.effects, names, parameters, comparable, known, {}, {}, {}, {})
    sealed = Sealed.seal(truth, hashlib.sha256(f"{order.seed} {order.number} repeats".encode()).hexdigest()[:32])
    write(directory, "sealed.txt", sealed.digest + "\n")
    return sealed
