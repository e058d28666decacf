"""Opening somebody else's file: what can go wrong before its content matters."""

from __future__ import annotations

import codecs
import os
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.formats.limits import CONFIG_BYTES, check_bytes, scan_bytes
from lidarcheck.reading import note, shown_content

__all__ = [
    "LONGEST_LINE",
    "check_file",
    "decode_text",
    "first_bytes",
    "long_line",
    "read_lines",
    "read_source",
    "read_text",
    "size_of",
]

LONGEST_LINE = 1 << 20
"""Bytes of a line of text: a row of ten thousand columns has a tenth of that."""
LOOKED_AT = 1 << 16


def check_file(path: str | os.PathLike[str], *, pipes: bool = False) -> Path:
    """The path, once it is known to be a file that has content, or with `pipes` a pipe; `InputError` otherwise."""
    file = Path(path)
    note(file)
    try:
        size = file.stat().st_size
        if pipes and file.is_fifo():
            return file
        if file.is_dir():
            raise InputError("is a directory, not a file", file=file, fix="name a file in it")
        if not file.is_file():
            raise InputError("is not a regular file", file=file, fix="copy its content into a file first")
    except (OSError, ValueError) as error:
        raise _unreadable(file, error) from error
    if size == 0:
        raise InputError("the file is empty", file=file, fix="was it written completely?")
    return file


def read_source(path: str | os.PathLike[str], *, pipes: bool = False, most: int = CONFIG_BYTES) -> bytes:
    """The whole content of a file that has some, or with `pipes` of a pipe.

    `InputError` when it cannot be read, or has more than `most` bytes, of which no more than these are read.
    """
    shown = shown_content(path)
    if shown is not None:
        return shown
    file = check_file(path, pipes=pipes)
    try:
        if pipes and file.is_fifo():
            return _from_pipe(file, most)
        check_bytes(file.stat().st_size, file, most)
        return file.read_bytes()
    except OSError as error:
        raise _unreadable(file, error) from error


def _from_pipe(file: Path, most: int) -> bytes:
    """What somebody writes into a pipe; nothing but its end says how much that is."""
    content = bytearray()
    with file.open("rb") as stream:
        while block := stream.read1(LOOKED_AT):
            content += block
            check_bytes(len(content), file, most)
    return bytes(content)


def read_lines(path: str | os.PathLike[str]) -> bytes:
    """The whole content of a file of text; `InputError` where a line is longer than `LONGEST_LINE`, before it is read.

    Bytes beyond are those of no table, and would cost a multiple of their size.
    """
    shown = shown_content(path)
    if shown is not None:
        return shown
    file = check_file(path)
    try:
        size = file.stat().st_size
        check_bytes(size, file, scan_bytes())
        if size > LONGEST_LINE:
            _check_line_lengths(file)
        return file.read_bytes()
    except OSError as error:
        raise _unreadable(file, error) from error


def _check_line_lengths(file: Path) -> None:
    """Look for a line end within every length that a line may have, from its end backwards."""
    size, begin = file.stat().st_size, 0
    with file.open("rb", buffering=0) as stream:
        while size - begin > LONGEST_LINE:
            place, end = begin + LONGEST_LINE, -1
            while end < 0:
                if place <= begin:
                    raise long_line(file, _line_at(file, begin))
                place, tail = max(place - LOOKED_AT, begin), place
                stream.seek(place)
                block = stream.read(tail - place)
                end = max(block.rfind(b"\n"), block.rfind(b"\r"))
            begin = place + end + 1


def _line_at(file: Path, place: int) -> int:
    """The line that begins at a byte of the file."""
    ends, before = 0, b""
    with file.open("rb") as stream:
        while place > 0 and (block := stream.read(min(place, LONGEST_LINE))):
            place -= len(block)
            ends += block.count(b"\n") + block.count(b"\r") - (before + block).count(b"\r\n")
            before = block[-1:]
    return ends + 1


def long_line(path: Path, line: int) -> InputError:
    """The error for a line that is longer than any row."""
    what = f"the line is longer than {LONGEST_LINE} bytes"
    return InputError(what, file=path, line=line, fix="end every row with a line end; is this a file of points?")


def first_bytes(path: str | os.PathLike[str], count: int = 65536) -> bytes:
    """The beginning of a file that has content; `InputError` when it cannot be read."""
    shown = shown_content(path)
    if shown is not None:
        return shown[:count]
    file = check_file(path)
    try:
        with file.open("rb") as stream:
            return stream.read(count)
    except OSError as error:
        raise _unreadable(file, error) from error


def size_of(path: str | os.PathLike[str]) -> int:
    """Bytes of a file that `first_bytes` has opened."""
    shown = shown_content(path)
    if shown is not None:
        return len(shown)
    try:
        return Path(path).stat().st_size
    except OSError as error:
        raise _unreadable(Path(path), error) from error


def read_text(path: str | os.PathLike[str]) -> str:
    """The text of a file or pipe, UTF-8, without a byte order mark; newlines as they stand.

    `InputError` when it is empty, missing, unreadable or not UTF-8; the last with its line.
    """
    return decode_text(read_source(path, pipes=True), path)


def decode_text(content: bytes, path: str | os.PathLike[str]) -> str:
    """The text in a file's bytes; `path` is named in errors, which are those of `read_text`."""
    if not content.strip():
        raise InputError("the file is empty", file=path, fix="was it written completely?")
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise InputError("the text is UTF-16, not UTF-8", file=path, line=1, fix="save it as UTF-8")
    content = content.removeprefix(codecs.BOM_UTF8)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        byte = content[error.start]
        raise InputError(f"byte 0x{byte:02X} is not UTF-8", file=path, line=line, fix="save it as UTF-8") from None


def _unreadable(file: Path, error: OSError | ValueError) -> InputError:
    if isinstance(error, FileNotFoundError):
        return InputError("there is no such file", file=file, fix="check the name and the directory")
    if isinstance(error, PermissionError):
        return InputError("the file may not be read", file=file, fix="check its permissions")
    reason = error.strerror if isinstance(error, OSError) else str(error)
    return InputError(f"cannot be read: {reason}", file=file)
