"""Results and logs in notebooks: reports of the command line, plots, frames."""

import copy
import html
import pickle
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import browser
import btr

matplotlib = pytest.importorskip("matplotlib", reason="pictures need matplotlib")
matplotlib.use("Agg")

from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.colors import to_hex

from btr.plots import INK

ROBOTS = Path(__file__).parents[2] / "robots"
ARM = ROBOTS / "arm.toml"
LEARN = sorted((ROBOTS / "arm").glob("learn_*.csv"))[:1]
HELD_OUT = sorted((ROBOTS / "arm").glob("held_out_*.csv"))[:1]
FRICTION = "coulomb_friction@yaw"
# For each verb: the arguments of the command line after the model.
TOLD = {
    "compare": [*LEARN],
    "diagnose": [*LEARN, "--held-out", *HELD_OUT],
    "fit": [*LEARN, "--held-out", *HELD_OUT, "--add", FRICTION],
}


@pytest.fixture(scope="module")
def arm() -> btr.Model:
    return btr.load_model(ARM)


@pytest.fixture(scope="module")
def answers(arm: btr.Model) -> dict:
    return {
        "compare": btr.compare(arm, LEARN),
        "diagnose": btr.diagnose(arm, LEARN, held_out=HELD_OUT),
        "fit": btr.fit(arm, LEARN, held_out=HELD_OUT, add=[FRICTION]),
    }


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    pyplot.close("all")


@pytest.mark.parametrize("verb", TOLD)
def test_the_report_is_that_of_the_command_line(verb: str, answers: dict, tmp_path: Path) -> None:
    answers[verb].report(tmp_path / "python.html")
    command = [sys.executable, "-m", "btr", verb, ARM, *TOLD[verb], "--report", tmp_path / "command.html", "-q"]
    subprocess.run(list(map(str, command)), check=True, stdout=subprocess.DEVNULL)
    assert (tmp_path / "python.html").read_bytes() == (tmp_path / "command.html").read_bytes()


def test_printed_answers_say_what_the_command_line_says(arm: btr.Model, answers: dict) -> None:
    found = answers["diagnose"]
    (friction,) = found.effects
    (torque,) = friction.parameters
    low, high = torque.ci95
    lines = str(found).split("\n")
    assert any(line.startswith(f"{FRICTION}: probability ") for line in lines), lines
    estimate = f"  {torque.name} = {torque.value:.4g} N·m (95 %: {low:.4g} .. {high:.4g}"
    assert any(line.startswith(estimate) for line in lines), lines
    assert f"next: fitted = btr.fit(model, learn, add=['{FRICTION}'])" in lines
    fitted = answers["fit"]
    assert fitted.null_directions and all(direction.sentence in str(fitted) for direction in fitted.null_directions)
    checked = btr.check(arm, LEARN)
    assert f"rank {checked.rank} of {len(checked.parameters)}, condition number" in str(checked)
    assert all(re.search(rf"^{re.escape(p.name)} +{p.value:.4g} ", str(checked), re.M) for p in checked.parameters)


@pytest.mark.parametrize("verb", TOLD)
def test_answers_keep_their_reports_in_pickles(verb: str, answers: dict, tmp_path: Path) -> None:
    answer = answers[verb]
    for again in (pickle.loads(pickle.dumps(answer)), copy.deepcopy(answer)):
        assert again == answer and repr(again) == repr(answer) and again._repr_html_() == answer._repr_html_()


