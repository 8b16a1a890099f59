"""The reports of compare, diagnose and fit in a browser: every plot is drawn, without network requests."""

import math
import subprocess
from pathlib import Path

import pytest

import browser
from program import BTR

PENDULUM = """
name = "pendulum"
[robot]
builtin = "pendulum"
length_m = 0.3
[actuators.hinge]
kind = "position"
kp = 12.0
kd = 0.3
[simulation]
control_s = 0.01
steps_per_control = 10
sample_every = 10
[noise]
position_rad = 0.0003
position_quantum_rad = 0.0005
[parameters]
"mass@bob" = { relative = [0.8, 1.25] }
"kp@hinge" = { relative = [0.8, 1.25] }
"kd@hinge" = { relative = [0.8, 1.25] }
"""
# Effects of reality that the model lacks.
REALITIES = {
    "friction": 'effect = "coulomb_friction"\nsite = "hinge"\ntorque = 0.25',
    "nothing": 'effect = "coulomb_friction"\nsite = "hinge"\ntorque = 0.0',
    "odd": 'effect = "formula"\nsite = "hinge"\non = "torque"\nlaw = "0.4*sin(7*t)*q"',
    "late": 'effect = "command_delay"\nsite = "hinge"\ndelay = 0.03',
}
JOINT = [
    "hinge in",
    "Residual in",
    "Residual against velocity",
    "Residual around reversals",
    "Spectrum",
    "Autocorrelation",
]
LADDER = ["The error, step by step"]
ROUND = ["Round 1"]
BOUNDS = ["Each value between its bounds"]
# For each report: the verb with its arguments, the reality, what the page says, and the plots that it has at least.
REPORTS = {
    "compare": ("compare", "friction", "follows", ["By regime", "Over", *JOINT]),
    "found": ("diagnose", "friction", "The model lacks coulomb_friction on hinge", [*LADDER, *ROUND, *JOINT]),
    "nothing": ("diagnose", "nothing", "Nothing is missing", [*LADDER, *JOINT]),
    "unexplained": ("diagnose", "odd", "nothing tried explains", [*LADDER, *ROUND, *JOINT]),
    "alike": ("diagnose", "late", "These logs cannot tell it from", [*LADDER, *ROUND, *JOINT]),
    "fit": ("fit --add coulomb_friction@hinge", "friction", "what remains is noise", [*LADDER, *BOUNDS, *JOINT]),
    "withheld": ("fit", "odd", "No intervals", [*LADDER, *BOUNDS, *JOINT]),
}

# Everything that is wrong with the page's plots, as sentences; and the plots' titles.
LOOK = """(() => {
  const wrong = [], titles = [], nonsense = /NaN|Infinity|undefined|null|inf/;
  for (const svg of document.querySelectorAll('svg')) {
    const title = svg.querySelector('title')?.textContent ?? '';
    const say = what => wrong.push(`${title}: ${what}`);
    titles.push(title);
    const box = svg.getBoundingClientRect(), view = svg.viewBox.baseVal;
    if (!title) say('no title');
    if (!(box.width > 50 && box.height > 50)) say(`${box.width} x ${box.height} px`);
    for (const shape of svg.querySelectorAll('path, polyline, line, rect, circle, text'))
      for (const {name, value} of shape.attributes)
        if (nonsense.test(value)) say(`${shape.tagName} with ${name}="${value.slice(0, 80)}"`);
    const all = [...svg.querySelectorAll('.line, .dots, .span, .stem, .heat')];
    const marks = all.filter(mark => !mark.closest('.legend')), legend = all.filter(mark => mark.closest('.legend'));
    if (!marks.length) say('nothing is drawn');
    for (const {classList: [ink]} of legend)
      if (!marks.some(mark => mark.classList.contains(ink))) say(`${ink} is in the legend alone`);
    const to = svg.getScreenCTM().inverse();
    for (const shape of [...marks, ...svg.querySelectorAll('text')]) {
      const own = shape.getBBox(), at = to.multiply(shape.getScreenCTM());
      const ends = [[own.x, own.y], [own.x + own.width, own.y + own.height]];
      const corners = ends.map(([x, y]) => new DOMPoint(x, y).matrixTransform(at));
      const what = `${shape.tagName} ${shape.getAttribute('class') ?? ''} ${shape.textContent}`;
      if (!(Math.max(own.width, own.height) > 0)) say(`${what} has no size`);
      for (const {x, y} of corners)
        if (!(x >= -2 && x <= view.width + 2 && y >= -2 && y <= view.height + 2)) say(`${what} is off the paper`);
    }
  }
  return {wrong, titles, text: document.body.innerText, wide: document.documentElement.scrollWidth - window.innerWidth};
})()"""


@pytest.fixture(scope="module")
def chromium():
    """A browser for all pages."""
    if browser.found() is None:
        pytest.skip("no chromium")
    with browser.Browser() as running:
        yield running


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """A model, and three logs of every reality."""
    if BTR is None:
        pytest.skip("no btr executable: set BTR, or build it")
    folder = tmp_path_factory.mktemp("reports")
    (folder / "pendulum.toml").write_text(PENDULUM)
    for reality, effect in REALITIES.items():
        (folder / "reality.toml").write_text(f"{PENDULUM}\n[[effects]]\n{effect}\n")
        for episode in range(3):
            (folder / "commands.csv").write_text(commands(episode))
            log = f"{reality}_{episode}.csv"
            btr(folder, f"simulate reality.toml --log commands.csv --seed {episode + 1} -o {log}")
    return folder


def btr(folder: Path, arguments: str) -> None:
    subprocess.run([BTR, *arguments.split(), "-q"], cwd=folder, check=True, stdout=subprocess.DEVNULL)


def commands(episode: int) -> str:
    """Four seconds for the hinge, others in each episode."""
    rate = 1.1 + 0.9 * episode
    wave = lambda t: 0.6 * math.sin(rate * t) + 0.35 * math.sin(2.7 * rate * t) + 0.1 * math.sin(9 * t)
    rows = [f"{k / 100},{0.9 * (1 - math.exp(-k / 33)) * wave(k / 100)}" for k in range(401)]
    return "\n".join(["t,cmd_hinge", *rows])


@pytest.mark.parametrize("name", REPORTS)
def test_a_browser_draws_the_report(name: str, chromium: browser.Browser, lab: Path) -> None:
    verb, reality, says, plots = REPORTS[name]
    held_out = "" if verb == "compare" else f"--held-out {reality}_2.csv"
    btr(lab, f"{verb} pendulum.toml {reality}_0.csv {reality}_1.csv {held_out} --report {name}.html")
    page = chromium.page(lab / f"{name}.html")
    seen = page.evaluate(LOOK)
    assert seen["wrong"] == []
    missing = [plot for plot in plots if not any(title.startswith(plot) for title in seen["titles"])]
    assert not missing, (missing, seen["titles"])
    assert says in seen["text"]
    assert seen["wide"] <= 0, "the page is wider than its window"
    assert page.requests() == []
    assert page.complaints() == []
