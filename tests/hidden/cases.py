"""A case: the arrangement of its frames, what is hidden in them, the files and the seal."""

import hashlib
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from . import aliens as _aliens  # noqa: F401  (registers its effects)
from . import effects_aim, effects_air, effects_detector, effects_light, effects_light_paths, effects_readout  # noqa: F401
from .chain import Effect, Nuisance, measure
from .files import Table, case_text, echoes_text, ideal_text, model_text, write
from .forms import AT_WINDOW, Draw, draw_alien, draw_effect
from .orders import SEVERAL, WITH_NUISANCE, CaseOrder
from .places import GLASS, KINDS, LAYERS, POINT_RANGE, TABLE, arrange
from .rays import Beams, Hits, Scene, cast, directions
from .sealing import Sealed, Truth
from .sensor import Echoes, Light
from .visibility import VISIBLE_Z, Seen, seen, stands_out

FRAMES = 6
FEWEST_FRAMES, MOST_FRAMES = 2, 10
MATERIALS_BY_SCENE = {"street": (1, 5, 6), "lab": (2, 3, 4, 6), "sign": (1, 5, 7), "mixed": (1, 3, 4, 5, 6)}
FRESH_FROM = 1000  # frames from this number on are for an outside classifier
VISIBILITY_FRAMES = 4  # the first ones: enough to say whether an effect shows, and quick


@dataclass(frozen=True)
class Setting:
    """All that a case's frames share."""

    order: CaseOrder
    table: Table
    hidden: tuple[Effect, ...]
    known: tuple[Effect, ...]
    in_model: dict[str, dict[str, float]]
    nuisance: Nuisance
    glass: bool
    object_ids: bool
    times: str  # "", "columns" or "start"
    step_s: float

    @property
    def beams(self) -> Beams:
        return Beams.block(LAYERS, POINT_RANGE)

    def scene(self, index: int) -> Scene:
        """The arrangement of a frame; "mixed" cases take the kinds in turn."""
        kind = KINDS[index % len(KINDS)] if self.order.scene == "mixed" else self.order.scene
        return arrange(kind, [self.order.seed, index, 3], self.glass)

    def ideal(self, index: int) -> Hits:
        """What the beams would meet from the nominal pose."""
        beams = self.beams
        return cast(
            self.scene(index),
            np.zeros((len(beams), 3)),
            directions(beams.azimuth_deg, beams.elevation_deg),
            beams.time_s,
        )

    def echoes(self, index: int, effects: tuple[Effect, ...], repeat: int = 0) -> Echoes:
        """One measured frame with these of the hidden effects; another `repeat` is other noise."""
        both = (*effects, *self.known)
        seed = self.order.seed * 8 + repeat
        return measure(self.scene(index), self.beams, self.order.variant, self.table, both, self.nuisance, seed, index)


def _nuisance(rng: np.random.Generator, materials: Table) -> Nuisance:
    return Nuisance(
        gain=float(np.exp(0.01 * rng.standard_normal())),
        yaw_deg=float(0.01 * rng.standard_normal()),
        pitch_deg=float(0.01 * rng.standard_normal()),
        height_m=float(0.005 * rng.standard_normal()),
        reflectance={m: float(np.exp(0.03 * rng.standard_normal())) for m in materials},
    )


def _known(rng: np.random.Generator) -> tuple[tuple[Effect, ...], dict[str, dict[str, float]]]:
    """What the model file already has, and the measurement too."""
    gain, rate = round(float(rng.uniform(0.75, 0.95)), 3), round(float(rng.uniform(5e-5, 2e-4)), 6)

    def dimmed(light: Light, frame: object) -> None:
        light.signal = light.signal * gain

    def noisier(light: Light, frame: object) -> None:
        light.background = light.background + rate

    effects = (
        Effect("signal_gain", "known", {"gain": gain}, light=dimmed, place=AT_WINDOW),
        Effect("dark_counts", "known", {"rate_per_ns": rate}, light=noisier, place=AT_WINDOW + 5),
    )
    return effects, {"signal_gain": {"gain": gain}, "dark_counts": {"rate_per_ns": rate}}


def _hidden(order: CaseOrder, rng: np.random.Generator, strength: str) -> tuple[Effect, ...]:
    draw = Draw(rng, strength, order.variant, MATERIALS_BY_SCENE[order.scene])
    return tuple(draw_alien(n, draw) if order.kind == "alien" else draw_effect(n, draw) for n in order.effects)


def setting(order: CaseOrder, strength: str | None = None) -> Setting:
    """Draws everything that the order leaves open, from its seed."""
    rng = np.random.default_rng([order.seed, 1])
    hidden = _hidden(order, np.random.default_rng([order.seed, 2]), strength or order.strength)
    with_known = rng.random() < 0.1 and not {"signal_gain", "dark_counts"} & set(order.effects)
    known, in_model = _known(rng) if with_known else ((), {})
    with_nuisance = {"null": False, "null_nuisance": True}.get(order.kind, rng.random() < WITH_NUISANCE)
    mirror = "mirror_multipath" in order.effects
    glass = rng.random() < 0.12 or mirror
    times = str(rng.choice(["", "", "", "", "columns", "start"]))
    if "motion" in order.effects and times == "columns":
        times = "start"  # an ideal scan with the columns' times would show the motion itself
    table = {m: row for m, row in TABLE.items() if m != GLASS or glass}
    nuisance = _nuisance(rng, table) if with_nuisance else Nuisance()
    traffic = any(e.form == "traffic" for e in hidden)
    return Setting(
        order, table, hidden, known, in_model, nuisance, glass, traffic or bool(rng.random() < 0.25), times,
        0.04 if rng.random() < 0.6 else round(float(rng.uniform(0.1, 30.0)), 2),
    )  # fmt: skip


