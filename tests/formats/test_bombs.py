"""Small files that stand for large ones: refused in one line, before memory is taken for what they say."""

import bz2
import json
import os
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from lidarcheck.cli import main
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.las import read_las, write_las
from lidarcheck.formats.limits import CONFIG_BYTES, MAX_ROWS, max_rows
from lidarcheck.formats.parquet import read_parquet
from lidarcheck.formats.pcd import read_pcd
from lidarcheck.formats.ply import read_ply
from lidarcheck.formats.recognise import read_table
from lidarcheck.formats.source import read_source
from lidarcheck.formats.table import Table

ROWS = 60_000_000
LIMIT = "the limit is 50000000 rows: --max-rows N"
ENOUGH = 12_000
"""Rows of text that a reader looks at to see that it is text."""
MOST_MB = 700
"""Of the whole process, of which the libraries take about 300 MB."""
RUN = """
import json, pathlib, resource, sys
resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))
import importlib
for where, path, *more in json.loads(sys.stdin.read()):
    module, _, name = where.partition(":")
    try:
        getattr(importlib.import_module(module), name)(pathlib.Path(path), *more)
        said = "read"
    except Exception as error:
        said = str(error)
    # Not what `resource` says: that begins with the peak of the process that started this one.
    most_kb = int(pathlib.Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0])
    print(json.dumps([path, said, most_kb // 1024]))
"""
MESH = "lidarcheck.scenes.meshes:load_mesh"
CALIBRATION = "lidarcheck.formats.sensors:import_sensor"
TABLE = "lidarcheck.formats.recognise:read_table"
PCD = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {0}\nHEIGHT 1\nPOINTS {0}\n"
PLY = "ply\nformat {1} 1.0\nelement vertex {0}\n" + "".join(f"property float {a}\n" for a in "xyz") + "end_header\n"


def sparse(path: Path, head: str, size: int) -> None:
    """A file of so many bytes that takes no more room on the disk than its head."""
    with path.open("wb") as stream:
        stream.write(head.encode())
        stream.truncate(size)


def flat_parquet(path: Path, rows: int = ROWS) -> None:
    """Runs of equal values: a page says how long they are."""
    zeros = pa.array(np.zeros(rows, np.int8))
    parquet.write_table(pa.table(dict.fromkeys("XYZ", zeros)), path, compression="zstd")


def packed_pcd(path: Path) -> None:
    """LZF in which three bytes stand for 264."""
    size = ROWS * 12
    repeats, rest = divmod(size - 1, 264)
    packed = b"\0\0" + b"\xe0\xff\0" * repeats + bytes([0xE0, rest - 9, 0])
    path.write_bytes(PCD.format(ROWS).encode() + b"DATA binary_compressed\n" + struct.pack("<II", len(packed), size))
    with path.open("ab") as stream:
        stream.write(packed)


def counted_laz(path: Path, rows: int = ROWS) -> None:
    write_las(Table({name: np.zeros(1000) for name in "XYZ"}), path)
    content = bytearray(path.read_bytes())
    struct.pack_into("<Q", content, 247, rows)
    path.write_bytes(content)


def sparse_las(path: Path) -> None:
    counted_laz(path)
    os.truncate(path, ROWS * 30 + 375)


def glb(path: Path, corners: int, nodes: int, *, there: bool = True) -> None:
    """A mesh of triangles in nothing, placed so many times; without `there` no byte stands for its corners."""
    size = 12 * corners if there else 4
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(nodes))}],
        "nodes": [{"mesh": 0, "translation": [i, 0, 0]} for i in range(nodes)],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "buffers": [{"byteLength": size}],
        "bufferViews": [{"buffer": 0, "byteLength": size}],
        "accessors": [
            {"componentType": 5126, "count": corners, "type": "VEC3", **({"bufferView": 0} if there else {})}
        ],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + size, len(text), 0x4E4F534A)
    path.write_bytes(head + text + struct.pack("<II", size, 0x4E4942) + bytes(size))


def firings(per_second: float) -> dict[str, object]:
    """A rotary lidar of two states that fires so often."""
    state = {"azimuthDeg": [0.0], "elevationDeg": [1.0]}
    rates = {"scanRateBaseHz": 1.0, "reportRateBaseHz": per_second}
    return {"profile": {"scanType": "rotary", "emitterStates": [state, state], **rates}}


