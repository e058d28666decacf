"""OSI traces, E57, rows of float32, files of packets; and what is said where an optional package is missing."""

import struct
import sys

import numpy as np
import pytest

from lidarcheck.cases.source import frames_in
from lidarcheck.errors import InputError
from lidarcheck.formats import load_scan
from lidarcheck.formats.field.recording import open_recording
from lidarcheck.formats.recognise import read_table, recognise
from lidarcheck.model.files.sensor_file import load_sensor


def sensor_data(frame, lidars=1):
    """Three detections: one ahead at 10 m, one to the left and above, one that is invalid."""
    from osi3.osi_sensordata_pb2 import SensorData

    data = SensorData()
    data.timestamp.seconds, data.timestamp.nanos = 100, frame * 40_000_000
    for _ in range(lidars):
        lidar = data.feature_data.lidar_sensor.add()
        for number, (distance, azimuth, elevation) in enumerate([(10.0 + frame, 0, 0), (20, 0.5, 0.25), (0, 0, 0)]):
            one = lidar.detection.add()
            one.position.distance, one.position.azimuth, one.position.elevation = distance, azimuth, elevation
            one.intensity, one.beam_id.value = 50.0 + number, number
            one.classification = 2 if number == 2 else 0
    return data


def osi(path, frames=3, lidars=1):
    contents = [sensor_data(n, lidars).SerializeToString() for n in range(frames)]
    path.write_bytes(b"".join(struct.pack("<I", len(one)) + one for one in contents))
    return path


def opened(path):
    return open_recording(path, recognise(path))


def test_osi_detections_are_rows(tmp_path):
    found = opened(osi(tmp_path / "a_sd_.osi"))
    assert len(found) == 3
    assert found.times_s == pytest.approx([0.0, 0.04, 0.08])
    table = found.read(1)
    assert table.names == ("X", "Y", "Z", "RANGE", "intensity", "beam_id", "invalid")
    flat = 20 * np.cos(0.25)
    expected = [[11, 0, 0], [flat * np.cos(0.5), flat * np.sin(0.5), 20 * np.sin(0.25)], [0, 0, 0]]
    assert np.stack([table.columns[axis] for axis in "XYZ"], axis=-1) == pytest.approx(np.array(expected))
    assert table.columns["invalid"].tolist() == [0, 0, 1]


def test_osi_cut_short_and_of_several_lidars(tmp_path):
    path = osi(tmp_path / "a.osi")
    path.write_bytes(path.read_bytes()[:-7])
    found = opened(path)
    assert len(found) == 2
    assert "cut short: its last" in found.notes[0]
    two = osi(tmp_path / "two.osi", lidars=2)
    with pytest.raises(InputError, match=r"holds 2 lidars: 0 \(3 detections\), 1 \(3 detections\); choose one: '.*#0'"):
        opened(two)
    assert len(frames_in(f"{two}#1")) == 3
    (tmp_path / "b.osi").write_bytes(struct.pack("<I", 5) + b"\xff" * 5)
    with pytest.raises(InputError, match="a message is no SensorData"):
        opened(tmp_path / "b.osi")
    empty = osi(tmp_path / "c.osi", lidars=0)
    with pytest.raises(InputError, match="no lidar detections"):
        opened(empty)


def test_osi_in_text_and_in_mcap(tmp_path):
    from google.protobuf import text_format
    from osi_utilities import MultiTraceWriter

    path = tmp_path / "a_sd_.txth"
    path.write_text("".join(text_format.MessageToString(sensor_data(n)) for n in range(2)))
    assert len(opened(path)) == 2
    assert read_table(f"{path}#@1").columns["RANGE"][0] == 11.0
    mcap = tmp_path / "a.mcap"
    writer = MultiTraceWriter()
    assert writer.open(mcap)
    writer.add_channel("lidar", type(sensor_data(0)))
    for n in range(3):
        assert writer.write_message(sensor_data(n), "lidar")
    writer.close()
    found = opened(mcap)
    assert (len(found), found.topic) == (3, "lidar")
    assert found.read(2).columns["RANGE"][0] == 12.0


def test_a_beam_id_is_a_row_of_the_sensors_table(tmp_path):
    (tmp_path / "beams.csv").write_text(
        "Layer,Point,elevation_deg,azimuth_deg\n0,0,0,0\n0,1,14.323945,28.647890\n0,2,0,5\n"
    )
    text = (
        'format = 1\nname = "three"\ndetector = "linear"\nframe_rate_hz = 25\n'
        '[beams]\nkind = "table"\nfile = "beams.csv"\n'
        '[sweep]\norder = "flash"\n[linear]\nrange_floor_m = 0.02\n'
    )
    (tmp_path / "three.toml").write_text(text)
    scan = load_scan(f"{osi(tmp_path / 'a.osi')}#@0", sensor=load_sensor(tmp_path / "three.toml"))
    assert scan.layer.tolist() == [0, 0]
    assert scan.point.tolist() == [0, 1]
    assert scan.fired is not None
    assert len(scan.fired) == 3


