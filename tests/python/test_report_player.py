"""The player of a report in a browser, on wide and on narrow screens: it plays, and goes with the plots."""

import json
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic, sleep

import pytest

playwright = pytest.importorskip("playwright.sync_api", reason="the page is used by Playwright")

from browser import found
from program import BTR

if found() is None:
    pytest.skip("there is no Chromium here", allow_module_level=True)
if BTR is None:
    pytest.skip("no btr executable: set BTR, or build it", allow_module_level=True)

ROBOTS = Path(__file__).parents[2] / "robots"
PLAYER = ROBOTS.parent / "crates/btr-report/src/html/player"
HOSTILE = "</script><img src=stolen onerror=alert(1)>"
# Debian's Chromium draws WebGL on the processor.
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic"]
WIDTHS = [1400, 500]
PATIENCE_S = 60


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Reports of the desk arm: of a diagnosis, of a fit with the friction that it lacks, and of a comparison."""
    folder = tmp_path_factory.mktemp("reports")
    # A log may have any name that a file may have.
    name = HOSTILE.replace("/", "\N{DIVISION SLASH}") + ".csv"
    shutil.copy(ROBOTS / "arm/held_out_2.csv", folder / name)
    learn, logs = sorted(ROBOTS.glob("arm/learn_*.csv")), sorted(ROBOTS.glob("arm/*.csv"))
    held_out = ["--held-out", str(ROBOTS / "arm/held_out_1.csv"), name]
    verbs = {
        "diagnose": [*map(str, learn), *held_out],
        "fit": [*map(str, learn), "--add", "coulomb_friction@yaw", *held_out],
        "compare": map(str, logs),
    }
    for verb, arguments in verbs.items():
        command = [BTR, verb, str(ROBOTS / "arm.toml"), *arguments, "--report", f"{verb}.html", "-q"]
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    run = [BTR, "coevolve", str(ROBOTS / "pendulum.toml"), "--out", "run", "-q"]
    subprocess.run(run, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return folder


@pytest.fixture(scope="module")
def chromium() -> Iterator["playwright.Browser"]:
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=found(), args=FLAGS)
        yield browser
        browser.close()


def opened(chromium: "playwright.Browser", path: Path, width: int = 1400, **context: object) -> "playwright.Page":
    page = chromium.new_page(viewport={"width": width, "height": 1000}, **context)
    page.failures = []
    page.on("pageerror", lambda error: page.failures.append(str(error)))
    page.on("console", lambda said: said.type in ("error", "warning") and page.failures.append(said.text))
    page.on("dialog", lambda dialog: page.failures.append(dialog.message))
    page.on("request", lambda request: request.url == path.as_uri() or page.failures.append(request.url))
    page.goto(path.as_uri())
    return page


def time(page: "playwright.Page") -> float:
    """The shown time in s, also where the clock is hidden."""
    # The clock is empty before the first frame.
    return float(page.locator(".clock", has_text="/").text_content().split()[0])


def until(holds: Callable[[], bool]) -> None:
    """Waits in Python: the page's policy lets nobody evaluate strings in it."""
    end = monotonic() + PATIENCE_S
    while not holds():
        assert monotonic() < end
        sleep(0.05)


def cursors(page: "playwright.Page") -> set[str]:
    """Where the lines of the shown log are in its plots."""
    return {line.get_attribute("x1") for line in page.locator(".cursor:not(.off)").all()}


@pytest.mark.parametrize("width", WIDTHS)
def test_the_arm_is_played_beside_its_plots(width: int, chromium: "playwright.Browser", reports: Path) -> None:
    page = opened(chromium, reports / "fit.html", width)
    errors = page.locator(".joints b").all_inner_texts
    beginning = time(page)
    assert float(errors()[0]) > 32, "the first picture is of the largest error"
    pictures = [page.locator(".player canvas").screenshot()]
    for robot in ("measured", "model"):
        page.get_by_label(robot, exact=True).uncheck()
        page.wait_for_timeout(100)
        pictures.append(page.locator(".player canvas").screenshot())
    assert len(set(pictures)) == 3, "no robot is drawn"
    assert page.locator(".cursor:not(.off)").count() == 6

    page.get_by_role("button", name="Play").click()
    until(lambda: time(page) > beginning + 0.2)
    page.get_by_role("button", name="Pause").click()

    scrubber = page.get_by_role("slider", name="Time")
    scrubber.fill("1.5")
    playwright.expect(page.locator(".clock")).to_have_text("1.50 / 4.00 s")
    at = cursors(page)
    assert len(at) == 1
    scrubber.press("ArrowRight")
    until(lambda: time(page) != 1.5)
    scrubber.fill("3")
    playwright.expect(page.locator(".clock")).to_have_text("3.00 / 4.00 s")
    assert cursors(page) != at

    page.locator(".states label").get_by_text("fitted, with coulomb_friction").click()
    until(lambda: float(errors()[0]) < 5)

    page.get_by_role("combobox", name="Log").select_option(label=HOSTILE.replace("/", "\N{DIVISION SLASH}"))
    playwright.expect(page.locator(".clock")).to_have_text("0.00 / 4.00 s")

    # In the middle of a plot of the other log.
    plot = page.locator("svg.timed", has_text="Residual in held_out_1").first
    frame = plot.locator("rect.frame")
    plot.scroll_into_view_if_needed()
    box = frame.bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    playwright.expect(page.get_by_role("combobox", name="Log", include_hidden=True)).to_have_value("0")
    until(lambda: abs(time(page) - 2.0) < 0.05)
    x, wide = (float(frame.get_attribute(name)) for name in ("x", "width"))
    assert all(abs(float(at) - x - wide / 2) < 5 for at in cursors(page))
    # Beside the plots the player is in a corner, until it is closed.
    playwright.expect(page.locator(".player.docked canvas")).to_be_in_viewport()
    page.get_by_role("button", name="Close").click()
    playwright.expect(page.locator(".docked")).to_have_count(0)

    assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
    assert page.failures == []
    page.close()


