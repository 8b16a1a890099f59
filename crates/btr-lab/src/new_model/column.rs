//! A column of a log, and its unit.

use super::words::Kind;
use btr_physics::robot::JointKind;

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// A column and what it is.
pub(super) struct Column {
    /// The log's name.
    pub(super) name: String,
    /// Index of the joint, in the order of [`Robot::movable`].
    pub(super) joint: usize,
    pub(super) kind: Kind,
    /// Its unit.
    pub(super) unit: Unit,
}

/// The unit of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Unit {
    /// btr's own, or the one that its name says.
    Native,
    /// Degrees, or degrees per second.
    Degrees,
    /// Millimetres, or millimetres per second.
    Millimetres,
}

impl Unit {
    /// Times this, its values are in btr's unit.
    pub(super) fn factor(self) -> f64 {
        match self {
            Unit::Native => 1.0,
            Unit::Degrees => DEGREE,
            Unit::Millimetres => 1e-3,
        }
    }

    /// The other unit that a position of this joint may have.
    pub(super) fn foreign(kind: JointKind) -> Unit {
        if kind == JointKind::Prismatic { Unit::Millimetres } else { Unit::Degrees }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Unit::Native => "rad",
            Unit::Degrees => "degrees",
            Unit::Millimetres => "millimetres",
        }
    }
}
