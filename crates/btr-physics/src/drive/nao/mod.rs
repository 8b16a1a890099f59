//! The Nao's motions, planned with the zero-moment point.

pub(super) mod cart_table;
pub(super) mod kick;
pub mod leg;
pub(super) mod posture;
pub(super) mod reference;
pub(super) mod walk;
pub(super) mod zmp_motion;
