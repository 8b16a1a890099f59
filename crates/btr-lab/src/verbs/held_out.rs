//! What a model says beside the logs that it is judged on, for plots.

use crate::identification::VerbInput;
use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_identify::compare::{Comparison, LogPair, compare};
use btr_identify::residual_model::TimeStep;
use rayon::prelude::*;
use std::ops::Range;

/// Logs that nothing was fitted to; all logs, where the last part of each is held out.
#[derive(Clone, Debug)]
pub struct HeldOutLogs<'a> {
    /// What they are called.
    pub names: Vec<&'a str>,
    /// What was recorded.
    pub logs: &'a [Log],
    /// Where they are among the model's scenarios.
    scenarios: Range<usize>,
}

impl VerbInput {
    /// The logs to judge on.
    pub fn judged(&self) -> HeldOutLogs<'_> {
        let (model, recorded) = (self.problem.model(), self.problem.recorded());
        let first = if model.learn < recorded.len() { model.learn } else { 0 };
        let scenarios = first..recorded.len();
        let names = model.scenarios[scenarios.clone()].iter().map(|scenario| scenario.name.as_str()).collect();
        HeldOutLogs { names, logs: &recorded[scenarios.clone()], scenarios }
    }

    /// What is wrong at a point of the family in the logs to judge on, in the channels that fits and diagnoses compare.
    /// Start states are as the logs have them; nothing is projected out.
    ///
    /// # Errors
    /// A simulation that blew up.
    pub fn judge(&self, judged: &HeldOutLogs, u: &[f64]) -> Result<Comparison, WorldError> {
        let simulate = |scenario: usize| self.problem.simulate(u, scenario, TimeStep::USUAL);
        let simulated: Vec<Log> =
            judged.scenarios.clone().into_par_iter().map(simulate).collect::<Result<_, WorldError>>()?;
        let pairs = judged.names.iter().zip(judged.logs).zip(&simulated);
        let episodes: Vec<LogPair> = pairs.map(|((name, real), simulated)| LogPair { name, real, simulated }).collect();
        let floors = self.floors();
        let floor = |channel: &str, _: &[f64]| floors.iter().find(|f| f.channel == channel).map(|f| f.sigma);
        Ok(compare(&episodes, floor))
    }
}
