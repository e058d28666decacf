"""A case around a model that is not ours: its files, frames whose echoes it gave, and the seal."""

import hashlib
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hidden.chain import Nuisance
from hidden.files import case_text, write
from hidden.foreign.cases import Setting as Foreign
from hidden.foreign.cases import ideal_text, truth_of
from hidden.foreign.chain import Aim, Effect, Frame, headings, light_of, look, nominal, turn
from hidden.foreign.detectors import LIGHT_M_NS, Echoes
from hidden.foreign.device import Beams
from hidden.foreign.effects import FORMS
from hidden.foreign.orders import CaseOrder
from hidden.foreign.places import MATERIALS
from hidden.foreign.readout import reported
from hidden.foreign.visibility import stands_out
from hidden.forms import Draw
from hidden.places import PANEL_80
from hidden.sealing import Sealed

from .programs import Program, program, rows_of

F = NDArray[np.float64]
FRAMES = 6


@dataclass(frozen=True)
class Setting(Foreign):
    """All that a case's frames share; `echoes` come of the example's own program."""

    @property
    def program(self) -> Program:
        return program(self.order.variant)

    def echoes(self, frame: int, effects: tuple[Effect, ...], repeat: int = 0) -> Echoes:
        """A measured frame; another `repeat` is other noise."""
        seed, beams, own = [self.order.seed, frame, repeat], self.beams(frame), self.nuisance
        true = {m: (n, rho * own.reflectance.get(m, 1.0), gain) for m, (n, rho, gain) in MATERIALS.items()}
        state = Frame(self.device, beams, true, np.random.default_rng(seed))
        streams = [np.random.default_rng([*seed, *e.name.encode()]) for e in effects]
        aim = Aim(turn(own.yaw_deg, own.pitch_deg), np.zeros((len(beams), 3)))
        for effect, state.rng in zip(effects, streams, strict=True):
            if effect.aim is not None:
                effect.aim(aim, state)
        parts = look(self.scene(frame).raised(-own.height_m), self.device, beams, aim)
        state.hits = parts[len(parts) // 2]
        shine = state.light = light_of(state, parts)
        shine.signal = shine.signal * own.gain
        for effect, state.rng in zip(effects, streams, strict=True):
            if effect.light is not None:
                effect.light(shine, state)
        threshold = float(shine.threshold[0]) / float(self.device.numbers["threshold"])
        rows = rows_of(shine, beams, self.device, MATERIALS, PANEL_80)
        noise = int(np.random.default_rng([*seed, 7]).integers(2**31))
        echoes = self._read_out(self.program.echoes(rows, beams, noise, threshold), shine.jitter_ns, [*seed, 8])
        for effect, state.rng in zip(effects, streams, strict=True):
            if effect.readout is not None:
                echoes = effect.readout(echoes, state)
        return reported(echoes, beams, self.device)

    def _read_out(self, echoes: Echoes, jitter_ns: float, seed: list[int]) -> Echoes:
        """Ranges between the steps of the program's own counter, with the jitter of each shot."""
        rng = np.random.default_rng(seed)
        n = len(echoes.beam)
        echoes.path_m = echoes.path_m + self.device.step_m * (rng.random(n) - 0.5)
        echoes.path_m = echoes.path_m + LIGHT_M_NS / 2 * jitter_ns * rng.standard_normal(n)
        return echoes


def setting(order: CaseOrder) -> Setting:
    """Draws everything that the order leaves open, from its seed."""
    rng = np.random.default_rng([order.seed, 1])
    own = program(order.variant).device
    draw = Draw(np.random.default_rng([order.seed, 2]), order.strength, order.variant, tuple(MATERIALS))
    off = {"null": False, "null_nuisance": True}.get(order.kind, rng.random() < 0.5)
    nuisance = Nuisance()
    if off:
        gain, yaw, pitch, height = (float(value) for value in rng.standard_normal(4))
        reflectance = {m: float(np.exp(0.03 * rng.standard_normal())) for m in MATERIALS}
        nuisance = Nuisance(float(np.exp(0.01 * gain)), 0.01 * yaw, 0.01 * pitch, 0.005 * height, reflectance)
    return Setting(order, own, tuple(FORMS[name](draw, own) for name in order.effects), nuisance)


def scan_text(echoes: Echoes, beams: Beams, heading: F) -> str:
    """The measured file."""
    at = echoes.path_m[:, None] * heading[echoes.beam]
    row = np.arange(len(echoes.beam))
    start = np.concatenate([[True], np.diff(echoes.beam) != 0])[: len(row)]
    number = row - np.maximum.accumulate(np.where(start, row, 0)) + 1
    columns = (*at.T, beams.layer[echoes.beam], beams.point[echoes.beam], number, echoes.amplitude)
    form = "%.6f %.6f %.6f %d %d %d %.0f"
    rows = "\n".join(form % values for values in zip(*(c.tolist() for c in columns), strict=True))
    return f"//X Y Z Layer Point EchoNumber INTENSITY\n{len(row)}\n{rows}\n"


def write_case(order: CaseOrder, directory: Path, frames: int | None = None) -> Sealed:
    """Writes a case directory and keeps its truth sealed; its digest lies there as `sealed.txt`."""
    s, count = setting(order), frames or FRAMES
    directory.mkdir(parents=True, exist_ok=True)
    parts = [nominal(s.scene(k), s.device, s.beams(k)) for k in range(count)]
    echoes = [s.echoes(k, s.hidden) for k in range(count)]
    rows = []
    for k in range(count):
        beams, names = s.beams(k), (f"frame_{k:02d}_ideal.txt", f"frame_{k:02d}_measured.txt")
        write(directory, names[0], ideal_text(s.device, beams, parts[k]))
        write(directory, names[1], scan_text(echoes[k], beams, headings(beams)))
        rows.append((*names, round(k / float(s.device.document["frame_rate_hz"]), 6)))
    for file in s.program.files:
        (directory / file).parent.mkdir(exist_ok=True)
        shutil.copy(s.program.folder / file, directory / file)
    write(directory, "model.toml", s.program.model_text(MATERIALS))
    write(directory, "case.toml", case_text(rows))
    visible = {}
    if s.hidden:
        without = [s.echoes(k, (), repeat=1) for k in range(count)]
        found = stands_out(s.device, echoes, without, [s.beams(k) for k in range(count)], parts)
        visible = dict.fromkeys(order.effects, found)
    salt = hashlib.sha256(f"{order.seed} {order.number} around".encode()).hexdigest()[:32]
    sealed = Sealed.seal(truth_of(s, visible), salt)
    write(directory, "sealed.txt", sealed.digest + "\n")
    return sealed
