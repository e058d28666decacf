"""A lidar model that is not ours, as a program of its own: a few samples of a Gaussian pulse, noise, a threshold.

It knows nothing of lidarcheck: it reads an ideal scan's text and writes echoes. What it reads is chosen by a list.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarcheck.scan import IdealScan

__all__ = ["EVERYTHING", "MATERIALS", "PROGRAM", "model_text", "wall_scan", "write_program"]

EVERYTHING = ("Share", "Parts", "Reflectance", "Background", "Time", "Frame", "Seed")

PROGRAM = '''\
"""Samples of 0.15 m, a pulse of 0.35 m, noise by the background, echoes above a threshold; ranges to 1 cm."""
import math, random, sys

ideal, scan, seed, frame, threshold = sys.argv[1:6]
READS = {reads!r}
REFLECTANCE, K, STEP, SIGMA = {{1: 0.1, 2: 0.6, 9: 0.3}}, 4000.0, 0.15, 0.35
RETRO, GAIN = 3, 400.0
threshold = float(threshold)

lines = open(ideal).read().splitlines()
names = lines[0].lstrip("/").split()
beams = {{}}
for line in lines[1:]:
    row = dict(zip(names, line.split()))
    if len(row) > 2:
        beams.setdefault((int(row["Layer"]), int(row["Point"])), []).append(row)

out = ["RANGE Point Layer EchoNumber WIDTH AREA PEAK"]
for (layer, point), rows in beams.items():
    key = [seed if "Seed" in READS else 0, frame if "Frame" in READS else 0, layer, point]
    draw = random.Random(" ".join(map(str, key)))
    background, wave = 1.0, {{}}
    total = sum(float(row.get("Share", 1.0)) for row in rows) or 1.0
    for row in rows:
        background = float(row.get("Background", 1.0)) if "Background" in READS else 1.0
        distance = float(row["Distance"])
        if distance <= 0.0:
            continue
        material = int(row["MaterialID"])
        rho = 0.5 * GAIN if material == RETRO else REFLECTANCE[material]
        if "Reflectance" in READS and "Reflectance" in row:
            rho = float(row["Reflectance"])
        cosine = 1.0 if material == RETRO else math.cos(math.radians(float(row["IncidenceAngle"])))
        part = float(row["Share"]) if "Share" in READS and "Share" in row else 1.0 / len(rows)
        if "Share" not in READS and "Parts" in READS and "Share" in row:
            part = float(row["Share"]) / total
        late = 0.001 * float(row["Time"]) if "Time" in READS and "Time" in row else 0.0
        peak = part * K * rho * cosine / distance**2
        for i in range(int((distance - 1.2) / STEP), int((distance + 1.2) / STEP) + 1):
            off = ((i + 0.5) * STEP - distance - late) / SIGMA
            wave[i] = wave.get(i, 0.0) + peak * math.exp(-0.5 * off * off)
    if draw.random() < 0.02 * background:
        i = draw.randrange(20, 700)
        for j in (-1, 0, 1):
            wave[i + j] = wave.get(i + j, 0.0) + 2.0 * threshold
    echoes, run = [], []
    for i in sorted(wave):
        level = wave[i] + draw.gauss(0.0, 0.01 * math.sqrt(background) + 0.03 * wave[i])
        if run and i > run[-1][0] + 1:
            echoes, run = [*echoes, run], []
        if level > threshold:
            run.append((i, min(level, 200.0)))
        elif run:
            echoes, run = [*echoes, run], []
    echoes = [*echoes, run] if run else echoes
    strongest = sorted(echoes, key=lambda one: -sum(level for _, level in one))[:3]
    for number, run in enumerate(sorted(strongest), 1):
        area = sum(level for _, level in run)
        middle = sum((i + 0.5) * STEP * level for i, level in run) / area
        numbers = [len(run), round(100.0 * area, 3), round(100.0 * max(level for _, level in run), 3)]
        out.append(f"{{round(middle, 2)}} {{point}} {{layer}} {{number}} " + " ".join(map(str, numbers)))
open(scan, "w").write("\\n".join(out) + "\\n")
'''

MATERIALS = """
[materials.1]
name = "dark"
reflectance = 0.1

[materials.2]
name = "bright"
reflectance = 0.6

[materials.3]
name = "sign"
kind = "retro"
reflectance = 0.5
retro_gain = 400.0

[materials.9]
name = "air"
reflectance = 0.3
"""


def write_program(folder: Path, reads: Sequence[str] = EVERYTHING) -> None:
    """The program, which reads these things."""
    (folder / "waveform.py").write_text(PROGRAM.format(reads=tuple(reads)), encoding="utf-8")


def model_text(more: str = "", beside: str = "", *, threshold: str = "0.05") -> str:
    """A model file around the program; `more`: further keys of its table, `beside`: what stands behind all."""
    command = [sys.executable, "-S", "waveform.py", "{ideal}", "{scan}", "{seed}", "{frame}", threshold]
    table = f"[external]\ncommand = {command!r}\n".replace("'", '"')
    return f'variant = "SMART"\n{table}{more}\n{MATERIALS}\n{beside}'


def wall_scan(distance_m: float = 20.0, *, material: int = 2, layers: int = 8, points: int = 40) -> IdealScan:
    """A wall that faces the sensor, a row a beam."""
    layer, point = (a.ravel() for a in np.meshgrid(250 + np.arange(layers), 460 + np.arange(points), indexing="ij"))
    n = len(layer)
    return IdealScan(
        layer=layer.astype(np.int32),
        point=point.astype(np.int32),
        distance_m=distance_m + 0.37 * (np.arange(n) % 7) / 7.0,
        material_id=np.full(n, material, dtype=np.int32),
        incidence_deg=np.zeros(n),
    )
