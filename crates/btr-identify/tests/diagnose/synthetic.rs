//! Synthetic models, whose motion is a sum of sines.

use btr_core::random::stream;
use btr_core::world::WorldError;
use btr_identify::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use btr_identify::fit::Objective;
use btr_identify::residual_model::{
    CandidateKind, Derivation, EffectCandidate, FitParameter, MeasuredChannel, ModelDescription, Needs,
    Parametrisation, RecordedLog, ResidualModel, ResidualRequest, TimeStep,
};
use rand::RngExt;
use std::sync::Arc;

pub(crate) const SAMPLES: usize = 400;
pub(crate) const PERIOD_S: f64 = 0.01;
/// Least error of a glitch.
pub(crate) const GLITCH: f64 = 90.0;

pub(crate) type Motion = dyn Fn(&[f64], usize, f64, f64) -> f64 + Send + Sync;

/// Two training logs and a held-out one, of one channel with a noise of 1.
#[derive(Clone)]
pub(crate) struct SyntheticModel {
    pub(crate) parameters: Vec<FitParameter>,
    pub(crate) candidates: Vec<EffectCandidate>,
    pub(crate) logs: Vec<RecordedLog>,
    pub(crate) measured: Vec<Vec<f64>>,
    pub(crate) contact: bool,
    /// Number of samples of a log's beginning, where that can be predicted and the rest cannot.
    pub(crate) beginning: Option<usize>,
    /// Sizes that the error shows, of each parameter, each with what it may explain.
    pub(crate) sizes: Vec<Vec<(f64, f64)>>,
    /// The motion from starts that are read from the model, where the usual ones are wrong.
    pub(crate) from_starts: Option<Arc<Motion>>,
    /// The noiseless measurement as a function of coordinates, log, time in s, and divisor of the time step.
    pub(crate) motion: Arc<Motion>,
}

/// Divisor of the time step for which the integrator's error vanishes.
pub(crate) const NO_STEP: f64 = 1e9;

impl SyntheticModel {
    /// A model with a free gain and effects of one amplitude each, whose true coordinates are `truth`.
    pub(crate) fn new(
        effects: &[&str],
        truth: &[f64],
        motion: impl Fn(&[f64], usize, f64, f64) -> f64 + Send + Sync + 'static,
    ) -> Self {
        Self::with_logs_of(SAMPLES, effects, truth, motion)
    }

