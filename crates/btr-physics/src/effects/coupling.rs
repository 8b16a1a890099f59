//! A motor that turns with two joints, as in the wrists of many industrial arms: the motor of the last joint is carried
//! through the one before, and turns with both. Its friction and its rotor act on both joints.

use super::effect::{Effect, EffectSpec, Param, SiteKind, TorqueLaw};
use crate::actuation::{JointInput, NeighbourQuantity};
use crate::engine::{Dof, mean_sign};
use crate::robot::{Actuator, Robot, Side};

/// Speed in rad/s at which dry friction is about three quarters of its own: a step at the reversal of a sum of two
/// speeds would make a light joint chatter.
const SMOOTH: f64 = 0.005;

/// Parameters of the motor's law.
const PARAMS: &[Param] = &[
    Param::new("coulomb", "N·m", (0.0, 5.0), 0.1),
    Param::new("viscous", "N·m·s/rad", (-5.0, 5.0), 0.05),
    Param::new("inertia", "kg·m^2", (-1.0, 1.0), 0.01),
    Param::shape("ratio", "1", (-3.0, 3.0), 1.0),
];

/// The coupling with the neighbour on one side.
pub(super) struct Coupling {
    spec: &'static EffectSpec,
    side: Side,
    neighbour: [NeighbourQuantity; 2],
}

impl Coupling {
    /// What is said of it, beside its name, its law and how it appears.
    pub(super) const fn described(name: &'static str, law: &'static str, symptom: &'static str) -> EffectSpec {
        EffectSpec {
            name,
            law,
            site: SiteKind::Joint,
            cite: "Guedelha, Traversaro and Pucci, Identification of Motor Parameters on Coupled Joints, \
                   arXiv:1906.05070",
            symptom,
            params: PARAMS,
            // How many turns of the joint the motor turns for one of the neighbour, in either direction.
            starts: &[&[1.0], &[-1.0]],
            similar: &["viscous_friction", "coulomb_friction", "asymmetric_friction"],
            nested: &[],
        }
    }

    /// With the neighbour on a side, whose velocity and acceleration are these.
    pub(super) const fn new(spec: &'static EffectSpec, side: Side, neighbour: [NeighbourQuantity; 2]) -> Self {
        Coupling { spec, side, neighbour }
    }
}

impl Effect for Coupling {
    fn spec(&self) -> &'static EffectSpec {
        self.spec
    }

    fn torque_law(&self) -> TorqueLaw {
        TorqueLaw::Proportional
    }

    fn is_for_prescribed_motion(&self) -> bool {
        true
    }

    /// Where a motion is simulated, the two joints would have to be solved for together: it is for prescribed motions.
    fn acts_on(&self, robot: &Robot, link: usize) -> bool {
        let prescribed = robot.links.get(link).is_some_and(|link| link.joint.actuator == Actuator::Prescribed);
        prescribed && robot.has_neighbour(link, self.side)
    }

    fn neighbours(&self) -> &[NeighbourQuantity] {
        &self.neighbour
    }

    /// What viscous friction and rotor do by the joint's own motion is part of what the joint has.
    fn torque(&self, p: &[f64], _memory: &mut [f64], dof: &mut Dof, state: &JointInput) {
        let (&[coulomb, viscous, inertia, ratio], Some(inputs)) = (p, state.neighbours) else { return };
        let [velocity, acceleration] = self.neighbour.map(|quantity| inputs[quantity as usize]);
        let (whole, accelerates) = (state.dq + ratio * velocity, state.acceleration + ratio * acceleration);
        let means = state.mean_s > 0.0;
        let sign = if means { mean_sign(whole, accelerates, state.mean_s) } else { (whole / SMOOTH).tanh() };
        dof.torque.constant -= coulomb * sign + viscous * velocity + inertia * acceleration;
    }
}
