//! System identification on top of [`btr_core`]: what a log is worth ([`quality`]), where a model fails beside it
//! ([`compare`]), the parameter values that fit ([`fit`]), and which physical effect is missing ([`diagnose`]).
//!
//! The crate knows a simulator only as a [`ResidualModel`](residual_model::ResidualModel): free parameters in, residuals in
//! multiples of the noise floor out. It does no I/O.

pub mod compare;
pub mod diagnose;
pub mod fit;
#[cfg(test)]
mod fixture;
mod ladder;
pub mod quality;
pub mod residual_model;

pub use ladder::LadderStep;
