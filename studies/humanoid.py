"""A generated humanoid of capsules: a trunk that floats, with a spine, two arms and two legs of six joints each."""

from pathlib import Path

ROOTS = {
    "spine": ("0 0 0.25", 1.0),
    "left_arm": ("0 0.18 0.2", -1.0),
    "right_arm": ("0 -0.18 0.2", -1.0),
    "left_leg": ("0 0.1 -0.25", -1.0),
    "right_leg": ("0 -0.1 -0.25", -1.0),
}
"""Where each limb begins on the trunk, and whether it goes up or down."""
AXES = ("0 0 1", "1 0 0", "0 1 0", "0 1 0", "0 1 0", "1 0 0")
LENGTH_M = 0.12
MODEL = """name = "humanoid"
[robot]
urdf = "humanoid.urdf"
base = "floating"
height_m = 1.01
[actuators."*"]
kind = "position"
kp = 60.0
kd = 2.0
[simulation]
control_s = 0.01
steps_per_control = 10
sample_every = 10
duration_s = 8.0
[noise]
position_rad = 0.0005
[parameters]
"mass@trunk" = { relative = [0.7, 1.5] }
"kp@left_leg_2" = { relative = [0.7, 1.5] }
[drive]
kind = "sine"
omega_rad_s = 3.0
[drive.set]
"""


def write_humanoid(folder: Path) -> Path:
    """Writes its URDF and its model; the path of the model."""
    parts = [_link("trunk", 8.0, 0.12, 0.4, 0.0), *(part for limb in ROOTS for part in _limb(limb))]
    (folder / "humanoid.urdf").write_text(f'<robot name="humanoid">{"".join(parts)}</robot>')
    swings = [f'"amplitude@{limb}_{k}" = 0.1\n"phase@{limb}_{k}" = {k}.0\n' for limb in ROOTS for k in range(len(AXES))]
    (folder / "humanoid.toml").write_text(MODEL + "".join(swings))
    return folder / "humanoid.toml"


def _limb(limb: str) -> list[str]:
    """Its joints and links, from the trunk on."""
    (place, side), parent, parts = ROOTS[limb], "trunk", []
    for k, axis in enumerate(AXES):
        name = f"{limb}_{k}"
        ends = f'<parent link="{parent}"/><child link="{name}_link"/><origin xyz="{place}"/><axis xyz="{axis}"/>'
        limit = '<limit lower="-2" upper="2" effort="200" velocity="20"/>'
        parts += [f'<joint name="{name}" type="revolute">{ends}{limit}</joint>']
        parts += [_link(f"{name}_link", 1.0, 0.04, 0.5 * LENGTH_M, 0.5 * side * LENGTH_M)]
        parent, place = f"{name}_link", f"0 0 {side * LENGTH_M}"
    return parts


def _link(name: str, mass_kg: float, radius_m: float, length_m: float, centre_m: float) -> str:
    """A capsule along z, with the inertia of a cylinder."""
    across = mass_kg * (3 * radius_m**2 + length_m**2) / 12
    inertia = f'ixx="{across}" iyy="{across}" izz="{mass_kg * radius_m**2 / 2}" ixy="0" ixz="0" iyz="0"'
    at = f'<origin xyz="0 0 {centre_m}"/>'
    shape = f'{at}<geometry><capsule radius="{radius_m}" length="{length_m}"/></geometry>'
    inertial = f'<inertial>{at}<mass value="{mass_kg}"/><inertia {inertia}/></inertial>'
    return f'<link name="{name}">{inertial}<visual>{shape}</visual><collision>{shape}</collision></link>'
