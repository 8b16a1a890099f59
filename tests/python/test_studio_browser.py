"""The studio in a browser, as an engineer uses it: look, ask what is missing, add it, save the model; watch a run."""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("viser", reason="the studio needs viser")
playwright = pytest.importorskip("playwright.sync_api", reason="the page is used by Playwright")

import btr
from browser import found
from btr._studio.plots import line, options
from btr._studio.run import panels
from btr._studio.run.folder import Snapshot
from btr._studio.run.page import PANEL_PX
from btr._studio.server import serve

if found() is None:
    pytest.skip("there is no Chromium here", allow_module_level=True)

ROBOTS = Path(__file__).parents[2] / "robots"
HOSTILE = "<img src=stolen onerror=alert(1)>.csv"
FRICTION = "coulomb_friction@yaw"
GAIN = "kp@yaw (N·m/rad)"
PATIENCE_MS = 240_000
# Debian's Chromium draws WebGL on the processor.
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic"]
QUIET = ["--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run"]


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    hostile = tmp_path / HOSTILE
    shutil.copy(ROBOTS / "arm/learn_2.csv", hostile)
    logs = [str(ROBOTS / "arm/learn_1.csv"), str(hostile)]
    held_out = ["--held-out", str(ROBOTS / "arm/held_out_1.csv")]
    options = ["--folder", str(tmp_path), "--port", "0", "--no-browser"]
    program = [sys.executable, "-m", "btr", "studio", str(ROBOTS / "arm.toml"), *logs, *options, *held_out]
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield process.stdout.readline().split()[-1]
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0


@contextlib.contextmanager
def opened(address: str, width: int = 1050, script: str = "") -> Iterator["playwright.Page"]:
    """A browser at the page, which must not fail, say anything or ask any other place; `script` runs in it first."""
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=found(), args=FLAGS + QUIET)
        page = browser.new_page(viewport={"width": width, "height": 700})
        page.add_init_script(script)
        page.set_default_timeout(PATIENCE_MS)
        page.address, page.failures = address, []
        page.on("pageerror", lambda error: page.failures.append(str(error)))
        page.on("dialog", lambda dialog: page.failures.append(dialog.message))
        own = re.compile(re.escape(address.partition("?")[0]) + r"(\?token=.*|clicks/\d+)?$|data:|blob:")
        page.on("request", lambda request: own.match(request.url) or page.failures.append(request.url))
        page.goto(address)
        yield page
        assert page.failures == []
        browser.close()


@pytest.fixture
def page(address: str) -> Iterator["playwright.Page"]:
    with opened(address) as page:
        yield page


def errors(page: "playwright.Page") -> list[float]:
    """The errors that stand at the top, in noise floors: on the training and on the held-out logs."""
    told = page.get_by_text(re.compile("^training logs")).locator("xpath=..").inner_text()
    return [float(number) for number in re.findall(r"\d+\.\d+", told)]


def number(page: "playwright.Page", label: str) -> "playwright.Locator":
    """The box of a number beside its slider."""
    beside = "xpath=following::input[@inputmode='decimal'][1]"
    return page.get_by_text(label, exact=True).locator(beside)


def weight(shown: "playwright.Locator") -> str:
    """How bold a text is."""
    return str(shown.evaluate("shown => getComputedStyle(shown).fontWeight"))


