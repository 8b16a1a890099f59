"""Reading compiled MuJoCo models: what btr can represent, and a list of what it cannot."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from btr._btr import BtrError
from btr._mujoco.actuators import actuators
from btr._mujoco.equalities import equalities
from btr._mujoco.left_out import left_out
from btr._mujoco.links import Links
from btr._mujoco.names import Names
from btr._mujoco.springs import passive
from btr._mujoco.trees import tree_of
from btr._optional import needed

NO_GRAVITY = 1 << 7
"""A bit of `mjtDisableBit`."""


def compiled(model: Any) -> tuple[Any, str, str]:
    """The `mujoco.MjModel` of a model or of the path of one (MJCF, URDF, `.mjb`), its name, and what it was made from.
    Raises `BtrError` if it does not compile, `TypeError` for anything else."""
    mujoco = needed("mujoco", "mujoco")
    if isinstance(model, mujoco.MjSpec):
        model = model.compile()
    if isinstance(model, mujoco.MjModel):
        return model, model.names.split(b"\0", 1)[0].decode() or "robot", "a compiled MuJoCo model"
    if not isinstance(model, (str, os.PathLike)):
        raise TypeError(f"a MuJoCo model is an MjModel, an MjSpec or the path of one, not {type(model).__name__}")
    path = Path(model)
    if not path.is_file():
        raise BtrError(f"{path}: there is no such file\nhelp: give the path of an MJCF file, or a compiled MjModel")
    load = mujoco.MjModel.from_binary_path if path.suffix == ".mjb" else mujoco.MjModel.from_xml_path
    try:
        return load(str(path)), path.stem, path.name
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        what = " ".join(str(error).split())
        help_ = "it must load in MuJoCo itself; its meshes and includes are found from its own folder"
        if path.suffix == ".mjb":
            help_ = "only the MuJoCo that saved a compiled model loads it: save it again, or give the MJCF file"
        raise BtrError(f"{path}: MuJoCo does not compile it: {what}\nhelp: {help_}") from error


def described(model: Any, root: str | None = None) -> dict[str, Any]:
    """The robot of a MuJoCo model as the description from which btr writes a model file.

    Raises `BtrError` for what would make the model false: closed loops, flexes, ball joints, several robots."""
    mj, name, made_from = compiled(model)
    names = Names(mj)
    notes: list[str] = []
    tree = tree_of(mj, root, notes)
    links = Links(mj, tree, names)
    mimics = equalities(mj, tree, names, notes)
    motors = actuators(mj, tree, names, mimics, notes)
    joints = {names.joint(j): {**passive(mj, j, motors.get(j)), **motors.facts(j)} for j in tree.joints}
    left_out(mj, tree, names, notes)
    gravity = 0.0 if mj.opt.disableflags & NO_GRAVITY else float(mj.opt.gravity[2])
    return {
        "name": name,
        "made_from": made_from,
        "urdf": links.urdf(name, mimics, motors),
        "base": "floating" if tree.floating else "fixed",
        "height_m": float(mj.body_pos[tree.root][2]) if tree.floating else None,
        "gravity": gravity,
        "step_s": float(mj.opt.timestep),
        "ground_friction": tree.ground_friction(),
        "joints": joints,
        "not_represented": notes + names.renamed,
    }

