"""A case of a foreign sensor: frames, model file, the sensor's file where it is no shipped one, and the seal."""

import hashlib
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hidden.chain import Nuisance
from hidden.files import case_text, write
from hidden.files import model_text as _model_text
from hidden.forms import Draw
from hidden.rays import Hits, Scene
from hidden.sealing import Sealed, Truth

from .chain import Effect, headings, measure, nominal
from .detectors import Echoes
from .device import Beams, Device, device
from .effects import FORMS
from .orders import CaseOrder
from .places import MATERIALS, arrange
from .readout import scan_text
from .visibility import VISIBLE_Z, stands_out

F = NDArray[np.float64]
FRAMES = {"street": 6, "bench": 60}
"""A chip has nine zones: its cases have more frames."""


@dataclass(frozen=True)
class Setting:
    """All that a case's frames share."""

    order: CaseOrder
    device: Device
    hidden: tuple[Effect, ...]
    nuisance: Nuisance

    def beams(self, frame: int) -> Beams:
        return self.device.sector(self.order.seed, frame)

    def scene(self, frame: int) -> Scene:
        beams = self.beams(0)
        angle = np.deg2rad(beams.azimuth_deg)
        middle = float(np.rad2deg(np.angle(np.mean(np.exp(1j * angle)))))
        half = float(np.abs((beams.azimuth_deg - middle + 180.0) % 360.0 - 180.0).max())
        return arrange(self.order.scene, [self.order.seed, frame, 3], middle, half)

    def echoes(self, frame: int, effects: tuple[Effect, ...], repeat: int = 0) -> Echoes:
        """A measured frame; another `repeat` is other noise."""
        seed = [self.order.seed, frame, repeat]
        return measure(self.scene(frame), self.device, self.beams(frame), MATERIALS, effects, self.nuisance, seed)


def setting(order: CaseOrder) -> Setting:
    """Draws everything that the order leaves open, from its seed."""
    rng = np.random.default_rng([order.seed, 1])
    own = device(order.variant)
    draw = Draw(np.random.default_rng([order.seed, 2]), order.strength, order.variant, tuple(MATERIALS))
    off = {"null": False, "null_nuisance": True}.get(order.kind, rng.random() < 0.5)
    nuisance = Nuisance()
    if off:
        gain, yaw, pitch, height = rng.standard_normal(4)
        height_m = 0.005 * float(height) if order.scene == "street" else 0.0
        nuisance = Nuisance(
            float(np.exp(0.01 * gain)), 0.01 * float(yaw), 0.01 * float(pitch), height_m,
            {m: float(np.exp(0.03 * rng.standard_normal())) for m in MATERIALS},
        )  # fmt: skip
    return Setting(order, own, tuple(FORMS[name](draw, own) for name in order.effects), nuisance)


def ideal_text(own: Device, beams: Beams, parts: list[Hits]) -> str:
    """What every beam meets within the sensor's reach: a row a part of it."""
    names = ["Layer", "Point", "Distance", "MaterialID", "IncidenceAngle"]
    wanders = own.rotating and not own.document["beams"].get("columns_repeat", True)
    names += ["Azimuth0"] * wanders
    rows = []
    for hits in parts:
        met = (hits.range_m > 0) & (hits.range_m <= own.gate_m[1])
        columns = (hits.range_m, hits.material, hits.incidence_deg)
        table = [beams.layer, beams.point, *(np.where(met, column, 0) for column in columns)]
        table += [np.full(len(beams), beams.first_deg)] * wanders
        rows.append(np.stack(table, axis=1))
    every = np.stack(rows, axis=1).reshape(-1, len(names))
    form = "%d %d %.4f %d %.3f" + " %.7f" * wanders
    return f"//{' '.join(names)}\n{len(every)}\n" + "\n".join(form % tuple(row) for row in every.tolist()) + "\n"


def _write_frame(s: Setting, directory: Path, frame: int, parts: list[Hits], echoes: Echoes) -> tuple[str, str, float]:
    ideal, measured = f"frame_{frame:02d}_ideal.txt", f"frame_{frame:02d}_measured.txt"
    beams = s.beams(frame)
    write(directory, ideal, ideal_text(s.device, beams, parts))
    write(directory, measured, scan_text(echoes, beams, s.device, headings(beams)))
    return ideal, measured, round(frame / float(s.device.document["frame_rate_hz"]), 6)


def write_case(order: CaseOrder, directory: Path, frames: int | None = None) -> Sealed:
    """Writes a case directory and keeps its truth sealed; its digest lies there as `sealed.txt`."""
    s = setting(order)
    count = frames or FRAMES[order.scene]
    directory.mkdir(parents=True, exist_ok=True)
    parts = [nominal(s.scene(k), s.device, s.beams(k)) for k in range(count)]
    echoes = [s.echoes(k, s.hidden) for k in range(count)]
    rows = [_write_frame(s, directory, k, parts[k], echoes[k]) for k in range(count)]
    if s.device.text:
        write(directory, s.device.name, s.device.text)
    write(directory, "model.toml", _model_text(s.device.name, MATERIALS, {}))
    write(directory, "case.toml", case_text(rows))
    visible = {}
    if s.hidden:
        without = [s.echoes(k, (), repeat=1) for k in range(count)]
        found = stands_out(s.device, echoes, without, [s.beams(k) for k in range(count)], parts)
        visible = dict.fromkeys(order.effects, found)
    salt = hashlib.sha256(f"{order.seed} {order.number} foreign".encode()).hexdigest()[:32]
    sealed = Sealed.seal(truth_of(s, visible), salt)
    write(directory, "sealed.txt", sealed.digest + "\n")
    return sealed


def truth_of(s: Setting, visible: dict[str, tuple[float, str]]) -> Truth:
    """What a case hides; `visible`: how far it stands out, and where."""
    nuisance = asdict(s.nuisance)
    return Truth(
        kind=s.order.kind,
        effects=s.order.effects,
        forms={e.name: e.name for e in s.hidden},
        parameters={e.name: e.parameters for e in s.hidden},
        comparable=_comparable(s),
        observable={name: z > VISIBLE_Z for name, (z, _) in visible.items()},
        z={name: round(z, 2) for name, (z, _) in visible.items()},
        shows_in={name: where for name, (_, where) in visible.items()},
        nuisance=nuisance | {"reflectance": {str(k): v for k, v in s.nuisance.reflectance.items()}},
        in_model={},
    )


def _comparable(s: Setting) -> dict[str, float]:
    """What data and model file differ by in all: a nuisance of the same kind is part of it."""
    values = {key: value for e in s.hidden for key, value in e.comparable.items()}
    if "signal_gain.gain" in values:
        values["signal_gain.gain"] *= s.nuisance.gain
    if "material_reflectance.factor" in values:
        material = int(values["material_reflectance.material_id"])
        values["material_reflectance.factor"] *= s.nuisance.reflectance.get(material, 1.0)
    for key, angle in (("boresight.yaw_deg", s.nuisance.yaw_deg), ("boresight.pitch_deg", s.nuisance.pitch_deg)):
        if key in values:
            values[key] += angle
    return values
