"""The binary formats, each with its writer and reader, and tables to try them on."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.errors import InputError
from lidarcheck.formats.las import read_las, write_las
from lidarcheck.formats.pcd import read_pcd, write_pcd
from lidarcheck.formats.pcd_header import ENCODINGS as PCD_ENCODINGS
from lidarcheck.formats.ply import ENCODINGS as PLY_ENCODINGS
from lidarcheck.formats.ply import read_ply, write_ply
from lidarcheck.formats.table import Table

Read = Callable[[Path], Table]
Write = Callable[[Table, Path], None]


def _writer(write: Callable[..., None], encoding: str) -> Write:
    return lambda table, path: write(table, path, encoding)


KINDS: dict[str, tuple[str, Write, Read]] = {
    **{f"pcd {encoding}": ("a.pcd", _writer(write_pcd, encoding), read_pcd) for encoding in PCD_ENCODINGS},
    **{f"ply {encoding}": ("a.ply", _writer(write_ply, encoding), read_ply) for encoding in PLY_ENCODINGS},
    "las": ("a.las", write_las, read_las),
    "laz": ("a.laz", write_las, read_las),
}
EXACT = [kind for kind in KINDS if not kind.startswith("la")]
KIND = pytest.mark.parametrize("kind", list(KINDS))


def make_table(rows: int = 30, seed: int = 0) -> Table:
    rng = np.random.default_rng(seed)
    return Table(
        {
            "X": rng.uniform(1, 300, rows),
            "Y": rng.uniform(-250, 250, rows),
            "Z": rng.uniform(-60, 60, rows),
            "Point": rng.integers(0, 960, rows).astype(np.int32),
            "Layer": rng.integers(0, 520, rows).astype(np.int32),
            "EchoNumber": rng.integers(1, 4, rows).astype(np.int32),
            "WIDTH": rng.uniform(1, 40, rows),
            "AREA": rng.uniform(10, 7000, rows).astype(np.float32),
            "PEAK": rng.integers(10, 236, rows).astype(np.float64),
            "NearIR": rng.integers(0, 65536, rows).astype(np.uint16),
        }
    )


def written(kind: str, table: Table, directory: Path) -> Path:
    name, write, _ = KINDS[kind]
    write(table, directory / name)
    return directory / name


def message_of(read: Read, path: Path, content: bytes | str) -> str:
    """The one line that reading this content gives."""
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(InputError) as caught:
        read(path)
    assert caught.value.fix
    (line,) = caught.value.lines()
    assert line.startswith(f"error: {path}")
    return line


PCD_HEAD = """# .PCD v.7 - Point Cloud Data file format
VERSION .7
# a comment in between
FIELDS x y z _ rgb normal
SIZE 4 4 4 1 4 4
TYPE F F F U U F
COUNT 1 1 1 4 1 3
WIDTH {width}
HEIGHT {height}
VIEWPOINT 0 0 0 1 0 0 0
POINTS {points}
DATA {data}
"""
RECORD = struct.Struct("<3f4xI3f")


def pcd_head(data: str, width: int = 2, height: int = 1, points: int = 2) -> str:
    return PCD_HEAD.format(width=width, height=height, points=points, data=data)


def put(path: Path, content: bytes) -> None:
    """Overwrite in place: emptying a file first makes some file systems flush it, thousands of times here."""
    with path.open("r+b" if path.exists() else "wb") as stream:
        stream.write(content)
        stream.truncate()
