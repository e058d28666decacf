"""KITTI's and nuScenes' `.bin`: rows of float32 without a head, a frame a file.

Four numbers a row are KITTI's, five nuScenes' (`formats.assign.bins`). Whether a file has four or five is told by its
size where only one divides it, else by what the numbers would be.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.formats.assign.bins import KITTI_RINGS, bin_columns, rings_by_wrap
from lidarcheck.formats.field.recording import Recording
from lidarcheck.formats.limits import check_bytes, check_rows, scan_bytes
from lidarcheck.formats.source import check_file
from lidarcheck.formats.table import Table

__all__ = ["open_bins"]

_FARTHEST_M = 1000.0
"""No lidar of these data sets sees as far; other files of bytes hold such numbers at once."""
_LOOKED_AT = 1000
_WIDTHS = (4, 5)


@dataclass
class _Rows(Recording):
    columns: int = 4

    def __len__(self) -> int:
        return 1

    def table(self, number: int) -> Table:
        """The frame: rings of nuScenes as written, of KITTI where 64 come out of the order of rows."""
        size = self.path.stat().st_size
        check_bytes(size, self.path, scan_bytes())
        check_rows(size // (4 * self.columns), self.columns, self.path, says="it holds")
        rows = np.fromfile(self.path, dtype="<f4").astype(np.float32, copy=False).reshape(-1, self.columns)
        columns = bin_columns(rows)
        if self.columns == 4:
            ring = rings_by_wrap(np.nan_to_num(rows[:, :3].astype(np.float64)))
            if ring is not None:
                columns["ring"] = ring.astype(np.int16)
        return Table({name: np.ascontiguousarray(column) for name, column in columns.items()}, self.path)


def open_bins(path: Path) -> Recording:
    """The frame of a file of float32 rows. `InputError` where it holds something else."""
    size = check_file(path).stat().st_size
    with path.open("rb") as stream:
        start = np.frombuffer(stream.read(_LOOKED_AT * 4 * 20), dtype="<u1")
    fits = [width for width in _WIDTHS if size % (4 * width) == 0 and _plausible(start, width)]
    if not fits:
        what = "holds no rows of 4 or 5 float32 numbers with a position in metres, as KITTI and nuScenes have them"
        raise InputError(what, file=path, fix="name the file by its own format's suffix")
    opened = _Rows(path, "KITTI rows" if fits[0] == 4 else "nuScenes rows", columns=fits[0])
    if fits[0] == 4 and "ring" not in opened.table(0).columns:
        opened.notes = (f"the order of rows gives no {KITTI_RINGS} rings: beams are told by direction alone",)
    return opened


def _plausible(start: np.ndarray[tuple[int], np.dtype[np.uint8]], width: int) -> bool:
    """Whether the first rows are positions with an intensity, and the fifth number a ring."""
    whole = len(start) // (4 * width)
    rows = start[: whole * 4 * width].view("<f4").reshape(whole, width)
    if not len(rows):
        return False
    position, intensity = rows[:, :3], rows[:, 3]
    near = np.isnan(position) | (np.abs(position) < _FARTHEST_M)
    # Numbers below what float32 can tell at a metre are other data read as float32.
    tiny = (position != 0) & (np.abs(position) < 1e-20)
    bright = np.isnan(intensity) | ((intensity >= 0) & (intensity <= (1.0 if width == 4 else 255.0)))
    ring = rows[:, 4] if width == 5 else np.zeros(len(rows), dtype=np.float32)
    whole_ring = (ring == np.rint(ring)) & (ring >= -1) & (ring < 1024)
    return bool(near.all() and not tiny.any() and bright.all() and whole_ring.all())
