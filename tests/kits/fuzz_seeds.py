"""Valid small files of everything that lidarcheck reads, each with the function by which a command reads it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from pyarrow import parquet

import sensor_import_kit as calibrations
from field_seeds import field_seeds
from lidarcheck.calibration.blooming.csv import read_profile
from lidarcheck.cases.case import load_case
from lidarcheck.formats import load_ideal, load_scan
from lidarcheck.formats.convert import describe
from lidarcheck.formats.lut import load_lut
from lidarcheck.formats.pcd import write_pcd
from lidarcheck.formats.ply import write_ply
from lidarcheck.formats.recognise import write_table
from lidarcheck.formats.sensors import Given, document_text, import_sensor, sensor_of_import, table_text
from lidarcheck.formats.settings import default_settings, load_settings
from lidarcheck.formats.table import Table
from lidarcheck.harness.goldens.file import load_golden
from lidarcheck.harness.review.release import last_check
from lidarcheck.harness.scenario.scenario import load_scenario
from lidarcheck.model import load_model
from lidarcheck.scenes.files.file import load_scene
from lidarcheck.scenes.meshes import load_mesh
from lidarcheck.sensor import Sensor
from reference_grid import beam_directions

__all__ = ["Seed", "seeds"]

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = "scenarios/effect_fog_SLIM.toml"
FIRE_TIMES = "Channel,Even_fire time(ns),Odd_fire time(ns)\n" + "".join(
    f"{n},{520 * n},{540 * n}\n" for n in range(1, 9)
)
PATTERN = "Layer,Point,elevation_deg,azimuth_deg,time_s\n" + "".join(f"0,{n},{n},{-n},0.00{n}\n" for n in range(8))
LUT = "[Blooming]\nPostPro.LUT_blooming_X = 0, 1, 2.5, 10\nPostPro.LUT_blooming_Y = 1, 0.5, 0.25, 0\n"


class Seed(NamedTuple):
    """A valid file: its name, its content, and who reads it."""

    name: str
    content: bytes
    read: Callable[[Path], object]


def seeds(directory: Path) -> list[Seed]:
    """All of them, in a fixed order; `directory` gets the files that some of them name, and is where they are read."""
    scan, ideal = _scan(), _ideal()
    made = [
        *[_table(directory, name, scan, read_scan) for name in ("a.txt", "a.csv", "a.parquet", "a.las", "a.laz")],
        *[_table(directory, name, ideal, read_ideal) for name in ("ideal.txt", "ideal.csv", "ideal.parquet")],
        _made("plain.parquet", lambda path: _unchecked(scan, path), read_scan, directory),
        _made("ascii.pcd", lambda path: write_pcd(scan, path, "ascii"), read_scan, directory),
        _made("binary.pcd", lambda path: write_pcd(scan, path, "binary"), read_scan, directory),
        _made("packed.pcd", lambda path: write_pcd(scan, path), read_scan, directory),
        _made("ascii.ply", lambda path: write_ply(scan, path, "ascii"), read_scan, directory),
        _made("binary.ply", lambda path: write_ply(scan, path), read_scan, directory),
        _made("semantic.ply", lambda path: write_ply(_semantic(), path), read_ideal, directory),
    ]
    field = [Seed(*one) for one in field_seeds(directory)]
    return [*made, *_settings(directory), *_meshes(directory), *_calibrations(directory), *field]


def read_scan(path: Path) -> None:
    """As `info`, then as `compare`."""
    describe(path, load_model=load_model)
    load_scan(path)


def read_ideal(path: Path) -> None:
    """As `info`, then as `simulate`."""
    describe(path, load_model=load_model)
    load_ideal(path)


def _scan() -> Table:
    rng = np.random.default_rng(3)
    layer, point = (a.ravel() for a in np.meshgrid(np.arange(250, 254), np.arange(470, 480), indexing="ij"))
    xyz = dict(zip("XYZ", np.round(beam_directions(layer, point).T * rng.uniform(29, 31, 40), 4), strict=True))
    numbers = {"Layer": layer, "Point": point, "EchoNumber": np.ones(40, np.int64)}
    return Table({**xyz, **numbers, **{name: rng.integers(5, 90, 40) / 1 for name in ("WIDTH", "AREA", "PEAK")}})


def _ideal() -> Table:
    scan = _scan().columns
    columns = {"Layer": scan["Layer"], "Point": scan["Point"], "Distance": np.round(scan["X"] / 0.99, 3)}
    return Table({**columns, "MaterialID": np.ones(40, np.int64), "IncidenceAngle": np.full(40, 12.5)})


def _unchecked(table: Table, path: Path) -> None:
    """As other programs write it: no checksum says that a page was damaged."""
    parquet.write_table(pa.table(dict(table.columns)), path, compression="snappy")


def _semantic() -> Table:
    scan = _scan().columns
    columns = {name.lower(): scan[name].astype(np.float32) for name in "XYZ"}
    ids = {"ObjIdx": np.arange(40, dtype=np.uint32), "ObjTag": np.full(40, 7, np.uint32)}
    return Table({**columns, "CosAngle": np.full(40, 0.5, np.float32), **ids})


def _table(directory: Path, name: str, table: Table, read: Callable[[Path], object]) -> Seed:
    return _made(name, lambda path: write_table(table, path), read, directory)


def _made(name: str, write: Callable[[Path], object], read: Callable[[Path], object], directory: Path) -> Seed:
    write(directory / name)
    content = bytearray((directory / name).read_bytes())
    if name.startswith("a.la"):
        content[90:94] = bytes(4)  # the day on which it was made
    return Seed(name, bytes(content), read)


def _settings(directory: Path) -> list[Seed]:
    model = (ROOT / "examples/sign_ghost_SLIM.toml").read_bytes()
    (directory / "model.toml").write_bytes(model)
    frame = '[[frames]]\nideal = "ideal.txt"\nmeasured = "{}"\ntime = {}\n'
    names = ("a.txt", "a.csv", "ascii.pcd")
    case = 'model = "model.toml"\n' + "".join(frame.format(name, at / 10) for at, name in enumerate(names))
    scenario = (ROOT / EXAMPLE).read_bytes().replace(b"../", str(ROOT).encode() + b"/")
    scenes = ROOT / "src/lidarcheck/scenes"
    materials = (scenes / "materials.toml").read_bytes()
    (directory / "materials.toml").write_bytes(materials)
    scene = (scenes / "builtin/bridge_signs.toml").read_bytes().replace(b"../materials", b"materials")
    (directory / "beside.toml").write_bytes(scene)
    check: dict[str, Any] = {"scenarios": [], "kpis_in_suite": 3, "verdict": "holds", "counts": {"holds": 3}, "seed": 1}
    profile = "offset_spad_rows,PEAK,AREA,WIDTH_ns,range_m\n"
    profile += "".join(
        f"{k},{236 if abs(k) < 5 else 90},{2900 if abs(k) < 5 else 600},12.5,20.1\n" for k in range(-12, 13)
    )
    sensor = Sensor.of("SLIM")
    settings = json.dumps(default_settings("vertical").document(), indent=1).encode()
    return [
        Seed("model.toml", model, load_model),
        Seed("case.toml", case.encode(), lambda path: load_case(path.parent, fewest=1)),
        Seed("scenario.toml", scenario, load_scenario),
        Seed("scene.toml", scene, lambda path: load_scene(path)),
        Seed("materials.toml", materials, lambda path: load_scene(path.with_name("beside.toml"))),
        Seed("golden.toml", (ROOT / "goldens/background_SLIM.toml").read_bytes(), load_golden),
        Seed("lut.ini", LUT.encode(), load_lut),
        Seed("Blooming_Calibration_V_SLIM.json", settings, load_settings),
        Seed("check.json", json.dumps(check).encode(), last_check),
        Seed("profile.csv", profile.encode(), lambda path: read_profile(path, sensor, signal_at_1m=1e4)),
    ]


def read_calibration(path: Path, **given: Any) -> None:
    """As `sensor from`, all that comes before its file is written."""
    imported = import_sensor(path, Given(**given))
    sensor_of_import(imported, path)
    document_text(imported, table_file="beams.csv")
    table_text(imported)


def _calibrations(directory: Path) -> list[Seed]:
    contents: dict[str, Any] = {
        "ouster.json": calibrations.ouster(),
        "velodyne.yaml": calibrations.velodyne(),
        "velodyne.xml": calibrations.veloview(),
        "hesai.csv": calibrations.hesai(),
        "isaac.json": calibrations.isaac(2),
        "isaac.usda": calibrations.usda(),
        "lidar.sdf": calibrations.sdf(),
        "carla.json": calibrations.carla(),
        "osi.json": calibrations.osi(),
    }
    files = [(name, calibrations.written(directory, name, content)) for name, content in contents.items()]
    scanner = calibrations.written(directory, "helios.xml", calibrations.helios())
    times = calibrations.written(directory, "firetimes.csv", FIRE_TIMES)
    pattern = calibrations.written(directory, "pattern.csv", PATTERN)
    return [
        *(Seed(name, path.read_bytes(), read_calibration) for name, path in files),
        Seed("helios.xml", scanner.read_bytes(), lambda path: read_calibration(path, model="turning")),
        Seed(
            "firetimes.csv",
            times.read_bytes(),
            lambda path: read_calibration(path.with_name("hesai.csv"), firetimes=path, state="even"),
        ),
        Seed(
            "pattern.csv",
            pattern.read_bytes(),
            lambda path: read_calibration(path.with_name("helios.xml"), model="risley", pattern=path),
        ),
    ]


def _meshes(directory: Path) -> list[Seed]:
    import trimesh

    box = trimesh.creation.box()
    made = {
        name: trimesh.exchange.export.export_mesh(box, None, file_type=name) for name in ("stl", "obj", "ply", "glb")
    }
    contents = {name: content if isinstance(content, bytes) else content.encode() for name, content in made.items()}
    return [Seed(f"mesh.{name}", content, lambda path: load_mesh(path, 1)) for name, content in contents.items()]
