"""ROS 2 bags through the package rosbags: bags other than a single MCAP file, and open readers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from btr import _btr
from btr._btr import BtrError, Log

# Message types to read; others (images) are not copied from the bag.
READ = {"JointState", "JointTrajectory", "Imu", "Float64MultiArray"}


def is_bag(path: Path) -> bool:
    """Whether this is the folder of a bag other than a single MCAP file (btr reads that one without rosbags)."""
    if not (path / "metadata.yaml").is_file():
        return False
    return len(list(path.glob("*.mcap"))) != 1 or any(path.glob("*.db3"))


def is_reader(source: Any) -> bool:
    """Whether this is a reader of rosbags."""
    return type(source).__module__.partition(".")[0] == "rosbags" and hasattr(source, "messages")


def load_bag(path: Path, model: _btr.Model | None) -> Log:
    """The log of a bag's folder. Raises `BtrError` if rosbags is not installed or cannot read the bag."""
    try:
        from rosbags.rosbag2 import Reader, ReaderError
    except ImportError:
        raise BtrError(f"{path}: a bag that needs the package rosbags\nhelp: pip install rosbags") from None
    try:
        with Reader(path) as reader:
            return read(reader, str(path), model)
    except ReaderError as error:
        raise BtrError(f"{path}: {error}\nhelp: check that it was closed and copied as a whole") from error


def read(reader: Any, name: str | None, model: _btr.Model | None) -> Log:
    """The log of a reader of rosbags: joint states and the other messages in `READ`, as for an MCAP file. Raises
    `BtrError` for a reader that is not open and for a bag without joint states."""
    if name is None:
        paths = getattr(reader, "paths", None) or [getattr(reader, "path", "bag")]
        name = str(paths[0])
    if not reader.connections:
        raise BtrError(f"{name}: no topics, or not open\nhelp: open the reader first: with AnyReader([...]) as reader")
    # A bag of several files has one connection per file for the same topic.
    topics = [(c.topic, c.msgtype, getattr(c.ext, "serialization_format", "ros1")) for c in reader.connections]
    selected = [c for c in reader.connections if c.msgtype.rpartition("/")[2] in READ]
    numbers = {id(connection): k for k, connection in enumerate(reader.connections)}
    # For an empty list of connections, rosbags would return all messages.
    raw = reader.messages(connections=selected) if selected else ()
    messages = ((numbers[id(connection)], stamp_ns, bytes(data)) for connection, stamp_ns, data in raw)
    return _btr.log_of_messages(Path(name), topics, messages, model)
