"""Rows read by compiled code: each number the float that Python reads, the same columns as the slow path's."""

import random
import struct
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from budget import examples
from lidarcheck.arrays import FloatArray
from lidarcheck.errors import InputError
from lidarcheck.formats import rows
from lidarcheck.formats.cells import CellFault, slow_columns
from lidarcheck.formats.compiled_rows import PlainRows
from lidarcheck.formats.rows import REAL_COLUMNS, single_blanks
from lidarcheck.formats.table import Table
from lidarcheck.formats.text import read_text, rows_as_text

DICE = random.Random(7)


def floats_of_all_sizes(count: int) -> list[str]:
    """Numbers above 0 of random bits, as Python writes them; the smallest are no normal floats."""
    drawn = (struct.unpack("d", struct.pack("Q", DICE.getrandbits(62)))[0] for _ in range(count))
    return [repr(number) for number in drawn if number > 1e-300]


def of_many_digits(count: int) -> list[str]:
    """1 to 19 digits, the point anywhere among them, with and without an exponent."""
    found = []
    for _ in range(count):
        digits = str(DICE.randrange(10 ** DICE.randint(0, 19)))
        point = DICE.randint(0, len(digits))
        exponent = f"e{DICE.randint(-280, 280):+d}" if DICE.random() < 0.5 else ""
        found.append(DICE.choice(["", "-"]) + digits[:point] + "." + digits[point:] + exponent)
    return found


def between_two_floats(count: int) -> list[str]:
    """Decimals half-way between neighbouring floats, and their neighbours in the last of 19 digits."""
    found = []
    for _ in range(count):
        half = Fraction((DICE.getrandbits(52) | 1 << 52) * 2 + 1) * Fraction(2) ** DICE.randint(-60, 9)
        power = 0
        while half.denominator > 1 and half < 10**18:
            half, power = half * 10, power - 1
        whole = int(half)
        if whole + 1 < 10**19:
            found += [f"{whole + more}e{power}" for more in (-1, 0, 1)]
    return found


@pytest.mark.parametrize("cells", [floats_of_all_sizes, of_many_digits, between_two_floats])
def test_each_number_is_the_float_that_python_reads(cells: object) -> None:
    assert callable(cells)
    texts: list[str] = cells(30_000)
    found = PlainRows(["X"], " ", [True]).columns("\n".join(texts).encode())
    assert found is not None
    assert found["X"].tobytes() == np.array([float(text) for text in texts]).tobytes()


@pytest.mark.parametrize(
    "text",
    ["5e-324", "1e400", "nan", "+1", "1.", "12345678901234567890", "1e", "1e+", "-", ".", "0x1", "1 ", "1\n\n2", "1,2",
     "1e99999", "-0", "9007199254740993\n0.5", "0.5\n9007199254740992", "1234567890123456789"],
)  # fmt: skip
def test_what_is_not_plain_is_left_to_the_others(text: str) -> None:
    found = PlainRows(["other"], " ", [False]).columns(text.encode())
    assert found is None or text == "1."


CELLS = st.text("0123456789+-.eE \t\r\n,na\0", max_size=12).map(str.encode)


@settings(deadline=None, max_examples=examples(1500))
@given(
    body=st.lists(CELLS | st.integers(-99, 99).map(lambda n: b"%d" % n), max_size=9), gap=st.sampled_from([b" ", b"\n"])
)
def test_nothing_is_taken_that_the_slow_path_reads_otherwise(body: list[bytes], gap: bytes) -> None:
    for delimiter, names in ((" ", ["X", "other"]), (",", ["X", "other"]), ("\t", ["X", "other"]), (" ", ["other"])):
        content = gap.join(body).strip(b" \t\r\n")
        content = single_blanks(content) if delimiter == " " else content
        found = PlainRows(names, delimiter, [name == "X" for name in names]).columns(content) if content else None
        if found is not None:
            slow = slow_columns(content, names, delimiter, REAL_COLUMNS, set())
            assert not isinstance(slow, CellFault)
            assert slow[1] == {}
            for name in names:
                assert found[name].dtype == slow[0][name].dtype
                assert found[name].tobytes() == slow[0][name].tobytes()


