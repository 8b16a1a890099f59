# %% [markdown]
# # The loop with a Python function as the robot
#
# Controllers are searched in simulation, a few are tested in reality, and the measured behaviour improves the
# simulation. Reality is any function that executes a controller's references and returns the sensor readings. Here it
# is a pendulum with friction in its hinge, which the simulations lack: the loop detects this, stops, names the missing
# effect, and continues with it.
#
#     python examples/coevolve.py
#
# Takes a quarter of a minute. The cells run as a script, and as a notebook in VS Code or with jupytext.

# %%
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import btr

# A notebook has no `__file__`; its working directory is its own folder.
HERE = Path(__file__).parent if "__file__" in globals() else Path.cwd()
OUT = Path(tempfile.mkdtemp(prefix="btr_"))

# %% [markdown]
# ## The experiment
# One of the bundled experiments. Any value of the file can be changed by its dotted key; its `[reality]` is not used
# here.

# %%
experiment = btr.load_model(HERE.parent / "robots" / "disengage.toml", {"coevolve.simulators.generations": 10})
print(repr(experiment))

# %% [markdown]
# ## The robot
# It receives `controller.references`, commands on a clock that are each held until the next, starting at rest at
# `controller.start`. `controller.parameters` are the controller's parameters. If the robot cannot execute a test, it
# raises `btr.TestFailed`: the test counts, and the run continues. Any other exception ends the run, which can be
# resumed with the same test.

# %%
TRUTH = {"mass_kg = 1.0": "mass_kg = 1.2", "kp = 10.0": "kp = 9.0"}
FINER = {"steps_per_control = 4": "steps_per_control = 16", "sample_every = 4": "sample_every = 16"}
FRICTION_NM = 0.4


class Robot:
    """A pendulum with other parameters, smaller time steps and friction; its third test fails."""

    def __init__(self) -> None:
        text = experiment.text
        for nominal, true in {**TRUTH, **FINER}.items():
            text = text.replace(nominal, true)
        friction = f'\n[[effects]]\neffect = "coulomb_friction"\nsite = "hinge"\ntorque = {FRICTION_NM}\n'
        self.model = btr.Model(text + friction, experiment.path)

    def __call__(self, controller: btr.Controller) -> btr.Log:
        print(f"  test {controller.number}: amplitude {controller.parameters['amplitude@hinge']:.2f} rad")
        if controller.number == 2:
            raise btr.TestFailed("the cable came off")
        commands = controller.references
        start = np.full(len(commands), controller.start["hinge"])
        log = btr.Log(commands.clock_s, {**commands.to_dict(), "q_hinge": start})
        return self.model.simulate(log, seed=controller.number)


# %% [markdown]
# ## Interrupt
# `tell` is called with every completed iteration. An exception in it ends the run, as Ctrl-C or a lost machine would;
# by then every real test is on disk.


# %%
class LunchBreak(Exception):
    """Interrupts the run."""


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
# ## Resume
# No real test is requested twice. In the end fresh tests are still mispredicted for all masses and gains: the run stops
# as disengaged, and diagnoses from its real tests what the simulations lack.

# %%
run = btr.coevolve(experiment, robot, out=OUT / "run", resume=True, tell=tell)
print(f"\n{run!r}\n")

# %% [markdown]
# ## Continue in a larger space
# With the effect added, the experiment continues in the same folder and uses all its real tests.

# %%
run = btr.coevolve(experiment.add(*run.missing), robot, out=OUT / "run", resume=True, tell=tell)
print(f"\n{run!r}\n")
for name, value in run.iterations[-1]["parameters"].items():
    print(f"{name} = {value:.3f}")

# %% [markdown]
# ## Results
# A notebook shows the run with its figures. The adapted model can be simulated and compared with logs.

# %%
if find_spec("matplotlib"):
    run.plot().savefig(OUT / "run.png")
adapted = btr.load_model(run.adapted)
print(f"\nadapted model: {adapted!r}")
run