def test_what_is_missing_is_found_added_and_saved(page: "playwright.Page", tmp_path: Path) -> None:
    page.get_by_text("x the noise floor (").first.wait_for()
    assert min(errors(page)) > 5.0

    page.get_by_role("button", name="Play", exact=True).click()
    shown = number(page, "Time (s)")
    playwright.expect(shown).not_to_have_value("0", timeout=PATIENCE_MS)
    page.get_by_role("button", name="Pause", exact=True).click()

    log = page.get_by_role("combobox", name="Log")
    log.click()
    page.get_by_role("option", name=HOSTILE).click()
    playwright.expect(log).to_have_value(HOSTILE)

    page.get_by_text(re.compile(r"Worst in the map: yaw under high load .*, mostly in held_out_1\.")).wait_for()
    page.get_by_role("button", name=re.compile("^shoulder under high load")).click()
    playwright.expect(log).to_have_value("held_out_1.csv (held out)")
    playwright.expect(page.get_by_role("combobox", name="Channel")).to_have_value("q_shoulder")
    playwright.expect(shown).to_have_value("1.2")
    page.get_by_text(re.compile("Shown: shoulder under high load .* from 1.20 s to ")).wait_for()

    page.get_by_role("button", name="What is missing?").click()
    page.get_by_role("button", name="Cancel", exact=True).click()
    page.get_by_text(re.compile("^stopped: (best|nothing) so far; the model is as it was$")).wait_for()
    page.get_by_role("button", name="What is missing?").click()
    add = page.get_by_role("button", name=f"Add {FRICTION}", exact=True)
    add.wait_for()
    missing, earlier = page.get_by_text(f"missing: {FRICTION}"), page.get_by_text("about an earlier model")
    assert missing.count() == 1 and weight(missing) == "600" and page.get_by_text("next: fitted").count() == 0

    page.get_by_role("button", name=f"Preview {FRICTION}", exact=True).click()
    page.get_by_text(f"preview: + {FRICTION}").wait_for()
    assert max(errors(page)) < 1.2
    page.get_by_text("values without the preview").wait_for()
    page.get_by_role("button", name=f"End preview of {FRICTION}", exact=True).click()
    page.get_by_text(f"preview: + {FRICTION}").wait_for(state="detached")
    assert min(errors(page)) > 5.0

    add.click()
    page.get_by_role("button", name=f"Remove {FRICTION}", exact=True).wait_for()
    page.get_by_text("every joint is within").wait_for()
    assert max(errors(page)) < 1.2
    page.get_by_text(re.compile(f"^Added {FRICTION}: the error went from .* noise floors")).wait_for()
    earlier.wait_for()
    assert weight(missing) == "400"
    page.get_by_role("button", name="What is missing?").click()
    page.get_by_text("nothing is missing").wait_for()
    assert earlier.count() == missing.count() == 0
    assert page.get_by_role("button", name=re.compile("^Preview ")).count() == 0, "no suspects"

    page.get_by_role("button", name="Save model, report and scripts").click()
    page.get_by_text("saved:").wait_for()
    assert "coulomb_friction.torque@yaw" in btr.load_model(tmp_path / "arm-studio.toml").values
    assert (tmp_path / "arm-studio.html").exists()
    page.get_by_text("Saved as arm-studio.toml, with 3 files beside it.").wait_for()

    page.get_by_role("button", name="Undo", exact=True).click()
    page.get_by_text("x the noise floor (").first.wait_for()
    assert min(errors(page)) > 5.0
    missing.wait_for()
    assert page.get_by_text("saved:").count() == 0, "this is another model"
    page.get_by_text("Undone. The model now: model as it stands.").wait_for()
    assert weight(missing) == "600" and earlier.count() == page.get_by_text("nothing is missing").count() == 0

    page.get_by_role("button", name=f"Preview {FRICTION}", exact=True).click()
    page.get_by_text(f"preview: + {FRICTION}").wait_for()
    page.get_by_role("button", name="Save model, report and scripts").click()
    page.get_by_text("saved, without the preview, which has ended").wait_for()
    page.get_by_text(f"preview: + {FRICTION}").wait_for(state="detached")
    assert "coulomb_friction.torque@yaw" not in btr.load_model(tmp_path / "arm-studio-2.toml").values


