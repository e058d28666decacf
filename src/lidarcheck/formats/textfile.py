"""Reading a whole file, with one clear error where that does not work."""

from __future__ import annotations

import codecs
import os
from pathlib import Path

from lidarcheck.errors import InputError

__all__ = ["decode_text", "read_bytes", "read_text"]


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """The file's bytes. `InputError` when it is missing, a directory or unreadable."""
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError("there is no such file", file=path, fix="check the path") from None
    except IsADirectoryError:
        raise InputError("this is a directory, a file is needed", file=path, fix="name a file inside it") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot read: {reason}", file=path, fix="check the path and its permissions") from error


def read_text(path: str | os.PathLike[str]) -> str:
    """The file's text, UTF-8, without a byte order mark; newlines as they stand.

    `InputError` when it is empty, missing, unreadable or not UTF-8; the last with its line.
    """
    return decode_text(read_bytes(path), path)


def decode_text(content: bytes, path: str | os.PathLike[str]) -> str:
    """The text in a file's bytes; `path` is named in errors, which are those of `read_text`."""
    if not content.strip():
        raise InputError("the file is empty", file=path, fix="write it again or name another")
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise InputError("the text is UTF-16, not UTF-8", file=path, line=1, fix="save it as UTF-8")
    content = content.removeprefix(codecs.BOM_UTF8)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        byte = content[error.start]
        raise InputError(f"byte 0x{byte:02X} is not UTF-8", file=path, line=line, fix="save it as UTF-8") from None
