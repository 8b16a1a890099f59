# %% [markdown]
# # A model and its logs
#
# The bundled desk arm is described as its maker believes it to be, and its logs say otherwise. Where does the model fail, what
# does it lack, and does the error fall on logs that nothing was fitted to?
#
#     python examples/compare_diagnose_fit.py
#
# A quarter of a minute. The cells run as a script, and as a notebook in VS Code or with jupytext. All errors are in multiples of the
# sensors' noise floor: 1 is as good as any model can be.

# %%
import tempfile
from importlib.util import find_spec
from pathlib import Path

import btr

# A notebook has no `__file__`; it begins in its own folder.
HERE = Path(__file__).parent if "__file__" in globals() else Path.cwd()
OUT = Path(tempfile.mkdtemp(prefix="btr_"))
arm = btr.load_model(HERE.parent / "robots" / "arm.toml")
logs = HERE.parent / "robots" / "arm"
learn, held_out = sorted(logs.glob("learn_*.csv")), sorted(logs.glob("held_out_*.csv"))
print(f"{arm!r}\n{len(learn)} logs to learn from, {len(held_out)} to judge on")

# %% [markdown]
# ## Are the logs good?
# Clocks, sensors, delays, signs and units, before anything is concluded from them; and how many of the free parameters they
# tell.

# %%
checked = btr.check(arm, learn)
print(f"\n{checked!r}\nthese logs tell {checked.rank} of {len(checked.parameters)} free parameters")

# %% [markdown]
# ## Where does the model fail?
# `chi` is a channel's error in noise floors; `failures` say in which joint and regime of motion it stands out.

# %%
before = btr.compare(arm, held_out)
print(f"\nbefore: {before!r}")

# %% [markdown]
# ## What is missing?
# Every effect of the library is tried at every site, with the free parameters refitted; what is named was confirmed by the
# held-out logs. `tell` hears how the error falls on the way.


# %%
def tell(step: str, learnt: float, judged: float | None) -> None:
    print(f"  {step}: {learnt:.2f}, held out {judged:.2f}")


print("\nwhat is missing:")
answer = btr.diagnose(arm, learn, held_out=held_out, tell=tell)
print(answer.verdict, answer.names)

# %% [markdown]
# ## With it, how far off is the model?
# The effect is added, and all free parameters are fitted together with it.

# %%
fitted = btr.fit(arm, learn, held_out=held_out, add=answer.names)
after = btr.compare(fitted.model, held_out)
print(f"\n{fitted!r}\n\nafter: {after!r}")

# %% [markdown]
# ## To keep
# The model is a file that the command line reads as well. A report is one HTML file, which notebooks show by themselves.

# %%
fitted.model.save(OUT / "fitted.toml")
answer.report(OUT / "why.html")
if find_spec("matplotlib"):
    values, _ = fitted.plot()
    values.figure.savefig(OUT / "fitted.png")
print("\nwritten:", ", ".join(str(path) for path in sorted(OUT.iterdir())))
