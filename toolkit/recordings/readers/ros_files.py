"""Files of ROS messages: SQLite (`.db3`) by the standard library, and ROS 1 bags, mcap and ROS 2 folders by `rosbags`.
All have the same interface: topics with types, message times, and messages from any one on.
"""

from __future__ import annotations

import sqlite3
import weakref
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from toolkit.io.errors import RecordingError, optional_package
from toolkit.io.files import is_file
from toolkit.recordings.readers.base import damaged

BAG_SUFFIXES, SQLITE_SUFFIX = (".bag", ".mcap"), ".db3"
METADATA = "metadata.yaml"
"""Metadata file of a ROS 2 folder."""


class MessageFile(Protocol):
    """Messages by topic.

    Attributes
    ----------
    topics : topic -> type in the notation of ROS 1 without `msg/`, such as `sensor_msgs/Image`
    cdr : True for messages in the CDR encoding of ROS 2, False for those of ROS 1
    """

    topics: dict[str, str]
    cdr: bool

    def times(self, topic: str) -> np.ndarray:
        """Return the times (T,) of the messages of a topic, int64 nanoseconds, ascending."""
        ...

    def messages(self, topic: str, start: int = 0) -> Iterator[bytes]:
        """Yield the messages of a topic in the order of `times`, from number `start` on."""
        ...


def open_messages(path: Path) -> MessageFile:
    """Open a file or a ROS 2 folder.

    Raises
    ------
    RecordingError
        The file is damaged or of another kind.
    UsageError
        The file needs the package `rosbags`, which is not installed.
    """
    if is_file(path) and path.suffix.lower() == SQLITE_SUFFIX:
        return _SqliteMessages(path)
    return _BagMessages(path)


def _type_name(name: str) -> str:
    return name.replace("/msg/", "/")


class _SqliteMessages:
    """A `.db3` file of ROS 2 or of the RealSense SDK, read by the standard library."""

    cdr = True

    def __init__(self, path: Path) -> None:
        self._path = path
        with damaged(path):
            self._database = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)
            rows = self._database.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
            if any(form != "cdr" for *_, form in rows):
                raise RecordingError(f"{path} holds messages of another form than CDR; record it by ROS 2")
            self._ids = {str(name): int(number) for number, name, _, _ in rows}
            self.topics = {str(name): _type_name(str(kind)) for _, name, kind, _ in rows}

    def _rows(self, what: str, topic: str, start: int) -> Iterator[tuple[Any, ...]]:
        order = f"SELECT {what} FROM messages WHERE topic_id = ? ORDER BY timestamp, id LIMIT -1 OFFSET ?"
        with damaged(self._path):
            yield from self._database.execute(order, (self._ids[topic], start))

    def times(self, topic: str) -> np.ndarray:
        """See `MessageFile`."""
        with damaged(self._path):
            return np.array([row[0] for row in self._rows("timestamp", topic, 0)], dtype=np.int64)

    def messages(self, topic: str, start: int = 0) -> Iterator[bytes]:
        """See `MessageFile`."""
        for (data,) in self._rows("data", topic, start):
            if not isinstance(data, bytes):
                raise RecordingError(f"a message of {topic} in {self._path} is no bytes; record it again")
            yield data


def _close(reader: Any) -> None:
    """Close a reader of `rosbags`, unless one of its queries is still open; that one closes it."""
    with suppress(Exception):  # of the database that it uses
        reader.close()


class _BagMessages:
    """Reader by `rosbags`: ROS 1 bags, mcap files and ROS 2 folders, compressed ones too."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.cdr = path.suffix.lower() != ".bag"
        module = optional_package(f"rosbags.rosbag{2 if self.cdr else 1}", "ros", f"reading {path}")
        with damaged(path):
            self._reader: Any = module.Reader(path)
            self._reader.open()
            weakref.finalize(self, _close, self._reader)
            self.topics = {c.topic: _type_name(c.msgtype) for c in self._reader.connections}
            if not all(isinstance(topic, str) for topic in self.topics):
                raise ValueError("a topic has no name")

    def _connections(self, topic: str) -> list[Any]:
        return [c for c in self._reader.connections if c.topic == topic]

    def times(self, topic: str) -> np.ndarray:
        """See `MessageFile`; a ROS 1 bag has an index, other files are scanned once."""
        connections = self._connections(topic)
        with damaged(self._path):
            if not self.cdr:
                entries = (self._reader.indexes[c.id] for c in connections)
                return np.sort(np.array([entry.time for index in entries for entry in index], dtype=np.int64))
            return np.array([time for _, time, _ in self._reader.messages(connections)], dtype=np.int64)

    def messages(self, topic: str, start: int = 0) -> Iterator[bytes]:
        """See `MessageFile`."""
        connections, first, skipped = self._connections(topic), None, start
        if start:
            times = self.times(topic)
            if start >= len(times):
                return
            first = int(times[start])
            skipped = start - int(np.searchsorted(times, first))  # messages with equal times
        with damaged(self._path):
            for k, (_, _, data) in enumerate(self._reader.messages(connections, start=first)):
                if k >= skipped:
                    yield bytes(data)