def table_text(count: int, odd: str) -> str:
    lines = [f"{i / 7} -{i}.25 {i % 5} {i % 520} {i % 960} 1 {i % 40} {i / 8} {i % 136}" for i in range(count)]
    lines[count // 2] = odd or lines[count // 2]
    return "//X Y Z Layer Point EchoNumber WIDTH AREA PEAK\n" + "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("odd", "refused"),
    [("", False), ("1 2 3 4 5 1 nan 7 8", False), ("1\t2  3 4 5 1 6 7 8", False), ("1 2 3 4 5 1 6 7", True),
     ("1 2 3 4 x 1 6 7 8", True)],
)  # fmt: skip
def test_a_file_is_read_alike_with_and_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, odd: str, refused: bool
) -> None:
    path = tmp_path / "scan.txt"
    path.write_text(table_text(30_000, odd), encoding="ascii")
    read = []
    for least in (0, 1 << 40):
        monkeypatch.setattr(rows, "_WORTH_COMPILED", least)
        try:
            table = read_text(path)
            read.append([(name, column.dtype, column.tobytes()) for name, column in table.columns.items()])
        except InputError as error:
            read.append([str(error)])
    assert read[0] == read[1]
    assert len(read[0]) == (1 if refused else 9)


def all_kinds_of_floats() -> FloatArray:
    """Random bits of both signs, powers of two and of ten and what stands beside these, decimals, whole numbers."""
    draw = np.random.default_rng(5)
    bits = draw.integers(0, 2**63 - 1, 20_000).view(np.float64)
    tens = 10.0 ** np.arange(-323, 309)
    found = [bits, -bits, 2.0 ** np.arange(-1074, 1024), tens, np.nextafter(tens, 0), np.nextafter(tens, np.inf)]
    found += [np.round(draw.normal(size=5000) * 50.0, digits) for digits in (1, 4, 6)]
    found += [np.arange(-20, 20) / 8, draw.integers(0, 2**53, 5000).astype(np.float64), np.array([0.0, -0.0])]
    every = np.concatenate(found)
    return np.asarray(every[np.isfinite(every)])


@pytest.mark.parametrize("delimiter", [" ", ","])
@pytest.mark.parametrize("odd", [None, np.nan, -np.inf])
def test_rows_are_written_to_the_bytes_of_pyarrow(
    monkeypatch: pytest.MonkeyPatch, delimiter: str, odd: float | None
) -> None:
    reals = all_kinds_of_floats()
    if odd is not None:
        reals[6000] = odd
    wholes = np.random.default_rng(6).integers(-(2**63), 2**63 - 1, len(reals))
    wholes[:60] = np.concatenate(
        [10 ** np.arange(19), 10 ** np.arange(19) - 1, -(10 ** np.arange(19)), [0, 1, -(2**63)]]
    )
    bits = (np.arange(len(reals)) % 2).astype(np.bool_)
    table = Table({"X": reals, "n": wholes, "few": wholes.astype(np.int16), "Y": reals[::-1], "bit": bits})
    written = []
    for least in (0, 1 << 40):
        monkeypatch.setattr(rows, "_WORTH_COMPILED", least)
        written.append(rows_as_text(table, delimiter))
    assert written[0] == written[1]
    again = [float(line.partition(delimiter.encode())[0]) for line in written[0].splitlines()]
    assert np.array(again).tobytes() == reals.tobytes()


def test_what_compiled_code_does_not_write_is_written_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rows, "_WORTH_COMPILED", 0)
    table = Table({"large": np.array([2**64 - 1, 0], dtype=np.uint64), "whole": np.array([5.0, 1e20])})
    assert rows_as_text(table, " ") == b"18446744073709551615 5.0\n0 1e+20\n"
