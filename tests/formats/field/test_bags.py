"""Bags as rosbags writes them, and clouds made byte by byte: what is read of them, and what is said where it is not."""

import sqlite3
import struct
from pathlib import Path

import numpy as np
import pytest

from bag_kit import (
    CLOUD,
    PERIOD_NS,
    START_NS,
    Message,
    cdr_cloud,
    custom_message,
    ros1_cloud,
    transforms_message,
    write_ros1,
    write_ros2,
)
from lidarcheck.cases.source import frames_in
from lidarcheck.errors import InputError
from lidarcheck.formats import load_scan
from lidarcheck.formats.assign.cloud import clouds_of
from lidarcheck.formats.describe import describe
from lidarcheck.formats.field.choice import Choice, choose
from lidarcheck.formats.field.clouds import cloud_of
from lidarcheck.formats.field.recording import open_recording
from lidarcheck.formats.field.transforms import Tree, read_transforms
from lidarcheck.formats.recognise import read_table, recognise
from places import shared_path

PACKETS = "velodyne_msgs/msg/VelodyneScan"


def columns(rows=40, seed=0):
    rng = np.random.default_rng(seed)
    xyz = {axis: rng.uniform(2, 20, rows).astype(np.float32) for axis in "xyz"}
    intensity = rng.uniform(0, 255, rows).astype(np.float32)
    ring = (np.arange(rows) % 16).astype(np.uint16)
    return {**xyz, "intensity": intensity, "ring": ring, "timestamp": 1.7e9 + np.arange(rows) * 1e-3}


def clouds(count=5, topic="/points", make=cdr_cloud, **more):
    return [
        Message(
            topic, CLOUD, START_NS + n * PERIOD_NS, make(columns(40 + n, n), stamp_ns=START_NS + n * PERIOD_NS, **more)
        )
        for n in range(count)
    ]


def opened(path, topic=""):
    return open_recording(f"{path}#{topic}" if topic else path, recognise(path))


BAGS = {
    "mcap": lambda place: write_ros2(place, clouds()),
    "mcap, chunks of zstd": lambda place: write_ros2(place, clouds(), compression="storage"),
    "mcap, messages of zstd": lambda place: write_ros2(place, clouds(), compression="message"),
    "sqlite": lambda place: write_ros2(place, clouds(), storage="db3"),
    "sqlite, messages of zstd": lambda place: write_ros2(place, clouds(), storage="db3", compression="message"),
    "ros 1": lambda place: write_ros1(place, clouds(make=ros1_cloud)),
    "ros 1, bz2": lambda place: write_ros1(place, clouds(make=ros1_cloud), compression="bz2"),
    "ros 1, lz4": lambda place: write_ros1(place, clouds(make=ros1_cloud), compression="lz4"),
}


@pytest.fixture(autouse=True)
def nothing_chosen():
    yield
    choose(Choice())


@pytest.mark.parametrize("kind", BAGS)
def test_every_frame_comes_back_as_it_was(kind, tmp_path):
    bag = opened(BAGS[kind](tmp_path / "drive.bag"))
    assert len(bag) == 5
    assert bag.topic == "/points"
    assert bag.times_s == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert bag.start_ns == START_NS
    for number, table in enumerate(bag.tables()):
        expected = columns(40 + number, number)
        assert table.names == tuple(expected)
        for name, column in expected.items():
            assert table.columns[name].dtype == column.dtype
            assert np.array_equal(table.columns[name], column)


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_messages_that_another_program_serialised(encoding):
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE if encoding == "cdr" else Stores.ROS1_NOETIC)
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](sec=1_700_000_000, nanosec=7)
    more = {} if encoding == "cdr" else {"seq": 3}
    head = types["std_msgs/msg/Header"](stamp=stamp, frame_id="velodyne", **more)
    field = types["sensor_msgs/msg/PointField"]
    fields = [field(name=name, offset=4 * i, datatype=7, count=1) for i, name in enumerate("xyz")]
    rows = np.arange(12, dtype=np.float32)
    cloud = types["sensor_msgs/msg/PointCloud2"](
        header=head, height=2, width=2, fields=fields, is_bigendian=False, point_step=12, row_step=24,
        data=rows.view(np.uint8), is_dense=True,
    )  # fmt: skip
    write = store.serialize_cdr if encoding == "cdr" else store.serialize_ros1
    found = cloud_of(bytes(write(cloud, "sensor_msgs/msg/PointCloud2")), encoding, Path("a"))
    assert (found.frame, found.height, found.stamp_ns) == ("velodyne", 2, START_NS + 7)
    assert np.array_equal(np.stack(list(found.columns.values()), axis=-1).ravel(), rows)
    vector, turn = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    step = types["geometry_msgs/msg/Transform"](
        translation=vector(x=1.0, y=2.0, z=3.0), rotation=turn(x=0, y=0, z=1, w=0)
    )
    one = types["geometry_msgs/msg/TransformStamped"](header=head, child_frame_id="roof", transform=step)
    tree = Tree()
    if encoding == "cdr":
        content = bytes(write(types["tf2_msgs/msg/TFMessage"](transforms=[one]), "tf2_msgs/msg/TFMessage"))
    else:  # a list is its length and what is in it
        content = struct.pack("<I", 1) + bytes(write(one, "geometry_msgs/msg/TransformStamped"))
    read_transforms(tree, content, encoding, Path("a"))
    rotation, move = tree.between("roof", "velodyne")
    assert move == pytest.approx([1.0, 2.0, 3.0])
    assert rotation == pytest.approx(np.diag([-1.0, -1.0, 1.0]))


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("padding", [0, 3])
def test_fields_stand_where_the_message_says(big, padding):
    own = {**columns(12), "a": np.arange(12, dtype="i1"), "b": np.arange(12, dtype="i4")}
    found = cloud_of(cdr_cloud(own, height=3, big=big, padding=padding, rest=padding * 7), "cdr", Path("a.mcap"))
    assert found.height == 3
    assert found.frame == "lidar"
    assert found.stamp_ns == START_NS
    for name, column in own.items():
        assert np.array_equal(found.columns[name], column)


