"""The user's own configuration, `config.toml`: programs that are trusted, and folders whose files may be named.

It lies in the user's configuration folder and nowhere else: a project cannot bring one.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

from lidarcheck.config.schema import Config, PathText
from lidarcheck.formats.config import load_toml

__all__ = ["HASH", "UserFile", "user_file", "user_file_path"]

HASH = re.compile(r"[0-9a-f]{64}")


def _hash(text: str) -> str:
    if not HASH.fullmatch(text):
        raise ValueError("not the hash of a program; copy it from the error that names the program")
    return text


def _absolute(path: Path) -> Path:
    if not path.expanduser().is_absolute():
        raise ValueError("not the whole path of a folder; begin with / or ~")
    return path.expanduser()


class UserFile(Config):
    """`trust`: hashes of programs; `roots`: folders below which files may be named."""

    trust: tuple[
        Annotated[str, AfterValidator(_hash), Field(json_schema_extra={"words": "a program's hash"})], ...
    ] = ()
    roots: tuple[Annotated[PathText, AfterValidator(_absolute)], ...] = ()


def user_file_path() -> Path:
    """Where the user's configuration is, or would be."""
    import platformdirs

    return platformdirs.user_config_path("lidarcheck", appauthor=False) / "config.toml"


def user_file() -> UserFile:
    """What stands there, nothing if there is none; `InputError` or `ConfigError` where it cannot be read."""
    path = user_file_path()
    if not path.exists() or path.stat().st_size == 0:
        return UserFile()
    return load_toml(path, UserFile)
