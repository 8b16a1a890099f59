"""The studio's page without a browser: who is answered, what is escaped, and how the robot is drawn."""

import contextlib
import http.client
import math
import queue
import socket
import warnings
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest

viser = pytest.importorskip("viser", reason="the studio needs viser")

import numpy as np

import btr
from btr._studio import panels
from btr._studio import server as server_module
from btr._studio.candidates import Candidate
from btr._studio.doubts import Doubts
from btr._studio.failures import covered, place
from btr._studio.player import Player
from btr._studio.plots import Lines, extremes
from btr._studio.replay import Replay, Run, error
from btr._studio.robot import parsed, robot_of
from btr._studio.scene import STEPS, Figure, Scene, colour_of
from btr._studio.server import Server, serve
from btr._studio.session import Session
from btr._studio.view import labels
from studio_served import served

__all__ = ["served"]

ROBOTS = Path(__file__).parents[2] / "robots"
HOSTILE = "<img src=x onerror=alert(1)>"


def ask(address: str, path: str = "/", **headers: str) -> tuple[int, dict[str, str], bytes]:
    place = urlsplit(address)
    connection = http.client.HTTPConnection(place.hostname, place.port, timeout=10)
    connection.putrequest("GET", path, skip_host=True, skip_accept_encoding=True)
    for key, value in {"Host": place.netloc, **headers}.items():
        connection.putheader(key, value)
    connection.endheaders()
    response = connection.getresponse()
    return response.status, dict(response.getheaders()), response.read()


@pytest.fixture(scope="module")
def cookie(served: tuple[Server, str]) -> str:
    _, address = served
    place = urlsplit(address)
    status, headers, _ = ask(address, f"{place.path}?{place.query}")
    assert status == 302 and headers["Location"] == "/", "the token leaves the address"
    assert "HttpOnly" in headers["Set-Cookie"] and "SameSite=Lax" in headers["Set-Cookie"]
    return headers["Set-Cookie"].partition(";")[0]


def socket_of(address: str, origin: str | None) -> dict[str, str]:
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"}
    keys = {"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Protocol": f"viser-v{viser.__version__}"}
    return {**upgrade, **keys, **({} if origin is None else {"Origin": origin})}


def test_only_the_token_opens_the_page(served: tuple[Server, str], cookie: str) -> None:
    _, address = served
    assert ask(address)[0] == 403
    assert ask(address, "/?token=guessed")[0] == 403
    assert ask(address, Cookie=cookie[:-1])[0] == 403
    status, headers, page = ask(address, Cookie=cookie)
    assert status == 200 and b"<html" in page
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert headers["X-Frame-Options"] == "DENY"


