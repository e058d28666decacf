"""Files made wrong at random, the same for the same seed: bytes, numbers, lengths, encodings."""

from __future__ import annotations

import random
import re
import struct

__all__ = ["mutated"]

NUMBER = re.compile(rb"-?[0-9]+(?:\.[0-9]+)?")
NUMBERS = (
    *(b"0", b"-1", b"1e999", b"-1e308", b"nan", b"inf", b"1e-320", b"0x10", b"1_000", b"00", b"true", b"", b"1.5.2"),
    *(b"%d" % (2**bits + more) for bits in (8, 16, 31, 32, 53, 63, 64) for more in (-1, 0)),
    b"9" * 40,
    b"9" * 5000,
    "²".encode(),
)
JUNK = (
    *(b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\xc3", b"\r", b"\n", b"\n\n", b"\t", b" ", b",", b";", b'"', b"'", b"\\"),
    *(b"[", b"]", b"{", b"}", b"=", b"#", b"//", b".", b"-", b'"""', b"[[", b"\x1a", b"\x1b[2J", b"\xed\xa0\x80"),
    *("\u202e".encode(), "\u0000x".encode(), b"inf", b"null", b"end_header\n", b"DATA ascii\n", b"[a]\n", b"a.b = 1\n"),
    bytes(300),
)
SIZES = ((1, "B"), (2, "<H"), (4, "<I"), (8, "<Q"))
EDGE = 400
"""Bytes at either end of a file in which most of its numbers about itself stand."""


def mutated(content: bytes, others: list[bytes], dice: random.Random) -> bytes:
    """The content with one to four faults; `others`: contents from which pieces may come."""
    for _ in range(dice.choice((1, 1, 1, 1, 2, 4))):
        content = dice.choice(_FAULTS)(content, others, dice)
    return content


def _place(content: bytes, dice: random.Random) -> int:
    """Somewhere, half of the time near an end."""
    size = len(content)
    if dice.random() < 0.5:
        return dice.randrange(size + 1)
    at = dice.randrange(min(EDGE, size) + 1)
    return at if dice.random() < 0.6 else size - at


def _flip(content: bytes, _others: list[bytes], dice: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(dice.choice((1, 1, 2, 8))):
        at = _place(content, dice)
        changed[at : at + 1] = bytes([dice.randrange(256)])
    return bytes(changed)


def _extreme(content: bytes, _others: list[bytes], dice: random.Random) -> bytes:
    """A number of some bytes, as headers of binary files have, becomes another one."""
    size, code = dice.choice(SIZES)
    most = 2 ** (8 * size) - 1
    value = dice.choice((0, 1, most, most >> 1, (most >> 1) + 1, dice.randrange(most + 1), most >> 4))
    at = _place(content, dice)
    return content[:at] + struct.pack(code, value) + content[at + size :]


def _number(content: bytes, _others: list[bytes], dice: random.Random) -> bytes:
    """A number in text becomes another one, or what is none."""
    found = [match.span() for match in NUMBER.finditer(content[:100_000])]
    if not found:
        return content
    start, end = dice.choice(found)
    return content[:start] + dice.choice(NUMBERS) + content[end:]


def _swap(content: bytes, _others: list[bytes], dice: random.Random) -> bytes:
    """Two numbers in text change places."""
    found = [match.span() for match in NUMBER.finditer(content[:100_000])]
    if len(found) < 2:
        return content
    (a, b), (c, d) = sorted(dice.sample(found, 2))
    return content[:a] + content[c:d] + content[b:c] + content[a:b] + content[d:]


def _cut(content: bytes, _others: list[bytes], dice: random.Random) -> bytes:
    return content[: _place(content, dice)]


def _delete(content: bytes, _others: list[bytes], dice: random.Random) -> bytes:
    at = _place(content, dice)
    return content[:at] + content[at + dice.choice((1, 2, 7, 40, 300)) :]


def _double(content: bytes, _others: list[bytes], dice: random.Random) -> bytes:
    at, size = _place(content, dice), dice.choice((1, 4, 20, 200))
    return content[:at] + content[at : at + size] * dice.choice((2, 2, 3, 50)) + content[at + size :]


def _insert(content: bytes, _others: list[bytes], dice: random.Random) -> bytes:
    at = _place(content, dice)
    return content[:at] + dice.choice(JUNK) * dice.choice((1, 1, 1, 30, 2000)) + content[at:]


def _graft(content: bytes, others: list[bytes], dice: random.Random) -> bytes:
    """A piece of another file in the place of one of this."""
    at, other = _place(content, dice), dice.choice(others)
    piece = other[_place(other, dice) :][: dice.choice((4, 40, 400))]
    return content[:at] + piece + content[at + dice.choice((0, len(piece))) :]


def _line(content: bytes, _others: list[bytes], dice: random.Random) -> bytes:
    """A line of text is lost, comes twice, or elsewhere."""
    lines = content.splitlines(keepends=True)
    if len(lines) < 2:
        return content
    at = dice.randrange(len(lines))
    line = lines.pop(at)
    for _ in range(dice.randrange(3)):
        lines.insert(dice.choice((at, dice.randrange(len(lines) + 1))), line)
    return b"".join(lines)


def _encoded(content: bytes, _others: list[bytes], dice: random.Random) -> bytes:
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError:
        return content
    ends = dice.choice(("\n", "\r\n", "\r"))
    return text.replace("\n", ends).encode(
        dice.choice(("utf-8", "utf-8-sig", "utf-16", "utf-16-be", "utf-32", "utf-7"))
    )


_FAULTS = (
    *(_flip, _flip, _extreme, _extreme, _number, _number, _swap),
    *(_cut, _delete, _double, _insert, _graft, _line, _encoded),
)
