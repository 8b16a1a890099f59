"""Logs in memory: the `[channels]` of a model, times, channels as a mapping, and names."""

import warnings
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest

import btr

ROBOTS = Path(__file__).parents[2] / "robots"
LEARN = sorted((ROBOTS / "arm").glob("learn_*.csv"))
CHANNELS = """
[channels]
time = "stamp_ms"
[channels.channels]
"q_{joint}" = "{joint}_deg"
"cmd_{joint}" = { column = "{joint}_goal", factor = 2.0 }
"""


@pytest.fixture(scope="module")
def arm() -> btr.Model:
    return btr.load_model(ROBOTS / "arm.toml")


@pytest.fixture(scope="module")
def foreign(arm: btr.Model) -> btr.Model:
    """The arm with foreign channel names."""
    return btr.Model(f"{arm.text}{CHANNELS}", arm.path)


@pytest.fixture(scope="module")
def log() -> btr.Log:
    return btr.load_log(LEARN[0])


def renamed(log: btr.Log) -> dict[str, np.ndarray]:
    columns = {f"{name[2:]}_deg": np.rad2deg(values) for name, values in log.items() if name.startswith("q_")}
    return columns | {f"{name[4:]}_goal": values / 2 for name, values in log.items() if name.startswith("cmd_")}


def channels(result: btr.CompareResult) -> list:
    return [channel["rmse"] for channel in sorted(result.channels, key=lambda channel: channel["name"])]


def test_channel_names_are_mapped_for_every_source(foreign: btr.Model, log: btr.Log, tmp_path: Path) -> None:
    columns, known = renamed(log), channels(btr.compare(foreign, LEARN[0]))
    made = btr.Log(log.clock_s, columns)
    mapping = {"stamp_ms": 1000 * log.clock_s, **columns}
    given: list = [made, mapping, pytest.importorskip("pandas").DataFrame(mapping)]
    lines = [",".join(mapping), *(",".join(map(repr, row)) for row in zip(*(map(float, x) for x in mapping.values())))]
    (tmp_path / "foreign.csv").write_text("\n".join(lines) + "\n")
    given.append(tmp_path / "foreign.csv")
    for one in given:
        np.testing.assert_allclose(channels(btr.compare(foreign, one)), known, rtol=1e-6)
        read = btr.load_log(one, model=foreign)
        assert set(read.keys()) == set(log.keys()) and read.unit("q_yaw") == "rad"
        np.testing.assert_allclose(read["q_yaw"], log["q_yaw"], atol=1e-12)
        assert btr.load_log(read, model=foreign) is read, "once is enough"
        assert len(foreign.simulate(one)) == len(foreign.simulate(read))
        assert channels(btr.compare(foreign, read)) == pytest.approx(known, rel=1e-6)
    assert btr.load_log(made)["yaw_deg"].tobytes() == columns["yaw_deg"].tobytes(), "no model maps it"


def test_a_log_under_btrs_names_stays_as_it_is(arm: btr.Model, log: btr.Log) -> None:
    scaled = '[channels.channels]\n"q_{joint}" = { column = "q_{joint}", factor = 0.5 }\n'
    model = btr.Model(f"{arm.text}\n{scaled}", arm.path)
    assert btr.load_log(log, model=model) is log and btr.compare(model, log).channels == btr.compare(arm, log).channels
    raw = btr.load_log({"t": log.clock_s, "q_yaw": log["q_yaw"]}, model=model)
    assert raw["q_yaw"].tobytes() == (0.5 * log["q_yaw"]).tobytes(), "columns are as in a file"


def test_missing_columns_of_the_model_are_reported(foreign: btr.Model) -> None:
    model = btr.Model(foreign.text.replace('"q_{joint}" =', 'q_nose = "snout"\n"q_{joint}" ='), foreign.path)
    columns = {"t": [0.0, 0.1], "yaw_deg": [0.0, 1.0]}
    for made in (columns, btr.Log(columns["t"], {"yaw_deg": columns["yaw_deg"]})):
        with pytest.warns(UserWarning, match="the mapping names `snout` for `q_nose`") as heard:
            btr.load_log(made, model=model)
        assert [warning.filename for warning in heard] == [__file__]


