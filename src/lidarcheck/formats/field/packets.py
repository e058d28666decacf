"""Recordings of a sensor's raw packets: recognised, with the tool that turns them into clouds. None is decoded here."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.formats.field.container import Topic

__all__ = ["cloud_tool", "no_cloud", "packet_file"]

_TOOLS = (
    ("velodyne", "a Velodyne", "velodyne_pointcloud's transform node, or the package velodyne-decoder"),
    ("ouster", "an Ouster", "ouster-ros (replay), or ouster-cli source FILE save out.bag"),
    ("nebula", "a sensor that nebula reads", "nebula_ros' launch file with launch_hw:=false"),
    ("pandar", "a Hesai", "nebula_ros with launch_hw:=false, or hesai_ros_driver_node"),
    ("hesai", "a Hesai", "hesai_ros_driver_node with source_type 3, or nebula_ros with launch_hw:=false"),
    ("robosense", "a RoboSense", "rslidar_sdk with msg_source 2"),
    ("rslidar", "a RoboSense", "rslidar_sdk with msg_source 2"),
    ("livox", "a Livox", "livox_ros_driver2 with xfer_format 0"),
    ("seyond", "a Seyond", "seyond_ros_driver"),
    ("continental", "a Continental", "nebula_ros with launch_hw:=false"),
)
"""Part of a message type's or topic's name, whose packets these are, and what makes clouds of them."""

_FILES = {
    ".pcap": ("a packet capture", "the vendor's tool: ouster-cli source FILE save out.bag, PandarView, VeloView"),
    ".pcapng": ("a packet capture", "the vendor's tool, once `editcap -F pcap` has made a .pcap of it"),
    ".osf": ("an Ouster recording", "ouster-cli source FILE save out.bag (or out.pcd)"),
    ".lvx": ("a Livox recording", "Livox Viewer: Export as LAS or CSV"),
    ".lvx2": ("a Livox recording", "Livox Viewer 2: Export as LAS or PCD"),
    ".rxp": ("a RIEGL recording", "RIEGL's RiSCAN PRO: export as LAS"),
}
_PCAP = (b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\xa1\xb2\x3c\x4d")
_PCAPNG = b"\x0a\x0d\x0d\x0a"


def packet_file(start: bytes, path: Path) -> InputError | None:
    """The error for a file of packets, by how it begins or, for formats without a mark, by its suffix."""
    suffix = path.suffix.lower()
    if start.startswith(_PCAP):
        suffix = ".pcap"
    elif start.startswith(_PCAPNG):
        suffix = ".pcapng"
    elif start.startswith(b"livox_tech"):
        suffix = ".lvx2" if suffix == ".lvx2" else ".lvx"
    elif start[4:8] == b"OSF!" or start[8:12] == b"OSF!":
        suffix = ".osf"
    elif suffix not in (".osf", ".rxp", ".lvx", ".lvx2"):
        return None
    kind, tool = _FILES[suffix]
    what = f"the file is {kind}, packets and no point cloud"
    return InputError(what, file=path, fix=f"make clouds of it with {tool}")


def cloud_tool(topics: Iterable[Topic]) -> tuple[Topic, str, str] | None:
    """The first topic that holds a sensor's packets, whose they are, and what makes clouds of them."""
    for topic in topics:
        told = f"{topic.kind} {topic.name}".casefold()
        if "imu" in told or ("packet" not in told and "scan" not in topic.kind.casefold()):
            continue
        for part, whose, tool in _TOOLS:
            if part in told:
                return topic, whose, tool
    return None


def no_cloud(path: Path, title: str, topics: Iterable[Topic], counts: dict[int, int]) -> InputError:
    """The error for a bag in which no topic holds point clouds."""
    listed = sorted(topics, key=lambda topic: topic.name)
    found = cloud_tool(topic for topic in listed if counts.get(topic.number))
    if found is not None:
        topic, whose, tool = found
        what = f"the {title} holds packets of {whose} ({counts[topic.number]} on {topic.name}) and no point cloud"
        return InputError(what, file=path, fix=f"make PointCloud2 of them with {tool}, and record that")
    names = ", ".join(f"{topic.name} ({topic.kind or 'no type'})" for topic in listed[:8])
    more = f" and {len(listed) - 8} more" if len(listed) > 8 else ""
    what = f"the {title} holds no point cloud; its topics are {names}{more}" if listed else f"the {title} has no topic"
    return InputError(what, file=path, fix="record the topic of sensor_msgs/PointCloud2")
