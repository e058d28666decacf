"""Readers and writers, one file a format; `load_*` recognise by content, `save_*` go by suffix."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lidarcheck.formats.files import load_ideal, load_scan, save_ideal, save_scan

__all__ = ["load_ideal", "load_scan", "save_ideal", "save_scan"]


def __getattr__(name: str) -> Any:
    """Loaded when first asked for: `--help` asks a format's neighbours for words alone, and needs no numpy."""
    if name in __all__:
        from lidarcheck.formats import files

        return getattr(files, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
