# %% [markdown]
# # A robot of your own
#
# btr needs a URDF of the robot, a short model file, and logs. Here all three are generated for a leg with two servos
# that hangs from a bench, so that the correct result is known: the shank is heavier than its nominal mass, and the
# knee's gears have backlash. Replace them with your own files, step by step.
#
#     python examples/own_robot.py
#
# Takes half a minute. The cells run as a script, and as a notebook in VS Code or with jupytext.

# %%
import tempfile
from pathlib import Path

import numpy as np

import btr

OUT = Path(tempfile.mkdtemp(prefix="btr_"))

# %% [markdown]
# ## 1. The robot
# Any URDF: links with masses and inertias, joints with axes and limits. Meshes are ignored.


# %%
def urdf(thigh_kg: float, shank_kg: float) -> str:
    """URDF of the leg. The real leg has other masses than the nominal one."""

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
    joints = hinge("hip", "bench", "thigh", 0.0) + hinge("knee", "thigh", "shank", 0.2)
    return f'<robot name="leg">{links}{joints}\n</robot>'


(OUT / "leg.urdf").write_text(urdf(thigh_kg=0.5, shank_kg=0.3))

# %% [markdown]
# ## 2. The model file
# Servos, sensors, and the free parameters with their bounds. The robot receives a command every `control_s`, which is
# `steps_per_control` simulation steps. This recorder uses its own names, a clock in ms and angles in degrees;
# `[channels]` maps them.

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
# A few seconds each, with different motions: slow and fast, with reversals, both joints at once. Skip this cell if you
# have a robot. Here another leg is simulated with smaller time steps, and recorded in the CSV format of the recorder.

# %%
(OUT / "real.urdf").write_text(urdf(thigh_kg=0.5, shank_kg=0.36))
BACKLASH = '[[effects]]\neffect = "backlash"\nsite = "knee"\ngap = 0.03\n'
FINER = {
    "leg.urdf": "real.urdf",
    "steps_per_control = 10": "steps_per_control = 40",
    "sample_every = 10": "sample_every = 40",
}
text = MODEL + BACKLASH
for nominal, true in FINER.items():
    text = text.replace(nominal, true)
reality = btr.Model(text, OUT / "real.toml")


def record(seed: int) -> Path:
    """Sums of sines that grow from rest, and the encoders' readings."""
    rng, clock_s = np.random.default_rng(seed), np.arange(0, 5, 0.01)
    swell = np.minimum(clock_s, 1.0)

    def motion() -> np.ndarray:
        waves = zip(rng.uniform(0.1, 0.3, 3), rng.uniform(1, 8, 3), rng.uniform(0, np.pi, 3))
        return swell * sum(size_rad * np.sin(rate * clock_s + phase) for size_rad, rate, phase in waves)

    commands = btr.Log(clock_s, {"cmd_hip": motion(), "cmd_knee": motion()})
    measured = reality.simulate(commands, seed=seed)
    angles = commands["cmd_hip"], measured["q_hip"], commands["cmd_knee"], measured["q_knee"]
    angles_deg = [np.degrees(values) for values in angles]
    path, header = OUT / f"log_{seed}.csv", "time_ms,hip_target,hip_position,knee_target,knee_position"
    np.savetxt(path, np.column_stack([1000 * clock_s, *angles_deg]), delimiter=",", header=header, comments="")
    return path


learn, held_out = [record(1), record(2)], [record(3)]

# %% [markdown]
# A path is a log, and so are arrays (`btr.Log(clock_s, {"cmd_hip": ..., "q_hip": ...})`, in s and rad) and frames of
# pandas or polars with a column `t`. `btr.load_log` shows how btr reads a file.

# %%
log = btr.load_log(learn[0], model=leg)
print(f"{log!r}: the knee goes from {log['q_knee'].min():.2f} to {log['q_knee'].max():.2f} {log.unit('q_knee')}")

# %% [markdown]
# ## 4. Does the model file match the robot?
# Fix what `check` reports as bad first: a sign, a unit, a joint that follows late.

# %%
print(f"\n{btr.check(leg, learn)!r}")

# %% [markdown]
# ## 5. Where does the model fail, and why?

# %%
print(f"\n{btr.compare(leg, held_out)!r}")
answer = btr.diagnose(leg, learn, held_out=held_out)
print(f"\n{answer!r}")

# %% [markdown]
# ## 6. The parameters of this leg
# In their units, with 95 % intervals. The true values are 0.36 kg and 0.03 rad.

# %%
fitted = btr.fit(leg, learn, held_out=held_out, add=answer.names)
fitted.model.save(OUT / "fitted.toml")
print(f"\n{fitted!r}\n\nthe model is in {OUT / 'fitted.toml'}")
