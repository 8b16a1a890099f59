//! Families that tests make up: one log of one channel, whose residual follows from the knobs' values.

use crate::residual_model::{Candidate, Family, Knob, Law, Measured, Recorded, Rollout, Step};
use btr_core::world::WorldError;

pub(crate) struct Made {
    pub(crate) knobs: Vec<Knob>,
    doubtful: Vec<usize>,
    logs: Vec<Recorded>,
    residual: fn(&[f64]) -> Vec<f64>,
}

/// A knob between -10 and 10, expected to be within 1.
pub(crate) fn knob(law: Law, origin: f64, size: f64) -> Knob {
    Knob {
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
    pub(crate) fn new(knobs: Vec<Knob>, rows: usize, residual: fn(&[f64]) -> Vec<f64>) -> Self {
        let channel = Measured { name: "q".to_owned(), unit: "rad".to_owned(), sigma: 1.0, samples: 0..rows };
        let log = Recorded { name: "log".to_owned(), held_out: false, channels: vec![channel], present: rows };
        Made { doubtful: (0..knobs.len()).collect(), knobs, logs: vec![log], residual }
    }
}

impl Family for Made {
    fn knobs(&self) -> &[Knob] {
        &self.knobs
    }

    fn doubtful(&self) -> &[usize] {
        &self.doubtful
    }

    fn candidates(&self) -> &[Candidate] {
        &[]
    }

    fn logs(&self) -> &[Recorded] {
        &self.logs
    }

    fn residual(&self, Rollout { u, .. }: Rollout, _: Step) -> Result<Vec<f64>, WorldError> {
        let values: Vec<f64> = self.knobs.iter().zip(u).map(|(knob, u)| knob.value(*u)).collect();
        Ok((self.residual)(&values))
    }
}
