//! Families that tests make up: one log of one channel, whose residual follows from the knobs' values.

use crate::residual_model::{
    EffectCandidate, FitParameter, MeasuredChannel, Parametrisation, RecordedLog, ResidualModel, ResidualRequest,
    TimeStep,
};
use btr_core::world::WorldError;

pub(crate) struct Made {
    pub(crate) parameters: Vec<FitParameter>,
    free: Vec<usize>,
    logs: Vec<RecordedLog>,
    residual: fn(&[f64]) -> Vec<f64>,
}

/// A knob between -10 and 10, expected to be within 1.
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

impl Made {
    /// All knobs are in doubt; `residual` is of so many rows.
    pub(crate) fn new(parameters: Vec<FitParameter>, rows: usize, residual: fn(&[f64]) -> Vec<f64>) -> Self {
        let channel = MeasuredChannel { name: "q".to_owned(), unit: "rad".to_owned(), sigma: 1.0, samples: 0..rows };
        let log = RecordedLog { name: "log".to_owned(), held_out: false, channels: vec![channel], present: rows };
        Made { free: (0..parameters.len()).collect(), parameters, logs: vec![log], residual }
    }
}

impl ResidualModel for Made {
    fn parameters(&self) -> &[FitParameter] {
        &self.parameters
    }

    fn free(&self) -> &[usize] {
        &self.free
    }

    fn candidates(&self) -> &[EffectCandidate] {
        &[]
    }

    fn logs(&self) -> &[RecordedLog] {
        &self.logs
    }

    fn residual(&self, ResidualRequest { u, .. }: ResidualRequest, _: TimeStep) -> Result<Vec<f64>, WorldError> {
        let values: Vec<f64> = self.parameters.iter().zip(u).map(|(parameter, u)| parameter.value(*u)).collect();
        Ok((self.residual)(&values))
    }
}