def test_a_slider_is_dragged_a_second_tab_follows_and_a_diagnosis_outlives_a_reload(page: "playwright.Page") -> None:
    page.get_by_text("x the noise floor (").first.wait_for()
    before = errors(page)
    beside = "xpath=following::*[contains(@class, 'mantine-Slider-track')][1]"
    track = page.get_by_text(GAIN, exact=True).locator(beside)
    track.scroll_into_view_if_needed()
    place = track.bounding_box()
    height = place["y"] + place["height"] / 2
    page.mouse.move(place["x"] + 0.5 * place["width"], height)
    page.mouse.down()
    for share in (0.4, 0.3, 0.2):
        page.mouse.move(place["x"] + share * place["width"], height)
    page.mouse.up()
    page.get_by_text("set by hand").first.wait_for()
    gain = number(page, GAIN).input_value()
    assert 17.0 < float(gain) < 19.0
    head = page.get_by_text(re.compile("^training logs")).locator("xpath=..")
    playwright.expect(head).not_to_contain_text(f"{before[0]:.2f}", timeout=PATIENCE_MS)
    page.get_by_text(re.compile("^Set by hand: the error is .* noise floors")).wait_for()

    second = page.context.browser.new_page(viewport={"width": 1050, "height": 700})
    second.set_default_timeout(PATIENCE_MS)
    second.goto(page.address)
    playwright.expect(number(second, GAIN)).to_have_value(gain, timeout=PATIENCE_MS)
    second.get_by_role("button", name="Undo", exact=True).click()
    page.get_by_text("Undone. The model now: model as it stands.").wait_for()
    playwright.expect(number(second, GAIN)).to_have_value("20", timeout=PATIENCE_MS)
    second.get_by_role("button", name="Redo", exact=True).click()
    playwright.expect(number(page, GAIN)).to_have_value(gain, timeout=PATIENCE_MS)

    page.get_by_text("Frozen in fits", exact=True).click()
    page.get_by_role("checkbox", name="kp@yaw").check()
    stated = "(in the model as it stands: 20): the next fit and diagnosis keep it."
    second.get_by_text(f"kp@yaw is frozen at {float(gain):.4g} {stated}").wait_for()
    page.get_by_text("(kp@yaw frozen) set by hand").first.wait_for()
    for _ in range(2):
        page.get_by_role("button", name="Undo", exact=True).click()
    page.get_by_text("Undone. The model now: model as it stands.").wait_for()
    playwright.expect(page.get_by_role("checkbox", name="kp@yaw")).not_to_be_checked(timeout=PATIENCE_MS)

    page.get_by_role("button", name="What is missing?").click()
    page.get_by_role("button", name="Cancel", exact=True).wait_for()
    page.reload()
    for tab in (page, second):
        tab.get_by_role("button", name=f"Add {FRICTION}", exact=True).wait_for()
    second.close()


def test_a_wide_window_after_a_narrow_one_has_wide_panels(address: str) -> None:
    def width(window: int) -> float:
        with opened(address, width=window) as page:
            log = page.get_by_role("combobox", name="Log")
            log.wait_for()
            page.wait_for_timeout(1500)
            return log.bounding_box()["width"]

    before = width(1400)
    width(700)
    assert width(1400) == pytest.approx(before)


def test_the_page_says_that_the_server_has_ended() -> None:
    server, address = serve("127.0.0.1", 0)
    server.gui.add_html("still here")
    with opened(address) as page:
        page.get_by_text("still here").wait_for()
        server.stop()
        page.get_by_text("btr studio has ended").wait_for(timeout=20_000)


LEFTMOST = """
    const draw = CanvasRenderingContext2D.prototype.fillText;
    window.leftmost = {x: 1e9};
    CanvasRenderingContext2D.prototype.fillText = function (text, x, ...rest) {
        const width = {right: 1, center: 0.5}[this.textAlign] ?? 0;
        const begin = x - width * this.measureText(text).width;
        if (begin < window.leftmost.x) window.leftmost = {x: begin, text};
        return draw.call(this, text, x, ...rest);
    };
"""
"""Keeps the text of a canvas that begins furthest to the left."""


