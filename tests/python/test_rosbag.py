"""ROS 2 bags are logs: folders of MCAP and SQLite files, in one file or several, and readers of rosbags."""

import sys
from pathlib import Path

import numpy as np
import pytest

import btr

highlevel = pytest.importorskip("rosbags.highlevel")
rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
TYPES = STORE.types
START_NS = 5_000_000_000
STEP_NS = 10_000_000
TICKS = 200


def header(ns: int):
    stamp = TYPES["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
    return TYPES["std_msgs/msg/Header"](stamp=stamp, frame_id="")


def joint_state(ns: int, position: list, velocity: list = ()):
    arrays = {"position": position, "velocity": velocity, "effort": ()}
    made = {key: np.array(values, dtype=np.float64) for key, values in arrays.items()}
    return TYPES["sensor_msgs/msg/JointState"](header=header(ns), name=["hip", "knee"], **made)


def trajectory(ns: int, positions: list):
    none = np.array([], dtype=np.float64)
    duration = TYPES["builtin_interfaces/msg/Duration"]

    def point(x: float, sec: int):
        rest = {"velocities": none, "accelerations": none, "effort": none}
        when = duration(sec=sec, nanosec=0)
        return TYPES["trajectory_msgs/msg/JointTrajectoryPoint"](positions=np.array([x]), time_from_start=when, **rest)

    points = [point(x, sec) for x, sec in positions]
    return TYPES["trajectory_msgs/msg/JointTrajectory"](header=header(ns), joint_names=["hip"], points=points)


def write(folder: Path, topics: dict, storage: str) -> Path:
    """A bag of (type, [(ns, message), ...]) by topic."""
    with rosbag2.Writer(folder, version=9, storage_plugin=rosbag2.StoragePlugin[storage]) as writer:
        for topic, (kind, messages) in topics.items():
            connection = writer.add_connection(topic, kind, typestore=STORE)
            for ns, message in messages:
                writer.write(connection, ns, STORE.serialize_cdr(message, kind))
    return folder


def commands_and_states(topic: str = "/joint_states") -> dict:
    """Positions and velocities of two joints, and commands at times between them."""
    ticks = [START_NS + k * STEP_NS for k in range(TICKS)]
    states = [(ns, joint_state(ns, [k / 7, -k / 3], [7.0, 3.0])) for k, ns in enumerate(ticks)]
    commands = [(ns - 1, joint_state(ns - 1, [k / 5, k / 9])) for k, ns in enumerate(ticks) if k]
    return {topic: ("sensor_msgs/msg/JointState", states), "/joint_commands": ("sensor_msgs/msg/JointState", commands)}


def assert_commands_and_states(log: btr.Log) -> None:
    k = np.arange(TICKS)
    np.testing.assert_array_equal(log.clock_s, (START_NS + k * STEP_NS) / 1e9)
    for name, values in {"q_hip": k / 7, "q_knee": -k / 3, "dq_hip": np.full(TICKS, 7.0)}.items():
        np.testing.assert_array_equal(log[name], values)
    np.testing.assert_array_equal(log["cmd_hip"], [np.nan, *(k[1:] / 5)])
    assert sorted(log.keys()) == ["cmd_hip", "cmd_knee", "dq_hip", "dq_knee", "q_hip", "q_knee"]


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_the_folder_of_a_bag_is_a_log(storage: str, tmp_path: Path) -> None:
    folder = write(tmp_path / "bag", commands_and_states(), storage)
    log = btr.load_log(folder)
    assert_commands_and_states(log)
    assert log.name == folder


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_an_open_reader_is_a_log(storage: str, tmp_path: Path) -> None:
    folder = write(tmp_path / "bag", commands_and_states(), storage)
    with highlevel.AnyReader([folder]) as reader:
        assert_commands_and_states(btr.load_log(reader))
        assert btr.load_log(reader, "walk").name == Path("walk")


def test_mcap_through_rosbags_is_what_btr_reads_itself(tmp_path: Path) -> None:
    folder = write(tmp_path / "bag", commands_and_states(), "MCAP")
    (file,) = folder.glob("*.mcap")
    with rosbag2.Reader(folder) as reader:
        through, itself = btr.load_log(reader), btr.load_log(file)
    assert through.keys() == itself.keys()
    np.testing.assert_array_equal(through.clock_s, itself.clock_s)
    for name in itself.keys():
        np.testing.assert_array_equal(through[name], itself[name])


def test_a_trajectory_is_followed(tmp_path: Path) -> None:
    states = [(START_NS + k * 10**9, joint_state(START_NS + k * 10**9, [0.0, 0.0])) for k in range(5)]
    plan = [(START_NS, trajectory(START_NS, [(0.0, 0), (4.0, 4)]))]
    topics = {
        "/joint_states": ("sensor_msgs/msg/JointState", states),
        "/joint_commands": ("trajectory_msgs/msg/JointTrajectory", plan),
    }
    log = btr.load_log(write(tmp_path / "bag", topics, "SQLITE3"))
    np.testing.assert_array_equal(log["cmd_hip"], [0, 1, 2, 3, 4])


def test_a_model_maps_topics_and_names(tmp_path: Path) -> None:
    folder = write(tmp_path / "bag", commands_and_states("/arm/states"), "SQLITE3")
    with pytest.raises(btr.BtrError, match="no joint states on `/joint_states`; topics: .*`/arm/states") as raised:
        btr.load_log(folder)
    assert "\nhelp: name the topic in the model's [channels.topics] table" in str(raised.value)
    arm = btr.load_model(Path(__file__).parents[2] / "robots" / "arm.toml")
    channels = '[channels]\ntopics = { states = "/arm/states" }\nchannels = { q_yaw = "q_hip" }\n'
    model = btr.Model(f"{arm.text}\n{channels}", arm.path)
    log = btr.load_log(folder, model=model)
    assert "q_yaw" in log and "q_knee" in log and "q_hip" not in log
    pendulum = btr.load_model(arm.path.parent / "disengage.toml")
    of_hinge = channels.replace("q_yaw =", 'cmd_hinge = "cmd_hip", q_hinge =')
    swing = btr.Model(f"{pendulum.text}\n{of_hinge}", pendulum.path)
    with highlevel.AnyReader([folder]) as reader:
        assert [entry["log"] for given in (folder, reader) for entry in btr.check(swing, given).logs] == [
            str(folder)
        ] * 2


def test_incomplete_bags_are_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write(tmp_path / "bag", commands_and_states(), "SQLITE3")
    with pytest.raises(btr.BtrError, match="a SQLite bag; btr reads bags in MCAP\nhelp: convert it: .* btr.load_log"):
        btr.Log.read(folder)
    with pytest.raises(TypeError, match="a log is a path, a Log, a reader of rosbags"):
        btr.load_log(3)
    with pytest.raises(btr.BtrError, match="not open\nhelp: open the reader first"):
        btr.load_log(highlevel.AnyReader([folder]))
    (folder / "metadata.yaml").write_text("nonsense")
    with pytest.raises(btr.BtrError, match="help: check that it was closed and copied as a whole"):
        btr.load_log(folder)
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    with pytest.raises(btr.BtrError, match="needs the package rosbags\nhelp: pip install rosbags"):
        btr.load_log(folder)