def mcap(path: Path, held: int, packed: bytes, compression: str = "zstd") -> None:
    """A chunk that says that it holds so many bytes."""
    name = compression.encode()
    head = struct.pack("<QQQII", 0, 0, held, 0, len(name)) + name + struct.pack("<Q", len(packed))
    chunk = head + packed
    path.write_bytes(b"\x89MCAP0\r\n" + b"\x06" + struct.pack("<Q", len(chunk)) + chunk)


def counted_mcap(path: Path) -> None:
    """A cloud that says that it has 60 million points."""

    def text(value: bytes) -> bytes:
        return struct.pack("<I", len(value)) + value

    cloud = b"\0\1\0\0" + bytes(8) + struct.pack("<I", 1) + bytes(4) + struct.pack("<III", 6000, 10_000, 0) + bytes(64)
    records = [
        struct.pack("<H", 1) + text(b"sensor_msgs/msg/PointCloud2") + text(b"ros2msg") + text(b""),
        struct.pack("<HH", 1, 1) + text(b"/points") + text(b"cdr") + text(b""),
        struct.pack("<HIQQ", 1, 0, 0, 0) + cloud,
    ]
    content = b"".join(
        bytes([kind]) + struct.pack("<Q", len(record)) + record for kind, record in zip((3, 4, 5), records, strict=True)
    )
    path.write_bytes(b"\x89MCAP0\r\n" + content)


def rosbag(path: Path, held: int) -> None:
    """A ROS 1 bag with a chunk that says that it holds so many bytes."""

    def record(data: bytes, **values: bytes) -> bytes:
        fields = [name.encode() + b"=" + value for name, value in values.items()]
        head = b"".join(struct.pack("<I", len(field)) + field for field in fields)
        return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data

    head = record(b" " * 4096, op=b"\3", index_pos=bytes(8), conn_count=bytes(4), chunk_count=bytes(4))
    packed = bz2.compress(bytes(1 << 26))
    chunk = record(packed, op=b"\5", compression=b"bz2", size=struct.pack("<I", held))
    path.write_bytes(b"#ROSBAG V2.0\n" + head + chunk)


def zeros_of(size: int) -> bytes:
    """Zeros as Zstandard packs them."""
    sink = pa.BufferOutputStream()
    with pa.CompressedOutputStream(sink, "zstd") as stream:
        for _ in range(size >> 24):
            stream.write(bytes(1 << 24))
    return sink.getvalue().to_pybytes()


