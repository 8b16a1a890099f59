//! What effects read of the joints beside theirs.

use crate::actuation::{NeighbourInputs, NeighbourQuantity};
use crate::effects::PlacedEffect;
use crate::robot::{Neighbours, Robot};
use crate::setup::setup_error;
use btr_core::world::WorldError;

/// The inputs from neighbouring joints; empty if no effect uses them.
pub(super) struct NeighbourTracker {
    /// The joints on which effects use them.
    readers: Vec<(usize, Neighbours)>,
    /// One per joint; NaN where no effect uses them.
    inputs: Vec<NeighbourInputs>,
    /// Whether any effect uses a torque, or an acceleration; only then they are computed.
    torques: bool,
    accelerations: bool,
}

impl NeighbourTracker {
    /// # Errors
    /// An effect at a joint that lacks a neighbour, or whose site matches nothing.
    pub(super) fn new(robot: &Robot, effects: &[PlacedEffect]) -> Result<Self, WorldError> {
        let missing = effects.iter().try_for_each(|placed| placed.check_neighbours(robot));
        missing.map_err(|missing| setup_error(missing.to_string()))?;
        let used: Vec<NeighbourQuantity> =
            effects.iter().flat_map(|placed| placed.effect.neighbours()).copied().collect();
        let neighbours = if used.is_empty() { Vec::new() } else { robot.neighbours() };
        let inputs = vec![[f64::NAN; NeighbourQuantity::ALL.len()]; neighbours.len()];
        let mut reads = vec![false; neighbours.len()];
        for placed in effects.iter().filter(|placed| !placed.effect.neighbours().is_empty()) {
            placed.joints(robot)?.into_iter().for_each(|joint| reads[joint] = true);
        }
        let readers = neighbours.into_iter().enumerate().filter(|(joint, _)| reads[*joint]).collect();
        let torques = used.iter().any(|quantity| quantity.is_torque());
        let accelerations = used.iter().any(|quantity| quantity.is_acceleration());
        Ok(NeighbourTracker { readers, inputs, torques, accelerations })
    }

    /// Updates the inputs to the joints' states, where `torque` is a motor's torque in the last step and `acceleration`
    /// that of a joint with a velocity.
    pub(super) fn update(
        &mut self,
        states: &[(f64, f64)],
        torque: impl Fn(usize, (f64, f64)) -> f64,
        acceleration: impl Fn(usize, f64) -> f64,
    ) {
        const HALF: usize = NeighbourQuantity::ALL.len() / 2;
        for (joint, neighbours) in &self.readers {
            let of = |joint: Option<usize>| {
                let (joint, (q, dq)) = joint.and_then(|joint| Some((joint, *states.get(joint)?)))?;
                let ddq = if self.accelerations { acceleration(joint, dq) } else { f64::NAN };
                Some([q, dq, ddq, if self.torques { torque(joint, (q, dq)) } else { f64::NAN }])
            };
            let inputs = &mut self.inputs[*joint];
            inputs[..HALF].copy_from_slice(&of(neighbours.parent).unwrap_or([f64::NAN; HALF]));
            inputs[HALF..].copy_from_slice(&of(neighbours.child).unwrap_or([f64::NAN; HALF]));
        }
    }

    /// The joints beside those on which effects use them.
    pub(super) fn read(&self) -> impl Iterator<Item = usize> {
        self.readers.iter().flat_map(|(_, neighbours)| [neighbours.parent, neighbours.child]).flatten()
    }

    /// The inputs of a joint.
    pub(super) fn of(&self, joint: usize) -> Option<&NeighbourInputs> {
        self.inputs.get(joint)
    }
}