def test_a_log_has_its_channels_as_a_mapping_has(log: btr.Log) -> None:
    assert list(log) == log.keys() == [name for name, _ in log.items()] == list(dict(log))
    assert all(values.tobytes() == log[name].tobytes() for name, values in log.items())
    assert [values.tobytes() for values in log.values()] == [log[name].tobytes() for name in log]
    assert log.get("q_nose") is None and log.get("q_nose", 3) == 3
    yaw = log.get("q_yaw")
    assert yaw is not None and yaw.tobytes() == log["q_yaw"].tobytes() and {**log}.keys() == set(log)


def test_times_are_seconds_from_the_first_one() -> None:
    seconds, q = np.array([0.0, 0.01, 0.025]), [0.0, 1.0, 2.0]
    since = (seconds * 1e9).astype("timedelta64[ns]")
    begin = datetime(2026, 5, 1, 12, tzinfo=timezone.utc)
    aware = np.array([begin + timedelta(seconds=s) for s in seconds])
    for times in (since, np.datetime64("2026-05-01T12:00") + since, aware, list(aware)):
        np.testing.assert_allclose(btr.load_log({"t": times, "q_a": q}).clock_s, seconds, atol=1e-9)
    pandas = pytest.importorskip("pandas")
    stamps = pandas.to_datetime(1.7e9 + seconds, unit="s")
    for times in (stamps, stamps.tz_localize("UTC"), pandas.to_timedelta(seconds, unit="s")):
        np.testing.assert_allclose(btr.load_log(pandas.DataFrame({"t": times, "q_a": q})).clock_s, seconds, atol=1e-6)
    with pytest.raises(btr.BtrError, match="column `t`: sample 1 has no time"):
        btr.load_log({"t": np.array(["2026-05-01", "NaT", "2026-05-02"], dtype="datetime64[s]"), "q_a": q})
    with pytest.raises(TypeError, match="clock_s holds times, not numbers\nhelp: btr.load_log"):
        btr.Log(since, {"q_a": q})
    for made in (lambda: btr.Log(seconds, {"q_a": since}), lambda: btr.load_log({"t": seconds, "q_a": since})):
        with pytest.raises(TypeError, match="q_a.* holds times, not numbers"):
            made()


def test_logs_are_counted_within_a_call(arm: btr.Model, log: btr.Log) -> None:
    columns = {"t": log.clock_s, **log.to_dict()}
    for _ in range(2):
        made = btr.Log(log.clock_s, log.to_dict())
        named = btr.Log(log.clock_s, log.to_dict(), "monday")
        checked = btr.check(arm, [LEARN[0], made, named, columns, arm.simulate(LEARN[0]), made])
        assert [entry["log"] for entry in checked.logs[1:]] == ["log 1", "monday", "log 2", "simulated 3", "log 1"]
    with pytest.raises(btr.BtrError, match="log 1 is both a training log and held out"):
        btr.fit(arm, made, held_out=made)
    with pytest.raises(btr.BtrError, match="log 2: .*does not increase"):
        btr.check(arm, [made, {"t": [0.0, 0.0], "q_yaw": [0.0, 0.0]}])
    assert made.name == Path("log") and not made.is_named and named.is_named


def test_each_warning_points_to_the_calling_line(arm: btr.Model, log: btr.Log) -> None:
    still = dict(log.to_dict(), q_yaw=np.rad2deg(log["q_yaw"]))
    heard = []
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        warnings.showwarning = lambda message, kind, file, line, *_: heard.append((str(message), file, line))
        for _ in range(2):
            btr.fit(arm, btr.Log(log.clock_s, still))
    assert len(heard) >= 2 and len(heard) == 2 * len(set(heard)), heard
    assert {file for _, file, _ in heard} == {__file__} and all(text.startswith("log 1: ") for text, _, _ in heard), (
        heard
    )
