"""Cases with known truth for tests of fitting: measured by the independent simulator with numbers of our choice."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from hidden.chain import Effect, Frame, Nuisance, measure
from hidden.effects_air import AIR_M, _backscatter
from hidden.files import case_text, echoes_text, ideal_text, model_text, write
from hidden.places import GLASS, TABLE, arrange
from hidden.rays import Beams, cast, directions
from hidden.sensor import LIGHT_M_NS, Detectors, Echoes, Light, gaussian_shape

SCENES = ("street", "lab", "sign")


@dataclass(frozen=True)
class Truth:
    """What the measuring sensor has that the model's file has not. `values`: by the names that calibrate uses."""

    values: Mapping[str, float]
    variant: str = "SMART"
    seed: int = 1
    frames: int = 6
    layers: range = field(default=range(210, 306))
    points: range = field(default=range(430, 526))
    scene: str = "mixed"

    def get(self, name: str, otherwise: float) -> float:
        """A value of the truth, or what the contract says."""
        return self.values.get(name, otherwise)


def effects_of(truth: Truth) -> tuple[Effect, ...]:
    """The truth's numbers as changes of the independent simulator's light, detectors and echoes."""
    gain = truth.get("signal_at_1m", 6000.0) / 6000.0 * truth.get("effects.signal_gain.gain", 1.0)
    mor = truth.get("effects.fog.mor_m", np.inf)
    backscatter = truth.get("effects.fog.backscatter", 0.046)

    def surfaces(light: Light, frame: Frame) -> None:
        light.signal = light.signal * gain

    def background(light: Light, frame: Frame) -> None:
        light.background[:] = truth.get("background_per_ns", 3e-4) + truth.get("effects.dark_counts.rate_per_ns", 0.0)

    def fog(light: Light, frame: Frame) -> None:
        alpha = np.full(len(AIR_M), np.log(20.0) / mor)
        light.signal = light.signal * np.exp(-2.0 * np.log(20.0) / mor * light.range_m)
        overlap = np.clip((AIR_M - 0.9) / 0.1, 0.0, 1.0)
        light.haze = _backscatter(alpha, np.full(len(AIR_M), backscatter / mor), overlap)[None] * gain
        light.haze_of, light.haze_gain = np.zeros(len(frame.beams), np.int64), np.ones(len(frame.beams))

    def detectors(d: Detectors, frame: Frame) -> None:
        d.threshold[:] = truth.get("threshold", 9.0)
        d.shape = gaussian_shape(truth.get("pulse_fwhm_ns", 5.0))
        d.dead = (int(truth.get("dead_bins", 12.0)), *d.dead[1:])

    def readout(echoes: Echoes, frame: Frame) -> Echoes:
        shift = truth.get("effects.range_offset.offset_m", 0.0)
        shift = shift + truth.get("effects.walk_error.per_decade_m", 0.0) * np.log10(echoes.area / 1000.0)
        shift = shift + truth.get("effects.range_scale.fraction", 0.0) * echoes.range_m
        jitter = truth.get("effects.timing_jitter.sigma_ns", 0.0)
        shift = shift + LIGHT_M_NS / 2 * jitter * frame.rng.standard_normal(len(echoes.beam))
        echoes.range_m = echoes.range_m + shift
        lost = frame.rng.random(len(frame.beams)) < truth.get("effects.dropout.share", 0.0)
        return echoes.kept(~lost[echoes.beam])

    found = [Effect("surfaces", "test", {}, light=surfaces, place=0)]
    if np.isfinite(mor):
        found.append(Effect("fog", "test", {}, light=fog, place=1))
    found.append(Effect("background", "test", {}, light=background, place=2))
    return (*found, Effect("sensor", "test", {}, detectors=detectors, readout=readout))


def table_of(truth: Truth) -> dict[int, tuple[str, float, float]]:
    """The measured world's materials: the contract's with the truth's reflectances."""
    return {
        m: (name, truth.get(f"materials.{m}.reflectance", rho), truth.get(f"materials.{m}.retro_gain", gain))
        for m, (name, rho, gain) in TABLE.items()
        if m != GLASS
    }


def write_case(truth: Truth, directory: Path, *, model: str = "") -> Path:
    """A case directory whose frames a sensor with this truth measured; `model` is put at the model file's end."""
    directory.mkdir(parents=True, exist_ok=True)
    layer, point = (a.ravel() for a in np.meshgrid(truth.layers, truth.points, indexing="ij"))
    beams = Beams(layer.astype(np.int64), point.astype(np.int64))
    rows = []
    for index in range(truth.frames):
        kind = SCENES[index % 3] if truth.scene == "mixed" else truth.scene
        scene = arrange(kind, [truth.seed, index, 3], False)
        heading = directions(beams.azimuth_deg, beams.elevation_deg)
        hits = cast(scene, np.zeros((len(beams), 3)), heading, beams.time_s)
        echoes = measure(
            scene, beams, truth.variant, table_of(truth), effects_of(truth), Nuisance(), truth.seed * 8, index
        )
        ideal, measured = f"ideal_{index}.txt", f"measured_{index}.txt"
        write(directory, ideal, ideal_text(beams, hits, False, None))
        write(directory, measured, echoes_text(beams, echoes))
        rows.append((ideal, measured, 0.1 * index))
    table = {m: row for m, row in TABLE.items() if m != GLASS}
    write(directory, "model.toml", model_text(truth.variant, table, {}) + model)
    write(directory, "case.toml", case_text(rows))
    return directory