def test_nothing_is_cut_in_a_narrow_window() -> None:
    server, address = serve("127.0.0.1", 0)
    server.gui.main_panel.set_width(PANEL_PX)
    small = -0.0001234
    closed = SimpleNamespace(i=10, fitness_sim=small, fitness_real=small, phi_predicted=-small, phi=-small)
    run = Snapshot("", None, None, 1, "", None, None, [], [], [], [closed] * 3, [], 0)
    with server.gui.add_folder("Iterations"):
        server.gui.add_html(panels.iterations(run))
    data = np.array([0.0, 1.0]), np.array([-12_000.0, -11_000.0])
    server.gui.add_uplot(data, ({"label": "x"}, line("y", "#000000")), **options(150))
    with opened(address, width=700, script=LEFTMOST) as page:
        page.locator("canvas").first.wait_for()
        told = page.get_by_text("phi predicted", exact=True).locator("xpath=ancestor::table/..")
        assert told.evaluate("box => box.scrollWidth <= box.clientWidth")
        page.wait_for_timeout(1000)
        leftmost = page.evaluate("window.leftmost")
        assert leftmost["text"].startswith("-1") and len(leftmost["text"]) == 7 and leftmost["x"] >= 0
    server.stop()


@contextlib.contextmanager
def run_shown(folder: Path) -> Iterator[tuple[subprocess.Popen, str]]:
    """A small run that `btr coevolve` computes and shows, and the address of its page."""
    short = ["coevolve.iterations=2", "coevolve.controllers.generations=2", "coevolve.simulators.generations=3"]
    settings = [word for setting in short for word in ("--set", setting)]
    command = ["coevolve", str(ROBOTS / "disengage.toml"), "--out", str(folder), "--studio", "--json", *settings]
    program = [sys.executable, "-m", "btr", *command]
    # The browser that the page would be opened in.
    environment = {**os.environ, "BROWSER": "true"}
    pipe = subprocess.PIPE
    with subprocess.Popen(program, stdout=pipe, stderr=pipe, text=True, env=environment) as process:
        assert process.stderr is not None
        try:
            yield process, next(line.split()[-1] for line in process.stderr if line.startswith("btr studio: "))
        finally:
            process.kill()


def test_a_run_and_its_page(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with run_shown(folder) as (process, address):
        with opened(address) as page:
            page.get_by_text("stopped: iterations done").wait_for()
            page.get_by_text("truth, revealed").wait_for()
            page.get_by_text("hidden effects: coulomb_friction@hinge").first.wait_for()
            page.get_by_text("Conclusions", exact=True).wait_for()
            page.get_by_text(re.compile("^best in reality: fitness .* in transfers/000")).wait_for()
            page.get_by_text("phi is the distance between what the robot did").wait_for()
            page.get_by_text(re.compile("^Controller of test 000. \\(iteration")).wait_for()
            shown = page.get_by_role("combobox", name="Shown")
            playwright.expect(shown).to_have_value("all side by side")
            page.get_by_role("button", name="Play", exact=True).click()
            time = number(page, "Time (s)")
            playwright.expect(time).not_to_have_value("0", timeout=PATIENCE_MS)
            page.get_by_role("button", name="Pause", exact=True).click()
            shown.click()
            page.get_by_role("option", name="test 0000 (iteration 1)").click()
            page.get_by_text("Controller of test 0000 (iteration 1)").wait_for()
            page.get_by_text("simulated after", exact=True).wait_for()
            channel = page.get_by_role("combobox", name="Channel")
            playwright.expect(channel).to_have_value("q_hinge")
            (folder / "checkpoint.bin").write_bytes(b"damaged")
            page.get_by_text("cannot be used: it does not begin as a checkpoint").wait_for()
            assert page.get_by_text("stopped: iterations done").count() == 1, "what was known stays"
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
        assert '"stop_reason":"iterations_done"' in process.stdout.read()


def test_a_page_that_cannot_be_served_does_not_end_the_run(tmp_path: Path) -> None:
    command = ["coevolve", str(ROBOTS / "disengage.toml"), "--out", str(tmp_path), "--studio", "--json"]
    settings = ["--set", "coevolve.iterations=1", "--set", "coevolve.simulators.generations=1"]
    environment = {**os.environ, "BTR_PYTHON": str(tmp_path / "gone-python")}
    program = [sys.executable, "-m", "btr", *command, *settings]
    ended = subprocess.run(program, capture_output=True, text=True, env=environment, timeout=120)
    assert ended.returncode == 0
    assert "warning: the studio is served by Python" in ended.stderr
    assert '"stop_reason":"iterations_done"' in ended.stdout
