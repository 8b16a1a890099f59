"""Duration of `btr.load_log` for one log as CSV, as MCAP, as another robot's MCAP and as a LeRobot episode: medians
over rounds.

    pip install . pyarrow rosbags
    python benches/python_load.py
"""

import json
import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import btr

ROWS, JOINTS, STEP_S, ROUNDS = 4024, 11, 0.002, 50


def made() -> btr.Log:
    """A log of 44 channels with noise, so that all digits are significant."""
    random, phase = np.random.default_rng(1), 0.01 * np.arange(ROWS)
    names = [f"{prefix}_joint{k}" for prefix in ("cmd", "q", "dq", "tau") for k in range(JOINTS)]
    return btr.Log(
        STEP_S * np.arange(ROWS), {n: np.sin(phase + len(n)) + 1e-3 * random.standard_normal(ROWS) for n in names}
    )


def columns(log: btr.Log, prefix: str) -> np.ndarray:
    """The joints' values under a prefix: (rows, joints)."""
    return np.stack([log[f"{prefix}_joint{k}"] for k in range(JOINTS)], axis=1)


def write_bag(log: btr.Log, folder: Path) -> Path:
    """The log as ROS 2 records it, without btr's own topic."""
    store, kind = get_typestore(Stores.ROS2_JAZZY), "sensor_msgs/msg/JointState"
    message, header, stamp = (store.types[t] for t in (kind, "std_msgs/msg/Header", "builtin_interfaces/msg/Time"))
    names, none = [f"joint{k}" for k in range(JOINTS)], np.zeros((ROWS, 0))
    q, dq, tau, cmd = (columns(log, prefix) for prefix in ("q", "dq", "tau", "cmd"))
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, position, velocity, effort in [("/joint_states", q, dq, tau), ("/joint_commands", cmd, none, none)]:
            connection = writer.add_connection(topic, kind, typestore=store)
            for k, t in enumerate(log.clock_s):
                ns = 10**9 + round(t * 1e9)
                when = header(stamp=stamp(sec=ns // 10**9, nanosec=ns % 10**9), frame_id="")
                said = message(header=when, name=names, position=position[k], velocity=velocity[k], effort=effort[k])
                writer.write(connection, ns, store.serialize_cdr(said, kind))
    return folder


def write_lerobot(log: btr.Log, folder: Path) -> Path:
    """The log as an episode of format v3.0, in float32 as LeRobot has it."""
    keys = {"action": "cmd", "observation.state": "q", "observation.velocity": "dq", "observation.effort": "tau"}
    features = {key: {"names": [f"joint{k}" for k in range(JOINTS)]} for key in keys}
    info = {"codebase_version": "v3.0", "total_episodes": 1, "data_path": "", "features": features}
    for part in ("meta", "data/chunk-000"):
        (folder / part).mkdir(parents=True)
    (folder / "meta/info.json").write_text(json.dumps(info))

    def vectors(prefix: str) -> pa.Array:
        return pa.FixedSizeListArray.from_arrays(pa.array(columns(log, prefix).astype(np.float32).ravel()), JOINTS)

    frames = {key: vectors(prefix) for key, prefix in keys.items()}
    clock = {"timestamp": log.clock_s.astype(np.float32), "episode_index": np.zeros(ROWS, np.int64)}
    pq.write_table(pa.table({**frames, **clock}), folder / "data/chunk-000/file-000.parquet")
    return folder


def main() -> int:
    log = made()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = {"CSV": folder / "log.csv", "CSV, gzip": folder / "log.csv.gz", "MCAP of btr": folder / "log.mcap"}
        for file in files.values():
            log.write(file)
        files["MCAP of ROS 2"] = write_bag(log, folder / "bag")
        files["LeRobot v3.0"] = write_lerobot(log, folder / "lerobot")
        print(f"{ROWS} rows, {4 * JOINTS} channels; median and least of {ROUNDS} rounds")
        for what, file in files.items():
            took_ms = []
            for _ in range(ROUNDS):
                start = time.perf_counter()
                read = btr.load_log(file)
                took_ms.append(1e3 * (time.perf_counter() - start))
            assert (len(read), len(read.keys())) == (ROWS, 4 * JOINTS), read
            print(f"{what:14} {statistics.median(took_ms):7.2f} ms {min(took_ms):7.2f} ms")
    return 0


if __name__ == "__main__":
    sys.exit(main())
