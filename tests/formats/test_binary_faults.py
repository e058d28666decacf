"""PCD, LAS/LAZ and PLY: a damaged or wrong file is one clear error, and never another exception."""

from __future__ import annotations

import random
import struct
from pathlib import Path

import lzf
import pytest

from binary_kinds import KIND, KINDS, RECORD, make_table, message_of, pcd_head, put, written
from lidarcheck.errors import InputError, LidarcheckError
from lidarcheck.formats.las import read_las, write_las
from lidarcheck.formats.pcd import read_pcd
from lidarcheck.formats.ply import read_ply

PCD_ROWS = "1 2 3 0 0 0 0 4 5 6 7\n" * 2


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("VERSION .7", "VERSION 1.2", ":2: PCD version '1.2' is not known"),
        ("HEIGHT 1", "HIGHT 1", ":9: 'HIGHT' is no PCD header key"),
        ("HEIGHT 1", "WIDTH 2", ":9: WIDTH stands twice"),
        ("HEIGHT 1", "HEIGHT", ":9: HEIGHT has no value"),
        ("HEIGHT 1", "HEIGHT 3", ":11: POINTS is 2, but WIDTH times HEIGHT is 6"),
        ("HEIGHT 1", "HEIGHT -1", ":9: HEIGHT has '-1', not a whole number"),
        ("SIZE 4 4 4 1 4 4", "SIZE 4 4 4 1 4", ":5: SIZE has 5 values, not 6"),
        ("SIZE 4 4 4 1 4 4", "SIZE 4 3 4 1 4 4", ":6: field 'y' has TYPE 'F' with SIZE 3"),
        ("SIZE 4 4 4 1 4 4", "SIZE 4 1 4 1 4 4", ":6: field 'y' has TYPE 'F' with SIZE 1"),
        ("TYPE F F F U U F", "TYPE F D F U U F", ":6: field 'y' has TYPE 'D' with SIZE 4"),
        ("TYPE F F F U U F", "TYPE F F F U U", ":6: TYPE has 5 values, not 6"),
        ("COUNT 1 1 1 4 1 3", "COUNT 1 1 1 4 1 99999999", "numbers is beyond"),
        ("x y z", "x y X", ":4: the column 'X' appears twice"),
        ("VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 0 0 0 1 0 0 up", ":10: VIEWPOINT '0 0 0 1 0 0 up' is not seven numbers"),
        ("DATA ascii", "DATA binary_zipped", ":12: DATA 'binary_zipped' is not known"),
        ("DATA ascii\n" + PCD_ROWS, "", "the header has no DATA line"),
        ("TYPE F F F U U F\n", "", "the header has no TYPE line"),
        ("1 2 3 0 0 0 0 4 5 6 7\n", "1 2 3 0 0 0 0 4 5 6\n", ":13: the row has 10 values"),
        ("1 2 3", "1 two 3", ":13: 'y' is 'two', not a number"),
        ("1 2 3", "1 1e99 3", ":13: 'y' is 1e+99, beyond the range of a 32-bit float"),
        (PCD_ROWS, PCD_ROWS + "1 2 3 0 0 0 0 4 5 6 7\n", ":11: POINTS says 2 rows, line 15 is one more"),
        (PCD_ROWS, PCD_ROWS[:22], ":11: POINTS says 2 rows, the file has 1"),
        (PCD_ROWS, PCD_ROWS[:35], ":14: the row has"),
        (PCD_ROWS, "", ":11: POINTS says 2 rows, the file has 0"),
    ],
)
def test_faults_of_a_pcd_text(old: str, new: str, said: str, tmp_path: Path) -> None:
    good = pcd_head("ascii") + PCD_ROWS
    assert old in good
    (tmp_path / "good.pcd").write_text(good)
    assert len(read_pcd(tmp_path / "good.pcd")) == 2
    assert said in message_of(read_pcd, tmp_path / "bad.pcd", good.replace(old, new, 1))


def test_faults_of_a_pcd_body(tmp_path: Path) -> None:
    path, rows = tmp_path / "a.pcd", RECORD.pack(1, 2, 3, 4, 5, 6, 7) * 2
    head = pcd_head("binary").encode()
    assert ":11: POINTS says 2 rows, the bytes end after 1 and 31 bytes of another" in message_of(
        read_pcd, path, head + rows[:-1]
    )
    assert "but 5 bytes follow the last" in message_of(read_pcd, path, head + rows + b"12345")
    huge = pcd_head("binary", width=10**12, points=10**12).encode()
    assert "POINTS says 1000000000000 rows" in message_of(read_pcd, path, huge + rows)
    assert "the file has 2" in message_of(read_pcd, path, pcd_head("ascii", 10**12, 1, 10**12) + PCD_ROWS)


