"""The examples' own models: built, and run on light as they are run by anybody, with no code of ours between."""

import importlib.util
import re
import shutil
import subprocess
import tempfile
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hidden.foreign.detectors import Echoes, Shine
from hidden.foreign.device import Beams, Device

F = NDArray[np.float64]
EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
Materials = dict[int, tuple[str, float, float]]


@dataclass(frozen=True)
class Program:
    """An example's folder, and what its model file says of it."""

    folder: Path
    files: tuple[str, ...]
    model: str
    compiled: bool

    @property
    def device(self) -> Device:
        text = (self.folder / "sensor.toml").read_text(encoding="utf-8")
        return Device("sensor.toml", tomllib.loads(text), text)

    def model_text(self, materials: Materials) -> str:
        """The model file with all materials of the cases."""
        head = (self.folder / self.model).read_text(encoding="utf-8").partition("[materials.")[0]
        tables = []
        for number, (name, reflectance, gain) in sorted(materials.items()):
            kind = f'kind = "retro"\nretro_gain = {gain}\n' if gain else ""
            tables.append(f'[materials.{number}]\nname = "{name}"\nreflectance = {reflectance}\n{kind}')
        return head + "\n".join(tables)

    def echoes(self, rows: dict[str, F], beams: Beams, seed: int, threshold: float) -> Echoes:
        """What it answers to the rows of an ideal scan; `threshold` over its own."""
        found = (self._compiled if self.compiled else self._called)(rows, seed, threshold)
        index = {key: k for k, key in enumerate(zip(beams.layer.tolist(), beams.point.tolist(), strict=True))}
        pairs = zip(found["Layer"].astype(int).tolist(), found["Point"].astype(int).tolist(), strict=True)
        beam = np.array([index[pair] for pair in pairs], np.int64)
        return Echoes(beam, found["RANGE"].astype(float), found["INTENSITY"].astype(float))

    def _compiled(self, rows: dict[str, F], seed: int, threshold: float) -> dict[str, F]:
        with tempfile.TemporaryDirectory() as name:
            place = Path(name)
            settings = (self.folder / "waveform.ini").read_text(encoding="utf-8")
            own = float(re.findall(r"(?m)^threshold = (\S+)", settings)[0])
            settings = re.sub(r"(?m)^threshold = .*", f"threshold = {own * threshold!r}", settings)
            (place / "s.ini").write_text(settings, encoding="utf-8")
            table = np.column_stack(list(rows.values()))
            form = " ".join("%d" if key in ("Layer", "Point", "MaterialID") else "%.9g" for key in rows)
            lines = "\n".join(form % tuple(row) for row in table.tolist())
            (place / "i.txt").write_text(f"//{' '.join(rows)}\n{len(table)}\n{lines}\n", encoding="utf-8")
            words = [str(self.folder / "waveform"), *(str(place / file) for file in ("i.txt", "s.ini", "o.txt"))]
            subprocess.run([*words, str(seed), "0"], check=True)
            head, *body = (place / "o.txt").read_text(encoding="utf-8").splitlines()
            values = np.array([line.split() for line in body], np.float64).reshape(-1, len(head.split()))
            return dict(zip(head.split(), values.T, strict=True))

    def _called(self, rows: dict[str, F], seed: int, threshold: float) -> dict[str, F]:
        whole = ("Layer", "Point", "MaterialID")
        ideal = {name: column.astype(np.int32) if name in whole else column for name, column in rows.items()}
        found: dict[str, F] = _function(self.folder).simulate(ideal, seed, 0, 5.0 * threshold)
        return found


@cache
def _function(folder: Path) -> Any:
    spec = importlib.util.spec_from_file_location("own_lidar_model", folder / "own_lidar" / "model.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@cache
def program(name: str) -> Program:
    """An example by the name of its folder; the C program is compiled into a copy, once a process."""
    if name == "own_model_python":
        return Program(
            EXAMPLES / name, ("sensor.toml", "own_lidar/__init__.py", "own_lidar/model.py"), "model.toml", False
        )
    folder = Path(shutil.copytree(EXAMPLES / name, Path(tempfile.mkdtemp(prefix="hidden-around-")) / name))
    subprocess.run(["make", "-s", "-B", "-C", str(folder)], check=True)
    return Program(folder, ("sensor.toml", "waveform", "waveform.ini"), "server.toml", True)


def rows_of(shine: Shine, beams: Beams, device: Device, nominal: Materials, white: int) -> dict[str, F]:
    """Light as rows of an ideal scan: a share of what its material would send back, by the nominal table.

    Light of no surface is a row of the material `white`; beams without light have a row of distance 0.
    """
    own = device.numbers
    material = np.where(shine.material > 0, shine.material, white)
    reflectance, gain = (np.array([nominal[int(m)][k] for m in material], np.float64) for k in (1, 2))
    lit = reflectance * np.where(gain > 0, gain, np.cos(np.deg2rad(shine.incidence_deg)))
    share = shine.signal * shine.range_m**2 / (float(own["signal_at_1m"]) * np.maximum(lit, 1e-9))
    dark = np.setdiff1d(np.arange(len(beams)), shine.beam)
    none = np.zeros(len(dark))
    beam = np.concatenate([shine.beam, dark])
    columns = {
        "Layer": beams.layer[beam], "Point": beams.point[beam], "Distance": np.concatenate([shine.range_m, none]),
        "MaterialID": np.concatenate([material, none + white]),
        "IncidenceAngle": np.concatenate([shine.incidence_deg, none]), "Share": np.concatenate([share, none + 1.0]),
        "Background": 1.0 + shine.background[beam] / float(own.get("noise", 1.0)) ** 2,
    }  # fmt: skip
    order = np.lexsort((columns["Distance"], beam))
    return {name: np.asarray(column, np.float64)[order] for name, column in columns.items()}
