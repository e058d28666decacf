"""Frames of a bag: the messages of one topic of point clouds, and the static transform to the sensor's frame."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.assign.returns import merged_returns
from lidarcheck.formats.field import packets, transforms
from lidarcheck.formats.field.choice import chosen
from lidarcheck.formats.field.clouds import Cloud, cloud_of, custom_of
from lidarcheck.formats.field.container import (
    CLOUD,
    CUSTOM,
    SENSOR_DATA,
    TRANSFORMS,
    Container,
    Place,
    Topic,
)
from lidarcheck.formats.field.db3 import read_db3
from lidarcheck.formats.field.drivers import known_fields
from lidarcheck.formats.field.mcap import read_mcap
from lidarcheck.formats.field.packing import is_zstd, zstd_message
from lidarcheck.formats.field.recording import Recording
from lidarcheck.formats.field.rosbag import read_rosbag
from lidarcheck.formats.table import Table, counted, quoted

__all__ = ["choose_topic", "open_bag", "open_container"]

_READERS: Mapping[str, Callable[[Path], Container]] = {"mcap": read_mcap, "rosbag": read_rosbag, "db3": read_db3}
_LOOKED_AT = 3
"""So many clouds are looked into when a bag is opened, to see that all are of one sensor."""
_MOST_LISTED = 12
_log = logging.getLogger(__name__)


def open_container(path: Path, kind: str) -> Container:
    """The topics of a bag and the places of their messages in order of time."""
    bag = _READERS[kind](path)
    _join_connections(bag)
    for places in bag.places.values():
        places.sort()
    return bag


def _join_connections(bag: Container) -> None:
    """Make one topic of those with one name and type: each publisher, and each start of one, has its own number."""
    first: dict[tuple[str, str, str], int] = {}
    for number, topic in list(bag.topics.items()):
        own = first.setdefault((topic.name, topic.kind, topic.encoding), number)
        if own != number:
            bag.counts[own] = bag.counts.get(own, 0) + bag.counts.pop(number, 0)
            bag.places.setdefault(own, []).extend(bag.places.pop(number, []))
            del bag.topics[number]


@dataclass
class _Bag(Recording):
    """`frame`: of the clouds; `turn`: what takes their positions into the sensor's frame, None where nothing does.

    `others`: the places of clouds of further returns.
    """

    bag: Container = field(default_factory=lambda: Container(Path(), ""))
    of: Topic = field(default_factory=lambda: Topic(0, "", "", ""))
    places: Sequence[Place] = ()
    frame: str = ""
    turn: tuple[FloatArray, FloatArray] | None = None
    others: tuple[Sequence[Place], ...] = ()

    def __len__(self) -> int:
        return len(self.places)

    def cloud(self, number: int, place: Place | None = None) -> Cloud:
        """The message of a frame; `place`: that of another return."""
        content = self.bag.message(place or self.places[number])
        if is_zstd(content):
            content = zstd_message(content, self.path)
        read = cloud_of if self.of.kind == CLOUD else custom_of
        return read(content, self.of.encoding, self.path)

    def table(self, number: int) -> Table:
        """The rows of a frame; `InputError` where they are another sensor's."""
        cloud = self.cloud(number)
        if cloud.frame != self.frame:
            raise self.two_sensors(number, cloud.frame)
        columns, _ = known_fields(cloud.columns)
        if self.others:
            columns = self._with_returns(number, columns)
        height = 1 if self.others else cloud.height
        return _turned(Table(columns, self.path, height=height, stamp_s=cloud.stamp_ns * 1e-9), self.turn)

    def _with_returns(self, number: int, columns: dict[str, Any]) -> dict[str, Any]:
        """The rows of all returns, numbered by their clouds."""
        time_ns = self.places[number].time_ns
        clouds = [columns]
        for places in self.others:
            place = min(places, key=lambda place: abs(place.time_ns - time_ns))
            clouds.append(known_fields(self.cloud(number, place).columns)[0])
        try:
            merged = merged_returns(clouds)
        except UsageError as error:
            raise InputError(error.what, file=self.path, fix=error.fix) from None
        return {"EchoNumber" if name == "return" else name: column for name, column in merged.items()}

    def two_sensors(self, number: int, other: str) -> InputError:
        """The error for clouds of two frames on one topic."""
        what = f"the topic {self.topic} holds clouds of two sensors: the first is in the frame {quoted(self.frame)}, "
        what += f"cloud {number} in {quoted(other)}"
        return InputError(what, file=self.path, fix="record each sensor on a topic of its own")


def _turned(table: Table, turn: tuple[FloatArray, FloatArray] | None) -> Table:
    """The table with X, Y, Z in the sensor's frame; a row without a return, (0, 0, 0), has no place and stays."""
    axes = [table.get(name) for name in "XYZ"]
    if turn is None or any(axis is None for axis in axes):
        return table
    xyz = np.stack([np.asarray(axis, dtype=np.float64) for axis in axes], axis=-1)
    nothing = (xyz == 0.0).all(axis=1)
    rotation, move = turn
    placed = np.where(nothing[:, None], 0.0, xyz @ rotation.T + move)
    for name, column in zip("XYZ", placed.T, strict=True):
        table = table.with_column(name, np.ascontiguousarray(column))
    return table


