# %% [markdown]
# # A model and its logs
#
# The nominal model of the bundled desk arm does not agree with its logs. Where does the model fail, what does it lack,
# and does the error on held-out logs decrease?
#
#     python examples/compare_diagnose_fit.py
#
# Takes a quarter of a minute. The cells run as a script, and as a notebook in VS Code or with jupytext. All errors are
# in multiples of the sensors' noise floor: 1 is the best that any model can reach.

# %%
import tempfile
from importlib.util import find_spec
from pathlib import Path

import btr

# A notebook has no `__file__`; its working directory is its own folder.
HERE = Path(__file__).parent if "__file__" in globals() else Path.cwd()
OUT = Path(tempfile.mkdtemp(prefix="btr_"))
arm = btr.load_model(HERE.parent / "robots" / "arm.toml")
logs = HERE.parent / "robots" / "arm"
learn, held_out = sorted(logs.glob("learn_*.csv")), sorted(logs.glob("held_out_*.csv"))
print(f"{arm!r}\n{len(learn)} training logs, {len(held_out)} held-out logs")

# %% [markdown]
# ## Are the logs good?
# Checks clocks, sensors, delays, signs and units before any other analysis, and how many of the free parameters the
# logs determine.

# %%
checked = btr.check(arm, learn)
print(f"\n{checked!r}\nthese logs determine {checked.rank} of {len(checked.parameters)} free parameters")

# %% [markdown]
# ## Where does the model fail?
# `chi` is a channel's error in noise floors; `failures` are the joints and regimes of motion in which it stands out.

# %%
before = btr.compare(arm, held_out)
print(f"\nbefore: {before!r}")

# %% [markdown]
# ## What is missing?
# Every effect of the library is tried at every site, with the free parameters refitted; the named effects are confirmed
# by the held-out logs. `tell` is called with the errors after each step.


# %%
def tell(step: str, train: float, held_out: float | None) -> None:
    print(f"  {step}: {train:.2f}, held out {held_out:.2f}")


print("\nwhat is missing:")
answer = btr.diagnose(arm, learn, held_out=held_out, tell=tell)
print(answer.verdict, answer.names)

# %% [markdown]
# ## How large is the error with it?
# The effect is added, and all free parameters are fitted together with it.

# %%
fitted = btr.fit(arm, learn, held_out=held_out, add=answer.names)
after = btr.compare(fitted.model, held_out)
print(f"\n{fitted!r}\n\nafter: {after!r}")

# %% [markdown]
# ## Save
# The model is a file that the command line also reads. A report is one HTML file; notebooks show it by themselves.

# %%
fitted.model.save(OUT / "fitted.toml")
answer.report(OUT / "why.html")
if find_spec("matplotlib"):
    fitted.plot().savefig(OUT / "fitted.png")
print("\nwritten:", ", ".join(str(path) for path in sorted(OUT.iterdir())))
