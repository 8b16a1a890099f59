# %% [markdown]
# # A robot of your own
#
# What btr needs to know of a robot: a URDF, a short text around it, and logs. Here all three are made up on the spot, a leg of
# two servos that hangs from a bench, so that it is known what should be found: the shank is heavier than its maker believes,
# and the knee's gears have play. Put your own files in their place, step by step.
#
#     python examples/own_robot.py
#
# Half a minute. The cells run as a script, and as a notebook in VS Code or with jupytext.

# %%
import tempfile
from pathlib import Path

import numpy as np

import btr

OUT = Path(tempfile.mkdtemp(prefix="btr_"))

# %% [markdown]
# ## 1. The robot
# Any URDF: links with masses and inertias, joints with axes and limits. Meshes are not looked at.


# %%
def urdf(thigh_kg: float, shank_kg: float) -> str:
    """The leg. In reality it has other masses than on paper."""

    def link(name: str, mass_kg: float, length_m: float) -> str:
        inertia = mass_kg * length_m**2 / 12
        return f"""
  <link name="{name}"><inertial>
    <origin xyz="0 0 {-length_m / 2}"/><mass value="{mass_kg}"/>
    <inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia / 20}" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>"""

    def hinge(name: str, parent: str, child: str, below_m: float) -> str:
        return f"""
  <joint name="{name}" type="revolute">
    <parent link="{parent}"/><child link="{child}"/>
    <origin xyz="0 0 {-below_m}"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="20" velocity="20"/>
  </joint>"""

    links = link("bench", 5.0, 0.1) + link("thigh", thigh_kg, 0.2) + link("shank", shank_kg, 0.18)
    return f'<robot name="leg">{links}{hinge("hip", "bench", "thigh", 0.0)}{hinge("knee", "thigh", "shank", 0.2)}\n</robot>'


(OUT / "leg.urdf").write_text(urdf(thigh_kg=0.5, shank_kg=0.3))

# %% [markdown]
# ## 2. What is known of it
# Servos, sensors, and the free parameters with their bounds. The robot takes a command every `control_s`, in so many steps of the
# simulation. This recorder has names of its own, a clock in ms and angles in degrees; `[channels]` translates them.

# %%
MODEL = """
name = "leg"

[robot]
urdf = "leg.urdf"
base = "fixed"

[actuators."*"]           # tau = kp·(cmd − q) − kd·dq
kind = "position"
kp = 18.0
kd = 0.4

[simulation]
control_s = 0.01
steps_per_control = 10
sample_every = 10

[noise]                   # of the encoders, as their data sheet has it
position_rad = 0.0005

[parameters]
"mass@thigh" = { relative = [0.7, 1.4] }
"mass@shank" = { relative = [0.7, 1.4] }
"kp@*" = { relative = [0.8, 1.25] }

[channels]
time = "time_ms"

[channels.channels]
"cmd_{joint}" = { column = "{joint}_target", factor = 0.017453292519943295 }
"q_{joint}" = { column = "{joint}_position", factor = 0.017453292519943295 }
"""
leg = btr.Model(MODEL, OUT / "leg.toml")
print(repr(leg))

# %% [markdown]
# ## 3. Its logs
# A few seconds each, with motions that differ: slow and fast, with reversals, both joints at once. This is the cell to leave
# out with a robot at hand. Here another leg is simulated in finer steps, and recorded by what writes CSV files in its own way.

# %%
(OUT / "real.urdf").write_text(urdf(thigh_kg=0.5, shank_kg=0.36))
PLAY = '[[effects]]\neffect = "backlash"\nsite = "knee"\ngap = 0.03\n'
FINER = {"leg.urdf": "real.urdf", "steps_per_control = 10": "steps_per_control = 40", "sample_every = 10": "sample_every = 40"}
text = MODEL + PLAY
for believed, true in FINER.items():
    text = text.replace(believed, true)
reality = btr.Model(text, OUT / "real.toml")


def record(seed: int) -> Path:
    """Sums of sines that swell from rest, and what the encoders say to them."""
    rng, clock_s = np.random.default_rng(seed), np.arange(0, 5, 0.01)
    swell = np.minimum(clock_s, 1.0)

    def motion() -> np.ndarray:
        waves = zip(rng.uniform(0.1, 0.3, 3), rng.uniform(1, 8, 3), rng.uniform(0, np.pi, 3))
        return swell * sum(size_rad * np.sin(rate * clock_s + phase) for size_rad, rate, phase in waves)

    told = btr.Log(clock_s, {"cmd_hip": motion(), "cmd_knee": motion()})
    did = reality.simulate(told, seed=seed)
    angles_deg = [np.degrees(values) for values in (told["cmd_hip"], did["q_hip"], told["cmd_knee"], did["q_knee"])]
    path, header = OUT / f"log_{seed}.csv", "time_ms,hip_target,hip_position,knee_target,knee_position"
    np.savetxt(path, np.column_stack([1000 * clock_s, *angles_deg]), delimiter=",", header=header, comments="")
    return path


learn, held_out = [record(1), record(2)], [record(3)]

# %% [markdown]
# A path is a log, and so are arrays (`btr.Log(clock_s, {"cmd_hip": ..., "q_hip": ...})`, in s and rad) and frames of pandas or
# polars with a column `t`. `btr.load_log` shows what is made of a file.

# %%
log = btr.load_log(learn[0], model=leg)
print(f"{log!r}: the knee goes from {log['q_knee'].min():.2f} to {log['q_knee'].max():.2f} {log.unit('q_knee')}")

# %% [markdown]
# ## 4. Does the text fit the robot?
# What `check` finds bad has to be mended first: a sign, a unit, a joint that follows late.

# %%
print(f"\n{btr.check(leg, learn)!r}")

# %% [markdown]
# ## 5. Where does the model fail, and why?

# %%
print(f"\n{btr.compare(leg, held_out)!r}")
answer = btr.diagnose(leg, learn, held_out=held_out)
print(f"\n{answer!r}")

# %% [markdown]
# ## 6. The numbers of this leg
# In units of their own, with 95 % intervals. Planted were 0.36 kg and 0.03 rad.

# %%
fitted = btr.fit(leg, learn, held_out=held_out, add=answer.names)
fitted.model.save(OUT / "fitted.toml")
print(f"\n{fitted!r}\n\nthe model is in {OUT / 'fitted.toml'}")
