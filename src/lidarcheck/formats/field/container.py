"""What bags of all kinds have in common: topics, the places of their messages, and the messages themselves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from lidarcheck.errors import InputError

__all__ = ["CLOUD", "CUSTOM", "KEPT", "SENSOR_DATA", "TRANSFORMS", "Container", "Place", "Topic", "plain_kind"]

CLOUD = "sensor_msgs/PointCloud2"
CUSTOM = "CustomMsg"
"""Of a Livox driver, whatever its package is called."""
TRANSFORMS = ("tf2_msgs/TFMessage", "tf/tfMessage")
SENSOR_DATA = "osi3.SensorData"
KEPT = (CLOUD, *TRANSFORMS, SENSOR_DATA)
"""Messages whose places are kept; of all others only the number."""


class Place(NamedTuple):
    """Where a message stands. `at`: byte of its chunk or of its record, or its number in a table of messages.

    `within`: byte in the unpacked chunk, -1 of a message that stands in the file itself. `topic`: number of its topic.
    """

    time_ns: int
    topic: int
    at: int
    within: int


@dataclass(frozen=True)
class Topic:
    """A topic of a bag. `kind`: its messages' type, without `/msg/`; `encoding`: how they are written."""

    number: int
    name: str
    kind: str
    encoding: str

    @property
    def kept(self) -> bool:
        """Whether its messages are something that lidarcheck reads."""
        return self.kind in KEPT or self.kind.rpartition("/")[2] == CUSTOM


@dataclass
class Container:
    """A bag's file. `topics` by their numbers, `counts` of all messages, `places` of those that are read, by topic.

    `lost`: what is missing of a bag that was cut short, in words.
    """

    path: Path
    title: str
    topics: dict[int, Topic] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    places: dict[int, list[Place]] = field(default_factory=dict)
    lost: str = ""

    def message(self, place: Place) -> bytes:
        """The message that stands at a place."""
        raise NotImplementedError

    def note(self, time_ns: int, topic: int, at: int, within: int) -> None:
        """A message was found; its place is kept where it is one that is read."""
        self.counts[topic] = self.counts.get(topic, 0) + 1
        known = self.topics.get(topic)
        if known is not None and known.kept:
            self.places.setdefault(topic, []).append(Place(time_ns, topic, at, within))

    def of_kind(self, *kinds: str) -> list[Topic]:
        """The topics of these kinds that have messages, by name; `CUSTOM` in any package."""
        found = [topic for topic in self.topics.values() if self.counts.get(topic.number)]
        return sorted(
            (topic for topic in found if topic.kind in kinds or topic.kind.rpartition("/")[2] in kinds),
            key=lambda topic: topic.name,
        )

    def damaged(self, what: str) -> InputError:
        """The error for a file that contradicts itself."""
        what = f"the {self.title} is damaged: {what}"
        return InputError(what, file=self.path, fix="record it again, or cut it there")

    def read(self, at: int, count: int) -> bytes:
        """So many bytes of the file; `InputError` where it has fewer."""
        try:
            with self.path.open("rb") as stream:
                stream.seek(at)
                found = stream.read(count)
        except (OSError, ValueError) as error:
            raise InputError(f"cannot be read: {error}", file=self.path) from None
        if len(found) < count:
            raise self.damaged(f"{count} bytes at {at} reach beyond its end")
        return found


def plain_kind(kind: str) -> str:
    """A type's name as both ROS write it: `sensor_msgs/PointCloud2`."""
    return kind.replace("/msg/", "/")


def cut_words(size: int, whole: int, messages: Iterable[int]) -> str:
    """How much of a file that was cut short is whole."""
    lost = size - whole
    return f"cut short: its last {lost} bytes are no whole record, {sum(messages)} messages before them are used"
