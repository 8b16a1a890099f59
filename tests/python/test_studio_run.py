"""The studio of a run without its page: what the folder says as the run grows, and real tests beside simulations."""

import json
import math
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("viser", reason="the studio needs viser")

import numpy as np

import btr
from btr._studio import robot as robots
from btr._studio.replay import Replay, Run
from btr._studio.run import panels
from btr._studio.run.folder import Snapshot, Truth
from btr._studio.run.motion import FRAME_S, motion_of
from btr._studio.run.session import Course, RunSession
from btr._studio.run.strip import colour_of_merit, merits, places
from btr._studio.run.view import MOST_WALKERS, chosen

ROBOTS = Path(__file__).parents[2] / "robots"
SMALL = {"coevolve.iterations": 3, "coevolve.controllers.generations": 2, "coevolve.simulators.generations": 3}
HOSTILE = "<img src=x onerror=alert(1)>"


class Watched:
    """A small run, and what a session saw of it after every iteration."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.session, self.seen = folder, None, []
        self.result = btr.coevolve(btr.load_model(ROBOTS / "disengage.toml", SMALL), out=folder, tell=self.look)

    def look(self, closed: btr.documents.Iteration) -> None:
        is_new = self.session is None or self.session.refresh()
        self.session = self.session or RunSession(self.folder)
        now = self.session.now
        ending = self.session.truth or self.session.conclusions or None
        self.seen.append((is_new, closed.i, len(now.iterations), len(now.tests), ending, now.stop_reason))


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Watched:
    return Watched(tmp_path_factory.mktemp("run"))


@pytest.fixture
def folder(watched: Watched, tmp_path: Path) -> Path:
    """A copy of the run, to be damaged."""
    return Path(shutil.copytree(watched.folder, tmp_path / "copy"))


def test_a_run_is_seen_as_it_grows(watched: Watched) -> None:
    assert watched.seen == [(True, k, k, 2 * k, None, "iterations_done" if k == 3 else None) for k in (1, 2, 3)]
    session = watched.session
    assert session.refresh() and not session.refresh()
    assert session.now.stop_reason == "iterations_done" and session.now.planned == 3
    assert [len(session.now.controllers), len(session.now.simulators)] == [6, 3 * (3 + 5)]
    assert all(generation.best <= generation.mean for generation in session.now.simulators)
    assert session.truth.parameters["mass@bob"] == 1.2 and session.truth.effects == ("coulomb_friction@hinge",)


def test_conclusions_are_those_of_the_run(watched: Watched, folder: Path) -> None:
    session = RunSession(watched.folder)
    assert session.conclusions == watched.result.conclusions and len(session.conclusions) > 5
    assert any(said.startswith("best in reality: fitness") for said in session.conclusions)
    history = json.loads((folder / "history.json").read_text())
    for stale in ({"stop_reason": "disengaged"}, {"real_tests": 5}):
        (folder / "history.json").write_text(json.dumps({**history, **stale}))
        gone_on = RunSession(folder)
        assert gone_on.conclusions == [] and gone_on.truth == session.truth


def test_the_parameters_of_a_tried_controller_are_shown(watched: Watched) -> None:
    session = RunSession(watched.folder)
    controller = session.now.done[1].trial.controller
    shown = re.sub("<[^>]+>", " ", panels.controller("test 0001", session.model.controllers, controller))
    amplitude, phase = (f"{value:.4g} rad" for value in controller)
    told = ["parameter", "value", "range", "amplitude@hinge", *amplitude.split(), "0", "..", "0.6"]
    told += ["phase@hinge", *phase.split(), "-3.142", "..", "3.142"]
    assert shown.split() == ["Controller", "of", "test", "0001", *told]
    assert panels.controller("test 0000", [], []) == "", "of a fixed drive"


def test_phi_is_explained(watched: Watched) -> None:
    told = panels.phi(RunSession(watched.folder).now.distance)
    assert "phi is the distance between what the robot did and what the simulation does" in told
    assert "by rmse (root mean square error, channels scaled" in told and "Less is better" in told
    assert "same controllers, as the mean" in panels.phi(None)


def test_tests_are_called_as_their_folders_are(watched: Watched) -> None:
    tests = RunSession(watched.folder).now.tests
    names = re.findall(r"test \d+", panels.tests(tests))
    assert names == [f"test {path.name}" for path in sorted((watched.folder / "transfers").iterdir())]


def test_parameters_are_beside_their_bounds_and_the_truth(watched: Watched) -> None:
    mass, gain = RunSession(watched.folder).courses
    assert (mass.dim.name, mass.dim.min, mass.dim.max, mass.truth) == ("mass@bob", 0.5, 1.5, 1.2)
    assert mass.values[0] == 1.0 and len(mass.values) == 4 and gain.truth == 9.0
    assert mass.intervals == [None] * 4


def test_a_real_test_is_beside_its_simulations(watched: Watched) -> None:
    session = RunSession(watched.folder)
    first = session.tested(session.now.done[0])
    before, after = (np.sqrt(np.mean(replay.residual("q_hinge") ** 2)) for replay in (first.before, first.after))
    assert after < 0.5 * before
    assert first.channels[0] == "q_hinge" and not any(name.startswith("cmd_") for name in first.channels)
    best = max(session.now.done, key=lambda test: test.verdict.done.fitness)
    assert best.trial.iteration == 1, "the simulation before it is the first one"
    written = btr.load_log(watched.folder / "simulated_before.mcap")
    assert session.tested(best).before.simulated["q_hinge"] == pytest.approx(written["q_hinge"], abs=1e-12)


def test_without_controllers_the_commands_are_replayed(folder: Path) -> None:
    session = RunSession(folder)
    expected = session.tested(session.now.done[0]).before.simulated["q_hinge"]
    replaying = RunSession(folder)
    replaying.model = btr.load_model(folder / "adapted.toml")
    simulated = replaying.tested(replaying.now.done[0]).before.simulated["q_hinge"]
    assert simulated == pytest.approx(expected, abs=0.01), "from the first reading on, which has noise"


def test_a_test_whose_iteration_is_open_has_no_simulation_after_it(watched: Watched) -> None:
    session = RunSession(watched.folder)
    session.now.iterations.pop()
    assert session.tested(session.now.done[-1]).after is None
    assert session.tested(session.now.done[0]).after is not None


def test_nothing_is_written(watched: Watched) -> None:
    def files() -> dict[Path, tuple[int, bytes]]:
        return {p: (p.stat().st_mtime_ns, p.read_bytes()) for p in watched.folder.rglob("*") if p.is_file()}

    before = files()
    session = RunSession(watched.folder)
    for test in session.now.done:
        session.tested(test)
    session.refresh()
    assert files() == before


def test_a_log_that_is_gone_or_damaged_is_no_error(folder: Path) -> None:
    (folder / "transfers/0000/log.mcap").unlink()
    (folder / "transfers/0001/log.mcap").write_bytes(b"damaged")
    (folder / "history.json").write_text("{")
    session = RunSession(folder)
    assert [session.tested(test) is None for test in session.now.done] == [True, True, False, False, False, False]
    assert session.truth is None and session.courses[0].truth is None


def test_a_folder_without_a_run_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(btr.BtrError, match="contains no run of an experiment\nhelp: name the folder"):
        btr.studio(tmp_path)
    with pytest.raises(btr.BtrError, match="is no folder of a run"):
        btr.studio(tmp_path / "missing")
    with pytest.raises(btr.BtrError, match="no log is given"):
        btr.studio(btr.load_model(ROBOTS / "arm.toml"))


def test_damage_is_told_and_what_was_known_stays(folder: Path) -> None:
    session, path = RunSession(folder), folder / "checkpoint.bin"
    whole = path.read_bytes()
    known = session.now
    path.write_bytes(whole[:-1])
    with pytest.raises(btr.BtrError, match="cannot be used: its checksum does not match"):
        session.refresh()
    with pytest.raises(btr.BtrError, match="cannot be used"):
        RunSession(folder)
    assert session.now is known
    path.write_bytes(whole)
    assert session.refresh() and session.now.tests == known.tests
    (folder / "experiment.toml").write_text("# --seed 2\nname = 'other'\n")
    with pytest.raises(btr.BtrError, match="is not the experiment that"):
        RunSession(folder)


def test_files_of_the_robot_are_beside_the_experiment(tmp_path: Path) -> None:
    short = {"simulation.duration_s": 1.0, "coevolve.iterations": 1, "coevolve.controllers.generations": 1}
    btr.coevolve(btr.load_model(ROBOTS / "quadruped.toml", short), out=tmp_path / "run")
    with pytest.raises(btr.BtrError, match="help: name the file of the run's experiment as well"):
        RunSession(tmp_path / "run")
    session = RunSession(tmp_path / "run", ROBOTS / "quadruped.toml")
    assert session.tested(session.now.done[0]).before.failed is None


def test_links_move_as_their_joints_do() -> None:
    """The tip of the arm, and the same for a base that floats and a reading that is missing."""
    drawn = robots.robot_of(btr.load_model(ROBOTS / "arm.toml"))
    joints = {"yaw": 0.3, "shoulder": -0.7, "elbow": 0.4}
    clock = np.arange(0.0, 0.5, 0.01)
    log = btr.Log(clock, {f"q_{name}": np.full(len(clock), value) for name, value in joints.items()})
    motion = motion_of(drawn, list(joints), Replay(Run("arm", log, False, None)))
    assert motion.xyz_m.shape == (math.ceil(0.49 / FRAME_S) + 1, 4, 3)
    elbow = [0.2 * math.cos(-0.7) * math.cos(0.3), 0.2 * math.cos(-0.7) * math.sin(0.3), 0.16 + 0.2 * math.sin(0.7)]
    assert motion.at(99.0)[1][3] == pytest.approx(elbow, abs=1e-6)
    held = log.to_dict() | {"q_elbow": np.where(clock > 0.1, np.nan, 0.4)}
    base = dict(zip(("base_x", "base_y", "base_z"), (1.0 + 0.0 * clock, 2.0 + 0.0 * clock, 0.0 * clock)))
    turned = {"base_qw": np.sqrt(0.5), "base_qx": 0.0, "base_qy": 0.0, "base_qz": np.sqrt(0.5)}
    simulated = base | {name: np.full(len(clock), value) for name, value in turned.items()}
    floating = motion_of(drawn, list(joints), Replay(Run("arm", btr.Log(clock, held), False, None), simulated))
    assert floating.at(0.4)[1][3] == pytest.approx([1.0 - elbow[1], 2.0 + elbow[0], elbow[2]], abs=1e-6)


def test_the_best_and_the_latest_tests_are_side_by_side() -> None:
    def test(number: int) -> SimpleNamespace:
        verdict = SimpleNamespace(done=SimpleNamespace(fitness=100.0 if number == 3 else float(number)))
        return SimpleNamespace(trial=SimpleNamespace(number=number), verdict=verdict)

    numbers = [shown.trial.number for shown in chosen([test(number) for number in range(50)])]
    assert numbers == [3, *range(50 - MOST_WALKERS + 1, 50)]
    assert len(chosen([test(number) for number in range(MOST_WALKERS)])) == MOST_WALKERS


def test_many_robots_stand_in_rows() -> None:
    assert places(4).tolist() == [[0.0, -1.5], [0.0, -0.5], [0.0, 0.5], [0.0, 1.5]]
    twelve = places(12)
    assert twelve[:6, 0].tolist() == [-1.0] * 6 and twelve[6:, 0].tolist() == [0.0] * 6
    assert len(np.unique(places(8), axis=0)) == 8 and np.ptp(places(8)[:, 1]) == 3.0
    assert places(0).shape == (0, 2)


def test_the_best_is_green_and_the_worst_is_red() -> None:
    assert merits({0: -1.0, 1: None, 2: 3.0, 3: 1.0}) == {0: 0.0, 1: 0.0, 2: 1.0, 3: 0.5}
    assert merits({0: 2.0}) == {0: 0.5}
    worst, best = colour_of_merit(0.0), colour_of_merit(1.0)
    assert worst[0] > worst[1] and best[1] > best[0]


def test_names_are_escaped() -> None:
    known = {"name": HOSTILE, "unit": HOSTILE, "min": 0.0, "max": 2.0, "scale": "linear", "nominal": 1.0}
    course = Course(btr.documents.Dimension(known), [1.0, 2.0], [None, (0.5, 1.5)], 1.5)
    failed = btr.documents.TestEntry(
        {
            "trial": {"number": 0, "iteration": 1, "controller": [], "scenario": 0},
            "promised": None,
            "promised_ci95": None,
            "verdict": {"failed": {"why": HOSTILE}},
        }
    )
    run = Snapshot("", None, None, 1, HOSTILE, None, HOSTILE, [], [], [], [], [failed], 0)
    texts = [
        panels.head(HOSTILE, run, 3.0, HOSTILE),
        panels.parameters([course], Truth({}, (HOSTILE,))),
        panels.tests([failed]),
        panels.conclusions([HOSTILE]),
        panels.controller(HOSTILE, [course.dim], [1.0]),
    ]
    for text in texts:
        assert "&lt;img" in text and "<img" not in text
    assert "last step 3 s ago" in texts[0]


def test_a_value_is_drawn_between_its_bounds() -> None:
    known = {"name": "x", "unit": "1", "min": 0.01, "max": 100.0, "scale": "log", "nominal": 1.0}
    course = Course(btr.documents.Dimension(known), [0.01, 1.0], [None, None], 100.0)
    drawn = panels.parameters([course], None)
    assert 'points="0.00,24.00 100.00,12.00"' in drawn and 'y1="0.00"' in drawn