def open_bag(path: Path, kind: str, topic: str = "") -> Recording:
    """The clouds of a bag's topic, or of several that hold a return each, with a plus between.

    `InputError` where the bag has none, or several of which none is chosen.
    """
    bag = open_container(path, kind)
    if bag.of_kind(SENSOR_DATA):
        from lidarcheck.formats.field.osi import open_osi_channel

        if not bag.of_kind(CLOUD, CUSTOM) or any(one.name == topic for one in bag.of_kind(SENSOR_DATA)):
            return open_osi_channel(bag, topic)
    found = bag.of_kind(CLOUD, CUSTOM)
    if not found:
        raise packets.no_cloud(path, bag.title, bag.topics.values(), bag.counts)
    name, *returns = (topic or chosen().topic).split("+")
    own = choose_topic(bag, found, name)
    others = [choose_topic(bag, found, one) for one in returns]
    places = bag.places.get(own.number, [])
    if not all(bag.places.get(one.number) for one in (own, *others)):
        raise bag.damaged(f"nothing says what the messages of {own.name} are")
    start_ns = places[0].time_ns
    opened = _Bag(
        path=path,
        title=bag.title,
        topic="+".join(one.name for one in (own, *others)),
        times_s=tuple((place.time_ns - start_ns) * 1e-9 for place in places),
        topics=tuple((one.name, bag.counts[one.number]) for one in found),
        start_ns=start_ns,
        bag=bag,
        of=own,
        places=places,
        others=tuple(bag.places[one.number] for one in others),
    )
    _look_into(opened)
    for note in opened.notes:
        _log.warning("%s: %s", path, note)
    return opened


def choose_topic(bag: Container, found: Sequence[Topic], topic: str = "") -> Topic:
    """The topic that is named, else the only one. `InputError` lists them where that chooses none."""
    wanted = topic or chosen().topic
    of_name = [one for one in found if one.name == wanted or one.name.lstrip("/") == wanted.lstrip("/")]
    if wanted and len(of_name) == 1:
        return of_name[0]
    listed = [f"{one.name} ({counted(bag.counts[one.number], 'frame')})" for one in found]
    more = f" and {len(listed) - _MOST_LISTED} more" if len(listed) > _MOST_LISTED else ""
    said = ", ".join(listed[:_MOST_LISTED]) + more
    fix = f"choose one: --topic {found[0].name}, or '{bag.path}#{found[0].name}'"
    second = next((one.name for one in found if one.name == f"{found[0].name}2"), "")
    if second:  # as Ouster's driver calls the cloud of second returns
        fix += f"; both returns as one: --topic {found[0].name}+{second}"
    if wanted:
        what = f"has no topic {quoted(wanted)} of point clouds" if not of_name else f"{quoted(wanted)} names several"
        raise InputError(f"{what}; there are {said}", file=bag.path, fix=fix)
    if len(found) > 1:
        raise InputError(f"holds point clouds on {len(found)} topics: {said}", file=bag.path, fix=fix)
    return found[0]


def _look_into(opened: _Bag) -> None:
    """Note the clouds' frame, what takes them into the sensor's, and what was done to their fields."""
    bag, notes = opened.bag, [opened.bag.lost] if opened.bag.lost else []
    first = opened.cloud(0)
    opened.frame = first.frame
    for number in range(1, min(_LOOKED_AT, len(opened))):
        other = opened.cloud(number)
        if other.frame != opened.frame:
            raise opened.two_sensors(number, other.frame)
    _, said = known_fields(first.columns)
    notes += [f"read {words}" for words in said]
    tree = transforms.Tree()
    if first.frame.lstrip("/") in transforms.VEHICLE_FRAMES or chosen().frame:
        for part in [bag, *_other_parts(bag)]:
            _read_static(tree, part)
    opened.turn, words = _turn(tree, opened.frame, bag.path)
    opened.notes = tuple([*notes, words] if words else notes)


def _read_static(tree: transforms.Tree, bag: Container) -> None:
    """Add the static transforms of a bag's file."""
    for topic in bag.of_kind(*TRANSFORMS):
        if topic.name.rstrip("/").endswith("tf_static"):
            for place in bag.places.get(topic.number, []):
                transforms.read_transforms(tree, bag.message(place), topic.encoding, bag.path)


def _other_parts(bag: Container) -> list[Container]:
    """The other files of a ROS 2 bag that was recorded into several: its first one alone has the static transforms."""
    folder, suffix = bag.path.parent, bag.path.suffix
    if not (folder / "metadata.yaml").is_file() or suffix not in (".mcap", ".db3"):
        return []
    others = sorted(path for path in folder.glob(f"*{suffix}") if path.name != bag.path.name)
    return [open_container(path, suffix[1:]) for path in others]


def _turn(tree: transforms.Tree, frame: str, path: Path) -> tuple[tuple[FloatArray, FloatArray] | None, str]:
    """What takes the clouds into the sensor's frame, and what to say of it."""
    own, wanted = frame.lstrip("/"), chosen().frame.lstrip("/")
    candidates = [wanted] if wanted else transforms.sensor_frames(tree, own)
    if wanted and wanted != own and tree.between(own, wanted) is None:
        known = ", ".join(sorted(tree.steps)[:_MOST_LISTED]) or "none"
        what = f"no static transform leads from {quoted(own)}, the clouds' frame, to {quoted(wanted)}"
        raise InputError(what, file=path, fix=f"name one of its frames ({known}), or give --pose")
    if len(candidates) != 1 or candidates[0] == own:
        if own in transforms.VEHICLE_FRAMES and not wanted:
            told = (
                f"; name the sensor's with --sensor-frame: {', '.join(candidates)}" if candidates else "; give --pose"
            )
            return None, f"the clouds are in {own}, a frame of the vehicle{told}"
        return None, ""
    turn = tree.between(own, candidates[0])
    return turn, f"the clouds are taken from {own} into {candidates[0]} by the bag's static transform"
