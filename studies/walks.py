#!/usr/bin/env python3
"""The final walks of `robots/nao.toml`, on the real robot for longer than their tests, and as a picture.

    cargo build --release && python3 studies/walks.py [--seeds 5] [--first 1] [--duration 20] [--picture
    docs/nao-walk.svg]

Each seed's last controller walks on its hidden twin, with the twin's masses. It prints forward speed, falls, heading,
and the largest joint speeds and torques relative to the published limits. The first seed's walk is drawn. Runs already
in the output folder are read, not repeated. Needs only the standard library. """

from __future__ import annotations

import argparse
import math
import pathlib
import re

from asking import BTR, ROOT, coevolved, heading_deg, simulated

EXPERIMENT = ROOT / "robots" / "nao.toml"

# No-load speed in rad/s, stall torque in N·m: motors and gears as in crates/btr-physics/src/nao.rs, which has the
# sources.
STRONG, KNEE = (4.162, 11.98), (6.402, 7.786)
LIMITS = {
    "HipYawPitch": STRONG,
    "HipRoll": STRONG,
    "AnkleRoll": STRONG,
    "HipPitch": KNEE,
    "KneePitch": KNEE,
    "AnklePitch": KNEE,
}
ARM, ROLL = (8.293, 2.269), (7.194, 2.616)
LIMITS |= {
    "HeadPitch": ROLL,
    "ShoulderRoll": ROLL,
    "ElbowRoll": ROLL,
    "HeadYaw": ARM,
    "ShoulderPitch": ARM,
    "ElbowYaw": ARM,
}

FALLEN_M = 0.25
"""Height of the torso, which is 0.35 m in the pose of the table, below which the robot has fallen."""


def walk(folder: pathlib.Path, truth: dict[str, float], duration_s: float, btr: str) -> list[dict[str, float]]:
    """The rows of the run's last controller on the hidden twin."""
    text = (folder / "adapted.toml").read_text()
    for name, value in truth.items():
        text = re.sub(rf'(?m)^("{name}" = .*value = )[-0-9.e]+', rf"\g<1>{value!r}", text)
    twin = folder / "twin.toml"
    twin.write_text(text)
    return simulated(btr, twin, folder / "walk.csv", duration_s)


def largest(rows: list[dict[str, float]], kind: str, limit: int) -> tuple[float, str]:
    """The largest ratio of a joint's channel of a kind to its limit, and the joint."""
    shares = {
        name: max(abs(row[name]) for row in rows if name in row) for name in rows[0] if name.startswith(f"{kind}_")
    }
    shares = {name.split("_", 1)[1]: value for name, value in shares.items()}
    joint = max(shares, key=lambda name: shares[name] / LIMITS[name.lstrip("LR")][limit])
    return shares[joint] / LIMITS[joint.lstrip("LR")][limit], f"{joint} {shares[joint]:.2f}"


# Positions of the joints in the table's pose, in the torso's frame (x forward, y left, z up), and their axes.
PITCH, YAW, TURN = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)


def chain(side: float, name: str) -> list[list[tuple[str, tuple, tuple]]]:
    """Leg and arm of a side: joints from the torso outwards, each chain with a fixed end point."""
    leg = lambda up, forward: (forward + 0.02, side * 0.06, up - 0.07)
    arm = lambda up, forward: (forward + 0.02, side * 0.095, up - 0.07)
    diagonal = (0.0, math.sqrt(0.5), -side * math.sqrt(0.5))
    hip, ankle = leg(-0.04, -0.03), leg(-0.23, -0.01)
    return [
        [(f"{name}HipYawPitch", hip, diagonal), (f"{name}HipRoll", hip, TURN), (f"{name}HipPitch", hip, PITCH),
         (f"{name}KneePitch", leg(-0.13, -0.01), PITCH), (f"{name}AnklePitch", ankle, PITCH),
         (f"{name}AnkleRoll", ankle, TURN), ("heel", leg(-0.28, -0.06), TURN),
         ("toe", leg(-0.28, 0.10), TURN), ("back", ankle, TURN)],
        [(f"{name}ShoulderPitch", arm(0.14, -0.02), PITCH), (f"{name}ShoulderRoll", arm(0.14, -0.02), YAW),
         (f"{name}ElbowYaw", arm(0.15, 0.07), TURN), (f"{name}ElbowRoll", arm(0.15, 0.07), YAW),
         ("hand", arm(0.15, 0.14), TURN)],
    ]  # fmt: skip


def turn(axis: tuple, angle: float, v: tuple) -> tuple:
    """A vector turned about an axis (O. Rodrigues)."""
    c, s = math.cos(angle), math.sin(angle)
    dot = sum(a * b for a, b in zip(axis, v))
    cross = (axis[1] * v[2] - axis[2] * v[1], axis[2] * v[0] - axis[0] * v[2], axis[0] * v[1] - axis[1] * v[0])
    return tuple(c * b + s * d + (1 - c) * dot * a for a, b, d in zip(axis, v, cross))


