"""ROS bags: readings of `sensor_msgs/Imu` by the stamps of their headers."""

from array import array
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from imuarray.errors import InputError, expecting, require
from imuarray.recording.layout import KINDS, read_layout, unit_of
from imuarray.recording.rig import Readings, Rig, pair, to_rig

ENDINGS = (".bag", ".mcap", ".db3")  # or a folder
MESSAGE = "sensor_msgs/msg/Imu"


def read_bags(
    paths: Sequence[str | PathLike],
    columns: str | PathLike | None = None,
    topics: Sequence[str] = (),
) -> Rig:
    """Bags of one rig, joined in time; ``columns`` is the YAML of docs/convert.md.

    ``topics`` are those to use, the reference first; by default all that the YAML has, in its
    order. InputError, with the topic, for anything that does not fit, and without `rosbags`.
    """
    bags = [Path(path) for path in paths]
    if columns is None:
        there = sorted({topic for path in bags for topic in _read(path)})
        raise InputError(
            "--columns: expected a YAML with noise, range and, under 'imus', the position of each"
            f" of {', '.join(there)}, found none"
        )
    layout, where = read_layout(columns, bag=True), str(columns)
    imus = _chosen(layout["imus"], topics, where)
    parts: dict[str, list] = {}
    for path in bags:
        for topic, part in _read(path).items():
            parts.setdefault(topic, []).append(part)
    read = {
        label: [
            _readings(parts, topic, kind, layout["imus"][label], where)
            for kind, topic in enumerate(of)
        ]
        for label, of in imus.items()
    }
    unused = sorted(set(parts).difference(*imus.values()))
    rig = to_rig(
        {label: layout["imus"][label] for label in imus}, read, layout, where,
        ", ".join(path.name for path in bags),
    )  # fmt: skip
    return rig._replace(lines=[*rig.lines, *(f"not used: {topic}" for topic in unused)])


def _chosen(imus: dict[str, dict], topics: Sequence[str], where: str) -> dict[str, list[str]]:
    """The topics of accelerometer and gyroscope of each IMU to use, in order."""
    named = {label: [str(t) for t in pair(imu.get("topic", label))] for label, imu in imus.items()}
    if not topics:
        return named
    found = {}
    for topic in topics:
        labels = [label for label, of in named.items() if topic in of]
        require(labels, where, f"an IMU of the topic {topic}", "none")
        found |= {label: named[label] for label in labels}
    return found


def _readings(parts: dict[str, list], topic: str, kind: int, imu, where: str) -> Readings:
    """One kind of a topic from all bags; each kind is three columns of what `_read` gives."""
    expected = f"a topic of {MESSAGE} among {', '.join(sorted(parts))}"
    require(topic in parts, where, expected, repr(topic))
    joined = sorted(parts[topic], key=lambda part: part[0][0])
    stamps, values = (np.concatenate(part) for part in zip(*joined, strict=True))
    found = f"none (0) in {np.sum(stamps == 0)} of {len(stamps)}"
    require(stamps.all(), topic, "stamps in the messages' headers", found)
    name = list(KINDS)[kind]
    unit = unit_of(imu[name], name, where)
    return Readings(stamps, 1e-9, unit * values[:, 3 * kind : 3 * kind + 3], topic)


def _read(path: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Stamps in ns (N,), specific force and angular rate (N, 6) of each topic."""
    stamps: dict[str, array] = {}
    values: dict[str, array] = {}
    with expecting(path, "a whole ROS bag"):
        opened, deserialize = _open(path)
        with opened as bag:
            wanted = [c for c in bag.connections if c.msgtype == MESSAGE]
            # of none the library would read all
            for connection, _, raw in bag.messages(wanted) if wanted else ():
                message = deserialize(raw, MESSAGE)
                stamp = message.header.stamp
                now = stamps.setdefault(connection.topic, array("q"))
                now.append(stamp.sec * 10**9 + stamp.nanosec)
                values.setdefault(connection.topic, array("d")).extend(_six(message))
    require(stamps, str(path), f"messages of {MESSAGE}", "none")
    return {t: (np.array(stamps[t]), np.array(values[t]).reshape(-1, 6)) for t in stamps}


def _six(message) -> tuple[float, ...]:
    """Specific force and angular rate; NaN what the message says it does not have (REP 145)."""
    force, rate = message.linear_acceleration, message.angular_velocity
    none = np.nan, np.nan, np.nan
    return (
        *(none if message.linear_acceleration_covariance[0] == -1 else (force.x, force.y, force.z)),
        *(none if message.angular_velocity_covariance[0] == -1 else (rate.x, rate.y, rate.z)),
    )


def _open(path: Path):
    """The library's reader of a bag, and what turns its bytes into a message.

    Messages are read as the standard defines them, whatever the bag says of its types.
    """
    try:
        from rosbags import rosbag1, rosbag2
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise InputError(
            "ROS bags: expected the library rosbags (pip install 'imuarray[ros]'), found none"
        ) from None
    if path.suffix.lower() == ".bag":
        return rosbag1.Reader(path), get_typestore(Stores.ROS1_NOETIC).deserialize_ros1
    return rosbag2.Reader(path), get_typestore(Stores.LATEST).deserialize_cdr