def test_faults_of_compressed_pcd(tmp_path: Path) -> None:
    path, head = tmp_path / "a.pcd", pcd_head("binary_compressed").encode()
    plain = bytes(64)
    packed = lzf.compress(plain)
    whole = head + struct.pack("<II", len(packed), 64) + packed
    path.write_bytes(whole)
    assert len(read_pcd(path)) == 2
    assert f"of {len(packed)} compressed bytes there are {len(packed) - 1}" in message_of(read_pcd, path, whole[:-1])
    assert "the bytes end before the two sizes" in message_of(read_pcd, path, head + b"\1\2\3")
    assert "holds 65 bytes instead of 64" in message_of(
        read_pcd, path, head + struct.pack("<II", len(packed), 65) + packed
    )
    assert "damaged" in message_of(read_pcd, path, head + struct.pack("<II", 3, 64) + b"\xff\xff\xff")
    assert "damaged" in message_of(read_pcd, path, head + struct.pack("<II", len(packed), 64) + b"\0" * len(packed))
    large = pcd_head("binary_compressed", 10**8, 1, 10**8).encode()
    assert "holds 64 bytes instead of 3200000000" in message_of(
        read_pcd, path, large + struct.pack("<II", len(packed), 64) + packed
    )
    claim = large + struct.pack("<II", len(packed), 3_200_000_000) + packed
    assert "damaged" in message_of(read_pcd, path, claim)


