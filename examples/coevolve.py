# %% [markdown]
# # The loop with a robot that is a function
#
# Controllers are found in simulation, a few are tried in reality, and what they really did finds a better simulation. Reality
# is any function that plays a controller's references and gives back what the sensors said. Here it is a pendulum whose hinge
# rubs, and the simulations know nothing of friction: the loop notices, stops, says what it lacks, and goes on with it.
#
#     python examples/coevolve.py
#
# A quarter of a minute. The cells run as a script, and as a notebook in VS Code or with jupytext.

# %%
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import btr

# A notebook has no `__file__`; it begins in its own folder.
HERE = Path(__file__).parent if "__file__" in globals() else Path.cwd()
OUT = Path(tempfile.mkdtemp(prefix="btr_"))

# %% [markdown]
# ## The experiment
# One of those that ship. Any value of the file can be changed by its dotted key; the `[reality]` in it is not used here.

# %%
experiment = btr.load_model(HERE.parent / "robots" / "disengage.toml", {"coevolve.simulators.generations": 10})
print(repr(experiment))

# %% [markdown]
# ## The robot
# It is told what to do by `controller.references`, commands on a clock that each hold until the next, from rest at
# `controller.start`. `controller.parameters` are the controller's own numbers. What the robot could not do ends in
# `btr.TestFailed`: the test is spent, and the run goes on. Any other exception ends the run, to be resumed with the same test.

# %%
TRUTH = {"mass_kg = 1.0": "mass_kg = 1.2", "kp = 10.0": "kp = 9.0"}
FINER = {"steps_per_control = 4": "steps_per_control = 16", "sample_every = 4": "sample_every = 16"}
FRICTION_NM = 0.4


class Robot:
    """A pendulum of other numbers in finer steps, with friction; in its third test somebody trips over its cable."""

    def __init__(self) -> None:
        text = experiment.text
        for believed, true in {**TRUTH, **FINER}.items():
            text = text.replace(believed, true)
        rubbing = f'\n[[effects]]\neffect = "coulomb_friction"\nsite = "hinge"\ntorque = {FRICTION_NM}\n'
        self.model = btr.Model(text + rubbing, experiment.path)

    def __call__(self, controller: btr.Controller) -> btr.Log:
        print(f"  test {controller.number}: amplitude {controller.parameters['amplitude@hinge']:.2f} rad")
        if controller.number == 2:
            raise btr.TestFailed("the cable came off")
        told = controller.references
        begins = np.full(len(told), controller.start["hinge"])
        return self.model.simulate(btr.Log(told.clock_s, {**told.to_dict(), "q_hinge": begins}), seed=controller.number)


# %% [markdown]
# ## Interrupted
# `tell` hears every closed iteration. Whatever it raises ends the run, as Ctrl-C or a lost machine would; every real test is on
# disk by then.


# %%
class LunchBreak(Exception):
    """Somebody has had enough for now."""


def tell(iteration: btr.coevolution.Iteration) -> None:
    print(f"iteration {iteration['i']}: phi {iteration['phi']:.4f} after {iteration['real_tests']} real tests")


def tell_until_lunch(iteration: btr.coevolution.Iteration) -> None:
    tell(iteration)
    if iteration["i"] == 2:
        raise LunchBreak


robot = Robot()
try:
    btr.coevolve(experiment, robot, out=OUT / "run", tell=tell_until_lunch)
except LunchBreak:
    print("interrupted")

# %% [markdown]
# ## Resumed
# No real test is asked for twice. In the end fresh tests are still mispredicted, whatever mass and gain are: the run stops as
# disengaged, and asks its real tests what the simulations lack.

# %%
run = btr.coevolve(experiment, robot, out=OUT / "run", resume=True, tell=tell)
print(f"\n{run!r}\n")

# %% [markdown]
# ## In a larger space
# With the effect in it the experiment goes on in the same folder, with every real test there is.

# %%
run = btr.coevolve(experiment.add(*run.missing), robot, out=OUT / "run", resume=True, tell=tell)
print(f"\n{run!r}\n")
for name, value in run.iterations[-1]["parameters"].items():
    print(f"{name} = {value:.3f}")

# %% [markdown]
# ## What it leaves
# A notebook shows the run with its figures. The adapted model is one to simulate and to compare with.

# %%
if find_spec("matplotlib"):
    run.plot()[0].figure.savefig(OUT / "run.png")
adapted = btr.load_model(run.adapted)
print(f"\nthe model with them: {adapted!r}")
run
