"""Episodes of LeRobot data sets are logs, in all formats in use, from Python and on the command line."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import btr

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

JOINTS = ["shoulder_pan", "elbow_flex", "gripper"]
FPS = 30
LENGTHS = [40, 25, 31]
Episode = dict[str, np.ndarray]


def episodes(lengths: list[int]) -> list[Episode]:
    """Commands and positions of a robot as float32, (frames, joints) each, and the clock."""
    made = []
    for k, length in enumerate(lengths):
        phase = np.arange(length)[:, None] / 7 + np.arange(len(JOINTS)) + k
        numbers = {
            "action": np.sin(phase),
            "observation.state": np.sin(phase - 0.1),
            "timestamp": np.arange(length) / FPS,
        }
        made.append({key: values.astype(np.float32) for key, values in numbers.items()})
    return made


def table(episode: Episode, index: int) -> pa.Table:
    """The frames of an episode as LeRobot writes them."""

    def vectors(values: np.ndarray) -> pa.Array:
        return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])

    columns = {key: vectors(values) if values.ndim == 2 else pa.array(values) for key, values in episode.items()}
    frames = len(episode["timestamp"])
    numbers = {"frame_index": np.arange(frames), "episode_index": np.full(frames, index), "index": np.arange(frames)}
    return pa.table({**columns, **{key: pa.array(values, pa.int64()) for key, values in numbers.items()}})


def info(folder: Path, version: str, count: int, names: object, data_path: str) -> None:
    features = {key: {"dtype": "float32", "shape": [3], "names": names} for key in ("action", "observation.state")}
    features["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    text = {"codebase_version": version, "total_episodes": count, "fps": FPS, "chunks_size": 2, "data_path": data_path}
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps({**text, "features": features}))


def write_v2(folder: Path, all_episodes: list[Episode], names: object, **options: object) -> Path:
    """A file per episode; two of them in a chunk, though LeRobot takes a thousand."""
    pattern = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
    info(folder, "v2.1", len(all_episodes), names, pattern)
    for k, episode in enumerate(all_episodes):
        file = folder / pattern.format(episode_chunk=k // 2, episode_index=k)
        file.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table(episode, k), file, **options)
    return folder


def write_v3(folder: Path, all_episodes: list[Episode], names: object, **options: object) -> Path:
    """Two episodes in a file, each as a group of rows."""
    info(folder, "v3.0", len(all_episodes), names, "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet")
    (folder / "data" / "chunk-000").mkdir(parents=True)
    for file in range(0, len(all_episodes), 2):
        tables = [table(episode, file + k) for k, episode in enumerate(all_episodes[file : file + 2])]
        path = folder / "data" / "chunk-000" / f"file-{file // 2:03d}.parquet"
        with pq.ParquetWriter(path, tables[0].schema, **options) as writer:
            for one in tables:
                writer.write_table(one)
    rows = {"episode_index": range(len(all_episodes)), "length": [len(e["timestamp"]) for e in all_episodes]}
    (folder / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
    pq.write_table(pa.table({k: list(v) for k, v in rows.items()}), folder / "meta/episodes/chunk-000/file-000.parquet")
    return folder


def assert_same(log: btr.Log, episode: Episode) -> None:
    np.testing.assert_array_equal(log.clock_s, episode["timestamp"])
    assert log.keys() == [f"{prefix}_{joint}" for prefix in ("cmd", "q") for joint in JOINTS]
    for k, joint in enumerate(JOINTS):
        np.testing.assert_array_equal(log[f"cmd_{joint}"], episode["action"][:, k])
        np.testing.assert_array_equal(log[f"q_{joint}"], episode["observation.state"][:, k])
        assert log.unit(f"q_{joint}") == "rad"


@pytest.mark.parametrize("write", [write_v2, write_v3])
@pytest.mark.parametrize("names", [[f"{joint}.pos" for joint in JOINTS], {"motors": JOINTS}, JOINTS])
@pytest.mark.parametrize("compression", ["snappy", "zstd", "none"])
def test_every_number_of_every_episode_is_read(write, names, compression, tmp_path: Path) -> None:
    made = episodes(LENGTHS)
    folder = write(tmp_path / "set", made, names, compression=compression)
    for k, episode in enumerate(made):
        assert_same(btr.load_log(folder, episode=k), episode)
        assert_same(btr.load_log(f"{folder}#{k}"), episode)


def test_choices_of_the_writer_change_nothing(tmp_path: Path) -> None:
    """Statistics, pages and the number of rows in a group have no effect."""
    made = episodes(LENGTHS)
    choices = [
        {"write_statistics": False, "use_dictionary": False},
        {"data_page_version": "2.0", "data_page_size": 64, "version": "2.4"},
    ]
    for k, choice in enumerate(choices):
        assert_same(btr.load_log(write_v3(tmp_path / f"{k}", made, JOINTS, **choice), episode=1), made[1])
    folder = write_v3(tmp_path / "groups", made, JOINTS)
    file = folder / "data/chunk-000/file-000.parquet"
    pq.write_table(pq.read_table(file), file, row_group_size=17)
    assert_same(btr.load_log(folder, episode=1), made[1])


def test_a_set_of_one_needs_no_number(tmp_path: Path) -> None:
    made = episodes([50])
    for write in (write_v2, write_v3):
        assert_same(btr.load_log(write(tmp_path / write.__name__, made, JOINTS)), made[0])


def test_missing_numbers_are_nan(tmp_path: Path) -> None:
    folder = write_v2(tmp_path, episodes([3]), JOINTS)
    file = folder / "data/chunk-000/episode_000000.parquet"
    state = pa.array([[1.0, None, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, None]], pa.list_(pa.float64()))
    old = pq.read_table(file)
    pq.write_table(old.set_column(old.schema.get_field_index("observation.state"), "observation.state", state), file)
    log = btr.load_log(folder)
    np.testing.assert_array_equal(log["q_elbow_flex"], [np.nan, 5, 8])
    np.testing.assert_array_equal(log["q_gripper"], [3, 6, np.nan])


def test_the_command_line_reads_episodes(tmp_path: Path) -> None:
    made = episodes(LENGTHS)
    folder = write_v3(tmp_path / "set", made, JOINTS)

    def run(*arguments: object) -> subprocess.CompletedProcess:
        return subprocess.run([sys.executable, "-m", "btr", *map(str, arguments)], capture_output=True, text=True)

    said = json.loads(run("info", f"{folder}#2", "--json").stdout)
    assert (said["samples"], len(said["channels"])) == (31, 6)
    assert run("convert", f"{folder}#2", tmp_path / "two.mcap").returncode == 0
    assert_same(btr.load_log(tmp_path / "two.mcap"), made[2])
    refused = run("info", folder)
    assert refused.returncode == 2 and f"{folder}: which episode of this data set of 3" in refused.stderr
    assert f"name an episode behind the folder: `{folder}#0` to `{folder}#2`" in refused.stderr


def test_a_model_is_made_of_a_set_without_an_episode(tmp_path: Path) -> None:
    folder = write_v3(tmp_path / "set", episodes(LENGTHS), ["elbow", "b", "c"])
    (tmp_path / "arm.urdf").write_text(URDF)

    def run(*arguments: object) -> str:
        command = [sys.executable, "-m", "btr", *map(str, arguments)]
        ran = subprocess.run(command, capture_output=True, text=True, check=False)
        assert ran.returncode == 0, ran.stderr
        return ran.stdout

    told = run("new", tmp_path / "arm.urdf", folder, "-o", tmp_path / "arm.toml")
    assert f"{folder} has 3 episodes: columns and units are those of the first" in told
    assert f"a log of it is called {folder}#0" in told
    assert "max_torque = 100.0 of elbow is the URDF's effort, the motor's limit or a placeholder" in told
    # By its mapping, a model's log is not what its columns seem to say.
    text = (tmp_path / "arm.toml").read_text()
    scaled = f'[channels.channels]\n"q_elbow" = {{ column = "q_elbow", factor = {DEGREES} }}\n'
    (tmp_path / "scaled.toml").write_text(text + scaled)
    of = {}
    for model in ("arm.toml", "scaled.toml"):
        found = json.loads(run("info", f"{folder}#0", "--model", tmp_path / model, "--json"))
        of[model] = next(channel["max"] for channel in found["channels"] if channel["name"] == "q_elbow")
    assert of["scaled.toml"] == pytest.approx(DEGREES * of["arm.toml"])
    assert "--model MODEL reads them by its [channels]" in run("info", f"{folder}#0")


MODEL = """
name = "arm"
[robot]
urdf = "arm.urdf"
[actuators."*"]
kind = "position"
kp = 20.0
kd = 0.5
[parameters]
"mass@arm" = { relative = [0.5, 2.0] }
"""
URDF = """<robot name="arm"><link name="base"/>
<link name="arm"><inertial><origin xyz="0 0 -0.1"/><mass value="0.3"/>
<inertia ixx="0.003" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.001"/></inertial></link>
<joint name="elbow" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="100" velocity="50"/></joint></robot>"""
DEGREES = 0.017453292519943295


def test_degrees_are_suspected_and_can_be_declared(tmp_path: Path) -> None:
    made = episodes([300])[0]
    degrees = {key: values if values.ndim == 1 else (60 * values).astype(np.float32) for key, values in made.items()}
    folder = write_v2(tmp_path / "set", [degrees], [f"{joint}.pos" for joint in JOINTS])
    (tmp_path / "arm.urdf").write_text(URDF)
    text = MODEL + '[channels.channels]\n"cmd_elbow" = "cmd_elbow_flex"\n"q_elbow" = "q_elbow_flex"\n'
    (tmp_path / "arm.toml").write_text(text)

    def suspected(model: btr.Model) -> set[str]:
        findings = btr.check(model, folder).logs[0]["findings"]
        return {f["sentence"].split()[0] for f in findings if f["sentence"].endswith("is it in degrees?")}

    assert {"cmd_elbow", "q_elbow"} <= suspected(btr.load_model(tmp_path / "arm.toml"))
    for ours in ("cmd_elbow", "q_elbow"):
        text = text.replace(f'"{ours}" = "{ours}_flex"', f'"{ours}" = {{ column = "{ours}_flex", factor = {DEGREES} }}')
    model = btr.Model(text, tmp_path / "arm.toml")
    log = btr.load_log(folder, model=model)
    np.testing.assert_array_equal(log["q_elbow"], degrees["observation.state"][:, 1].astype(float) * DEGREES)
    assert not {"cmd_elbow", "q_elbow"} & suspected(model)


def rewrite(folder: Path, change) -> None:
    file = folder / "meta/info.json"
    info = json.loads(file.read_text())
    change(info)
    file.write_text(json.dumps(info))


def cut(folder: Path) -> None:
    file = folder / "data/chunk-000/episode_000000.parquet"
    file.write_bytes(file.read_bytes()[:200])


def drop(column: str):
    def change(folder: Path) -> None:
        file = folder / "data/chunk-000/episode_000000.parquet"
        pq.write_table(pq.read_table(file).drop_columns([column]), file)

    return change


def put(column: str, values: list):
    def change(folder: Path) -> None:
        file = folder / "data/chunk-000/episode_000000.parquet"
        old = pq.read_table(file)
        pq.write_table(old.set_column(old.schema.get_field_index(column), column, pa.array(values)), file)

    return change


DATA = "data/chunk-000/episode_000000.parquet"
BROKEN = {
    "cut": (cut, f"{DATA}: Parquet error: "),
    "no data": (lambda folder: (folder / DATA).unlink(), f"{DATA}: No such file"),
    "no json": (lambda folder: (folder / "meta/info.json").write_text("{"), "meta/info.json: EOF while parsing"),
    "no features": (lambda f: rewrite(f, lambda info: info.pop("features")), "info.json: missing field `features`"),
    "old": (lambda f: rewrite(f, lambda info: info.update(codebase_version="v1.6")), "a data set in format v1.6"),
    "no clock": (drop("timestamp"), f"{DATA}: no column `timestamp`"),
    "no action": (drop("action"), f"{DATA}: no column `action`"),
    "still": (put("timestamp", [0.0, 0.1, 0.1]), "the clock does not increase at sample 2: 0.1 s, then 0.1 s"),
    "text": (put("action", ["a", "b", "c"]), "the column `action` holds no numbers"),
    "ragged": (put("action", [[1.0], [1.0, 2.0], [3.0]]), "`action` has not the same count of numbers in each frame"),
    "null": (put("action", [[1.0, 2.0], None, [3.0, 4.0]]), "`action` has not the same count of numbers in each frame"),
    "foreign": (put("episode_index", [7, 7, 7]), "no frame of episode 0 in the data"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_sets_end_in_messages(case: str, tmp_path: Path) -> None:
    spoil, message = BROKEN[case]
    folder = write_v2(tmp_path, episodes([3]), JOINTS)
    spoil(folder)
    with pytest.raises(btr.BtrError) as raised:
        btr.load_log(folder)
    assert message in str(raised.value) and "\nhelp: " in str(raised.value)


def test_damaged_bytes_end_in_messages(tmp_path: Path) -> None:
    """Damaged data gives an error of btr or numbers."""
    folder = write_v2(tmp_path, episodes([30]), JOINTS)
    file = folder / DATA
    whole, random = file.read_bytes(), np.random.default_rng(1)
    for _ in range(300):
        spoilt = bytearray(whole)
        for place in random.integers(0, len(spoilt), 3):
            spoilt[place] = random.integers(0, 256)
        file.write_bytes(spoilt)
        try:
            btr.load_log(folder)
        except btr.BtrError:
            pass


def test_missing_episodes_are_named(tmp_path: Path) -> None:
    folder = write_v3(tmp_path / "set", episodes(LENGTHS), JOINTS)
    for episode in (3, -1):
        with pytest.raises(btr.BtrError, match=f"no episode `{episode}` of this data set of 3\nhelp: name an episode"):
            btr.load_log(folder, episode=episode)
    with pytest.raises(btr.BtrError, match="which episode of this data set of 3"):
        btr.load_log(folder)
    with pytest.raises(btr.BtrError, match="not a log format that btr reads"):
        btr.load_log(tmp_path, episode=0)
    with pytest.raises(TypeError, match="an episode is one of a data set's folder"):
        btr.load_log(btr.load_log(folder, episode=0).to_dict(), episode=0)