def test_an_organised_cloud_says_which_beams_were_fired(tmp_path):
    own = columns(64)
    own["x"][[3, 40]] = np.nan
    bag = write_ros2(tmp_path / "a", [Message("/points", CLOUD, START_NS, cdr_cloud(own, height=16))])
    table = read_table(bag)
    assert table.height == 16
    assert str(describe(bag)).count("no return") == 1
    assert len(load_scan(bag)) == 62


def test_the_frames_of_a_bag_are_frames_of_a_command(tmp_path):
    bag = write_ros2(tmp_path / "drive", clouds())
    frames = frames_in(bag)
    assert [str(frame) for frame in frames] == [f"{bag}#/points@{n}" for n in range(5)]
    assert [frame.value for frame in frames] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert len(frames_in(tmp_path / "drive")) == 5  # the folder of a ROS 2 bag, its metadata.yaml beside
    assert len(frames[3].read()) == len(read_table(f"{bag}#/points@3")) == 43
    with pytest.raises(InputError, match=r"holds 5 frames, where one is wanted; name one, as '.*#/points@0'"):
        load_scan(bag)
    with pytest.raises(InputError, match="has no frame 9: it holds 5; name one of 0 to 4"):
        frames_in(f"{bag}#/points@9")


def test_several_topics_must_be_chosen_from(tmp_path):
    bag = write_ros2(tmp_path / "drive", [*clouds(3), *clouds(2, topic="/rear/points")])
    with pytest.raises(InputError, match=r"on 2 topics: /points \(3 frames\), /rear/points \(2 frames\); choose one"):
        opened(bag)
    assert len(opened(bag, "/rear/points")) == 2
    choose(Choice(topic="rear/points"))
    assert len(opened(bag)) == 2
    assert len(opened(bag, "/points")) == 3  # what a file's own name says goes before
    with pytest.raises(InputError, match="has no topic '/front' of point clouds; there are /points"):
        opened(bag, "/front")


def test_connections_of_one_topic_are_one_topic(tmp_path):
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(tmp_path / "a.bag") as writer:
        for caller in ("/first", "/second"):  # the driver was started again
            connection = writer.add_connection("/points", CLOUD, typestore=store, callerid=caller)
            for one in clouds(2, make=ros1_cloud):
                writer.write(connection, one.time_ns + 2 * PERIOD_NS * (caller == "/second"), one.content)
    found = opened(tmp_path / "a.bag")
    assert len(found) == 4
    assert found.topics == (("/points", 4),)
    assert [len(table) for table in found.tables()] == [40, 41, 40, 41]


def test_a_cloud_for_each_return_is_merged(tmp_path):
    one = {**columns(32), "t": np.arange(32, dtype=np.uint32)}
    del one["timestamp"]
    two = {**one, "x": one["x"] + np.float32(5)}
    messages = [Message("/ouster/points", CLOUD, START_NS, cdr_cloud(one)),
                Message("/ouster/points2", CLOUD, START_NS + 5, cdr_cloud(two))]  # fmt: skip
    bag = write_ros2(tmp_path / "a", messages)
    with pytest.raises(InputError, match=r"both returns as one: --topic /ouster/points\+/ouster/points2"):
        opened(bag)
    table = opened(bag, "/ouster/points+/ouster/points2").read(0)
    assert np.array_equal(table.columns["EchoNumber"], np.repeat([1, 2], 32))
    assert np.array_equal(table.columns["x"], np.concatenate([one["x"], two["x"]]))


