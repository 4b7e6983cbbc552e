"""ROS bags of `sensor_msgs/Imu`, written by the library's own writers."""

from pathlib import Path

import numpy as np

IMU = "sensor_msgs/msg/Imu"
KINDS = "ros1", "sqlite3", "mcap"


def write(path: Path, kind: str, topics: dict) -> Path:
    """A bag of ``topics``: name to stamps (N,) ns, force (N, 3) and rate (N, 3), None for no data.

    Messages arrive in their order at other times than their stamps.
    """
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    if kind == "ros1":
        path = path.with_suffix(".bag")
        bag, pack = rosbag1.Writer(path), store.serialize_ros1
    else:
        plugin = rosbag2.StoragePlugin[kind.upper()]
        bag, pack = rosbag2.Writer(path, version=9, storage_plugin=plugin), store.serialize_cdr
    with bag:
        bag.add_connection("/other", "std_msgs/msg/String", typestore=store)
        named = {name: bag.add_connection(name, IMU, typestore=store) for name in topics}
        rows = [(i, name) for name in topics for i in range(len(topics[name][0]))]
        for when, (i, name) in enumerate(sorted(rows)):
            stamp, force, rate = int(topics[name][0][i]), *topics[name][1:]
            message = _message(
                store, stamp, *(None if x is None else x[i] for x in (force, rate)), kind == "ros1"
            )
            bag.write(named[name], when * 1_000_000, pack(message, IMU))
    return path


def _message(store, stamp, force, rate, first):
    types = store.types
    vector, none = types["geometry_msgs/msg/Vector3"], np.array([-1.0] + [0.0] * 8)
    whole = types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    given = {"seq": 0} if first else {}
    header = types["std_msgs/msg/Header"](stamp=whole, frame_id="imu", **given)
    turn = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    out = {}
    for name, values in (("linear_acceleration", force), ("angular_velocity", rate)):
        x, y, z = np.zeros(3) if values is None else values
        out[name] = vector(x=float(x), y=float(y), z=float(z))
        out[f"{name}_covariance"] = none if values is None else np.zeros(9)
    return types[IMU](header=header, orientation=turn, orientation_covariance=none, **out)
