"""What is wrong with a sensor file beyond a single key, and where it stands."""

from __future__ import annotations

from lidarcheck.errors import UsageError

__all__ = ["KeyFault", "RowFault"]


class KeyFault(UsageError):
    """Values that do not fit together. `at`: the key of the sensor file that holds what is wrong."""

    def __init__(self, what: str, *, fix: str, at: tuple[str, ...]) -> None:
        super().__init__(what, fix=fix)
        self.at = at

    def __reduce__(self) -> tuple[type[UsageError], tuple[str]]:
        return UsageError, (self.what,)


class RowFault(UsageError):
    """A table of beams or channels that is wrong. `row`: from 0, None for its header; `table`: the file's name."""

    def __init__(self, what: str, *, fix: str, row: int | None = None, table: str = "") -> None:
        super().__init__(what if row is None else f"row {row + 1}: {what}", fix=fix)
        self.plain, self.row, self.table = what, row, table

    def of_table(self, table: str) -> RowFault:
        """The same, of the table of that name."""
        return RowFault(self.plain, fix=self.fix, row=self.row, table=table)

    def __reduce__(self) -> tuple[type[UsageError], tuple[str]]:
        return UsageError, (self.what,)
