"""MCAP files of btr open in other readers and contain the same numbers."""

import csv
import json
import math
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest

from program import BTR

mcap_reader = pytest.importorskip("mcap.reader")
mcap_ros2 = pytest.importorskip("mcap_ros2.decoder")
rosbags = pytest.importorskip("rosbags.highlevel")
typesys = pytest.importorskip("rosbags.typesys")

ROBOTS = Path(__file__).parents[2] / "robots"
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


@pytest.fixture(scope="module")
def overlay(tmp_path_factory):
    """The desk arm and its model in two logs: the messages of each topic, with their times in s."""
    if BTR is None:
        pytest.skip("no btr executable: set BTR, or build it")
    path = tmp_path_factory.mktemp("overlay") / "overlay.mcap"
    logs = [ROBOTS / "arm" / f"held_out_{k}.csv" for k in (1, 2)]
    command = [BTR, "compare", ROBOTS / "arm.toml", *logs, "-o", path, "-q"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    topics = {}
    with open(path, "rb") as file:
        reader = mcap_reader.make_reader(file, decoder_factories=[mcap_ros2.DecoderFactory()])
        assert reader.get_summary().statistics.message_count > 0
        for _, channel, message, decoded in reader.iter_decoded_messages():
            topics.setdefault(channel.topic, []).append((message.log_time * 1e-9, decoded))
    return topics


def test_both_robots_are_in_one_file_log_after_log(overlay):
    with open(ROBOTS / "arm" / "held_out_2.csv", newline="") as file:
        second = list(csv.DictReader(file))
    states = {name: overlay[f"/{name}/joint_states"] for name in ("measured", "model", "difference")}
    begins = states["measured"][-1][0] - float(second[-1]["t"])
    first_end = max(t for t, _ in states["measured"] if t < begins - 1e-6)
    assert begins - first_end == pytest.approx(1.0)
    for row, (t, message) in zip(second, states["measured"][-len(second) :], strict=True):
        assert t == pytest.approx(begins + float(row["t"]), abs=1e-6)
        assert list(message.position) == [float(row[f"q_{joint}"]) for joint in message.name]
    for (_, real), (_, model), (_, difference) in zip(*states.values(), strict=True):
        assert difference.position == pytest.approx([a - b for a, b in zip(real.position, model.position, strict=True)])
    largest = max(abs(message.position[0]) for _, message in states["difference"])
    assert 0.03 < largest < 0.3, "the arm differs from its model"


def test_viewers_find_every_link_in_a_tree_of_frames(overlay):
    descriptions = {name: overlay[f"/{name}/robot_description"][0][1].data for name in ("measured", "model")}
    robots = {name: ElementTree.fromstring(text) for name, text in descriptions.items()}
    parents = {}
    for _, message in [*overlay["/tf_static"], *overlay["/tf"]]:
        for transform in message.transforms:
            frame, parent = transform.child_frame_id, transform.header.frame_id
            assert parents.setdefault(frame, parent) == parent
    links = {link.get("name") for robot in robots.values() for link in robot.iter("link")}
    assert set(parents) == links and "measured/forearm" in links
    assert all(robot.find("link/visual") is not None for robot in robots.values()), "something is to be seen"
    radius = {name: float(robot.find("link/visual//cylinder").get("radius")) for name, robot in robots.items()}
    assert radius["model"] < radius["measured"], "surfaces at the same place flicker"
    for robot in robots.values():
        for joint in robot.iter("joint"):
            assert parents[joint.find("child").get("link")] == joint.find("parent").get("link")
    assert parents["measured/base"] == parents["model/base"] == "world"


def test_frames_turn_with_the_joints(overlay):
    # The yaw turns about z, and /tf is a part of the samples.
    for name in ("measured", "model"):
        yaw = {t: message.position[0] for t, message in overlay[f"/{name}/joint_states"]}
        for t, message in overlay["/tf"]:
            [turret] = [x.transform for x in message.transforms if x.child_frame_id == f"{name}/turret"]
            assert 2 * math.atan2(turret.rotation.z, turret.rotation.w) == pytest.approx(yaw[t], abs=1e-9)
            assert turret.translation.z == pytest.approx(0.1)


def test_the_frame_of_a_floating_base_is_the_root_of_its_description(tmp_path):
    if BTR is None:
        pytest.skip("no btr executable: set BTR, or build it")
    short = ["--set", "simulation.duration_s=0.1", "--quiet"]
    subprocess.run([BTR, "simulate", ROBOTS / "ant.toml", *short, "-o", tmp_path / "ant.mcap"], check=True)
    with open(tmp_path / "ant.mcap", "rb") as file:
        reader = mcap_reader.make_reader(file, decoder_factories=[mcap_ros2.DecoderFactory()])
        messages = {channel.topic: message for _, channel, _, message in reader.iter_decoded_messages()}
    robot = ElementTree.fromstring(messages["/robot_description"].data)
    carried = {child.get("link") for child in robot.iter("child")}
    (root,) = {link.get("name") for link in robot.iter("link")} - carried
    assert [transform.child_frame_id for transform in messages["/tf"].transforms] == [root]


def test_the_layout_for_foxglove_names_what_is_in_the_file(overlay):
    layout = json.loads((ROBOTS.parent / "examples" / "overlay.foxglove-layout.json").read_text())
    panels = layout["configById"]
    layers = panels["3D!overlay"]["layers"].values()
    drawn = [layer["topic"] for layer in layers if layer["layerId"] == "foxglove.Urdf"]
    plotted = [path["value"].split(".")[0] for panel in panels.values() for path in panel.get("paths", [])]
    assert len(drawn) == 2 and len(plotted) == 4 and {*drawn, *plotted} < set(overlay)

    def shown(part):
        return [part] if isinstance(part, str) else shown(part["first"]) + shown(part["second"])

    assert sorted(shown(layout["layout"])) == sorted(panels)
    assert panels["3D!overlay"]["followTf"] == "world"