def test_the_messages_time_is_the_start_of_its_frame(tmp_path):
    bag = opened(write_ros2(tmp_path / "a", clouds(1)))
    assert bag.read(0).stamp_s == pytest.approx(START_NS * 1e-9)
    assert clouds_of(bag.read(0))[0].stamp_s == bag.read(0).stamp_s


QUARTER = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
TREE = transforms_message(
    [("base_link", "mast", (1.0, 0.0, 0.5), (0, 0, 0, 1)), ("mast", "lidar_top", (0.0, 0.2, 1.0), QUARTER)]
)


def transformed(tmp_path, frame, tree=TREE):
    static = Message("/tf_static", "tf2_msgs/msg/TFMessage", START_NS, tree)
    return write_ros2(tmp_path / f"of_{frame}", [static, *clouds(2, frame=frame)])


def test_a_static_transform_takes_the_clouds_of_a_vehicle_to_its_lidar(tmp_path, caplog):
    bag = opened(transformed(tmp_path, "base_link"))
    assert bag.notes == ("the clouds are taken from base_link into lidar_top by the bag's static transform",)
    assert "static transform" in caplog.text
    own, table = columns(40, 0), bag.read(0)
    # The lidar looks to the vehicle's left: its x is the vehicle's y, its y is minus the vehicle's x.
    assert table.columns["x"] == pytest.approx(own["y"].astype(float) - 0.2)
    assert table.columns["y"] == pytest.approx(1.0 - own["x"].astype(float))
    assert table.columns["z"] == pytest.approx(own["z"].astype(float) - 1.5)


def test_clouds_in_their_sensors_frame_are_not_transformed(tmp_path):
    bag = opened(transformed(tmp_path, "lidar_top"))
    assert bag.notes == ()
    assert np.array_equal(bag.read(0).columns["x"], columns(40, 0)["x"])
    choose(Choice(frame="mast"))
    assert opened(transformed(tmp_path, "base_link")).read(0).columns["x"] == pytest.approx(
        columns(40, 0)["x"].astype(float) - 1.0
    )


def test_a_bag_of_several_files_has_its_transforms_in_the_first(tmp_path):
    first = transformed(tmp_path, "base_link")
    second = write_ros2(tmp_path / "more", clouds(2, frame="base_link")).rename(first.with_name("of_base_link_1.mcap"))
    frames = frames_in(first.parent)
    assert [frame.path for frame in frames] == [first, first, second, second]
    assert frames[2].read().columns["y"] == pytest.approx(1.0 - columns(40, 0)["x"].astype(float))


def test_what_no_transform_tells_is_said(tmp_path):
    two = transforms_message([("base_link", f"lidar_{n}", (1, int(n), 0), (0, 0, 0, 1)) for n in "12"])
    bag = opened(transformed(tmp_path, "base_link", two))
    words = (
        "the clouds are in base_link, a frame of the vehicle; name the sensor's with --sensor-frame: lidar_1, lidar_2"
    )
    assert bag.notes == (words,)
    choose(Choice(frame="roof"))
    with pytest.raises(InputError, match="no static transform leads from 'base_link', the clouds' frame, to 'roof'"):
        opened(tmp_path / "of_base_link" / "of_base_link.mcap")


def test_two_sensors_on_one_topic_are_refused(tmp_path):
    bag = write_ros2(
        tmp_path / "a", [*clouds(2), *[m._replace(time_ns=m.time_ns + 1) for m in clouds(1, frame="rear")]]
    )
    with pytest.raises(
        InputError, match="holds clouds of two sensors: the first is in the frame 'lidar', cloud 1 in 'rear'"
    ):
        opened(bag)


@pytest.mark.parametrize("kind", ["mcap", "mcap, chunks of zstd", "ros 1", "ros 1, lz4", "sqlite"])
def test_a_bag_cut_short_is_read_as_far_as_it_is_whole(kind, tmp_path):
    make = ros1_cloud if "ros 1" in kind else cdr_cloud
    many = [Message("/points", CLOUD, START_NS + n, make(columns(3000, n))) for n in range(60)]
    compression = "storage" if "zstd" in kind else "lz4" if "lz4" in kind else ""
    if "ros 1" in kind:
        bag = write_ros1(tmp_path / "a.bag", many, compression=compression)
    else:
        bag = write_ros2(tmp_path / "a", many, compression=compression, storage="db3" if kind == "sqlite" else "mcap")
    whole = bag.read_bytes()
    bag.write_bytes(whole[: int(len(whole) * 0.6)])
    found = opened(bag)
    assert 10 < len(found) < 50
    assert "cut short" in found.notes[0]
    assert np.array_equal(found.read(len(found) - 1).columns["x"], columns(3000, len(found) - 1)["x"])
    assert "cut short" in str(describe(bag))