PLY = """ply
format ascii 1.0
comment x
element vertex 2
property float x
property float y
property int Layer
end_header
1 2 3
4 5 6
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("ply\n", "plx\n", ":1: 'plx' is not the word 'ply'"),
        ("format ascii 1.0", "format ascii 2.0", ":2: the format 'ascii 2.0' cannot be read"),
        ("comment x", "format ascii 1.0", ":3: the format is said twice"),
        ("format ascii 1.0\n", "", ":3: the format line is missing"),
        ("comment x", "remark x", ":3: 'remark x' does not belong here"),
        ("element vertex 2", "element vertex two", ":4: 'element vertex two' is not a name and a whole number"),
        ("element vertex 2", "element vertex -2", ":4: 'element vertex -2' is not a name and a whole number"),
        ("element vertex 2", "element vertices 2", ":8: the header has 0 elements called vertex"),
        ("element vertex 2", "element vertex 1000000000000", ":4: element vertex says 1000000000000 rows"),
        ("element vertex 2", "element vertex 3", ":4: element vertex says 3 rows, the file has 2"),
        ("element vertex 2", "element vertex 1", ":4: element vertex says 1 row, line 10 is one more"),
        ("property float y", "property half y", ":6: 'property half y' has no known type"),
        ("property float y", "property list uchar int y", ":6: element 'vertex' has a list property"),
        ("property float y", "property float X", ":6: the column 'X' appears twice"),
        ("end_header\n", "", ":8: '1 2 3' does not belong here in a PLY header; it has format"),
        ("end_header\n1 2 3\n4 5 6\n", "", ":8: the header has no end_header line"),
        ("1 2 3", "1 2", ":9: the row has 2 values"),
        ("1 2 3", "1 2 c", ":9: 'Layer' is 'c', not a number"),
        ("4 5 6", "4 5 -2147483649", ":10: 'Layer' is -2147483649, not a whole number from -2147483648"),
        ("4 5 6", "4 5 6.5", ":10: 'Layer' is 6.5, not a whole number"),
    ],
)
def test_faults_of_a_ply_text(old: str, new: str, said: str, tmp_path: Path) -> None:
    assert old in PLY
    (tmp_path / "good.ply").write_text(PLY)
    assert len(read_ply(tmp_path / "good.ply")) == 2
    assert said in message_of(read_ply, tmp_path / "bad.ply", PLY.replace(old, new, 1))


def test_faults_of_a_ply_body(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    head = PLY.split("1 2 3")[0].replace("ascii", "binary_little_endian").encode()
    rows = struct.pack("<ffi", 1, 2, 3) * 2
    path.write_bytes(head + rows)
    assert len(read_ply(path)) == 2
    assert ":4: element vertex says 2 rows, the bytes end after 1 and 11 bytes" in message_of(
        read_ply, path, head + rows[:-1]
    )
    assert "but 12 bytes follow the last" in message_of(read_ply, path, head + rows + rows[:12])
    absurd = head.replace(b"vertex 2", b"vertex 1000000000000")
    assert "says 1000000000000 rows" in message_of(read_ply, path, absurd + rows)
    lists = head.replace(b"element vertex", b"element face 1\nproperty list uchar int i\nelement vertex")
    assert ":5: element 'face' has a list property" in message_of(read_ply, path, lists + rows)
    sensors = head.replace(b"element vertex", b"element sensor 999999999999999\nproperty int i\nelement vertex")
    assert "the bytes end after 0" in message_of(read_ply, path, sensors + rows)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_faults_of_a_las(suffix: str, tmp_path: Path) -> None:
    write_las(make_table(), tmp_path / f"good{suffix}")
    good, path = (tmp_path / f"good{suffix}").read_bytes(), tmp_path / f"bad{suffix}"

    def patched(at: int, code: str, value: int) -> str:
        content = bytearray(good)
        struct.pack_into(code, content, at, value)
        return message_of(read_las, path, bytes(content))

    assert "is not the signature 'LASF'" in message_of(read_las, path, b"LAZF" + good[4:])
    assert "the header needs 227 bytes, the file has 100" in message_of(read_las, path, good[:100])
    assert "LAS version 1.9 is not known" in patched(25, "B", 9)
    assert "a header of 100 bytes" in patched(94, "<H", 100)
    assert "points from byte 4000000000 do not fit" in patched(96, "<I", 4_000_000_000)
    assert "lies beyond byte" in patched(100, "<I", 4_000_000_000)
    assert "point format 63 is not known" in patched(104, "B", good[104] & 0x80 | 63)
    assert "too short for point format 6" in patched(105, "<H", 12)
    assert "1000000000000 " in patched(247, "<Q", 10**12)
    assert "31 points" in patched(247, "<Q", 31)
    cut = message_of(read_las, path, good[:-40])
    assert "the bytes end after 29" in cut if suffix == ".las" else "outside the file" in cut


def test_a_laz_whose_chunks_lie_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    """The LAZ library allocates what the tables say, and ends the process where that fails."""
    write_las(make_table(), tmp_path / "good.laz")
    good, path = (tmp_path / "good.laz").read_bytes(), tmp_path / "bad.laz"
    start = struct.unpack_from("<I", good, 96)[0]
    (table,) = struct.unpack_from("<q", good, start)
    record = good.index(b"laszip encoded") - 2 + 54
    for at, code, value, said in [
        (start, "<q", 2**60, "outside the file"),
        (table, "<I", 1, "which do not hold 30 points"),
        (table + 4, "<I", 2**32 - 1, "the table says 4294967295 chunks"),
        (record, "<H", 9, "compressor 9"),
        (record + 12, "<I", 0, "chunks of 0"),
        (record + 12, "<I", 7, "which do not hold 30 points"),
        (record + 32, "<H", 900, "too few for 900 items"),
        (record + 36, "<H", 20000, "LASzip item 10 of 20000 bytes"),
        (record + 34, "<H", 99, "LASzip item 99"),
    ]:
        content = bytearray(good)
        struct.pack_into(code, content, at, value)
        assert said in message_of(read_las, path, bytes(content))
    size = struct.unpack_from("<H", good, 105)[0]
    for layer in range(3):
        content = bytearray(good)
        struct.pack_into("<I", content, start + 8 + size + 4 * layer, 2**32 - 1)
        assert "chunk 1 of 1" in message_of(read_las, path, bytes(content))


def test_damage_inside_a_laz_chunk_is_noticed(tmp_path: Path) -> None:
    write_las(make_table(2000), tmp_path / "good.laz")
    good = (tmp_path / "good.laz").read_bytes()
    start = struct.unpack_from("<I", good, 96)[0]
    noticed = 0
    for at in range(start + 200, start + 1200, 20):
        content = bytearray(good)
        content[at] ^= 0x55
        put(tmp_path / "bad.laz", bytes(content))
        try:
            read_las(tmp_path / "bad.laz")
        except InputError:
            noticed += 1
    assert noticed == 50


@KIND
def test_damage_is_never_another_exception(kind: str, tmp_path: Path) -> None:
    """Every truncation of the first bytes and some of the rest, and several hundred flips: read, or one clear line."""
    good = written(kind, make_table(20), tmp_path).read_bytes()
    read, path, rng = KINDS[kind][2], tmp_path / "damaged", random.Random(kind)
    refused = 0
    for i in range(800):
        content = bytearray(good)
        if i < 200:
            content = content[: rng.randrange(len(good))]
        else:
            for _ in range(rng.choice([1, 1, 2, 8])):
                at = rng.randrange(min(len(good), 900) if i % 2 else len(good))
                content[at] = rng.choice([0, 9, 10, 32, 48, 57, 127, 255, content[at] ^ (1 << rng.randrange(8))])
        put(path, content)
        try:
            read(path)
        except LidarcheckError as caught:
            said = caught.lines()
            refused += 1
            assert len(said) == 1
            assert said[0].startswith(f"error: {path}")
    assert refused >= 200


@KIND
def test_every_cut_is_noticed(kind: str, tmp_path: Path) -> None:
    """A file that ends early is refused wherever it ends, but for its last line break."""
    good = written(kind, make_table(3), tmp_path).read_bytes()
    path = tmp_path / "cut"
    for end in range(1, len(good) - 1):
        if kind.endswith("ascii") and good[end : end + 1].isdigit():
            continue
        put(path, good[:end])
        with pytest.raises(InputError):
            KINDS[kind][2](path)
