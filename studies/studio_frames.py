#!/usr/bin/env python3
"""How fast the studio is and what it holds in memory, for robots of 3 to 30 joints.

    python3 studies/studio_frames.py [--minutes 10] [--robots arm,nao,humanoid]

Needs btr in this Python with viser and Playwright, and Chromium. Each robot has one log: the desk arm moves for 40 s,
the Nao walks, and a generated humanoid of 30 joints swings them. Measured are the time from the start of the studio to
the first picture in a headless browser; the time from a slider's change to the redraws of the beginning and of the
whole, on the server; and the server's memory as it plays and a slider moves, for so many minutes.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from playwright.sync_api import Browser, Page, ViewportSize, sync_playwright

import btr
from humanoid import write_humanoid

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/python"))
from browser import found

ROBOTS = Path(__file__).parents[1] / "robots"
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
CHANGES = 40
"""Number of timed changes of a slider."""
SMALL: ViewportSize = {"width": 640, "height": 360}
"""The window in which memory is watched."""
MOVES = 8
"""Number of moves of a slider before a rest, while the memory is watched."""
DRAWS = """
    window.draws = 0;
    const draw = WebGL2RenderingContext.prototype.drawElements;
    WebGL2RenderingContext.prototype.drawElements = function (...given) { window.draws++; draw.apply(this, given); };
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--robots", default=",".join(MADE))
    parser.add_argument("--serve", nargs=2, metavar=("MODEL", "LOG"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.serve:
        serve(*args.serve)
        return
    print(f"{'robot':>9} {'joints':>6} {'rows':>6} {'picture s':>9} {'first ms':>14} {'whole ms':>14} {'MB':>5} "
          f"{'MB after':>8} {'MB/min':>7}")
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=found(), args=FLAGS)
        for robot in args.robots.split(","):
            with tempfile.TemporaryDirectory() as folder:
                print(measured(robot, browser, Path(folder), args.minutes), flush=True)


def measured(robot: str, browser: Browser, folder: Path, minutes: float) -> str:
    """A row of the table."""
    path, log = MADE[robot](folder)
    seen = {name: values for name, values in log.items() if name.startswith(("cmd_", "q_"))}
    btr.Log(log.clock_s, seen).write(folder / "log.csv")
    model = btr.load_model(path)
    with served(path, folder / "log.csv") as studio:
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        # Other load on this machine makes it slow, not wrong.
        page.set_default_timeout(300_000)
        page.add_init_script(DRAWS)
        page.goto(studio.address)
        while page.evaluate("window.draws") < len(model.joints):
            time.sleep(0.02)
        picture_s = time.monotonic() - studio.began
        page.get_by_text("comparing ...").wait_for(state="detached", timeout=300_000)
        time.sleep(5.0)
        slider = slider_of(page, model.parameters[0])
        first, whole = np.array([redrawn(studio, slider, k) for k in range(CHANGES)]).T * 1e3
        memory = watched(studio, page, slider, minutes)
        page.close()
    # The first half of the time fills caches.
    later = memory[len(memory) // 2 :]
    growth = np.polyfit(later[:, 0], later[:, 1], 1)[0] if len(later) > 2 else np.nan
    return (f"{robot:>9} {len(model.joints):6} {len(log):6} {picture_s:9.1f} {told(first)} {told(whole)} "
            f"{memory[0, 1]:5.0f} {memory[-1, 1]:8.0f} {growth:7.2f}")


def told(times_ms: np.ndarray) -> str:
    """The median, and what 95 % stay below."""
    return f"{np.median(times_ms):6.0f} /{np.quantile(times_ms, 0.95):6.0f}"


class Studio:
    """The studio in a process of its own, and what it says of its redraws."""

    def __init__(self, process: subprocess.Popen) -> None:
        self.process, self.began = process, time.monotonic()
        self.events: list[tuple[str, float]] = []
        self.address = next(line.split()[-1] for line in process.stdout if line.startswith("btr studio: "))
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        for line in self.process.stdout:
            what, _, at_s = line.partition(" ")
            if what in ("changed", "part", "whole"):
                self.events.append((what, float(at_s)))

    @property
    def megabytes(self) -> float:
        """Resident memory."""
        pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@contextmanager
def served(model: Path, log: Path) -> Iterator[Studio]:
    command = [sys.executable, __file__, "--serve", str(model), str(log)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield Studio(process)
        finally:
            process.terminate()


def serve(model: str, log: str) -> None:
    """The studio, which says when a slider has changed and when something was drawn."""
    from btr._studio.page import Page as StudioPage
    from btr._studio.view import View

    load, change = View.load, StudioPage._on_value

    def say(what):
        # In one piece: two threads say something.
        sys.stdout.write(f"{what} {time.monotonic()}\n")
        sys.stdout.flush()

    def loaded(view, replay):
        load(view, replay)
        is_whole = all(np.isfinite(values[-1]) for values in replay.simulated.values())
        say("whole" if is_whole else "part")

    def changed(page, *given):
        say("changed")
        change(page, *given)

    View.load, StudioPage._on_value = loaded, changed
    btr.studio(model, [log], port=0, browser=False)


def slider_of(page: Page, parameter: btr.documents.Dimension) -> Callable[[int], None]:
    """Sets a parameter, by the number beside its slider, to one of some values around its nominal one."""
    label = page.get_by_text(f"{parameter.name} ({parameter.unit})", exact=True)
    number = label.locator("xpath=following::input[@inputmode='decimal'][1]")
    return lambda k: number.fill(f"{parameter.nominal * (0.97 + 0.02 * (k % 4)):.3f}")


def redrawn(studio: Studio, slider: Callable[[int], None], k: int) -> tuple[float, float]:
    """How long after a change something and everything was redrawn, in s."""
    studio.events.clear()
    slider(k)
    while not any(what == "whole" for what, _ in list(studio.events)):
        time.sleep(0.01)
    # The comparison that follows is no part of it.
    time.sleep(1.5)
    begin = next(at_s for what, at_s in studio.events if what == "changed")
    first = next(at_s for what, at_s in studio.events if what != "changed")
    whole = next(at_s for what, at_s in studio.events if what == "whole")
    return first - begin, whole - begin


def watched(studio: Studio, page: Page, slider: Callable[[int], None], minutes: float) -> np.ndarray:
    """Minutes and megabytes while the time runs and a slider moves, with rests in which comparisons end."""
    # Without a graphics card, drawing a large window takes the processor that the studio needs.
    page.set_viewport_size(SMALL)
    begin, rows = time.monotonic(), [(0.0, studio.megabytes)]
    page.get_by_role("button", name="Play", exact=True).click()
    for k in iter(int, 1):
        slider(k)
        for k in range(1, MOVES):
            time.sleep(0.5)
            slider(k)
        time.sleep(4.0)
        rows.append(((time.monotonic() - begin) / 60, studio.megabytes))
        print(f"{rows[-1][0]:7.1f} min {rows[-1][1]:5.0f} MB", file=sys.stderr, end="\r", flush=True)
        if rows[-1][0] >= minutes:
            return np.array(rows)


def arm(folder: Path) -> tuple[Path, btr.Log]:
    """The desk arm, and 40 s of it with other servos."""
    path = ROBOTS / "arm.toml"
    model = btr.load_model(path)
    clock = np.arange(0.0, 40.0, 0.01)
    swing = {f"cmd_{joint}": 0.5 * np.sin((1.1 + 0.7 * k) * clock) for k, joint in enumerate(model.joints)}
    return path, model.at({"kp@yaw": 18.0}).simulate(btr.Log(clock, swing), seed=1)


def nao(folder: Path) -> tuple[Path, btr.Log]:
    """A walk of the Nao with a lighter thigh."""
    path = ROBOTS / "nao.toml"
    model = btr.load_model(path)
    lighter = model.parameters[4]
    return path, model.at({lighter.name: 0.8 * lighter.nominal}).simulate(seed=1)


def humanoid(folder: Path) -> tuple[Path, btr.Log]:
    """A humanoid of 30 joints with a heavier trunk."""
    path = write_humanoid(folder)
    return path, btr.load_model(path).at({"mass@trunk": 9.0}).simulate(seed=1)


MADE = {"arm": arm, "nao": nao, "humanoid": humanoid}

if __name__ == "__main__":
    main()
