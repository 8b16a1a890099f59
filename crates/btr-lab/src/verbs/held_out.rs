//! Simulations of the held-out logs, for plots.

use crate::identification::{NoiseFloor, VerbInput};
use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_identify::compare::{Comparison, LogPair, compare};
use btr_identify::residual_model::TimeStep;
use rayon::prelude::*;
use std::ops::Range;

/// Held-out logs; all logs if the last part of each is held out.
#[derive(Clone, Debug)]
pub struct HeldOutLogs<'a> {
    /// Their names.
    pub names: Vec<&'a str>,
    /// The recorded logs.
    pub logs: &'a [Log],
    /// Their indices among the model's scenarios.
    scenarios: Range<usize>,
}

/// What a point of the free parameters does with logs.
#[derive(Clone, Debug)]
pub struct JudgedLogs {
    /// Its errors.
    pub comparison: Comparison,
    /// The simulation of each log.
    pub simulated: Vec<Log>,
}

impl VerbInput {
    /// The held-out logs.
    pub fn judged(&self) -> HeldOutLogs<'_> {
        let (model, recorded) = (self.problem.model(), self.problem.recorded());
        let first = if model.learn < recorded.len() { model.learn } else { 0 };
        let scenarios = first..recorded.len();
        let names = model.scenarios[scenarios.clone()].iter().map(|scenario| scenario.name.as_str()).collect();
        HeldOutLogs { names, logs: &recorded[scenarios.clone()], scenarios }
    }

    /// Errors of the residual model at point `u` on the held-out logs, in the channels that fits and diagnoses compare,
    /// simulated in a fit's time step, in multiples of these noise floors. Initial states are those of the logs;
    /// nothing is projected out.
    ///
    /// # Errors
    /// A simulation that diverged.
    pub fn judge(
        &self,
        judged: &HeldOutLogs,
        u: &[f64],
        step: TimeStep,
        floors: &[NoiseFloor],
    ) -> Result<JudgedLogs, WorldError> {
        let simulate = |scenario: usize| self.problem.simulate(u, scenario, step);
        let simulated: Vec<Log> =
            judged.scenarios.clone().into_par_iter().map(simulate).collect::<Result<_, WorldError>>()?;
        let pairs = judged.names.iter().zip(judged.logs).zip(&simulated);
        let episodes: Vec<LogPair> = pairs.map(|((name, real), simulated)| LogPair { name, real, simulated }).collect();
        let floor = |channel: &str, _: &[f64], _: &[f64]| floors.iter().find(|f| f.channel == channel).map(|f| f.sigma);
        let comparison = compare(&episodes, floor);
        Ok(JudgedLogs { comparison, simulated })
    }
}
