//! A motor that turns with a joint and with the joint before it in the chain.

use crate::actuation::NeighbourQuantity;
use crate::effects::coupling::Coupling;
use crate::effects::effect::EffectSpec;
use crate::robot::Side;

static SPEC: EffectSpec = Coupling::described(
    "parent_coupling",
    "-coulomb·sign(dq + ratio·dq_parent) - viscous·dq_parent - inertia·ddq_parent",
    "a torque residual that follows the sum of the joint's velocity and that of the joint before it",
);

pub(in crate::effects) static PARENT_COUPLING: Coupling =
    Coupling::new(&SPEC, Side::Parent, [NeighbourQuantity::ParentVelocity, NeighbourQuantity::ParentAcceleration]);
