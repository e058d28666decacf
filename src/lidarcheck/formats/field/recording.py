"""A recording: frames that are read one by one, so that no more than one of them is in memory at once."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.formats.field.place import Named, named
from lidarcheck.formats.frames import SeveralFrames
from lidarcheck.formats.names import with_known_names
from lidarcheck.formats.table import Table

__all__ = ["RECORDINGS", "RECORDING_SUFFIXES", "Recording", "open_recording"]


@dataclass
class Recording:
    """The frames of one topic of a file.

    `times_s`: when each was measured, since the first, None where not known; `start_ns`: when that was, since 1970, 0
    where not known. `notes`: what is to be said of it: what was cut off, what was transformed. `topics`: those that
    hold frames, with how many.
    """

    path: Path
    title: str
    topic: str = ""
    times_s: tuple[float, ...] | None = None
    notes: tuple[str, ...] = ()
    topics: tuple[tuple[str, int], ...] = ()
    start_ns: int = 0

    def __len__(self) -> int:
        raise NotImplementedError

    def table(self, number: int) -> Table:
        """The rows of a frame, as the file names their columns."""
        raise NotImplementedError

    def read(self, number: int) -> Table:
        """The rows of a frame, from 0; `InputError` for what is wrong with it."""
        table = with_known_names(self.table(number))
        return table if len(self) == 1 else replace(table, path=Path(self.named(number)))

    def tables(self) -> Iterator[Table]:
        """All frames, one after the other."""
        for number in range(len(self)):
            yield self.read(number)

    def named(self, number: int | None = None) -> str:
        """How the command line names the topic, or a frame of it."""
        return str(Named(self.path, self.topic, number))

    def only(self) -> Table:
        """The one frame. `InputError` where there are several."""
        if len(self) != 1:
            what = f"holds {len(self)} frames, where one is wanted"
            fix = f"name one, as '{self.named(0)}', or split it: lidarcheck split '{self.named()}' --out frames"
            raise SeveralFrames(what, file=self.path, fix=fix)
        return self.read(0)


RECORDINGS = {
    "mcap": ("MCAP", (".mcap",)),
    "rosbag": ("ROS 1 bag", (".bag", ".active")),
    "db3": ("ROS 2 bag", (".db3",)),
    "osi": ("OSI trace", (".osi", ".txth")),
    "e57": ("E57", (".e57",)),
    "bins": ("float32 rows", (".bin",)),
}
"""Kinds of recordings: their names in messages, and the suffixes of their files."""
RECORDING_SUFFIXES = tuple(suffix for _, suffixes in RECORDINGS.values() for suffix in suffixes)


def open_recording(place: str | os.PathLike[str], kind: str) -> Recording:
    """The frames of a recording, of the topic that its name or the command line chooses; none of them read.

    `kind`: of `RECORDINGS`. `InputError` for a damaged file, one without point clouds, and where a topic must be
    chosen.
    """
    found = named(place)
    try:
        if kind in ("mcap", "rosbag", "db3"):
            from lidarcheck.formats.field.bags import open_bag

            return open_bag(found.file, kind, found.topic)
        if kind == "osi":
            from lidarcheck.formats.field.osi import open_osi

            return open_osi(found.file, found.topic)
        if kind == "e57":
            from lidarcheck.formats.field.e57 import open_e57

            return open_e57(found.file, found.topic)
        from lidarcheck.formats.field.bins import open_bins

        return open_bins(found.file)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", file=found.file) from error
