"""The echoes that somebody else's model gives, read as any scan; what is said of them is said once a model.

A run is a frame: echoes of one beam that have the same number are several of that frame, numbered anew by their range.
"""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Iterator
from pathlib import Path

from lidarcheck.errors import ExternalModelError, LidarcheckError
from lidarcheck.formats.table import Table
from lidarcheck.model.external.process import failure, name_of
from lidarcheck.model.spec import External
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor

__all__ = ["echoes_in", "echoes_of_table"]

_READERS = ("names", "rows", "scans", "times")
"""The modules of `lidarcheck.formats` that say what they make of a file."""


class _Once(logging.Filter):
    """Lets a thing be said of the echoes of a model once: a thousand runs would say it a thousand times."""

    def __init__(self) -> None:
        super().__init__()
        self.reading = threading.local()
        self._said: set[tuple[str, str]] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether the record is let through; it names the model in the place of the file."""
        model = getattr(self.reading, "model", None)
        if model is None or not isinstance(record.args, tuple):
            return True
        record.args = (f"the external model {model}", *record.args[1:])
        new = (model, str(record.msg)) not in self._said
        self._said.add((model, str(record.msg)))
        return new


_once = _Once()
for _name in _READERS:
    logging.getLogger(f"lidarcheck.formats.{_name}").addFilter(_once)


def echoes_in(scan: Path, external: External, sensor: Sensor | None, said: str) -> Scan:
    """The echoes that the model wrote; `said`: its last words. `ExternalModelError` where there are none to read."""
    from lidarcheck.formats.recognise import read_table
    from lidarcheck.formats.scans import scan_from_table

    if not scan.is_file() or scan.stat().st_size == 0:
        what = "wrote an empty scan" if scan.exists() else "wrote no scan"
        raise failure(what, external, said, "let it write its echoes to {scan}")
    with _reading(external, said, "wrote"):
        return scan_from_table(read_table(scan), sensor=sensor)


def echoes_of_table(table: Table, external: External, sensor: Sensor | None, said: str) -> Scan:
    """The echoes of a table that the model returned; raises as `echoes_in`."""
    from lidarcheck.formats.scans import scan_from_table

    with _reading(external, said, "returned"):
        return scan_from_table(table, sensor=sensor)


@contextlib.contextmanager
def _reading(external: External, said: str, how: str) -> Iterator[None]:
    _once.reading.model = name_of(external)
    try:
        yield
    except ExternalModelError:
        raise
    except LidarcheckError as error:
        where = f" at line {error.line}" if error.line else ""
        raise failure(f"{how} a malformed scan: {error.what}{where}", external, said, error.fix) from error
    finally:
        _once.reading.model = None
