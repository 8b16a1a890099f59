//! A motor that turns with a joint and with the joint before it in the chain.

use crate::actuation::{JointInput, NeighbourQuantity};
use crate::effects::coupling;
use crate::effects::effect::{Effect, EffectSpec, SiteKind, TorqueLaw};
use crate::engine::Dof;
use crate::robot::{Robot, Side};

pub(in crate::effects) struct ParentCoupling;

static SPEC: EffectSpec = EffectSpec {
    name: "parent_coupling",
    law: "-coulomb·sign(dq + ratio·dq_parent) - viscous·dq_parent - inertia·ddq_parent",
    site: SiteKind::Joint,
    cite: coupling::CITE,
    symptom: "a torque residual that follows the sum of the joint's velocity and that of the joint before it",
    params: coupling::PARAMS,
    starts: coupling::STARTS,
    similar: &["viscous_friction", "coulomb_friction", "asymmetric_friction"],
    nested: &[],
};

const NEIGHBOUR: [NeighbourQuantity; 2] = [NeighbourQuantity::ParentVelocity, NeighbourQuantity::ParentAcceleration];

impl Effect for ParentCoupling {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn torque_law(&self) -> TorqueLaw {
        TorqueLaw::Proportional
    }

    fn is_for_prescribed_motion(&self) -> bool {
        true
    }

    fn acts_on(&self, robot: &Robot, link: usize) -> bool {
        coupling::acts_on(robot, link, Side::Parent)
    }

    fn neighbours(&self) -> &[NeighbourQuantity] {
        &NEIGHBOUR
    }

    fn torque(&self, p: &[f64], _memory: &mut [f64], dof: &mut Dof, state: &JointInput) {
        coupling::act(p, dof, state, NEIGHBOUR);
    }
}
