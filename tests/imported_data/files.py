"""Bags and CSV files as other people's tools write them, and a force with known pushes in it."""

from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
STORE1 = get_typestore(Stores.ROS1_NOETIC)
START = 1_700_000_000 * 10**9
WRENCH, JOINTS = "geometry_msgs/msg/WrenchStamped", "sensor_msgs/msg/JointState"
PANDA = tuple(f"panda_joint{i}" for i in range(1, 8))


def made(kind, store=STORE, **fields):
    return store.types[kind](**fields)


def header(stamp, frame="", store=STORE):
    time = made("builtin_interfaces/msg/Time", store, sec=int(stamp // 10**9), nanosec=int(stamp % 10**9))
    extra = {"seq": 0} if store is STORE1 else {}
    return made("std_msgs/msg/Header", store, stamp=time, frame_id=frame, **extra)


def wrench(stamp, force, torque=(0.1, 0.2, 0.3), frame="base", store=STORE):
    vectors = [
        made("geometry_msgs/msg/Vector3", store, x=float(v[0]), y=float(v[1]), z=float(v[2])) for v in (force, torque)
    ]
    both = made("geometry_msgs/msg/Wrench", store, force=vectors[0], torque=vectors[1])
    return made(WRENCH, store, header=header(stamp, frame, store), wrench=both)


def joints(stamp, q, names=PANDA, velocity=(), effort=()):
    rows = {"position": q, "velocity": velocity, "effort": effort}
    return made(
        JOINTS, header=header(stamp), name=list(names), **{name: np.array(row, float) for name, row in rows.items()}
    )


def write_bag(folder, messages, plugin=StoragePlugin.MCAP, store=STORE):
    """Write messages (topic, time of recording [ns], message); return the folder."""
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        _write(writer, messages, store, store.serialize_cdr)
    return folder


def write_bag1(file, messages, store=STORE1):
    with Writer1(file) as writer:
        _write(writer, messages, store, store.serialize_ros1)
    return file


def _write(writer, messages, store, serialized):
    topics = {}
    for topic, time, message in messages:
        if topic not in topics:
            topics[topic] = writer.add_connection(topic, message.__msgtype__, typestore=store)
        writer.write(topics[topic], int(time), serialized(message, message.__msgtype__))


def stamps(count, rate=100.0):
    """Instants [ns] at a rate."""
    return START + np.round(np.arange(count) * 1e9 / rate).astype(np.int64)


def wrenches(force, topic="/wrench", rate=100.0, **given):
    """Messages of a force (N, 3), recorded a little after their stamps."""
    times = stamps(len(force), rate)
    return [(topic, t + 300_000, wrench(t, f, **given)) for t, f in zip(times, force, strict=True)]


def pushed(seconds, pushes, rate=100.0, seed=3, noise=0.4, mean=(1.0, -2.0, 0.5)):
    """Force (N, 3) [N]: noise about a mean, and half-sine pushes (start [s], duration [s], peak (3,) [N])."""
    time = np.arange(round(seconds * rate)) / rate
    force = np.array(mean) + noise * np.random.default_rng(seed).standard_normal((len(time), 3))
    for start, duration, peak in pushes:
        share = np.clip((time - start) / duration, 0.0, 1.0)
        force += np.sin(np.pi * share)[:, None] * np.array(peak)
    return force


PUSHES = ((3.0, 0.6, (0.0, 40.0, 0.0)), (7.0, 0.5, (-45.0, 0.0, 10.0)), (11.0, 0.8, (0.0, 0.0, -35.0)))


def write_csv(file: Path, columns, separator=",", ending="\n"):
    rows = [separator.join(columns)]
    rows += [separator.join(repr(float(v)) for v in row) for row in np.array(list(columns.values())).T]
    file.write_text(ending.join(rows) + ending)
    return file


def force_columns(force, rate=100.0):
    return {"time_s": np.arange(len(force)) / rate} | {f"force_{a}_N": force[:, i] for i, a in enumerate("xyz")}


def by_time(*parts):
    """Messages of several topics in the order of their times."""
    return sorted((m for part in parts for m in part), key=lambda m: m[1])
