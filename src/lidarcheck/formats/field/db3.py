"""ROS 2 bags in SQLite (`.db3`): a table of topics and one of messages.

Of a file that was cut short the messages before the first damaged page are read.
"""

from __future__ import annotations

import contextlib
import sqlite3
import urllib.parse
from collections.abc import Iterator
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.formats.field.container import Container, Place, Topic, plain_kind
from lidarcheck.formats.field.packing import CHUNK_BYTES, is_zstd, zstd_message

__all__ = ["MAGIC", "read_db3"]

MAGIC = b"SQLite format 3\0"
_MOST_STEPS = 2_000_000_000
"""Steps of the database's own machine, of which reading a message takes a few hundred: no bag asks for more."""


class _Database(Container):
    def __init__(self, path: Path) -> None:
        super().__init__(path, "ROS 2 bag")

    def message(self, place: Place) -> bytes:
        """A message's content, unpacked where the recorder packed each by itself."""
        with _opened(self) as database:
            row = database.execute(
                "SELECT length(data), data FROM messages WHERE rowid = ? AND length(data) <= ?", (place.at, CHUNK_BYTES)
            ).fetchone()
        if row is None or not isinstance(row[1], bytes):
            raise self.damaged(f"message {place.at} is not there, or longer than {CHUNK_BYTES} bytes")
        content = bytes(row[1])
        return zstd_message(content, self.path) if is_zstd(content) else content


def read_db3(path: Path) -> Container:
    """The topics of a database and the places of their messages.

    `InputError` for a database that is no bag, or damaged before its first message.
    """
    bag = _Database(path)
    with _opened(bag) as database:
        tables = {row[0] for row in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {"topics", "messages"} <= tables:
            what = "the file is an SQLite database without the tables of a ROS 2 bag"
            raise InputError(what, file=path, fix="name the .db3 file of a bag")
        for number, name, kind, encoding in database.execute("SELECT id, name, type, serialization_format FROM topics"):
            if not all(isinstance(text, str) for text in (name, kind, encoding)) or not isinstance(number, int):
                raise bag.damaged("a topic without a name")
            bag.topics[number] = Topic(number, name, plain_kind(kind), encoding)
        _note_messages(bag, database)
    if bag.lost:
        _drop_torn(bag)
    left = path.with_name(path.name + "-wal")
    if not bag.lost and left.is_file() and left.stat().st_size:
        bag.lost = f"the recorder did not close it: messages in {left.name} are not read"
    return bag


def _note_messages(bag: _Database, database: sqlite3.Connection) -> None:
    try:
        for row, topic, time_ns in database.execute("SELECT rowid, topic_id, timestamp FROM messages"):
            if not isinstance(topic, int) or not isinstance(time_ns, int):
                raise bag.damaged("a message without a time or topic")
            bag.note(time_ns, topic, row, -1)
    except sqlite3.DatabaseError as error:
        if not sum(bag.counts.values()):
            raise
        bag.lost = f"cut short ({error}): only the messages before that are used"


def _drop_torn(bag: _Database) -> None:
    """Take out the last messages, whose rows are there and whose content is not."""
    for topic, places in bag.places.items():
        while places:
            try:
                bag.message(places[-1])
                break
            except InputError:
                places.pop()
        bag.counts[topic] = len(places)


@contextlib.contextmanager
def _opened(bag: _Database) -> Iterator[sqlite3.Connection]:
    """The database, which nothing writes; errors as a user is told."""
    place = urllib.parse.quote(str(bag.path.absolute()))
    try:
        database = sqlite3.connect(f"file:{place}?mode=ro&immutable=1", uri=True)
    except sqlite3.Error as error:
        raise InputError(f"cannot be read: {error}", file=bag.path) from None
    steps = 0

    def stop() -> int:
        nonlocal steps
        steps += 1_000_000
        return int(steps > _MOST_STEPS)

    try:
        database.text_factory = lambda content: content.decode("utf-8", "replace")
        database.set_progress_handler(stop, 1_000_000)
        database.execute("PRAGMA trusted_schema = OFF")
        # Else nothing is read of a file that has fewer pages than it says. It is open for reading alone.
        database.execute("PRAGMA writable_schema = ON")
        yield database
    except (sqlite3.Error, OverflowError) as error:
        raise bag.damaged(str(error)) from None
    finally:
        database.close()