    /// The same with logs of that many samples.
    pub(crate) fn with_logs_of(
        samples: usize,
        effects: &[&str],
        truth: &[f64],
        motion: impl Fn(&[f64], usize, f64, f64) -> f64 + Send + Sync + 'static,
    ) -> Self {
        let names = ["gain"].iter().chain(effects).enumerate();
        let parameters: Vec<FitParameter> = names.map(|(i, name)| parameter(name, i > 0)).collect();
        let candidate = |(i, name): (usize, &&str)| EffectCandidate {
            ripple: None,
            kind: CandidateKind::Effect,
            effect: (*name).to_owned(),
            site: "here".to_owned(),
            amplitudes: vec![i + 1],
            shapes: Vec::new(),
            starts: vec![Vec::new()],
            similar: Vec::new(),
            nested: Vec::new(),
            needs: Needs::Nothing,
            is_usual: false,
        };
        let log = |i: usize| RecordedLog {
            name: format!("log {i}"),
            held_out: i == 2,
            channels: vec![MeasuredChannel {
                name: "q".to_owned(),
                unit: "rad".to_owned(),
                sigma: 1.0,
                sensor: 1.0,
                beside: [].into(),
                offset_differs: false,
                samples: 0..samples,
                present: samples,
            }],
            present: samples,
        };
        // The sum of twelve uniform numbers has a variance of one.
        let noise = |log: usize, i: usize| {
            let mut rng = stream(7, &[log as u64, i as u64]);
            (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
        };
        let measured = |log: usize| {
            (0..samples).map(|i| motion(truth, log, i as f64 * PERIOD_S, NO_STEP) + noise(log, i)).collect()
        };
        SyntheticModel {
            parameters,
            candidates: effects.iter().enumerate().map(candidate).collect(),
            logs: (0..3).map(log).collect(),
            measured: (0..3).map(measured).collect(),
            contact: false,
            beginning: None,
            sizes: Vec::new(),
            from_starts: None,
            motion: Arc::new(motion),
        }
    }

    pub(crate) fn diagnosis(&self) -> Diagnosis {
        diagnose(&mut Objective::new(self), DiagnoseOptions::default(), &|_| ()).unwrap()
    }
}

impl SyntheticModel {
    /// The model without the samples that are further than any error from the motion at a point.
    fn without_glitches_at(&self, u: &[f64]) -> Option<Box<dyn ResidualModel>> {
        let mut other = self.clone();
        for (log, measured) in other.measured.iter_mut().enumerate() {
            for (i, x) in measured.iter_mut().enumerate() {
                let error = *x - (self.motion)(u, log, i as f64 * PERIOD_S, 1.0);
                *x = if error.abs() > GLITCH { f64::NAN } else { *x };
            }
            other.logs[log].present = measured.iter().filter(|x| x.is_finite()).count();
        }
        let gone = other.logs.iter().zip(&self.logs).any(|(now, before)| now.present < before.present);
        gone.then(|| Box::new(other) as Box<dyn ResidualModel>)
    }
}

pub(crate) fn parameter(name: &str, amplitude: bool) -> FitParameter {
    let (bounds, spread) = if amplitude { ((-40.0, 40.0), 30.0) } else { ((-3.0, 3.0), 1.0) };
    let (name, unit) = (name.to_owned(), "1".to_owned());
    FitParameter {
        name,
        unit,
        origin: 0.0,
        size: 1.0,
        law: Parametrisation::Linear,
        bounds,
        spread,
        known: None,
        reach: 0.1,
        amplitude,
    }
}

impl ResidualModel for SyntheticModel {
    fn description(&self) -> ModelDescription {
        ModelDescription {
            free: vec![0],
            candidates: self.candidates.clone(),
            has_contact: self.contact,
            ..ModelDescription::new(self.parameters.clone(), self.logs.clone())
        }
    }

    fn residuals(&self, requests: &[ResidualRequest], step: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
        let finer = f64::from(step.divides_by());
        let residual = |&ResidualRequest { u, log, .. }: &ResidualRequest| {
            let simulated = (0..self.logs[log].rows()).map(|i| (self.motion)(u, log, i as f64 * PERIOD_S, finer));
            Ok(self.measured[log].iter().zip(simulated).map(|(measured, simulated)| measured - simulated).collect())
        };
        requests.iter().map(residual).collect()
    }

    fn sizes(&self, parameter: usize, _residuals: &[(usize, &[f64])]) -> Vec<(f64, f64)> {
        self.sizes.get(parameter).cloned().unwrap_or_default()
    }

    fn derive(&self, derivation: &Derivation) -> Option<Box<dyn ResidualModel>> {
        match derivation {
            Derivation::Beginnings => (),
            Derivation::WithoutGlitchesAt(u) => return self.without_glitches_at(u),
            Derivation::WithStartsAt(_) => {
                let motion = self.from_starts.clone()?;
                return Some(Box::new(SyntheticModel { motion, ..self.clone() }));
            }
            _ => return None,
        }
        let mut short = SyntheticModel { beginning: None, ..self.clone() };
        for log in &mut short.logs {
            log.channels[0].samples.end = self.beginning?;
            log.present = self.beginning?;
        }
        Some(Box::new(short))
    }
}

pub(crate) fn names(diagnosis: &Diagnosis) -> Vec<&str> {
    diagnosis.effects.iter().map(|found| found.effect.as_str()).collect()
}

/// A sine with a different phase for each log.
pub(crate) fn swing(rate: f64, log: usize, t: f64) -> f64 {
    (rate * t + 2.0 * log as f64).sin()
}