def test_a_report_does_not_overwrite_other_files(answers: dict, tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,q_yaw\n0,1\n")
    with pytest.raises(btr.BtrError, match=r"must end in \.html\nhelp: "):
        answers["compare"].report(log)
    with pytest.raises(btr.BtrError, match="nowhere"):
        answers["compare"].report(tmp_path / "nowhere" / "report.html")
    assert log.read_text() == "t,q_yaw\n0,1\n" and list(tmp_path.iterdir()) == [log]


def test_the_overlay_is_that_of_the_command_line(arm: btr.Model, answers: dict, tmp_path: Path) -> None:
    compared, path = answers["compare"], tmp_path / "python.mcap"
    compared.overlay(path)
    command = [sys.executable, "-m", "btr", "compare", ARM, *LEARN, "-o", tmp_path / "command.mcap", "-q"]
    subprocess.run(list(map(str, command)), check=True, stdout=subprocess.DEVNULL)
    assert path.read_bytes() == (tmp_path / "command.mcap").read_bytes()
    compared.overlay(path)  # An earlier one may be replaced.
    arm.simulate().write(tmp_path / "log.mcap")
    recording = (tmp_path / "log.mcap").read_bytes()
    with pytest.raises(btr.BtrError, match=r"may be a recording, which would be lost\nhelp: "):
        compared.overlay(tmp_path / "log.mcap")
    with pytest.raises(btr.BtrError, match=r"must end in \.mcap"):
        compared.overlay(tmp_path / "overlay.csv")
    assert (tmp_path / "log.mcap").read_bytes() == recording
    with pytest.raises(btr.BtrError, match="from a pickle has no logs to write\nhelp: compare again"):
        pickle.loads(pickle.dumps(compared)).overlay(path)


@pytest.mark.parametrize("verb", TOLD)
def test_a_notebook_shows_the_whole_report(verb: str, answers: dict, tmp_path: Path) -> None:
    answers[verb].report(tmp_path / "report.html")
    shown = re.fullmatch(r'<iframe srcdoc="([^"]*)"[^>]*></iframe>', answers[verb]._repr_html_())
    assert shown and html.unescape(shown[1]) == (tmp_path / "report.html").read_text()


def test_a_browser_draws_the_report_in_a_notebook(answers: dict, tmp_path: Path) -> None:
    if browser.found() is None:
        pytest.skip("no chromium")
    (tmp_path / "notebook.html").write_text(f"<!doctype html><body>{answers['compare']._repr_html_()}</body>")
    with browser.Browser() as running:
        page = running.page(tmp_path / "notebook.html")
        frame = "document.querySelector('iframe')"
        assert page.evaluate(f"{frame}.contentDocument.querySelectorAll('svg').length") > 3
        assert page.evaluate(f"{frame}.getBoundingClientRect().height") > 300
        assert page.complaints() == []


def test_a_log_in_memory_is_named_and_no_command_is_suggested_for_it(arm: btr.Model, tmp_path: Path) -> None:
    read = btr.load_log(LEARN[0])
    answer = btr.diagnose(arm, btr.Log(read.clock_s, read.to_dict(), "monday"))
    assert answer.names == [FRICTION]
    answer.report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert "arm.toml against monday, evaluated on" in page and "btr fit" not in page


def names(ax: Axes) -> list[str]:
    return [label.get_text() for label in ax.get_yticklabels()]


def labels(ax: Axes) -> list[str]:
    return [text.get_text() for text in ax.get_legend().get_texts()]


def drawn(ax: Axes, ink: str) -> list[list[float]]:
    """The x values of everything drawn in a colour."""
    return [list(line.get_xdata()) for line in ax.lines if to_hex(line.get_color()) == INK[ink]]


def test_compare_draws_each_channel_with_the_noise_floor(answers: dict) -> None:
    found = answers["compare"]
    (ax,) = found.plot().axes
    assert names(ax) == [channel["name"] for channel in found.channels]
    assert [bar.get_width() for bar in ax.patches] == [channel["chi"] for channel in found.channels]
    assert ax.get_xscale() == "log" and drawn(ax, "truth") == [[1, 1]] and labels(ax) == ["noise floor"]
    assert ax.get_xlim()[0] < 1 < max(channel["chi"] for channel in found.channels) < ax.get_xlim()[1]


def test_diagnose_draws_how_the_error_fell(answers: dict) -> None:
    found = answers["diagnose"]
    (ax,) = found.plot().axes
    assert names(ax) == [step["step"] for step in found.error_ladder]
    assert drawn(ax, "main") == [[step["train"] for step in found.error_ladder]]
    assert drawn(ax, "second") == [[step["held_out"] for step in found.error_ladder]]
    assert labels(ax) == ["training logs", "held-out logs", "noise floor"] and "noise floors" in ax.get_xlabel()


def test_fit_draws_every_value_between_its_bounds(answers: dict) -> None:
    found = answers["fit"]
    values, ladder = found.plot().axes
    assert names(values) == list(found.values) and names(ladder)[0] == "model as it stands"
    dims = {dim["name"]: dim for dim in found.space}
    shares = [
        (value - dims[name]["min"]) / (dims[name]["max"] - dims[name]["min"]) for name, value in found.values.items()
    ]
    np.testing.assert_allclose(np.concatenate(drawn(values, "main")), shares)
    assert all(0 <= share <= 1 for share in shares)
    # The masses were in the middle of their bounds by ratio, and nothing rubbed.
    before = np.concatenate(drawn(values, "third"))
    assert before[-1] == 0 and before[0] == pytest.approx((1 - 0.75) / (1.33 - 0.75))
    spans = [collection for collection in values.collections if len(collection.get_segments())]
    assert len(spans) == sum(parameter["ci95"] is not None for parameter in found.parameters) > 0


def test_missing_intervals_are_not_drawn(answers: dict) -> None:
    found = copy.deepcopy(answers["fit"])
    for parameter in found.parameters:
        parameter["ci95"] = None
    found.parameters[0]["at_bound"] = True
    for step in found.error_ladder:
        step["held_out"] = None
    values, ladder = found.plot().axes
    assert not values.collections and len(drawn(values, "alarm")) == 1 and "at its bound" in labels(values)
    assert labels(ladder) == ["training logs", "noise floor"]


def test_plots_use_the_given_axes(answers: dict) -> None:
    figure, (bars, steps, values, ladder, lines) = pyplot.subplots(1, 5)
    assert answers["compare"].plot(bars) is figure and answers["diagnose"].plot(ax=steps) is figure
    assert answers["fit"].plot(np.array([values, ladder])) is figure
    assert btr.load_log(LEARN[0]).plot(ax=lines) is figure and len(pyplot.get_fignums()) == 1
    assert bars.patches and all(ax.lines for ax in (steps, values, ladder, lines))


def test_every_plot_is_a_figure_that_can_be_saved(answers: dict, tmp_path: Path) -> None:
    for drawn_of in [answers["compare"], answers["diagnose"], answers["fit"], btr.load_log(LEARN[0])]:
        drawn_of.plot().savefig(tmp_path / "plot.svg")
        assert (tmp_path / "plot.svg").read_text().count("<path") > 5


def test_a_log_draws_commands_and_readings_of_a_joint_together() -> None:
    log = btr.load_log(LEARN[0])
    axes = log.plot().axes
    assert [labels(ax) for ax in axes] == [[f"cmd_{joint}", f"q_{joint}"] for joint in ("yaw", "shoulder", "elbow")]
    assert axes[0].get_ylabel() == "yaw (rad)" and axes[-1].get_xlabel() == "time (s)"
    np.testing.assert_array_equal(axes[0].lines[1].get_xdata(), log.clock_s)
    np.testing.assert_array_equal(axes[0].lines[1].get_ydata(), log["q_yaw"])
    with pytest.raises(KeyError, match="no channel q_nose"):
        log.plot("q_nose")


def test_channels_of_other_units_have_axes_of_their_own() -> None:
    clock_s = np.linspace(0, 1, 5)
    log = btr.Log(clock_s, {"q_a": clock_s, "dq_a": clock_s, "tau_a": clock_s, "q_b": clock_s, "gyro_x": clock_s})
    assert [labels(ax) for ax in log.plot().axes] == [["q_a"], ["q_b"]]
    assert [labels(ax) for ax in log.plot("tau_a", "q_b", "dq_a").axes] == [["tau_a"], ["q_b"], ["dq_a"]]
    (together,) = log.plot("q_a", "tau_a", ax=pyplot.subplots()[1]).axes
    assert labels(together) == ["q_a", "tau_a"] and together.get_ylabel() == "a (rad, N·m)"
    assert [labels(ax) for ax in btr.Log(clock_s, {"gyro_x": clock_s}).plot().axes] == [["gyro_x"]]
    assert btr.Log(clock_s, {}).plot().axes == []


def test_a_log_is_a_frame_and_back() -> None:
    pandas = pytest.importorskip("pandas", reason="frames need pandas")
    log = btr.load_log(LEARN[0])
    frame = log.to_dataframe()
    assert isinstance(frame, pandas.DataFrame) and list(frame) == ["t", *log.keys()] and len(frame) == len(log)
    assert btr.load_log(frame) == log
    # A joint whose name ends like a unit comes back as itself.
    odd = pickle.loads(pickle.dumps(btr.Log([0.0, 0.1], {"q_arm_m_rad": [0.0, 1.0]})))
    assert odd.keys() == ["q_arm_m"] and btr.load_log(odd.to_dataframe()) == odd


def test_a_log_shows_its_channels_in_a_notebook() -> None:
    log = btr.Log([0.0, 0.1, 0.2], {"q_knee": [0.25, np.nan, -1.5], "q_<b>": [np.nan] * 3}, "monday")
    shown = log._repr_html_()
    assert "Log monday: 3 samples" in shown and "&lt;b&gt;" in shown and "<b>" not in shown
    assert "<td>q_knee</td><td>rad</td><td>2</td><td>-1.5</td><td>0.25</td>" in shown
    assert "<td>0</td><td>-</td><td>-</td>" in shown


@pytest.mark.parametrize(
    ("library", "extra", "use"),
    [("pandas", "pandas", "to_dataframe()"), ("matplotlib.pyplot", "plot", "plot()")],
)
def test_a_missing_library_is_named_with_how_to_get_it(library: str, extra: str, use: str) -> None:
    without = f"import sys, btr\nsys.modules[{library!r}] = None\nbtr.Log([0.0, 1.0], {{'q_a': [0.0, 1.0]}}).{use}"
    done = subprocess.run([sys.executable, "-c", without], capture_output=True, text=True, check=False)
    assert f"ImportError: this needs {library}: pip install 'btr[{extra}]'" in done.stderr, done.stderr


def test_no_probability_is_told_as_certain() -> None:
    cap = {"at_most": 0.8, "reasons": ["series"]}
    told = [
        (0.999999, None, ">0.99", "<0.01"),
        (0.9, None, "0.90", "0.10"),
        (0.001, None, "<0.01", ">0.99"),
        (0.8, cap, "at most 0.80", "0.20"),
    ]
    for share, at_most, expected, rest in told:
        support = {"probability": share, "probability_cap": at_most, "established": True, "alike": [], "parameters": []}
        rivals = [{"name": "backlash@yaw", "probability": 1.0 - share}]
        effect = {**support, "effect": "coulomb_friction", "site": "yaw", "share": 0.9, "rivals": rivals}
        document = {"verdict": "effect_missing", "degree": "explained", "cut_short": False}
        document |= {"error_ladder": [{"step": "+ coulomb_friction@yaw", "train": 1.0, "held_out": None}]}
        found = btr.DiagnoseResult({**document, "effects": [effect]}, None, None, None)._finding()
        assert f"probability {expected}, explains" in found
        assert f"the rest of the probability: backlash@yaw {rest}" in found


def test_a_small_share_of_a_large_error_is_told_by_how_much_the_error_fell() -> None:
    steps = ("model as it stands", 25.9), ("+ payload@hand", 1.34), ("+ asymmetric_friction@yaw", 1.02)
    steps = (*steps, ("coulomb_friction@yaw for asymmetric_friction@yaw", 1.01))
    ladder = [{"step": step, "train": error, "held_out": error + 0.1} for step, error in steps]
    shares = {"payload": ("hand", 0.99), "coulomb_friction": ("yaw", 0.001)}
    support = {"probability": 0.9, "established": True, "rivals": [], "alike": [], "parameters": []}
    effects = [{**support, "effect": name, "site": site, "share": share} for name, (site, share) in shares.items()]
    document = {"verdict": "effect_missing", "degree": "explained", "cut_short": False, "error_ladder": ladder}
    document |= {"effects": effects}
    payload, coulomb = btr.DiagnoseResult(document, None, None, None)._finding().splitlines()[1:]
    above = "of the squared error above the noise"
    assert payload.endswith(f"explains 99 % {above}")
    fell = "with it, the error fell from 1.34 to 1.01 noise floors (held out: from 1.44 to 1.11)"
    assert coulomb.endswith(f"explains less than 1 % {above}; {fell}")
