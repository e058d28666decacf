"""Valid small bags, traces and point files of the field, each with the function by which a command reads it."""

from __future__ import annotations

import struct
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from bag_kit import CLOUD, START_NS, Message, cdr_cloud, custom_message, ros1_cloud, transforms_message
from bag_kit import write_ros1 as ros1
from bag_kit import write_ros2 as ros2
from lidarcheck.cases.dataset import load_dataset
from lidarcheck.cases.source import frames_in, scan_of
from lidarcheck.formats.convert import describe

__all__ = ["field_seeds", "read_frames", "seeds"]

Made = tuple[str, bytes, Callable[[Path], object]]
ROWS = 48
DATASET = """[dataset]
sensor = "SLIM"
mask = "mask.csv"

[[frames]]
measured = "a.txt"
ideal = "ideal.txt"
distance_m = 30.0
class = "wall"
time = 0.0
repeat = 0
pose = {x_m = 0.0, yaw_deg = 0.0}

[[frames]]
measured = "a.csv"
unit = "m"
"""


def read_frames(path: Path) -> None:
    """As `info`, then as a command that takes frames."""
    describe(path)
    for frame in frames_in(path):
        scan_of(frame)


def seeds(directory: Path) -> list[Any]:
    """These alone, for a run of the fuzz of nothing else."""
    from fuzz_seeds import seeds as all_seeds

    made = all_seeds(directory)
    first = next(at for at, one in enumerate(made) if one.name == "plain.mcap")
    return made[first:]


def field_seeds(directory: Path) -> list[Made]:
    """All of them, in a fixed order; made in `directory`."""
    place = directory / "field"
    place.mkdir(exist_ok=True)
    static = Message(
        "/tf_static",
        "tf2_msgs/msg/TFMessage",
        START_NS,
        transforms_message([("base_link", "lidar", (1, 0, 2), (0, 0, 0, 1))]),
    )
    two = [
        Message("/points", CLOUD, START_NS + n, cdr_cloud(_columns(), frame="base_link", padding=1)) for n in range(2)
    ]
    older = [Message("/points", CLOUD, START_NS + n, ros1_cloud(_columns(), height=6)) for n in range(2)]
    livox = Message(
        "/livox",
        "livox_ros_driver2/msg/CustomMsg",
        START_NS,
        custom_message([(n, 9, n, 0, 1, 16, 2) for n in range(9)]),
    )
    packets = Message("/velodyne_packets", "velodyne_msgs/msg/VelodyneScan", START_NS, bytes(60))
    bags = {
        "plain.mcap": ros2(place / "a", [static, *two]),
        "packed.mcap": ros2(place / "b", [livox], compression="storage"),
        "a.db3": ros2(place / "c", [*two[:1], packets], storage="db3"),
        "packed.db3": ros2(place / "d", two[:1], storage="db3", compression="message"),
        "plain.bag": ros1(place / "a.bag", older),
        "bz2.bag": ros1(place / "b.bag", older, compression="bz2"),
        "lz4.bag": ros1(place / "c.bag", older, compression="lz4"),
        "packets.bag": ros1(place / "d.bag", [packets]),
        "a.e57": _e57(place / "a.e57"),
    }
    (directory / "mask.csv").write_text("Layer,Point\n250,470\n")
    rows = np.stack([*[np.linspace(-20, 20, 80)] * 3, np.full(80, 0.5)], axis=-1).astype("<f4")
    return [
        *[(name, path.read_bytes(), _refused if "packets" in name else read_frames) for name, path in bags.items()],
        ("a.osi", _osi(), read_frames),
        ("a.bin", rows.tobytes(), read_frames),
        ("a.pcap", b"\xd4\xc3\xb2\xa1\2\0\4\0" + bytes(60), _refused),
        ("dataset.toml", DATASET.encode(), _read_dataset),
    ]


def _read_dataset(path: Path) -> None:
    """As a command that takes its frames."""
    load_dataset(path)
    for frame in frames_in(path):
        scan_of(frame)


def _refused(path: Path) -> None:
    """Packets are never read; what is left of them when they are damaged may be."""
    from lidarcheck.errors import InputError

    try:
        read_frames(path)
    except InputError as error:
        if "and no point cloud" not in str(error):
            raise


def _columns() -> dict[str, Any]:
    rng = np.random.default_rng(7)
    xyz = {axis: rng.uniform(5, 20, ROWS).astype(np.float32) for axis in "xyz"}
    return {**xyz, "intensity": np.full(ROWS, 9, np.uint8), "t": np.arange(ROWS, dtype=np.uint32)}


def _osi() -> bytes:
    from osi3.osi_sensordata_pb2 import SensorData

    data = SensorData()
    lidar = data.feature_data.lidar_sensor.add()
    for number in range(12):
        one = lidar.detection.add()
        one.position.distance, one.position.azimuth, one.intensity = 9.0 + number, 0.01 * number, 40.0
    content = data.SerializeToString()
    return (struct.pack("<I", len(content)) + content) * 2


def _e57(path: Path) -> Path:
    import pye57

    with mock.patch("uuid.uuid4", return_value=uuid.UUID(int=7)), pye57.E57(str(path), "w") as file:
        rows = np.arange(12)
        data = {"cartesianX": 3.0 + rows, "cartesianY": rows / 2, "cartesianZ": np.zeros(12), "intensity": rows / 12}
        file.write_scan_raw(data | {"rowIndex": (rows // 6).astype("H"), "columnIndex": (rows % 6).astype("H")})
    return path