def test_the_page_is_called_as_its_model_is(
    served: tuple[Server, str], cookie: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    server, address = served
    monkeypatch.setattr(server.guard, "title", f"{HOSTILE} - btr studio")
    for encoding in ({}, {"Accept-Encoding": "gzip"}):
        _, headers, page = ask(address, Cookie=cookie, **encoding)
        assert b"<title>&lt;img src=x onerror=alert(1)&gt; - btr studio</title>" in page
        assert int(headers["Content-Length"]) == len(page)


def test_other_hosts_are_refused(served: tuple[Server, str], cookie: str) -> None:
    _, address = served
    port = urlsplit(address).port
    for host in ("evil.example", f"evil.example:{port}", f"127.0.0.1.evil.example:{port}", "", "[", "::1]"):
        assert ask(address, Cookie=cookie, Host=host)[0] == 403, host
    for host in ("localhost", "192.168.1.2", "[::1]", socket.gethostname().upper(), f"{socket.gethostname()}.local"):
        assert ask(address, Cookie=cookie, Host=f"{host}:{port}")[0] == 200, host


def test_other_origins_are_refused(served: tuple[Server, str], cookie: str) -> None:
    _, address = served
    own = f"http://{urlsplit(address).netloc}"
    for origin in ("http://evil.example", "null", "http://127.0.0.1:1", f"{own}.evil.example", None):
        assert ask(address, Cookie=cookie, **socket_of(address, origin))[0] == 403, origin
    assert ask(address, Cookie=cookie, Origin="http://evil.example")[0] == 403
    assert ask(address, **socket_of(address, own))[0] == 403, "no token"
    assert ask(address, Cookie=cookie, **socket_of(address, own))[0] == 101


def test_no_other_file_is_served(served: tuple[Server, str], cookie: str) -> None:
    _, address = served
    for path in ("/../../../../../../etc/passwd", "/%2e%2e/%2e%2e/_viser.py", "//etc/passwd", str(ROBOTS / "arm.toml")):
        assert ask(address, path, Cookie=cookie)[0] == 404, path


def test_nothing_is_shared_with_the_internet(served: tuple[Server, str], monkeypatch: pytest.MonkeyPatch) -> None:
    def tunnel(*_: object) -> None:
        raise AssertionError("a tunnel to the internet")

    monkeypatch.setattr("viser._viser.ViserTunnel", tunnel)
    assert served[0].request_share_url() is None


def test_a_viser_that_cannot_be_guarded_does_not_serve(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "_guarding", lambda _: contextlib.nullcontext())
    with pytest.raises(RuntimeError, match="this version of viser"):
        serve("127.0.0.1", 0)


def test_names_are_escaped() -> None:
    hostile = SimpleNamespace(joint=HOSTILE, regime="fast", chi=3.0, hint=HOSTILE, log=HOSTILE, t0=0.0, t1=1.0)
    verdict = SimpleNamespace(sentences=[HOSTILE, HOSTILE])
    comparison = SimpleNamespace(verdict=verdict, failures=[hostile], warnings=[HOSTILE], not_judged=[HOSTILE])
    likely = (SimpleNamespace(name=HOSTILE, probability=0.3),)
    card = Candidate((HOSTILE,), HOSTILE, HOSTILE, (HOSTILE,), 0.5, True, (HOSTILE,), likely, 1.0)
    rival = SimpleNamespace(effect=HOSTILE, separation=2.0)
    texts = [
        panels.head(HOSTILE, HOSTILE, 1.0, 1.0),
        panels.head("arm", "model as it stands", 1.0, 1.0, left_out=[HOSTILE]),
        panels.ladder([(HOSTILE, 1.0, 1.0)], HOSTILE),
        panels.sentence(comparison, HOSTILE),
        panels.regimes(comparison, [HOSTILE], HOSTILE),
        panels.card(card),
        panels.card(replace(card, alike=())),
        panels.verdict(HOSTILE, is_current=True),
        panels.verdict(HOSTILE, is_current=False),
        panels.no_experiment([HOSTILE]),
        panels.note(HOSTILE),
        panels.doubts(Doubts(HOSTILE, [(HOSTILE, HOSTILE, HOSTILE)], [HOSTILE])),
        panels.regimes(comparison, [HOSTILE], HOSTILE, 0),
        panels.at_bounds([(SimpleNamespace(name=HOSTILE, unit=HOSTILE, min=0.0, max=1.0), 1.0)]),
        panels.commands(HOSTILE, HOSTILE),
        panels.lines({HOSTILE: "red"}),
        panels.lines({"model": "red"}, HOSTILE),
        panels.next_experiment(SimpleNamespace(sentence=HOSTILE, rivals=[rival])),
    ]
    for text in texts:
        assert "&lt;img" in text and "<img" not in text


def failure(regime: str, words: str, chi: float, joint: str = "yaw") -> SimpleNamespace:
    hint = f"{joint}, {words}: {chi} noise floors; the residual follows no single quantity"
    return SimpleNamespace(joint=joint, regime=regime, chi=chi, hint=hint, log="monday", t0=1.25, t1=2.0)


def test_the_map_has_the_cell_that_the_sentence_names_or_says_why_not() -> None:
    cells = [failure("after_reversal", "after reversals", 39.8), failure("high_load", "under high load", 52.1)]
    cells.append(failure("fast", "moving fast", 60.0, joint="elbow"))

    def told(sentence: str, cells: list[SimpleNamespace]) -> str:
        comparison = SimpleNamespace(verdict=SimpleNamespace(sentences=[sentence]), failures=cells)
        return panels.regimes(comparison, ["yaw", "elbow"], "all 3 logs").replace("&#x27;", "'")

    off = "yaw: 30 x the noise floor (1 degrees rms); the residual follows the velocity"
    both = told(f"{off}, largest after reversals, where it is an offset", cells[:2])
    assert "Worst in the map: yaw under high load (52.1), mostly in monday." in both
    assert "The sentence names yaw after reversals (39.8), as its share of the joint's error" in both
    same = told(f"{off}, largest under high load", cells[:2])
    assert "Worst in the map: yaw under high load (52.1)" in same and "The sentence" not in same
    assert "elbow moving fast (60.0)" in (other := told(f"{off}, largest under high load", cells))
    assert "The sentence names yaw under high load (52.1)" in other
    assert "The sentence is of the joint's whole motion." in told(off, cells)
    comparison = SimpleNamespace(verdict=SimpleNamespace(sentences=[off]), failures=cells)
    chosen = panels.regimes(comparison, ["yaw", "elbow"], "all 3 logs", 1)
    assert chosen.count("outline") == 1 and "A click" not in chosen
    assert "Shown: yaw under high load (52.1); most of that error in monday is from 1.25 s to 2.00 s." in chosen
    little = told("every joint is within 1.5 x the noise floor: most of it in yaw after reversals", cells[:2])
    assert "names yaw after reversals (39.8), as it has most of the error of all joints" in little


def test_sentence_and_map_say_which_logs_they_are_of() -> None:
    log = btr.Log([0.0, 0.1], {"q_a": [0.0, 0.0]})
    runs = [Run("x.csv", log, held, None) for held in (False, False, True)]
    assert covered(runs) == "all 3 logs as a whole: 2 training, 1 held out"
    assert covered(runs[:2]) == "all 2 logs as a whole" and covered(runs[:1]) == "the log as a whole"
    verdict = SimpleNamespace(sentences=["yaw: off"])
    cells = [failure("fast", "moving fast", 9.0)]
    comparison = SimpleNamespace(verdict=verdict, failures=cells, warnings=[], not_judged=[])
    for text in (panels.sentence(comparison, covered(runs)), panels.regimes(comparison, ["yaw"], covered(runs))):
        assert "of all 3 logs as a whole: 2 training, 1 held out" in text.lower()


def test_a_cell_of_the_map_is_a_place_in_a_log() -> None:
    clock = np.arange(0.0, 4.0, 0.01)
    log = btr.Log(clock, {"q_yaw": np.zeros(400)})

    def replay(path: str, error: float) -> Replay:
        return Replay(Run(path, log, False, path), {"q_yaw": np.where(clock > 1.0, error, 0.0)})

    cell = failure("fast", "moving fast", 9.0)
    replays = [replay("tuesday.csv", 9.0), replay("a/monday.csv", 1.0), replay("b/monday.csv", 2.0)]
    assert place(cell, replays) == (2, 1.25), "of the logs with this name, the one with the error"
    cell.log = "tuesday from 1.5 s"
    assert place(cell, replays) == (0, 2.75), "a piece between gaps"


def test_only_the_page_can_click(served: tuple[Server, str], cookie: str) -> None:
    server, address = served
    clicks: queue.Queue[int] = queue.Queue()
    server.guard.clicked = clicks.put
    click = {"X-Btr-Studio": "1"}
    assert ask(address, "/clicks/7", Cookie=cookie, **click)[0] == 200
    assert clicks.get(timeout=5.0) == 7
    for path, headers in (
        ("/clicks/8", {"Cookie": cookie}),
        ("/clicks/8", click),
        ("/clicks/x", {"Cookie": cookie, **click}),
        ("/clicks/8", {"Cookie": cookie, "Origin": "http://evil.example", **click}),
    ):
        assert ask(address, path, **headers)[0] in (403, 404), (path, headers)
    assert clicks.empty()


def test_a_verdict_stands_out_from_its_evidence() -> None:
    told = panels.verdict("missing: a@b\na@b: probability 0.9\n  size = 1", is_current=True)
    verdict, _, evidence = told.partition("missing: a@b")
    assert "font-weight:600" in verdict and "font-weight" not in evidence and "a@b: probability 0.9<br>" in evidence


def test_errors_are_told_in_few_digits() -> None:
    assert "1.02" in panels.head("arm", "fitted", 1.0234, None)
    assert "infinite" in panels.head("arm", "set by hand", math.inf, None)


def test_held_out_logs_are_marked_and_labels_are_unique() -> None:
    log = btr.Log([0.0, 0.1], {"q_a": [0.0, 0.0]})
    runs = [Run(name, log, held, None) for name, held in (("a/x.csv", False), ("b/x.csv", False), ("y.csv", True))]
    assert labels(runs) == ["a/x.csv", "b/x.csv", "y.csv (held out)"]
    assert labels([runs[2], runs[2]]) == ["1: y.csv (held out)", "2: y.csv (held out)"]


def test_time_runs_at_its_speed_and_begins_again() -> None:
    player = Player(lambda _: None)
    player.end_s, player.speed = 4.0, 0.5
    assert player.step(1.0) == 0.5
    player.time_s = 3.9
    assert player.step(1.0) == pytest.approx(0.4)
    player.loops, player.time_s = False, 3.9
    player.play()
    assert player.step(1.0) == 4.0 and not player.playing
    player.play()
    assert player.time_s == 0.0, "it begins again after the end"
    player.end()


def test_errors_count_missing_readings_as_none() -> None:
    log = btr.Log([0.0, 0.1, 0.2], {"q_a": [0.0, math.nan, 0.3]})
    replay = Replay(Run("x", log, False, None), {"q_a": np.array([0.0, 9.0, 0.0])})
    assert error([replay], {"q_a": 0.1}) == pytest.approx(3.0 / math.sqrt(2))
    assert error([], {"q_a": 0.1}) is None


def test_thinned_lines_keep_their_extremes() -> None:
    values = np.sin(np.linspace(0.0, 40.0, 10_007))
    values[[1234, 7777]], values[5000:5003] = (9.0, -9.0), math.nan
    for most in (100, 800, 10_006):
        kept = extremes(values, most)
        assert {1234, 7777} <= set(kept.tolist()) and len(kept) <= most
        assert np.all(np.diff(kept) > 0)
        assert kept[0] < len(values) * 2 / most and kept[-1] > len(values) * (1 - 2 / most)
    assert extremes(values[:50], 100).tolist() == list(range(50))
    assert len(extremes(np.full(1000, math.nan), 100)) <= 100


def test_the_cursor_is_at_its_time_in_thinned_lines() -> None:
    clock = np.arange(0.0, 40.0, 0.01)
    lines = Lines(clock, [np.sin(clock)], np.sin(clock))
    for most in (100, 4000):
        shown, sine, cursor = lines.at(20.0, most)
        drawn = np.flatnonzero(np.isfinite(cursor))
        begin = drawn[0]
        assert cursor[begin] == 0.0 and np.nanmax(cursor) == 1.0
        # uPlot draws nothing of what is narrower than a pixel.
        assert shown[drawn[-1]] - shown[begin] >= 40.0 / 300
        assert shown[begin] == pytest.approx(20.0, abs=2 * 40.0 / most)
        assert np.array_equal(sine, np.sin(shown)) and len(shown) <= most


def test_colours_grow_with_the_error() -> None:
    assert [colour_of(-error) for error in (0.0, 3.0, 7.0, 15.0, 1e9)] == [colour for _, colour in STEPS]


def test_every_robot_has_a_drawing() -> None:
    arm = robot_of(btr.load_model(ROBOTS / "arm.toml"))
    assert [link.joint for link in arm.links] == ["", "yaw", "shoulder", "elbow"]
    assert arm.reach_m == pytest.approx(0.54)
    (forearm,) = arm.rods(arm.links[3])
    assert forearm.end_m == (0.18, 0.0, 0.0), "through the centre of mass"
    nao = robot_of(btr.load_model(ROBOTS / "nao.toml"))
    assert set(btr.load_model(ROBOTS / "nao.toml").joints) <= {link.joint for link in nao.links}
    assert any(link.shapes for link in nao.links)


def test_a_urdf_that_is_none_is_an_error() -> None:
    for text in ("", "<robot>", "<robot><joint name='a'><parent link='b'/><child link='c'/></joint></robot>"):
        with pytest.raises(btr.BtrError, match="URDF"):
            parsed(text)


def test_the_figure_moves_as_its_joints_do(served: tuple[Server, str]) -> None:
    """The tip of the arm, by the frames of the scene and by hand."""
    server, _ = served
    figure = Figure(server, robot_of(btr.load_model(ROBOTS / "arm.toml")), "tested", ghost=False)
    yaw, shoulder, elbow = 0.3, -0.7, 0.4
    figure.pose({"yaw": yaw, "shoulder": shoulder, "elbow": elbow}, None)
    tip = np.array([0.18, 0.0, 0.0])
    for frame in reversed(list(figure.frames.values())):
        tip = viser.transforms.SO3(frame.wxyz).apply(tip) + frame.position
    out = 0.2 * math.cos(shoulder) + 0.18 * math.cos(shoulder + elbow)
    up = 0.16 - 0.2 * math.sin(shoulder) - 0.18 * math.sin(shoulder + elbow)
    assert tip == pytest.approx([out * math.cos(yaw), out * math.sin(yaw), up], abs=1e-6)


def test_the_program_tells_what_it_cannot_use(capfd: pytest.CaptureFixture[str]) -> None:
    from btr._studio.__main__ import main

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert main(["missing.toml", "missing.csv", "--no-browser"]) == 2
    assert "error: " in capfd.readouterr().err


MESHED = """<robot name="m"><link name="base">
<visual><geometry><mesh filename="{name}" scale="2 2 2"/></geometry></visual>
<collision><geometry><sphere radius="0.1"/></geometry></collision></link></robot>"""
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def test_meshes_are_read_from_beside_the_urdf_and_from_no_other_place(tmp_path: Path) -> None:
    folder = tmp_path / "arm_description" / "urdf"
    folder.mkdir(parents=True)
    secret, beside = tmp_path / "secret.obj", folder / "link.obj"
    secret.write_text(TRIANGLE)
    beside.write_text(TRIANGLE)
    (folder / "way_out.obj").symlink_to(secret)
    (folder / "link.txt").write_text(TRIANGLE)
    (folder / "broken.obj").write_text("no mesh")
    for name in ("link.obj", f"file://{beside}", "package://arm_description/urdf/link.obj"):
        (shape,) = parsed(MESHED.format(name=name), folder).links[0].shapes
        assert shape.kind == "mesh" and shape.mesh[0].max() == 2.0, name
    outside = ("../../secret.obj", str(secret), "package://other/secret.obj", "package://arm_description/../secret.obj")
    for name in (*outside, "way_out.obj", "link.txt", "broken.obj", "http://evil.example/link.obj"):
        (shape,) = parsed(MESHED.format(name=name), folder).links[0].shapes
        assert shape.kind == "sphere", f"{name}: the collision shape takes its place"


def test_the_y_axis_of_a_gltf_becomes_z(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box(extents=(1.0, 2.0, 3.0), transform=trimesh.transformations.translation_matrix((0, 5, 0)))
    (tmp_path / "link.glb").write_bytes(box.export(file_type="glb"))
    (shape,) = parsed(MESHED.format(name="link.glb"), tmp_path).links[0].shapes
    vertices = shape.mesh[0]
    assert vertices.min(axis=0).tolist() == [-1.0, -3.0, 8.0] and vertices.max(axis=0).tolist() == [1.0, 3.0, 12.0]


def test_readings_without_noise_have_no_floor(served: tuple[Server, str]) -> None:
    model = btr.load_model(ROBOTS / "emps.toml")
    session = Session(model, model.simulate())
    session.compare()
    assert 0.0 in session.floors.values()
    scene = Scene(served[0], robot_of(model), floats=False)
    scene.load(session.replay(0), model.joints, session.floors)
    scene.at(0)
    off = SimpleNamespace(joint="slide", regime="fast", chi=None, hint="", log="")
    verdict = SimpleNamespace(sentences=["slide is off"])
    assert "infinite" in panels.regimes(SimpleNamespace(failures=[off], verdict=verdict), ["slide"], "the log")
