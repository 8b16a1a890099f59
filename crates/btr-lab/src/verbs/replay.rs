//! What a model says beside the logs that it is judged on, for plots.

use super::Problem;
use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_identify::compare::{Comparison, Episode, compare};
use btr_identify::residual_model::Step;
use rayon::prelude::*;
use std::ops::Range;

/// Logs that nothing was fitted to; all logs, where the last part of each is held out.
#[derive(Clone, Debug)]
pub struct Judged<'a> {
    /// What they are called.
    pub names: Vec<&'a str>,
    /// What was recorded.
    pub logs: &'a [Log],
    /// Where they are among the model's scenarios.
    scenarios: Range<usize>,
}

impl Problem {
    /// The logs to judge on.
    pub fn judged(&self) -> Judged<'_> {
        let (model, recorded) = (self.beside.model(), self.beside.recorded());
        let first = if model.learn < recorded.len() { model.learn } else { 0 };
        let scenarios = first..recorded.len();
        let names = model.scenarios[scenarios.clone()].iter().map(|scenario| scenario.name.as_str()).collect();
        Judged { names, logs: &recorded[scenarios.clone()], scenarios }
    }

    /// What is wrong at a point of the family in the logs to judge on, in the channels that fits and diagnoses compare. Start
    /// states are as the logs have them; nothing is projected out.
    ///
    /// # Errors
    /// A simulation that blew up.
    pub fn judge(&self, judged: &Judged, u: &[f64]) -> Result<Comparison, WorldError> {
        let simulate = |scenario: usize| self.beside.simulate(u, scenario, Step::USUAL);
        let simulated: Vec<Log> =
            judged.scenarios.clone().into_par_iter().map(simulate).collect::<Result<_, WorldError>>()?;
        let pairs = judged.names.iter().zip(judged.logs).zip(&simulated);
        let episodes: Vec<Episode> = pairs.map(|((name, real), simulated)| Episode { name, real, simulated }).collect();
        let floors = self.floors();
        let floor = |channel: &str, _: &[f64]| floors.iter().find(|f| f.channel == channel).map(|f| f.sigma);
        Ok(compare(&episodes, floor))
    }
}