def test_packets_are_named_with_the_tool_that_decodes_them(tmp_path):
    one = Message("/velodyne_packets", PACKETS, START_NS, bytes(100))
    ours = Message("/lidar_packets", "ouster_sensor_msgs/msg/PacketMsg", START_NS, bytes(100))
    with pytest.raises(
        InputError, match=r"packets of a Velodyne \(1 on /velodyne_packets\) and no point cloud; make Poi"
    ):
        opened(write_ros2(tmp_path / "a", [one]))
    with pytest.raises(InputError, match=r"packets of an Ouster .* with ouster-ros \(replay\), or ouster-cli"):
        opened(write_ros2(tmp_path / "b", [ours]))
    with pytest.raises(InputError, match=r"holds no point cloud; its topics are /x \(std_msgs/Nothing\)"):
        opened(write_ros2(tmp_path / "c", [Message("/x", "std_msgs/msg/Nothing", START_NS, b"\0\1\0\0")]))


@pytest.mark.parametrize(
    ("name", "whose"), [("vlp32_packets.db3", "a Velodyne (5"), ("ouster_512x10_packets.bag", "an Ouster (32")]
)
def test_real_recordings_of_packets(name, whose):
    with pytest.raises(InputError) as error:
        opened(shared_path(f"data/bags/{name}"))
    assert f"packets of {whose}" in str(error.value)
    assert "\n" not in str(error.value)


def test_an_unknown_compression_is_named(tmp_path):
    bag = write_ros2(tmp_path / "a", clouds(), compression="storage")
    content = bag.read_bytes()
    assert content.count(struct.pack("<I", 4) + b"zstd") >= 2
    bag.write_bytes(content.replace(struct.pack("<I", 4) + b"zstd", struct.pack("<I", 4) + b"brot"))
    with pytest.raises(
        InputError, match="the chunks are compressed with 'brot', which is not known; write it again with"
    ):
        opened(bag)


@pytest.mark.parametrize("cdr", [True, False])
def test_livox_custom_messages_are_decoded(cdr, tmp_path):
    rows = [(n * 1000, 1.0 + n, 2.0, 3.0, 10 + n, 0x10, n % 6) for n in range(50)]
    one = Message("/livox/lidar", "livox_ros_driver2/msg/CustomMsg", START_NS, custom_message(rows, cdr=cdr))
    bag = write_ros2(tmp_path / "a", [one]) if cdr else write_ros1(tmp_path / "a.bag", [one])
    table = read_table(bag)
    assert table.names == ("offset_time", "x", "y", "z", "reflectivity", "tag", "line")
    assert np.array_equal(table.columns["offset_time"], np.arange(50) * 1000)
    assert np.array_equal(table.columns["x"], 1.0 + np.arange(50))
    assert np.array_equal(table.columns["line"], np.arange(50) % 6)


def test_ranges_are_in_metres_whatever_the_driver_calls_them(tmp_path):
    own = {**columns(40), "range": np.full(40, 12_345, np.uint32)}
    bag = opened(write_ros2(tmp_path / "a", [Message("/points", CLOUD, START_NS, cdr_cloud(own))]))
    assert bag.read(0).columns["RANGE"] == pytest.approx(np.full(40, 12.345))
    assert bag.notes == ("read range (whole mm) as RANGE in metres",)


def test_a_database_that_is_no_bag(tmp_path):
    path = tmp_path / "a.db3"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE x (y)")
    database.close()
    with pytest.raises(InputError, match="an SQLite database without the tables of a ROS 2 bag"):
        opened(path)


def test_a_message_that_is_none_says_which(tmp_path):
    bag = write_ros2(tmp_path / "a", [*clouds(1), Message("/points", CLOUD, START_NS + 9, b"\0\1\0\0" + bytes(30))])
    with pytest.raises(InputError, match="a message is damaged: it ends too early"):
        opened(bag)
    with pytest.raises(InputError, match="its head is none of CDR"):
        cloud_of(b"\0\3\0\0", "cdr", Path("a"))
    with pytest.raises(InputError, match="encoded as 'json'"):
        cloud_of(b"{}", "json", Path("a"))
