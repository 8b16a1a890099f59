//! Glitches that show beside a fitted model.

use super::problem::IdentificationProblem;
use crate::log_quality::beside_model::{is_searched, leave_out_beside};
use btr_core::log::Log;
use btr_identify::quality::GlitchReport;
use btr_identify::residual_model::TimeStep;
use rayon::prelude::*;

impl IdentificationProblem {
    /// Searches for glitches beside fitted models from now on, as is asked of the logs.
    pub(in crate::identification) fn searching_glitches(self) -> Self {
        IdentificationProblem { searches_glitches: is_searched(&self.model), ..self }
    }

    /// The problem without the glitches that show beside the model at `u`; its noise floors are those of logs that
    /// never had them. `None` where there are none.
    pub(super) fn without_glitches_at(&self, u: &[f64]) -> Option<Self> {
        if !self.searches_glitches {
            return None;
        }
        let mut other = self.clone();
        let of_scenario = |(scenario, log): (usize, &mut Log)| self.leave_out_at(u, scenario, log);
        let found: Vec<_> = other.recorded.par_iter_mut().enumerate().map(of_scenario).collect();
        let found: Vec<_> = found.into_iter().flatten().filter(|(_, glitch)| glitch.left_out).collect();
        if found.is_empty() {
            return None;
        }
        other.glitches.extend(found);
        let origin = vec![0.0; self.parameters.len()];
        other.measure().and_then(|()| other.lower_floors(&origin)).ok()?;
        Some(other)
    }

    /// Leaves out the glitches of a scenario's log; those that are found, with the scenario.
    fn leave_out_at(&self, u: &[f64], scenario: usize, log: &mut Log) -> Vec<(usize, GlitchReport)> {
        let Ok(simulated) = self.simulate(u, scenario, TimeStep::USUAL) else { return Vec::new() };
        let before = self.glitches.iter().filter(|(other, _)| *other == scenario);
        let before: Vec<GlitchReport> = before.map(|(_, glitch)| glitch.clone()).collect();
        let found = leave_out_beside(&self.model, log, simulated, &before).into_iter();
        found.map(|glitch| (scenario, glitch)).collect()
    }

    /// The glitches, each with the log that has its first sample.
    pub(super) fn glitches_of_logs(&self) -> Vec<(usize, GlitchReport)> {
        let holds = |log: usize, scenario: usize, sample: usize| {
            self.parts[log].scenario == scenario && self.parts[log].samples.contains(&sample)
        };
        let of = |(scenario, glitch): &(usize, GlitchReport)| {
            let log = (0..self.parts.len()).find(|&log| holds(log, *scenario, glitch.sample))?;
            Some((log, glitch.clone()))
        };
        self.glitches.iter().filter_map(of).collect()
    }
}
