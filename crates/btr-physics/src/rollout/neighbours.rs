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
    /// Whether any effect uses a torque, or an acceleration; only then they are computed.
    torques: bool,
    accelerations: bool,
}

impl NeighbourTracker {
    /// # Errors
    /// An effect at a joint that lacks a neighbour.
    pub(super) fn new(robot: &Robot, effects: &[PlacedEffect]) -> Result<Self, WorldError> {
        let missing = effects.iter().try_for_each(|placed| placed.check_neighbours(robot));
        missing.map_err(|missing| setup_error(missing.to_string()))?;
        let used: Vec<NeighbourQuantity> =
            effects.iter().flat_map(|placed| placed.effect.neighbours()).copied().collect();
        let neighbours = if used.is_empty() { Vec::new() } else { robot.neighbours() };
        let inputs = vec![[f64::NAN; NeighbourQuantity::ALL.len()]; neighbours.len()];
        let torques = used.iter().any(|quantity| quantity.is_torque());
        let accelerations = used.iter().any(|quantity| quantity.is_acceleration());
        Ok(NeighbourTracker { neighbours, inputs, torques, accelerations })
    }

    /// Updates the inputs to the joints' states, where `torque` is a motor's torque in the last step and `acceleration`
    /// that of a joint with a velocity.
    pub(super) fn update(
        &mut self,
        states: &[(f64, f64)],
        torque: impl Fn(usize, (f64, f64)) -> f64,
        acceleration: impl Fn(usize, f64) -> f64,
    ) {
        for (inputs, neighbours) in self.inputs.iter_mut().zip(&self.neighbours) {
            let of = |joint: Option<usize>| {
                let (joint, (q, dq)) = joint.and_then(|joint| Some((joint, *states.get(joint)?)))?;
                let ddq = if self.accelerations { acceleration(joint, dq) } else { f64::NAN };
                Some([q, dq, ddq, if self.torques { torque(joint, (q, dq)) } else { f64::NAN }])
            };
            let unknown = [f64::NAN; NeighbourQuantity::ALL.len() / 2];
            let [parent, child] = [neighbours.parent, neighbours.child].map(|joint| of(joint).unwrap_or(unknown));
            for (input, value) in inputs.iter_mut().zip(parent.into_iter().chain(child)) {
                *input = value;
            }
        }
    }

    /// The inputs of a joint.
    pub(super) fn of(&self, joint: usize) -> Option<&NeighbourInputs> {
        self.inputs.get(joint)
    }
}
