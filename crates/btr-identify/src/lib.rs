//! System identification on top of [`btr_core`]: the quality of a log ([`quality`]), where a model differs from it
//! ([`compare`]), the parameter values that fit ([`fit`]), the combinations of them that logs can tell
//! ([`base_parameters`]), and which physical effect is missing ([`diagnose`]).
//!
//! The crate knows a simulator only as a [`ResidualModel`](residual_model::ResidualModel): free parameters in,
//! residuals in multiples of the noise floor out. It does no I/O.
//!
//! # Quick start
//!
//! Fit the gain of a linear model. The measured gain is 2, the model's current value is 1.5:
//!
//! ```
//! use btr_core::world::WorldError;
//! use btr_identify::fit::{Objective, fitted};
//! use btr_identify::residual_model::{
//!     FitParameter, MeasuredChannel, ModelDescription, Parametrisation, RecordedLog, ResidualModel, ResidualRequest,
//!     TimeStep,
//! };
//!
//! struct Linear(ModelDescription);
//!
//! impl ResidualModel for Linear {
//!     fn description(&self) -> ModelDescription {
//!         self.0.clone()
//!     }
//!
//!     fn residuals(&self, requests: &[ResidualRequest], _: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
//!         let residual = |request: &ResidualRequest| {
//!             let gain = self.0.parameters[0].value(request.u[0]);
//!             Ok((0..100).map(|k| 0.01 * f64::from(k)).map(|t| (2.0 * t - gain * t) / 0.001).collect())
//!         };
//!         requests.iter().map(residual).collect()
//!     }
//! }
//!
//! let gain = FitParameter {
//!     name: "gain".to_owned(),
//!     unit: "1".to_owned(),
//!     origin: 1.5,
//!     size: 0.5,
//!     law: Parametrisation::Linear,
//!     bounds: (-10.0, 10.0),
//!     spread: 1.0,
//!     known: None,
//!     reach: 0.05,
//!     amplitude: false,
//! };
//! let (name, unit) = ("q".to_owned(), "rad".to_owned());
//! let (sigma, sensor, present) = (0.001, 0.001, 100);
//! let (beside, samples) = ([].into(), 0..present);
//! let channel = MeasuredChannel { name, unit, sigma, sensor, beside, offset_differs: false, samples, present };
//! let log = RecordedLog { name: "ramp".to_owned(), held_out: false, channels: vec![channel], present };
//! let model = Linear(ModelDescription::new(vec![gain], vec![log]));
//!
//! let fit = fitted(&mut Objective::new(&model), &|_| ())?;
//! assert!((fit.parameters[0].value - 2.0).abs() < 1e-3);
//! # Ok::<(), WorldError>(())
//! ```

pub mod base_parameters;
pub mod compare;
pub mod diagnose;
pub mod fit;
#[cfg(test)]
mod fixture;
mod ladder;
pub mod quality;
pub mod residual_model;

pub use ladder::LadderStep;
