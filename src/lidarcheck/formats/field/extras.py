"""Optional packages: what is said where one is missing that a file needs."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

from lidarcheck.errors import InputError

__all__ = ["needed"]


def needed(module: str, extra: str, what: str, path: Path) -> ModuleType:
    """The module of an optional package. `InputError` that names the extra to install where it cannot be imported."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        missing = error.name or module
        fix = f'install it: pip install "lidarcheck[{extra}]"'
        raise InputError(f"{what} needs the package {missing.partition('.')[0]}", file=path, fix=fix) from None