BOMBS: dict[str, tuple[Callable[[Path], object], str, str]] = {
    "flat.parquet": (flat_parquet, TABLE, f": it says that it holds {ROWS} rows in "),
    "packed.pcd": (packed_pcd, TABLE, f":9: it says that it holds {ROWS} rows in 8182 kB; {LIMIT}"),
    "binary.pcd": (
        lambda path: sparse(path, PCD.format(ROWS) + "DATA binary\n", 12 * ROWS + 200),
        TABLE,
        f":9: it says that it holds {ROWS} rows in 720 MB; {LIMIT}",
    ),
    "behind.pcd": (
        lambda path: sparse(path, PCD.format(1) + "DATA binary\n", 100 << 30),
        TABLE,
        ":9: POINTS says 1 row, but 107374182",
    ),
    "chunk.mcap": (
        lambda path: mcap(path, 10 << 30, zeros_of(1 << 24)),
        TABLE,
        f": a chunk says that it holds {10 << 30} bytes; the limit is 268435456 bytes:",
    ),
    "more.mcap": (
        lambda path: mcap(path, 1000, zeros_of(1 << 28)),
        TABLE,
        ": a chunk says that it holds 1000 bytes and holds more;",
    ),
    "rows.mcap": (counted_mcap, TABLE, f": a message says that it holds {ROWS} rows in 227 bytes; {LIMIT}"),
    "chunk.bag": (
        lambda path: rosbag(path, 1 << 31),
        TABLE,
        f": a chunk says that it holds {1 << 31} bytes; the limit is",
    ),
    "more.bag": (lambda path: rosbag(path, 1000), TABLE, ": a chunk says that it holds 1000 bytes and holds more;"),
    "long.osi": (
        lambda path: sparse(path, "\x7f\x7f\x7f\x7f", 100 << 30),
        TABLE,
        ": a message says that it has 2139062143 bytes; the limit is 268435456 bytes",
    ),
    "rows.bin": (lambda path: sparse(path, "", 16 * ROWS), TABLE, f": it holds {ROWS} rows in 960 MB; {LIMIT}"),
    "ascii.pcd": (
        lambda path: sparse(path, PCD.format(3) + "DATA ascii\n1 2 3\n", 10 << 30),
        TABLE,
        ":12: the line is longer than 1048576 bytes",
    ),
    "lie.las": (
        lambda path: counted_laz(path, 4_000_000_000),
        TABLE,
        ": the header says 4000000000 points, the bytes end after 1000;",
    ),
    "many.las": (sparse_las, TABLE, f": it says that it holds {ROWS} rows in 1800 MB; {LIMIT}"),
    "many.laz": (counted_laz, TABLE, f": it says that it holds {ROWS} rows in "),
    "lie.laz": (lambda path: counted_laz(path, 40_000_000), TABLE, ": the table says 1 chunks, which do not hold"),
    "binary.ply": (
        lambda path: sparse(path, PLY.format(ROWS, "binary_little_endian"), 12 * ROWS + 200),
        TABLE,
        f":3: it says that it holds {ROWS} rows in 720 MB; {LIMIT}",
    ),
    "behind.ply": (
        lambda path: sparse(path, PLY.format(1, "binary_big_endian"), 100 << 30),
        TABLE,
        ":3: element vertex says 1 row, but 107374182",
    ),
    "lie.ply": (
        lambda path: path.write_text(PLY.format(ROWS, "ascii") + "1 2 3\n"),
        TABLE,
        f":3: element vertex says {ROWS} rows, the file has 1;",
    ),
    "ascii.ply": (
        lambda path: sparse(path, PLY.format(ROWS, "ascii") + "1 2 3\n", 400_000_000),
        TABLE,
        f":3: it says that it holds {ROWS} rows in 400 MB; {LIMIT}",
    ),
    "behind_packed.pcd": (
        lambda path: sparse(path, PCD.format(1) + "DATA binary_compressed\n", 100 << 30),
        TABLE,
        ":9: POINTS says 1 row, but 107374182",
    ),
    "long.csv": (
        lambda path: sparse(path, "X,Y,Z\n" + "1,2,3\n" * ENOUGH, 10 << 30),
        TABLE,
        f":{ENOUGH + 2}: the line is longer than 1048576 bytes",
    ),
    "large.txt": (
        lambda path: sparse(path, "//X Y Z\n" + "1 2 3\n" * ENOUGH, 100 << 30),
        TABLE,
        f": the file has {100 << 30} bytes; the limit is {256 * MAX_ROWS} bytes, 256 for each of {MAX_ROWS} rows",
    ),
    "nothing.glb": (
        lambda path: glb(path, 150_000_000, 1, there=False),
        MESH,
        ": not a whole GLB mesh: it says that it holds 150000000 numbers in a row, it has",
    ),
    "often.glb": (
        lambda path: glb(path, 30_000, 1000),
        MESH,
        ": the mesh comes down to 30000000 corners of triangles; the limit is 15000000",
    ),
    "large.stl": (
        lambda path: sparse(path, "solid", 1 << 30),
        MESH,
        f": the file has {1 << 30} bytes; the limit is {256 << 20} bytes",
    ),
    "calibration.json": (
        lambda path: path.write_text('{"beam_intrinsics": [' + "[]," * (1 << 20) + "[]]}"),
        CALIBRATION,
        ": beam_azimuth_angles is missing;",
    ),
    "calibration.yaml": (
        lambda path: path.write_text("lasers: [" + "[]," * 80_000 + "[]]\n"),
        CALIBRATION,
        ":1: lasers has 80001 entries, no sensor has more than 4096;",
    ),
    "calibration.csv": (
        lambda path: path.write_text("Channel,Elevation,Azimuth\n" + "1\n" * 500_000),
        CALIBRATION,
        ": more than 10000 lines;",
    ),
    "calibration.xml": (
        lambda path: path.write_text("<a>" + "<b/>" * 200_000 + "</a>"),
        CALIBRATION,
        ":1: the file has too many elements;",
    ),
    "calibration.usda": (
        lambda path: path.write_text("#usda 1.0\nfloat[] omni:sensor:Core:numRaysPerLine = [" + "1," * 500_000 + "]\n"),
        CALIBRATION,
        ":1: profile.emitterStates is missing;",
    ),
    "turn.json": (
        lambda path: path.write_text(json.dumps(firings(1e8))),
        CALIBRATION,
        ":1: 100000000 beams, a table has at most 1000000;",
    ),
    **{
        name: (
            lambda path: sparse(path, "# nothing\n", 1 << 30),
            where,
            f": the file has {1 << 30} bytes; ",
        )
        for name, where in {
            "model.toml": "lidarcheck.model:load_model",
            "scenario.toml": "lidarcheck.harness.scenario.scenario:load_scenario",
            "scene.toml": "lidarcheck.scenes.files.file:load_scene",
            "golden.toml": "lidarcheck.harness.goldens.file:load_golden",
            "settings.json": "lidarcheck.formats.settings:load_settings",
            "lut.ini": "lidarcheck.formats.lut:load_lut",
            "check.json": "lidarcheck.harness.review.release:last_check",
            "large.yaml": CALIBRATION,
        }.items()
    },
}


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[str, int]]:
    """What one process says of each bomb, and the most memory that it has taken by then [MB]."""
    directory = tmp_path_factory.mktemp("bombs")
    tasks = []
    for name, (write, where, _) in BOMBS.items():
        write(directory / name)
        tasks.append([where, str(directory / name), *[1] * (where == MESH)])
    environment = {name: value for name, value in os.environ.items() if name != "LIDARCHECK_MAX_ROWS"}
    run = subprocess.run(
        [sys.executable, "-c", RUN],
        input=json.dumps(tasks),
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    found = [json.loads(line) for line in run.stdout.splitlines()]
    return {Path(path).name: (text.replace(str(directory), ""), most) for path, text, most in found}


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused_before_memory_is_taken(name: str, said: dict[str, tuple[str, int]]) -> None:
    text, most_mb = said[name]
    assert text.startswith(f"error: /{name}{BOMBS[name][2]}")
    assert "\n" not in text
    assert most_mb < MOST_MB


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIDARCHECK_MAX_ROWS", "1000")


@pytest.mark.usefixtures("few")
def test_a_table_of_many_columns_may_have_fewer_rows(tmp_path: Path) -> None:
    path = tmp_path / "wide.parquet"
    parquet.write_table(pa.table({f"c{i}": [0, 0] for i in range(8001)}), path)
    with pytest.raises(InputError, match=r"2 rows of 8001 numbers in .* the limit is 16000 numbers, 16 in each"):
        read_parquet(path)
    path = tmp_path / "wide.pcd"
    names = " ".join(f"c{i}" for i in range(9000))
    lists = "".join(f"{key} {' '.join([value] * 9000)}\n" for key, value in (("SIZE", "1"), ("TYPE", "U")))
    path.write_bytes(f"FIELDS {names}\n{lists}WIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA binary\n".encode() + bytes(18000))
    with pytest.raises(InputError, match="2 rows of 9000 numbers"):
        read_pcd(path)


@pytest.mark.usefixtures("few")
def test_rows_that_nobody_announces_are_counted_while_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("X Y Z\n" + "1 2 3\n" * 1001)
    with pytest.raises(InputError, match="it holds 1001 rows in 6012 bytes; the limit is 1000 rows: --max-rows N"):
        read_table(path)
    path.write_text("X Y Z\n" + "1 2 3\n" * 1000)
    assert len(read_table(path)) == 1000


def test_ten_thousand_columns_are_read(tmp_path: Path) -> None:
    path = tmp_path / "wide.parquet"
    names = [*"XYZ", *(f"c{i}" for i in range(9997))]
    parquet.write_table(pa.table({name: pa.array([1.0, 2.0]) for name in names}), path)
    assert read_parquet(path).names == tuple(names)


def test_text_and_nested_columns_of_parquet_take_no_memory(tmp_path: Path) -> None:
    path = tmp_path / "texts.parquet"
    nested = pa.array([{"X": 1.0, "of": [1, 2]}] * 2)
    columns = {**{name: pa.array([1.0, 2.0]) for name in "XYZ"}, "note": ["a" * (64 << 20), ""], "nested": nested}
    parquet.write_table(pa.table(columns), path, compression="zstd")
    assert path.stat().st_size < 100_000
    pool = pa.default_memory_pool()
    before = pool.max_memory()
    assert read_parquet(path).names == ("X", "Y", "Z")
    assert pool.max_memory() == before


@pytest.mark.parametrize("at", ["rows", "values"])
def test_a_footer_that_contradicts_itself_is_refused(tmp_path: Path, at: str) -> None:
    path = tmp_path / "a.parquet"
    number = {"rows": 765_432, "values": 234_567}
    parquet.write_table(pa.table({"X": np.zeros(234_567, np.int8)}), path, compression="none")
    content = path.read_bytes()
    tail = content[-int.from_bytes(content[-8:-4], "little") - 8 :]
    was, now = (_zigzag(value) for value in (number["values"], number["rows"]))
    places = [at for at in range(len(tail)) if tail.startswith(was, at)]
    place = places[("rows", "values").index(at)]  # the file's rows stand first, then the column's values
    path.write_bytes(content[: -len(tail)] + tail[:place] + now + tail[place + len(was) :])
    with pytest.raises(InputError, match="damaged or cut off Parquet"):
        read_parquet(path)


def _zigzag(number: int) -> bytes:
    """A whole number as thrift's compact protocol has it."""
    number, found = 2 * number, bytearray()
    while number > 127:
        found.append(number & 127 | 128)
        number >>= 7
    return bytes([*found, number])


@pytest.mark.parametrize("packed", [5, 2**32 - 1])
def test_sizes_of_a_compressed_block_that_do_not_match(tmp_path: Path, packed: int) -> None:
    path = tmp_path / "a.pcd"
    head = PCD.format(1000).encode() + b"DATA binary_compressed\n"
    path.write_bytes(head + struct.pack("<II", packed, 12_000) + b"\0\0\xe0\xff\0")
    with pytest.raises(InputError, match=r"the compressed data are damaged|of 4294967295 compressed bytes there are 5"):
        read_pcd(path)
    path.write_bytes(head + struct.pack("<II", 5, 2**32 - 1) + b"\0\0\xe0\xff\0")
    with pytest.raises(InputError, match="the compressed block holds 4294967295 bytes instead of 12000"):
        read_pcd(path)


def test_a_point_of_64_kilobytes_is_read_in_small_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.las"
    write_las(Table({name: np.zeros(500) for name in "XYZ"}), path)
    content = bytearray(path.read_bytes())
    start = struct.unpack_from("<I", content, 96)[0]
    struct.pack_into("<H", content, 105, 65_535)
    path.write_bytes(bytes(content[:start]) + bytes(65_535 * 500))
    assert len(read_las(path)) == 500
    monkeypatch.setenv("LIDARCHECK_MAX_ROWS", "10000")
    with pytest.raises(InputError, match="500 rows of 8192 numbers in 33 MB; the limit is 160000 numbers"):
        read_las(path)


def test_lists_of_a_ply_are_refused_before_they_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(
        b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty list uint float x\nend_header\n"
        + struct.pack("<I", 2**32 - 1)
    )
    with pytest.raises(InputError, match=":4: element 'vertex' has a list property"):
        read_ply(path)


def test_a_pipe_is_read_no_further_than_a_file_may_be_long(tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with subprocess.Popen(["dd", "if=/dev/zero", f"of={path}", "bs=1M", "count=64"], stderr=subprocess.DEVNULL) as dd:
        with pytest.raises(InputError, match=f"the limit is {CONFIG_BYTES} bytes"):
            read_source(path, pipes=True)
        dd.kill()


def test_the_limit_of_the_environment_must_be_a_number(monkeypatch: pytest.MonkeyPatch) -> None:
    for text in ("", "0", "-1", "1e6", "²", "9" * 30):
        monkeypatch.setenv("LIDARCHECK_MAX_ROWS", text)
        with pytest.raises(UsageError, match="LIDARCHECK_MAX_ROWS is"):
            max_rows()


def test_the_option_of_a_command_holds_for_it_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.txt"
    path.write_text("X Y Z\n" + "9 0 0\n" * 11)
    assert main(["info", str(path), "--max-rows", "10"]) == 2
    assert (
        capsys.readouterr().err == f"error: {path}: it holds 11 rows in 72 bytes; the limit is 10 rows: --max-rows N\n"
    )
    assert main(["info", str(path), "--max-rows", "11", "--quiet"]) == 0
    assert max_rows() == MAX_ROWS
    assert main(["info", str(path), "--max-rows", "0"]) == 2
    assert "--max-rows 0 is out of range; use a whole number from 1 to 1000000000000" in capsys.readouterr().err