def write_e57(path, **more):
    import pye57

    rows = np.arange(6)
    with pye57.E57(str(path), "w") as file:
        for shift in (0.0, 100.0):
            data = {"cartesianX": 3.0 + rows + shift, "cartesianY": rows / 2, "cartesianZ": np.zeros(6)}
            data |= {"intensity": rows / 6, "rowIndex": (rows // 3).astype("H"), "columnIndex": (rows % 3).astype("H")}
            file.write_scan_raw(data, **more)
    return path


def test_e57_gives_a_frame_for_each_scan(tmp_path):
    path = write_e57(tmp_path / "a.e57")
    found = opened(path)
    assert len(found) == 2
    table = found.read(1)
    assert table.names == ("X", "Y", "Z", "INTENSITY", "ring", "column")
    assert table.columns["X"].tolist() == [103.0, 104, 105, 106, 107, 108]
    assert table.columns["ring"].tolist() == [0, 0, 0, 1, 1, 1]
    assert len(frames_in(f"{path}#1")) == 1
    content = bytearray(path.read_bytes())
    content[1500] ^= 255
    (tmp_path / "b.e57").write_bytes(content)
    with pytest.raises(InputError, match="the E57 file is damaged"):
        opened(tmp_path / "b.e57").read(0)
    (tmp_path / "c.e57").write_bytes(path.read_bytes()[:-10])
    with pytest.raises(InputError, match="the E57 head says 7168 bytes, the file has 7158"):
        opened(tmp_path / "c.e57")


def test_entities_in_the_xml_of_an_e57_are_refused_before_it_is_opened(tmp_path):
    path = write_e57(tmp_path / "a.e57")
    content = bytearray(path.read_bytes())
    start, size = struct.unpack_from("<QQ", content, 24)
    end = start // 1024 * 1024 + 1020
    assert end - start < size
    content[end - 4 : end], content[end + 4 : end + 9] = b"<!DO", b"CTYPE"  # a checksum stands between
    path.write_bytes(content)
    with pytest.raises(InputError, match="the E57 file's XML defines entities; export it again, without them"):
        opened(path)


def turn_of_64(columns=50):
    """Rings from the top, each a turn to the left, as KITTI's files run."""
    elevation = np.deg2rad(np.repeat(np.linspace(2, -24.8, 64), columns))
    azimuth = np.deg2rad(np.tile(np.linspace(1, 359, columns), 64))
    xyz = [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
    return np.stack([*(20 * np.array(xyz)), np.full(len(azimuth), 0.5)], axis=-1).astype(np.float32)


def test_rows_of_kitti_have_rings_where_64_come_out(tmp_path):
    rows = turn_of_64()
    rows.tofile(tmp_path / "0000000000.bin")
    table = read_table(tmp_path / "0000000000.bin")
    assert np.array_equal(table.columns["ring"], np.repeat(np.arange(64), 50))
    np.random.default_rng(1).permutation(rows).tofile(tmp_path / "0000000001.bin")
    found = opened(tmp_path / "0000000001.bin")
    assert "ring" not in found.read(0).columns
    assert found.notes == ("the order of rows gives no 64 rings: beams are told by direction alone",)
    assert len(frames_in(tmp_path)) == 2


def test_rows_of_nuscenes_have_their_ring(tmp_path):
    rows = np.column_stack([turn_of_64()[:640, :3], np.full(640, 17.0), np.arange(640) % 32]).astype(np.float32)
    rows.tofile(tmp_path / "a.pcd.bin")
    table = read_table(tmp_path / "a.pcd.bin")
    assert table.columns["ring"].tolist() == [n % 32 for n in range(640)]
    assert table.columns["INTENSITY"][0] == 17.0


def test_bytes_that_are_no_rows(tmp_path):
    for name, content in {
        "a.bin": b"\x7fELF" + bytes(range(256)) * 5,
        "b.bin": bytes(7),
        "c.bin": b"abcd" * 100,
    }.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match="holds no rows of 4 or 5 float32 numbers"):
            read_table(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "start", "words"),
    [
        (
            "a.pcap",
            b"\xd4\xc3\xb2\xa1\2\0\4\0",
            "a packet capture, packets and no point cloud; make clouds of it with the",
        ),
        ("a.txt", b"\xa1\xb2\x3c\x4d\0\2\0\4", "a packet capture"),
        ("a.pcapng", b"\x0a\x0d\x0d\x0a\x1c\0\0\0", "once `editcap -F pcap` has made a .pcap of it"),
        (
            "a.osf",
            b"\x30\0\0\0\x10\0\0\0OSF!",
            "an Ouster recording, packets and no point cloud; make clouds of it with oust",
        ),
        (
            "a.lvx",
            b"livox_tech\0\0\0\0\0\0",
            "a Livox recording, packets and no point cloud; make clouds of it with Livox V",
        ),
        ("a.lvx2", b"livox_tech\0\0\0\0\0\0", "Livox Viewer 2"),
    ],
)
def test_files_of_packets_are_named_with_their_tool(name, start, words, tmp_path):
    (tmp_path / name).write_bytes(start + bytes(64))
    with pytest.raises(InputError) as error:
        read_table(tmp_path / name)
    assert words in str(error.value)
    assert len(error.value.lines()) == 1


MISSING = {
    "osi3": (lambda path: osi(path.with_suffix(".osi")), "an OSI trace needs the package osi3", "osi"),
    "pye57": (lambda path: write_e57(path.with_suffix(".e57")), "an E57 file needs the package pye57", "e57"),
}


@pytest.mark.parametrize("package", MISSING)
def test_a_missing_package_is_named_with_its_extra(package, tmp_path, monkeypatch):
    make, words, extra = MISSING[package]
    path = make(tmp_path / "a")
    for name in [name for name in sys.modules if name.partition(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError) as error:
        opened(path)
    assert (
        str(error.value)
        == f'error: {path.with_suffix("." + extra)}: {words}; install it: pip install "lidarcheck[{extra}]"'
    )