def lines(page: "playwright.Page", shown: str) -> set[str]:
    """The numbers of the model's states whose lines, `hidden` or not, are in the plots."""
    groups = page.locator(f"g[data-state]{shown}").all()
    return {group.get_attribute("data-state") for group in groups}


@pytest.mark.parametrize("width", WIDTHS)
def test_each_step_of_the_ladder_can_be_chosen(width: int, chromium: "playwright.Browser", reports: Path) -> None:
    page = opened(chromium, reports / "diagnose.html", width)
    steps, yaw = page.locator(".states label"), page.locator(".joints b").first
    names = page.locator(".states span span").all_inner_texts()
    names = [name.replace("\u200b", "").replace("\u00a0", " ") for name in names]
    assert names == ["as it stands", "its parameters fitted", "+ coulomb_friction@yaw"]
    errors = [float(error) for error in page.locator(".states b").all_inner_texts()]
    assert errors[0] > 2 * errors[1] > 8 and errors[2] < 1.1
    # The first and the last are drawn before anything is chosen, as without scripts.
    assert lines(page, ":not(.hidden)") == {"0", "2"} and lines(page, ".hidden") == {"1"}

    page.get_by_role("slider", name="Time").fill("2.5")
    at, picture = float(yaw.inner_text()), page.locator(".player canvas").screenshot()
    steps.nth(1).click()
    until(lambda: float(yaw.inner_text()) < at)
    assert lines(page, ":not(.hidden)") == {"0", "1"} and lines(page, ":not(.faded)") == {"1"}
    assert page.locator("svg.timed", has_text="its parameters fitted").first.get_by_text("after").is_hidden()
    assert page.locator(".player canvas").screenshot() != picture
    steps.nth(2).click()
    until(lambda: float(yaw.inner_text()) < 5)
    assert lines(page, ":not(.hidden)") == {"0", "2"} and lines(page, ":not(.faded)") == {"2"}

    # Beside the plots there is a list of the same.
    plot = page.locator("svg.timed").first
    plot.scroll_into_view_if_needed()
    plot.click()
    page.get_by_role("combobox", name="The model").select_option(index=1)
    assert lines(page, ":not(.faded)") == {"1"} and steps.nth(1).locator("input").is_checked()
    assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
    edges = "elements => elements.map(element => element.scrollWidth - element.clientWidth)"
    assert max(page.locator(".states label>span, .side, .bar").evaluate_all(edges)) <= 0
    assert page.failures == []
    page.close()


def test_the_picture_is_turned_by_pointer_and_by_keyboard(chromium: "playwright.Browser", reports: Path) -> None:
    page = opened(chromium, reports / "compare.html")
    canvas = page.locator(".player canvas")
    canvas.scroll_into_view_if_needed()
    seen = [canvas.screenshot()]
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 400, box["y"] + 240)
    page.mouse.up()
    seen.append(canvas.screenshot())
    page.mouse.wheel(0, -300)
    page.wait_for_timeout(100)
    seen.append(canvas.screenshot())
    for key in ("ArrowLeft", "ArrowUp", "-", ",", "0"):
        canvas.press(key)
        page.wait_for_timeout(50)
        seen.append(canvas.screenshot())
    assert len(set(seen)) == len(seen)
    canvas.press("Space")
    assert page.get_by_role("button", name="Pause").count() == 1
    assert page.failures == []
    page.close()


