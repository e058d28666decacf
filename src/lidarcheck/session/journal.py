"""A journal of edits: a line for each, on the disk before it is shown, so that no end of the process loses one.

The first line has what the edits began from. A line that was not finished when the process died was never shown as
done and is left out.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from lidarcheck.errors import InputError
from lidarcheck.formats.atomic import write_text

__all__ = ["Journal", "read_journal"]

Record = dict[str, Any]


class Journal:
    """An append-only file of JSON lines. Nothing is written before the first record; `clear` removes the file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._descriptor: int | None = None

    def begin(self, head: Record, records: list[Record] | None = None) -> None:
        """Start anew with a head, and records that follow it, all at once."""
        self.close()
        write_text(self.path, "".join(_line(record) for record in [head, *(records or [])]))
        self._open()

    def append(self, record: Record) -> None:
        """Add a record; on the disk when this returns. `InputError` when it could not be written."""
        descriptor = self._descriptor if self._descriptor is not None else self._open()
        line = _line(record).encode()
        end = os.fstat(descriptor).st_size
        try:
            if os.write(descriptor, line) != len(line):
                raise OSError("the disk is full")
            os.fsync(descriptor)
        except OSError as error:
            os.ftruncate(descriptor, end)  # or the next record would stand behind half a line
            raise self._fault(error) from error

    def clear(self) -> None:
        """Remove the file: there is nothing to bring back."""
        self.close()
        self.path.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the file and leave it as it is."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _open(self) -> int:
        try:
            self._descriptor = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW)
        except OSError as error:
            raise self._fault(error) from error
        return self._descriptor

    def _fault(self, error: OSError) -> InputError:
        what = f"the edit could not be kept: {error.strerror or error}"
        return InputError(what, file=self.path, fix="nothing was changed; free some space, then edit again")


def read_journal(path: Path) -> list[Record]:
    """The records of a journal up to the first that is damaged or not finished; none where there is no file."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return []
    except OSError as error:
        raise InputError(f"cannot read: {error.strerror or error}", file=path, fix="check its permissions") from error
    records: list[Record] = []
    for line in content.split(b"\n")[:-1]:  # what follows the last newline was not finished
        try:
            record = json.loads(line)
        except ValueError:
            break
        if not isinstance(record, dict):
            break
        records.append(record)
    return records


def _line(record: Record) -> str:
    return json.dumps(record, separators=(",", ":")) + "\n"