def points(row: dict[str, float], joints: list[tuple[str, tuple, tuple]]) -> list[tuple]:
    """Positions of a chain's joints in the world."""
    w, *v = (row[f"base_q{axis}"] for axis in "wxyz")
    norm = math.sqrt(sum(a * a for a in v)) or 1.0
    turns = [(tuple(a / norm for a in v), 2 * math.atan2(norm if w * norm else 0.0, w))]
    at, before, path = tuple(row[f"base_{axis}"] for axis in "xyz"), (0.0, 0.0, 0.0), []
    for name, place, axis in joints:
        step = tuple(a - b for a, b in zip(place, before))
        for about, angle in reversed(turns):
            step = turn(about, angle, step)
        at, before = tuple(a + b for a, b in zip(at, step)), place
        path.append(at)
        turns.append((axis, row.get(f"q_{name}", 0.0)))
    return path


def figure(row: dict[str, float], left: float, base: float, view: int) -> list[str]:
    """One picture: the robot from its left (`view` 0) or from behind (1), its torso above `left`."""
    scale, parts = 260.0, []
    flat = lambda p: (
        left + scale * ((p[0] - row["base_x"]) if view == 0 else (row["base_y"] - p[1])),
        base - scale * p[2],
    )
    draw = lambda path, colour, width: parts.append(
        f'<polyline points="{" ".join("%.1f,%.1f" % flat(p) for p in path)}" stroke="{colour}" stroke-width="{width}"/>'
    )
    for side, name, colour in ((-1.0, "R", "#c98b5b"), (1.0, "L", "#2b6c99")):
        leg, arm = (points(row, joints) for joints in chain(side, name))
        draw(leg, colour, 4)
        draw(arm, colour, 2)
    head = points(row, [("hips", (0.0, 0.0, -0.11), TURN), ("neck", (0.0, 0.0, 0.09), TURN)])
    draw(head, "#444", 7)
    x, y = flat(points(row, [("head", (0.02, 0.0, 0.15), TURN)])[0])
    parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="15" fill="#444" stroke="none"/>')
    return parts


def strip(rows: list[dict[str, float]], file: pathlib.Path) -> None:
    """The start, the middle and the end of a walk, from the left and from behind."""
    clock = next(iter(rows[0]))
    end_s, every_s, count = rows[-1][clock], 0.11, 11
    parts, height = [], 165
    for band, (title, from_s) in enumerate((("start", 0.0), ("midway", end_s / 2), ("stop", end_s - 1.3))):
        for view in (0, 1):
            base = 40 + height * (2 * band + view + 1) - 20
            label = f"{title}, from {from_s:.1f} s every {every_s} s, {'from its left' if view == 0 else 'from behind'}"
            parts.append(f'<text x="10" y="{base - 138}" stroke="none" fill="#444">{label}</text>')
            parts.append(f'<line x1="0" y1="{base}" x2="1000" y2="{base}" stroke="#bbb"/>')
            for k in range(count):
                row = min(rows, key=lambda row: abs(row[clock] - from_s - k * every_s))
                parts += figure(row, 50 + 90 * k, base, view)
    size = f'width="1000" height="{6 * height + 50}" viewBox="0 0 1000 {6 * height + 50}"'
    style = 'fill="none" stroke-linecap="round" stroke-linejoin="round" font-family="sans-serif" font-size="13"'
    ground = '<rect width="1000" height="2000" fill="white"/>'
    file.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{ground}<g {style}>{"".join(parts)}</g></svg>\n')
    print(f"picture: {file}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--duration", type=float, default=20.0, help="s")
    parser.add_argument("--picture", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "runs" / "walks")
    parser.add_argument("--btr", default=BTR)
    args = parser.parse_args()
    print(
        "seed | tested, walked | speed m/s | ends at x, y m | heading deg | fell | joint speed, torque of their limits"
    )
    for seed in range(args.first, args.first + args.seeds):
        folder = args.out.resolve() / f"nao-{seed}"
        truth = coevolved(args.btr, folder, EXPERIMENT, seed)["revealed"]["parameters"]
        rows = walk(folder, truth, args.duration, args.btr)
        if args.picture and seed == args.first:
            strip(rows, args.picture)
        last, lowest = rows[-1], min(row["base_z"] for row in rows)
        fell = next((row for row in rows if row["base_z"] < FALLEN_M), None)
        (speed, fastest), (torque, strongest) = largest(rows, "dq", 0), largest(rows, "tau", 1)
        print(
            f"{seed:4} | 7, {args.duration:.0f} s | {last['base_x'] / args.duration:.3f} | "
            f"{last['base_x']:+.2f} {last['base_y']:+.2f} | {heading_deg(last):+.1f} | "
            f"{'no' if fell is None else 'yes'}, lowest {lowest:.2f} m | "
            f"{100 * speed:.0f} % ({fastest} rad/s), {100 * torque:.0f} % ({strongest} N·m)",
            flush=True,
        )


if __name__ == "__main__":
    main()
