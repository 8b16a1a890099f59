"""Tables over many cases, and the figure of reliability."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from .score import ANSWERS, GOOD, SCORES, VISIBLE, Outcome

BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0)


def summary(outcomes: list[Outcome]) -> str:
    """Everything in words and tables."""
    if not outcomes:
        return "no cases"
    lines = [f"{len(outcomes)} cases"]
    counts = Counter(outcome.score for outcome in outcomes)
    for score, meaning in SCORES.items():
        if counts[score]:
            lines.append(f"  {score:<12}{counts[score]:4} {100 * counts[score] / len(outcomes):6.1f} %  {meaning}")
    lines.append(f"confident and wrong: {sum(outcome.confident_and_wrong for outcome in outcomes)}")
    indistinct = sum(outcome.indistinct for outcome in outcomes)
    lines.append(f"not good, but as good in these logs as the truth is: {indistinct}")
    visible = [o for o in outcomes if o.kind in ("one", "two") and o.before > VISIBLE]
    if visible:
        right = sum(o.score in ("exact", "alike") for o in visible)
        lines.append(f"hidden, in the library and visible: {right} of {len(visible)} exact or alike")
    given = [interval for o in outcomes for interval in o.intervals if "holds" in interval]
    held = sum(interval["holds"] for interval in given)
    lines.append(f"95 % intervals that hold the truth: {held} of {len(given)}")
    answered = [o for o in outcomes if o.rollouts]
    if answered:
        for what in ("rollouts", "seconds"):
            numbers = [getattr(o, what) for o in answered]
            lines.append(f"{what}: median {statistics.median(numbers):.0f}, most {max(numbers):.0f}")
    raised = [o for o in outcomes if o.floors and not o.robot["noise_stated"]]
    if raised:
        worst = [o.floors[1] for o in raised]
        middle, most = statistics.median(worst), max(worst)
        lines.append(f"a case's largest estimated noise floor over the true one: median {middle:.2f}, most {most:.2f}")
    lines += table("kind", outcomes, lambda o: o.kind)
    lines += table("effect", [o for o in outcomes if o.kind != "two"], lambda o: f"{o.kind}: {o.effect}")
    lines += table("difference in noise floors", [o for o in outcomes if o.difference], size)
    lines += table("clock", outcomes, clock)
    lines += table("joints", outcomes, lambda o: str(o.robot["joints"]))
    lines += table("beginning", outcomes, lambda o: "in motion" if o.robot["moving_start"] else "at rest")
    lines += ["", "reliability: names by btr's probability", "  probability     names   right"]
    for low, high, names, right, _ in reliability(outcomes):
        lines.append(f"  {low:.2f} .. {high:.2f} {names:8} {100 * right / names:6.0f} %")
    return "\n".join(lines)


def size(outcome: Outcome) -> str:
    """How much the smallest hidden effect shows."""
    least = min(outcome.difference)
    for bound in (2.0, 5.0, 15.0):
        if least < bound:
            return f"below {bound:4.0f}"
    return "above   15"


def clock(outcome: Outcome) -> str:
    """Samples a second."""
    hertz = outcome.robot["clock_hz"]
    return "up to 30 Hz" if hertz <= 30 else "up to 100 Hz" if hertz <= 100 else "up to 500 Hz"


def table(title: str, outcomes: list[Outcome], key: Callable[[Outcome], str]) -> list[str]:
    """Scores of the cases with each key."""
    lines = ["", title]
    for name in sorted(set(map(key, outcomes))):
        group = [o for o in outcomes if key(o) == name]
        good = sum(o.score in GOOD for o in group)
        scores = ", ".join(f"{count} {score}" for score, count in Counter(o.score for o in group).most_common())
        lines.append(f"  {name:<36} {good:3} of {len(group):3} good: {scores}")
    return lines


Bin = tuple[float, float, int, int, float]


def reliability(outcomes: list[Outcome]) -> list[Bin]:
    """For each bin of btr's probability: its bounds, number of names, number that are right, mean probability.

    Only names that btr gives as the answer count, not what merely helps. A name is right if it is hidden, or
    physically the same as what is hidden.
    """
    pairs = [
        (p, right) for o in outcomes if o.verdict in ANSWERS for p, right in zip(o.probabilities, o.right)
    ]
    bins = []
    for low, high in zip(BINS, BINS[1:]):
        here = [(p, right) for p, right in pairs if low <= p < high or (high == 1.0 and p == 1.0)]
        if here:
            mean = sum(p for p, _ in here) / len(here)
            bins.append((low, high, len(here), sum(right for _, right in here), mean))
    return bins


LEFT, TOP, WIDTH, HEIGHT = 60.0, 40.0, 520.0, 300.0
BLUE, ORANGE = "#1f5fa8", "#c26a1b"


def draw(outcomes: list[Outcome], file: Path) -> None:
    """How often a name is right, for each range of the probability that btr gives it, and what it gives on average."""

    def y(share: float) -> float:
        return TOP + HEIGHT * (1.0 - share)

    title = f"how often a named effect is the hidden one: {len(outcomes)} robots"
    parts = [f'<text x="{LEFT}" y="20">{title}</text>']
    for value in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0):
        ends = f'x1="{LEFT}" x2="{LEFT + WIDTH}" y1="{y(value):.1f}" y2="{y(value):.1f}"'
        parts.append(f'<line {ends} stroke="#e4e4e4"/>')
        parts.append(f'<text x="{LEFT - 8}" y="{y(value) + 4:.1f}" text-anchor="end">{value:.1f}</text>')
    bins = reliability(outcomes)
    column = WIDTH / max(len(bins), 1)
    for place, (low, high, names, right, mean) in enumerate(bins):
        at = LEFT + column * (place + 0.5)
        least, most = wilson(right, names)
        parts += [
            f'<rect x="{at - 18:.1f}" y="{y(mean) - 1.5:.1f}" width="36" height="3" fill="{ORANGE}"/>',
            f'<line x1="{at:.1f}" x2="{at:.1f}" y1="{y(least):.1f}" y2="{y(most):.1f}" stroke="{BLUE}"/>',
            f'<circle cx="{at:.1f}" cy="{y(right / names):.1f}" r="6" fill="{BLUE}"/>',
            f'<text x="{at:.1f}" y="{TOP + HEIGHT + 20}" text-anchor="middle">{low:g}–{high:g}</text>',
            f'<text x="{at:.1f}" y="{TOP + HEIGHT + 38}" text-anchor="middle" fill="{BLUE}">{right} of {names}</text>',
        ]
    below = TOP + HEIGHT + 62
    parts.append(f'<text x="{LEFT + WIDTH / 2}" y="{below}" text-anchor="middle">probability that btr gives</text>')
    says = "names that are right, with 95 % interval"
    parts.append(f'<circle cx="{LEFT + 36}" cy="{below + 18}" r="6" fill="{BLUE}"/>')
    parts.append(f'<text x="{LEFT + 50}" y="{below + 22}" fill="{BLUE}">{says}</text>')
    parts.append(f'<rect x="{LEFT + 330}" y="{below + 16}" width="24" height="3" fill="{ORANGE}"/>')
    parts.append(f'<text x="{LEFT + 362}" y="{below + 22}" fill="{ORANGE}">mean probability</text>')
    frame = 'width="600" height="440" viewBox="0 0 600 440" font-family="sans-serif" font-size="13" fill="#333"'
    body = '<rect width="600" height="440" fill="white"/>' + "".join(parts)
    file.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {frame}>{body}</svg>\n')


def wilson(right: int, names: int, z: float = 1.96) -> tuple[float, float]:
    """95 % interval of a share (Wilson 1927)."""
    share = right / names
    middle = (share + z**2 / (2 * names)) / (1 + z**2 / names)
    half = z / (1 + z**2 / names) * (share * (1 - share) / names + z**2 / (4 * names**2)) ** 0.5
    return max(0.0, middle - half), min(1.0, middle + half)
