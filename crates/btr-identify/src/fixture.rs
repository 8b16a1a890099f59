//! Residual models for tests: logs of one channel, whose residual is a function of the parameters' values.

use crate::residual_model::{
    CandidateKind, EffectCandidate, FitParameter, MeasuredChannel, ModelDescription, Needs, Parametrisation,
    RecordedLog, ResidualModel, ResidualRequest, TimeStep,
};
use btr_core::world::WorldError;

pub(crate) struct SyntheticModel {
    pub(crate) parameters: Vec<FitParameter>,
    logs: Vec<RecordedLog>,
    candidates: Vec<EffectCandidate>,
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
        known: None,
        reach: 0.05,
        amplitude: false,
    }
}

impl SyntheticModel {
    /// A model whose parameters are all free, unless they are of a candidate; `residual` has `rows` rows.
    pub(crate) fn new(parameters: Vec<FitParameter>, rows: usize, residual: fn(&[f64]) -> Vec<f64>) -> Self {
        SyntheticModel { parameters, logs: vec![log(rows)], candidates: Vec::new(), residual }
    }

    /// The same with a second log, whose rows come after those of the first.
    pub(crate) fn and_log(mut self, rows: usize) -> Self {
        self.logs.push(log(rows));
        self
    }

    /// The same with an effect that may be missing, of one amplitude.
    pub(crate) fn with_candidate(mut self, amplitude: usize) -> Self {
        self.parameters[amplitude].amplitude = true;
        self.candidates.push(EffectCandidate {
            ripple: None,
            kind: CandidateKind::Effect,
            effect: "effect".to_owned(),
            site: "here".to_owned(),
            amplitudes: vec![amplitude],
            shapes: Vec::new(),
            starts: vec![Vec::new()],
            similar: Vec::new(),
            nested: Vec::new(),
            needs: Needs::Nothing,
            is_usual: false,
        });
        self
    }

    /// The same with the last log held out.
    pub(crate) fn with_last_held_out(mut self) -> Self {
        self.logs.iter_mut().last().into_iter().for_each(|log| log.held_out = true);
        self
    }
}

fn log(rows: usize) -> RecordedLog {
    let channel = MeasuredChannel {
        name: "q".to_owned(),
        unit: "rad".to_owned(),
        sigma: 1.0,
        sensor: 1.0,
        beside: [].into(),
        offset_differs: false,
        samples: 0..rows,
        present: rows,
    };
    RecordedLog { name: "log".to_owned(), held_out: false, channels: vec![channel], present: rows }
}

impl ResidualModel for SyntheticModel {
    fn description(&self) -> ModelDescription {
        let is_free = |k: &usize| self.candidates.iter().all(|candidate| !candidate.amplitudes.contains(k));
        ModelDescription {
            free: (0..self.parameters.len()).filter(is_free).collect(),
            candidates: self.candidates.clone(),
            ..ModelDescription::new(self.parameters.clone(), self.logs.clone())
        }
    }

    fn residuals(&self, requests: &[ResidualRequest], _: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
        let residual = |request: &ResidualRequest| {
            let values: Vec<f64> = self.parameters.iter().zip(request.u).map(|(p, u)| p.value(*u)).collect();
            let all = (self.residual)(&values);
            let before = self.logs[..request.log].iter().map(RecordedLog::rows).sum::<usize>();
            Ok(all[before..before + self.logs[request.log].rows()].to_vec())
        };
        requests.iter().map(residual).collect()
    }
}
