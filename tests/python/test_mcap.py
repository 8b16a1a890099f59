"""MCAP files of btr open in other readers and contain the same numbers."""

import csv
import math
import subprocess

import pytest

from program import BTR

mcap_reader = pytest.importorskip("mcap.reader")
mcap_ros2 = pytest.importorskip("mcap_ros2.decoder")
rosbags = pytest.importorskip("rosbags.highlevel")
typesys = pytest.importorskip("rosbags.typesys")

NAMES = ["cmd_hip", "cmd_knee", "q_hip", "q_knee", "dq_knee", "imu_acc_x", "imu_acc_y", "imu_acc_z", "foot_Left-1"]


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """The rows of a log, and the MCAP file that btr made of it."""
    if BTR is None:
        pytest.skip("no btr executable: set BTR, or build it")
    folder = tmp_path_factory.mktemp("log")
    rows = [[0.1 + 0.01 * i + 1e-4 * math.sin(i)] + [math.sin(i + k) for k in range(len(NAMES))] for i in range(500)]
    with open(folder / "log.csv", "w", newline="") as file:
        csv.writer(file).writerows([["t", *NAMES], *rows])
    subprocess.run([BTR, "convert", folder / "log.csv", folder / "log.mcap"], check=True)
    return [dict(zip(["t", *NAMES], row)) for row in rows], folder / "log.mcap"


def test_mcap_decodes_every_field_to_the_bit(log):
    rows, path = log
    with open(path, "rb") as file:
        reader = mcap_reader.make_reader(file, decoder_factories=[mcap_ros2.DecoderFactory()])
        channels = [m for *_, m in reader.iter_decoded_messages(topics=["/btr/channels"])]
        assert reader.get_header().profile == "ros2"
    assert [m.time_s for m in channels] == [row["t"] for row in rows]
    for name in NAMES:
        field = name.lower().replace("-", "_")
        assert [getattr(m, field) for m in channels] == [row[name] for row in rows], name


def test_rosbags_reads_the_standard_topics_and_writes_the_same_bytes(log):
    rows, path = log
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    counts = {}
    with rosbags.AnyReader([path], default_typestore=store) as reader:
        for connection, stamp_ns, raw in reader.messages():
            if connection.topic == "/btr/channels":
                continue
            row = rows[counts.setdefault(connection.topic, 0)]
            counts[connection.topic] += 1
            message = store.deserialize_cdr(raw, connection.msgtype)
            assert bytes(store.serialize_cdr(message, connection.msgtype)) == bytes(raw)
            assert abs(stamp_ns * 1e-9 - row["t"]) < 0.51e-9
            if connection.topic == "/joint_states":
                assert message.name == ["hip", "knee"]
                assert list(message.position) == [row["q_hip"], row["q_knee"]]
                assert math.isnan(message.velocity[0]) and message.velocity[1] == row["dq_knee"]
            if connection.topic == "/joint_commands":
                assert list(message.position) == [row["cmd_hip"], row["cmd_knee"]]
            if connection.topic == "/imu":
                assert message.linear_acceleration.x == row["imu_acc_x"]
    assert counts == {"/joint_states": 500, "/joint_commands": 500, "/imu": 500}
