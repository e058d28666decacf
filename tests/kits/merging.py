"""One file of several frames, for tests of who takes it and who does not."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarcheck.formats.recognise import read_table, write_table
from lidarcheck.formats.table import Table


def merge(files: Sequence[str | Path | Table], out: str | Path, *, number: str | None = None, leave_out=(), first=5):
    """The rows of all files behind each other; `number`: a column of that name with the frame's number from `first`."""
    tables = [one if isinstance(one, Table) else read_table(one) for one in files]
    names = [name for name in tables[0].names if name not in leave_out]
    columns = {name: np.concatenate([table.columns[name] for table in tables]) for name in names}
    if number is not None:
        columns[number] = np.repeat(np.arange(first, first + len(tables)), [len(table) for table in tables])
    write_table(Table(columns), out)
