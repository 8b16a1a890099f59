//! A motor that turns with a joint and with the joint after it in the chain.

use crate::actuation::NeighbourQuantity;
use crate::effects::coupling::Coupling;
use crate::effects::effect::EffectSpec;
use crate::robot::Side;

static SPEC: EffectSpec = Coupling::described(
    "child_coupling",
    "-coulomb·sign(dq + ratio·dq_child) - viscous·dq_child - inertia·ddq_child",
    "a torque residual that follows the sum of the joint's velocity and that of the joint after it",
);

pub(in crate::effects) static CHILD_COUPLING: Coupling =
    Coupling::new(&SPEC, Side::Child, [NeighbourQuantity::ChildVelocity, NeighbourQuantity::ChildAcceleration]);
