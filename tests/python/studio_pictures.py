"""Takes the pictures of the studio in docs/ again, in headless Chromium: docs/studio-*.png. Takes some minutes, most of
them for a run with the Nao.

    python3 tests/python/studio_pictures.py [arm] [run]
"""

import contextlib
import io
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Page, expect, sync_playwright

from browser import found

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic"]
FRICTION = "coulomb_friction@yaw"
WIDE, NARROW, RUN = (1400, 900), (700, 900), (1400, 850)
PATIENCE_MS = 240_000
# Plots, the robot and the map are drawn by then.
DRAWN_MS = 3000


@contextlib.contextmanager
def studio(*arguments: str) -> Iterator[str]:
    """The address of a studio of these files."""
    with tempfile.TemporaryDirectory() as folder:
        options = ["--folder", folder, "--port", "0", "--no-browser"]
        program = [sys.executable, "-m", "btr", "studio", *arguments, *options]
        with subprocess.Popen(program, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            try:
                yield process.stdout.readline().split()[-1]
            finally:
                process.terminate()


def opened(browser: Browser, address: str, size: tuple[int, int]) -> Page:
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.set_default_timeout(PATIENCE_MS)
    page.goto(address)
    return page


def take(page: Page, name: str) -> None:
    """A picture without notices, such as the browser's own about its graphics."""
    page.add_style_tag(content=".mantine-Notifications-root, .mantine-Notification-root {display: none !important}")
    page.mouse.move(700, 20)
    page.wait_for_timeout(DRAWN_MS)
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    # A palette takes a third of the space, and text stays sharp.
    small = picture.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=1, dither=Image.Dither.NONE)
    small.save(DOCS / f"studio-{name}.png", optimize=True)


def show(page: Page, time_s: str) -> None:
    shown = page.get_by_text("Time (s)", exact=True).locator("xpath=following::input[@inputmode='decimal'][1]")
    shown.fill(time_s)
    shown.press("Enter")
    shown.blur()


def choose(page: Page, what: str, option: str) -> None:
    page.get_by_role("combobox", name=what).click()
    page.get_by_role("option", name=option).click()


def arm(browser: Browser) -> None:
    """Suspects on a wide and on a narrow page, and one that was added."""
    learn, held_out = (
        sorted(f"robots/arm/{path.name}" for path in (ROOT / "robots/arm").glob(pattern))
        for pattern in ("learn_*.csv", "held_out_*.csv")
    )
    add = f"Add {FRICTION}"
    with studio("robots/arm.toml", *learn, "--held-out", *held_out) as address:
        page = opened(browser, address, WIDE)
        page.get_by_text("x the noise floor (").first.wait_for()
        choose(page, "Error shown", "5 times as large")
        show(page, "1.7")
        page.get_by_role("button", name="What is missing?").click()
        page.get_by_role("button", name=add, exact=True).wait_for()
        take(page, "cause")
        narrow = opened(browser, address, NARROW)
        narrow.get_by_role("button", name=add, exact=True).wait_for()
        take(narrow, "narrow")
        narrow.close()
        # The newest page was narrow; the next one places the panels anew.
        page = opened(browser, address, WIDE)
        page.get_by_role("button", name=add, exact=True).click()
        page.get_by_text("every joint is within").wait_for()
        expect(page.get_by_role("button", name="Cancel", exact=True)).to_have_count(0)
        take(page, "added")


def run(browser: Browser) -> None:
    """All tried controllers of a run with the Nao, and one real test of a run with the disengaged pendulum."""
    with tempfile.TemporaryDirectory() as folder:
        for name in ("nao", "disengage"):
            command = ["coevolve", f"robots/{name}.toml", "--out", f"{folder}/{name}", "-q"]
            ended = subprocess.run([sys.executable, "-m", "btr", *command], cwd=ROOT, stdout=subprocess.DEVNULL)
            # A run that disengages ends with 1.
            assert ended.returncode in (0, 1), ended
        with studio(f"{folder}/nao") as address:
            page = opened(browser, address, RUN)
            page.get_by_text("Conclusions", exact=True).wait_for()
            show(page, "3.55")
            take(page, "run")
        with studio(f"{folder}/disengage") as address:
            page = opened(browser, address, RUN)
            page.get_by_text("Conclusions", exact=True).wait_for()
            choose(page, "Shown", "test 0000 (iteration 1)")
            page.get_by_text("simulated after", exact=True).wait_for()
            show(page, "0.88")
            take(page, "run-test")


if __name__ == "__main__":
    with sync_playwright() as started:
        chromium = started.chromium.launch(executable_path=found(), args=FLAGS)
        for part in [part for part in (arm, run) if not sys.argv[1:] or part.__name__ in sys.argv[1:]]:
            part(chromium)
