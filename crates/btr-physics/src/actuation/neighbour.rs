//! Quantities of a joint's neighbours, as inputs of effects.

use crate::robot::Side;

/// A quantity of the neighbouring joint on one side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeighbourQuantity {
    /// Position of the parent in rad (m).
    ParentPosition,
    /// Velocity of the parent in rad/s (m/s).
    ParentVelocity,
    /// Acceleration of the parent over the last step, or that of a prescribed motion, in rad/s² (m/s²).
    ParentAcceleration,
    /// Torque of the parent's motor in the last step, in N·m (N).
    ParentTorque,
    /// Position of the child.
    ChildPosition,
    /// Velocity of the child.
    ChildVelocity,
    /// Acceleration of the child.
    ChildAcceleration,
    /// Torque of the child's motor.
    ChildTorque,
}

/// Values of all quantities, in the order of [`NeighbourQuantity::ALL`].
pub type NeighbourInputs = [f64; NeighbourQuantity::ALL.len()];

impl NeighbourQuantity {
    /// All of them.
    pub const ALL: [NeighbourQuantity; 8] = [
        NeighbourQuantity::ParentPosition,
        NeighbourQuantity::ParentVelocity,
        NeighbourQuantity::ParentAcceleration,
        NeighbourQuantity::ParentTorque,
        NeighbourQuantity::ChildPosition,
        NeighbourQuantity::ChildVelocity,
        NeighbourQuantity::ChildAcceleration,
        NeighbourQuantity::ChildTorque,
    ];

    /// Name in formulas.
    pub fn name(self) -> &'static str {
        match self {
            NeighbourQuantity::ParentPosition => "q_parent",
            NeighbourQuantity::ParentVelocity => "dq_parent",
            NeighbourQuantity::ParentAcceleration => "ddq_parent",
            NeighbourQuantity::ParentTorque => "tau_parent",
            NeighbourQuantity::ChildPosition => "q_child",
            NeighbourQuantity::ChildVelocity => "dq_child",
            NeighbourQuantity::ChildAcceleration => "ddq_child",
            NeighbourQuantity::ChildTorque => "tau_child",
        }
    }

    /// The neighbour's side.
    pub fn side(self) -> Side {
        match self {
            NeighbourQuantity::ParentPosition
            | NeighbourQuantity::ParentVelocity
            | NeighbourQuantity::ParentAcceleration
            | NeighbourQuantity::ParentTorque => Side::Parent,
            NeighbourQuantity::ChildPosition
            | NeighbourQuantity::ChildVelocity
            | NeighbourQuantity::ChildAcceleration
            | NeighbourQuantity::ChildTorque => Side::Child,
        }
    }

    /// Whether it is an acceleration.
    pub(crate) fn is_acceleration(self) -> bool {
        matches!(self, NeighbourQuantity::ParentAcceleration | NeighbourQuantity::ChildAcceleration)
    }

    /// Whether it is a motor's torque.
    pub fn is_torque(self) -> bool {
        matches!(self, NeighbourQuantity::ParentTorque | NeighbourQuantity::ChildTorque)
    }
}
