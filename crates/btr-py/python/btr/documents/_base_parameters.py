"""Base parameters: what logs tell about all dynamic parameters of an arm of motion and torque."""

from __future__ import annotations

from typing import Literal

from btr.documents._record import Record


class CombinationPart(Record):
    """A parameter in a combination."""

    parameter: str
    """Its name, for instance `mass*com_x@upper`, `inertia_yy@upper`, `viscous@elbow` or `rotor@elbow`."""
    coefficient: float
    """What one unit of it adds."""


class Combination(Record):
    """A combination of parameters that the logs tell."""

    name: str
    """As a sum: `mass*com_x@upper + 0.3*mass@forearm`."""
    unit: str
    """SI unit of the leading parameter."""
    parts: list[CombinationPart]
    """Its parameters, the leading one first."""
    model: float
    """The model's value, in `unit`."""
    value: float
    """The estimate, in `unit`."""
    sd: float | None
    """Standard deviation of the estimate, in `unit`; None while the residual has structure."""
    sd_percent: float | None
    """The same in percent of the estimate's size; None without it, and for an estimate of 0."""


class RelativeError(Record):
    """What is left of a torque with the estimates."""

    channel: str
    """Name of the channel."""
    train_percent: float | None
    """Root mean square error in percent of that of the readings, on the training logs."""
    held_out_percent: float | None
    """The same on the held-out logs; None without any."""


class PossibleBody(Record):
    """A body of the possible set, and the joint that moves it."""

    link: str
    """The link in whose frame its values are; links that are fixed to it are part of it."""
    mass_kg: float
    """Mass, in kg."""
    com_m: tuple[float, float, float]
    """Centre of mass in the link's frame, in m."""
    inertia_kg_m2: tuple[float, float, float, float, float, float]
    """Inertia about the centre of mass in the link's axes: xx, yy, zz, xy, xz, yz, in kg·m²."""
    joint: str
    """Name of the joint."""
    viscous: float
    """Viscous friction, in N·m·s/rad (N·s/m of a slide)."""
    coulomb: float
    """Coulomb friction, in N·m (N)."""
    offset: float
    """Constant torque that the motor has to deliver, in N·m (N)."""
    rotor: float
    """Rotor inertia seen at the joint, in kg·m² (kg)."""


class PossibleBodies(Record):
    """Values of all parameters that rigid bodies can have: the nearest to the model's among those that give the
    estimated combinations best."""

    membership: Literal["as_estimated", "within_uncertainty", "contradicted"]
    """Whether they give the estimates: exactly, so that the logs do not tell the difference, or not."""
    distance: float
    """Root mean square of the combinations' deviations from the estimates, in standard deviations."""
    train: float
    """Error with them on the training logs, in multiples of the noise floor."""
    held_out: float | None
    """The same on the held-out logs; None without any."""
    links: list[PossibleBody]
    """The moving bodies, from the base on."""


class BaseParameters(Record):
    """What the logs tell about all dynamic parameters of an arm."""

    combinations: list[Combination]
    """The combinations that the logs tell."""
    not_identifiable: list[str]
    """Names of parameters without any effect in the training logs."""
    train: float
    """Error with the estimates on the training logs, in multiples of the noise floor."""
    held_out: float | None
    """The same on the held-out logs; None without any."""
    withheld: str | None
    """Why there are no standard deviations; None if there are."""
    remaining: list[RelativeError]
    """What is left of each torque."""
    possible: PossibleBodies | None
    """Values that rigid bodies can have; None where the model's own are far from possible."""