def _write_frames(
    s: Setting, directory: Path, indices: list[int], hits: list[Hits], echoes: list[Echoes]
) -> list[tuple[Path, Path]]:
    """Frames, model file and case file; paths of (ideal, measured)."""
    directory.mkdir(parents=True, exist_ok=True)
    beams = s.beams
    times = {"": None, "columns": beams.time_s, "start": np.zeros(len(beams))}[s.times]
    rows, paths = [], []
    for number, (index, h, e) in enumerate(zip(indices, hits, echoes, strict=True)):
        ideal, measured = f"frame_{number:02d}_ideal.txt", f"frame_{number:02d}_measured.txt"
        paths.append((
            write(directory, ideal, ideal_text(beams, h, s.object_ids, times)),
            write(directory, measured, echoes_text(beams, e)),
        ))  # fmt: skip
        rows.append((ideal, measured, round(s.step_s * (index % FRESH_FROM), 6)))
    write(directory, "model.toml", model_text(s.order.variant, s.table, s.in_model))
    write(directory, "case.toml", case_text(rows))
    return paths


def _visibility(s: Setting, indices: list[int], hits: list[Hits], measured: Seen) -> dict[str, tuple[float, str]]:
    """How far each hidden effect stands out against the same frames without it."""
    found = {}
    for effect in s.hidden:
        others = tuple(e for e in s.hidden if e is not effect)
        frames = [s.echoes(i, others, repeat=1) for i in indices]
        found[effect.name] = stands_out(measured, seen(frames, s.beams, hits))
    return found


def comparable(s: Setting) -> dict[str, float]:
    """The values that data and model file differ by in all: a nuisance of the same kind is part of them."""
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


def _truth(s: Setting, visible: dict[str, tuple[float, str]]) -> Truth:
    return Truth(
        kind=s.order.kind,
        effects=s.order.effects,
        forms={e.name: e.form for e in s.hidden},
        parameters={e.name: e.parameters for e in s.hidden},
        comparable=comparable(s),
        observable={name: z > VISIBLE_Z for name, (z, _) in visible.items()},
        z={name: round(z, 2) for name, (z, _) in visible.items()},
        shows_in={name: where for name, (_, where) in visible.items()},
        nuisance={k: v for k, v in asdict(s.nuisance).items() if k != "reflectance"} | {
            "reflectance": {str(k): v for k, v in s.nuisance.reflectance.items()}
        },
        in_model=s.in_model,
    )  # fmt: skip


def _measured(s: Setting, indices: list[int]) -> tuple[list[Hits], list[Echoes], dict[str, tuple[float, str]]]:
    """Ideal scans and echoes of a case's frames, and how far each hidden effect stands out of them."""
    hits = [s.ideal(i) for i in indices]
    echoes = [s.echoes(i, s.hidden) for i in indices]
    part = slice(0, VISIBILITY_FRAMES)
    return hits, echoes, _visibility(s, indices[part], hits[part], seen(echoes[part], s.beams, hits[part]))


def _must_show(order: CaseOrder) -> bool:
    """Whether a case makes no sense unless all that it hides can be seen, and there is a stronger draw of it."""
    return order.kind in ("pair", SEVERAL, "left_out", "alien") and order.strength != "strong"


def _all_show(visible: dict[str, tuple[float, str]]) -> bool:
    return all(z > VISIBLE_Z for z, _ in visible.values())


def write_case(order: CaseOrder, directory: Path, frames: int = FRAMES) -> Sealed:
    """Writes a case directory and keeps its truth sealed; its digest lies there as `sealed.txt`.

    Where all that a case hides must be seen (pairs, and what is to be called unknown) and is not, it is drawn strong.
    """
    if not FEWEST_FRAMES <= frames <= MOST_FRAMES:
        raise ValueError(f"a case has {FEWEST_FRAMES} to {MOST_FRAMES} frames, not {frames}")
    indices = list(range(frames))
    s = setting(order)
    hits, echoes, visible = _measured(s, indices)
    if _must_show(order) and not _all_show(visible):
        s = setting(order, "strong")
        hits, echoes, visible = _measured(s, indices)
    _write_frames(s, directory, indices, hits, echoes)
    salt = hashlib.sha256(f"{order.seed} {order.number} salt".encode()).hexdigest()[:32]
    sealed = Sealed.seal(_truth(s, visible), salt)
    write(directory, "sealed.txt", sealed.digest + "\n")
    return sealed


def fresh_frames(order: CaseOrder, directory: Path, count: int, frames: int = FRAMES) -> list[tuple[Path, Path]]:
    """More measured frames of the same truth, of other arrangements and noise, as a case directory of their own."""
    s = setting(order)
    if _must_show(order) and not _all_show(_measured(s, list(range(frames)))[2]):
        s = setting(order, "strong")
    indices = [FRESH_FROM + k for k in range(count)]
    return _write_frames(s, directory, indices, [s.ideal(i) for i in indices], [s.echoes(i, s.hidden) for i in indices])
