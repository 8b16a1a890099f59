"""What acts in a joint without a motor and has no place in URDF."""

from __future__ import annotations

from typing import Any

import numpy as np

NO_SPRINGS, NO_DAMPERS = 1 << 5, 1 << 6
"""Bits of `mjtDisableBit`."""


def passive(mj: Any, joint: int, motor: Any | None) -> dict[str, Any]:
    """The rotor inertia and the spring of a joint. A geared motor's own rotor counts with the square of its gear."""
    dof = mj.jnt_dofadr[joint]
    armature = float(mj.dof_armature[dof]) + (motor.armature if motor else 0.0)
    stiffness = 0.0 if mj.opt.disableflags & NO_SPRINGS else float(np.ravel(mj.jnt_stiffness[joint])[0])
    rest = float(mj.qpos_spring[mj.jnt_qposadr[joint]]) if stiffness else 0.0
    return {"armature": armature, "stiffness": stiffness, "rest": rest}
