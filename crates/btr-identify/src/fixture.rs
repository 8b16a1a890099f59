//! Residual models for tests: one log of one channel, whose residual is a function of the parameters' values.

use crate::residual_model::{
    FitParameter, MeasuredChannel, ModelDescription, Parametrisation, RecordedLog, ResidualModel, ResidualRequest,
    TimeStep,
};
use btr_core::world::WorldError;

pub(crate) struct SyntheticModel {
    pub(crate) parameters: Vec<FitParameter>,
    logs: Vec<RecordedLog>,
    residual: fn(&[f64]) -> Vec<f64>,
}

/// A parameter between -10 and 10, expected to be within 1.
pub(crate) fn parameter(law: Parametrisation, origin: f64, size: f64) -> FitParameter {
    FitParameter {
        name: String::new(),
        unit: String::new(),
        origin,
        size,
        law,
        bounds: (-10.0, 10.0),
        spread: 1.0,
        reach: 0.05,
        amplitude: false,
    }
}

impl SyntheticModel {
    /// A model whose parameters are all free; `residual` has `rows` rows.
    pub(crate) fn new(parameters: Vec<FitParameter>, rows: usize, residual: fn(&[f64]) -> Vec<f64>) -> Self {
        let channel = MeasuredChannel { name: "q".to_owned(), unit: "rad".to_owned(), sigma: 1.0, samples: 0..rows };
        let log = RecordedLog { name: "log".to_owned(), held_out: false, channels: vec![channel], present: rows };
        SyntheticModel { parameters, logs: vec![log], residual }
    }
}

impl ResidualModel for SyntheticModel {
    fn description(&self) -> ModelDescription {
        ModelDescription::new(self.parameters.clone(), self.logs.clone())
    }

    fn residuals(&self, requests: &[ResidualRequest], _: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
        let residual = |request: &ResidualRequest| {
            let values: Vec<f64> = self.parameters.iter().zip(request.u).map(|(p, u)| p.value(*u)).collect();
            Ok((self.residual)(&values))
        };
        requests.iter().map(residual).collect()
    }
}
