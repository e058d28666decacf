"""What the commands of ideal scans share: numbers with commas between them, and files that can hold an ideal scan."""

from __future__ import annotations

from pathlib import Path

from lidarcheck.errors import UsageError

__all__ = ["check_ideal_file", "numbers_of"]


def numbers_of(text: str, count: int, option: str, what: str) -> tuple[float, ...]:
    """So many finite numbers; `UsageError` for another text."""
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        found = ()
    if len(found) != count or not all(abs(one) < float("inf") for one in found):
        raise UsageError(f"{option} {text} is not {count} numbers", fix=f"give {what}, with commas between them")
    return found


def check_ideal_file(out: Path) -> None:
    """Refuse a name whose format cannot hold an ideal scan."""
    from lidarcheck.formats.recognise import target_format

    if target_format(out).name == "las":
        what = "LAS holds points, not what a beam meets"
        raise UsageError(what, file=out, fix="use .txt, .csv, .pcd, .ply or .parquet")
