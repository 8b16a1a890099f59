//! What effects read of the joints beside theirs.

use crate::actuation::{NeighbourInputs, NeighbourQuantity};
use crate::effects::PlacedEffect;
use crate::robot::{Neighbours, Robot};
use crate::setup::setup_error;
use btr_core::world::WorldError;

/// The inputs from neighbouring joints; empty if no effect uses them.
pub(super) struct NeighbourTracker {
    neighbours: Vec<Neighbours>,
    inputs: Vec<NeighbourInputs>,
    /// Whether any effect uses a torque; only then they are computed.
    torques: bool,
}

impl NeighbourTracker {
    /// # Errors
    /// An effect at a joint that lacks a neighbour.
    pub(super) fn new(robot: &Robot, effects: &[PlacedEffect]) -> Result<Self, WorldError> {
        let missing = effects.iter().try_for_each(|placed| placed.check_neighbours(robot));
        missing.map_err(|missing| setup_error(missing.to_string()))?;
        let mut used = effects.iter().flat_map(|placed| placed.effect.neighbours()).peekable();
        let neighbours = if used.peek().is_some() { robot.neighbours() } else { Vec::new() };
        let inputs = vec![[f64::NAN; NeighbourQuantity::ALL.len()]; neighbours.len()];
        Ok(NeighbourTracker { neighbours, inputs, torques: used.any(|quantity| quantity.is_torque()) })
    }

    /// Updates the inputs to the joints' states, where `torque` is a motor's torque in the last step.
    pub(super) fn update(&mut self, states: &[(f64, f64)], torque: impl Fn(usize, (f64, f64)) -> f64) {
        for (inputs, neighbours) in self.inputs.iter_mut().zip(&self.neighbours) {
            let of = |joint: Option<usize>| {
                let (joint, (q, dq)) = joint.and_then(|joint| Some((joint, *states.get(joint)?)))?;
                Some([q, dq, if self.torques { torque(joint, (q, dq)) } else { f64::NAN }])
            };
            let sides = [neighbours.parent, neighbours.child].map(|joint| of(joint).unwrap_or([f64::NAN; 3]));
            let [[q_parent, dq_parent, tau_parent], [q_child, dq_child, tau_child]] = sides;
            *inputs = [q_parent, dq_parent, tau_parent, q_child, dq_child, tau_child];
        }
    }

    /// The inputs of a joint.
    pub(super) fn of(&self, joint: usize) -> Option<&NeighbourInputs> {
        self.inputs.get(joint)
    }
}