# Of a comparison, the table of channels has too many columns for a narrow screen.
@pytest.mark.parametrize(("verb", "scrolled"), [("diagnose", 0), ("fit", 0), ("compare", 1), ("run/report", 0)])
def test_nothing_is_cut_on_a_narrow_screen(
    verb: str, scrolled: int, chromium: "playwright.Browser", reports: Path
) -> None:
    page = opened(chromium, reports / f"{verb}.html", 500)
    frames = page.locator(".scroll")
    scrolls = frames.evaluate_all("frames => frames.map(frame => frame.scrollWidth > frame.clientWidth)")
    assert sum(scrolls) == scrolled
    right = "elements => Math.max(...elements.map(element => element.getBoundingClientRect().right))"
    assert page.locator("body :not(.scroll *):not(svg *)").evaluate_all(right) <= 500
    page.close()


def test_without_scripts_or_on_paper_there_are_the_plots_alone(
    chromium: "playwright.Browser", reports: Path
) -> None:
    page = opened(chromium, reports / "fit.html", java_script_enabled=False)
    text = page.locator("body").inner_text()
    assert "Motion" not in text and "{" not in text and page.locator("svg").count() > 10
    page.close()
    page = opened(chromium, reports / "diagnose.html", java_script_enabled=False)
    plot = page.locator("svg", has_text="Residual in").first
    assert plot.get_by_text("before").is_visible() and plot.get_by_text("its parameters fitted").is_hidden()
    page.close()
    page = opened(chromium, reports / "fit.html")
    page.emulate_media(media="print")
    playwright.expect(page.locator("#motion")).to_be_hidden()
    page.close()


def test_without_webgl_the_page_says_so(chromium: "playwright.Browser", reports: Path) -> None:
    page = chromium.new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto((reports / "fit.html").as_uri())
    playwright.expect(page.get_by_text("it has no WebGL 2")).to_be_visible()
    page.get_by_role("slider", name="Time").fill("1")
    playwright.expect(page.locator(".clock")).to_have_text("1.00 / 4.00 s")
    page.close()


def test_the_page_is_small(reports: Path) -> None:
    assert all((reports / f"{verb}.html").stat().st_size < 3_000_000 for verb in ("diagnose", "fit", "compare"))


def test_the_robot_is_where_mujoco_has_it(chromium: "playwright.Browser", tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    arm5, log = str(ROBOTS / "arm5.toml"), str(tmp_path / "arm5.csv")
    report = tmp_path / "arm5.html"
    for arguments in (["simulate", arm5, "-o", log, "-q"], ["compare", arm5, log, "--report", str(report), "-q"]):
        subprocess.run([BTR, *arguments], check=True, stdout=subprocess.DEVNULL)
    motion = json.loads(report.read_text().split('id="motion-data">')[1].split("</script>")[0])
    positions = [0.3 - 0.4 * k for k in range(len(motion["joints"]))]
    scripts = "".join((PLAYER / name).read_text() for name in ("space.js", "robot.js"))
    page = chromium.new_page()
    poses = page.evaluate(
        f"""([motion, positions]) => {{ {scripts}
          const poses = new Robot(motion).poses(null, positions);
          const moving = motion.links.flatMap((link, k) => (link.joint === null ? [] : [[link, poses[k]]]));
          return moving.map(([link, pose]) => [pose.slice(0, 3), turned(pose.slice(3), link.axis)]);
        }}""",
        [motion, positions],
    )
    page.close()
    model = mujoco.MjModel.from_xml_path(str(ROBOTS / "arm5.urdf"))
    data = mujoco.MjData(model)
    joints = [model.joint(name) for name in motion["joints"]]
    for joint, q in zip(joints, positions, strict=True):
        data.qpos[joint.qposadr] = q
    mujoco.mj_kinematics(model, data)
    for joint, (place, axis) in zip(joints, poses, strict=True):
        assert data.xanchor[joint.id] == pytest.approx(place, abs=1e-5)
        assert data.xaxis[joint.id] == pytest.approx(axis, abs=1e-5)


@pytest.mark.parametrize("width", WIDTHS)
def test_a_run_plays_its_best_real_test_before_and_after(
    width: int, chromium: "playwright.Browser", reports: Path
) -> None:
    page = opened(chromium, reports / "run" / "report.html", width)
    errors = page.locator(".joints b").all_inner_texts
    assert float(errors()[0]) > 32
    page.get_by_text("after", exact=True).first.click()
    until(lambda: float(errors()[0]) < 5)
    # Each plot of positions and of differences over time has its line.
    assert page.locator(".cursor:not(.off)").count() == 4
    assert page.locator("h2").all_inner_texts() == [
        "Result", "Motion", "Progress", "Real tests", "Parameters", "Following"
    ]
    edges = "elements => elements.map(element => element.getBoundingClientRect().right)"
    assert max(page.locator("svg, .scroll, p, canvas").evaluate_all(edges)) <= width
    assert page.failures == []
    page.close()
