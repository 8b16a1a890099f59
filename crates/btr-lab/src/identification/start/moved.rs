//! Changes of the initial states of logs, and initial states estimated by the model.

use super::windows;
use crate::identification::log_parts::whole;
use crate::identification::problem::IdentificationProblem;
use btr_core::log::Log;
use btr_identify::fit::{NOISE, nearest_starts, squares};
use btr_identify::residual_model::{MovedStart, ResidualModel, ResidualRequest, TimeStep};
use btr_physics::model::{Model, Scenario};
use btr_physics::robot::Base;
use std::borrow::Cow;
use std::sync::Arc;

/// A nudge moves an initial position by this many noise floors, and an initial velocity by as much per this time in s.
const NUDGE: (f64, f64) = (3.0, 0.05);
/// Standard deviations of the initial positions and velocities of a fixed robot, given its first readings, in nudges.
pub(crate) const OPEN: [f64; 2] = [1.0, 30.0];
/// If the squares of a log fall to this share, or to noise, its initial state differs from its first readings.
const MOST: f64 = 0.5;

/// The scenarios of a fixed robot's logs with initial states estimated by the model, where these explain all or most of
/// the error. `None` if there are none.
pub(crate) fn seen_starts(model: &Model, recorded: &[Log]) -> Option<Vec<Scenario>> {
    if model.robot.base != Base::Fixed {
        return None;
    }
    let shared_model = Arc::new(model.in_situations(model.scenarios.clone()));
    let mut problem = IdentificationProblem::without_effects(shared_model, recorded.to_vec(), whole(recorded)).ok()?;
    problem.measure().ok()?;
    let origin = vec![0.0; problem.parameters.len()];
    let (mut moved, _) = nearest_starts(&problem, &problem.description(), &origin, 0.0);
    moved.retain(|start| problem.is_explained_from(&origin, start.log, &start.by));
    (!moved.is_empty()).then(|| problem.with_initial_states(&moved).situations)
}

impl IdentificationProblem {
    /// The same problem with other initial states of some logs.
    pub fn with_initial_states(&self, moved: &[MovedStart]) -> IdentificationProblem {
        let mut other = self.clone();
        for MovedStart { log, by } in moved {
            other.situations[self.parts[*log].scenario] = self.begun_from(*log, by).into_owned();
        }
        other
    }

    /// The scenario of a log whose initial state is moved.
    pub fn begun_from(&self, log: usize, moved: &[f64]) -> Cow<'_, Scenario> {
        let mut scenario = Cow::Borrowed(&self.situations[self.parts[log].scenario]);
        if moved.iter().all(|by| *by == 0.0) {
            return scenario;
        }
        let moved = moved.iter().enumerate().filter(|(_, by)| **by != 0.0);
        if scenario.restarts.is_empty() {
            moved.for_each(|(number, by)| self.nudge(log, scenario.to_mut(), number, *by));
        } else {
            let mut restarts = scenario.restarts.to_vec();
            moved.for_each(|(number, by)| windows::nudge(&mut restarts, number, *by, &self.parts[log].noise));
            scenario.to_mut().restarts = restarts.into();
        }
        scenario
    }

    /// Moves one coordinate of a log's initial state by a number of nudges.
    fn nudge(&self, log: usize, scenario: &mut Scenario, number: usize, by: f64) {
        // At rest all velocities are zero, so that only positions are uncertain.
        let numbers = if self.rests { 1 } else { 2 };
        let Some((joint, sigma)) = self.nudged(log).nth(number / numbers) else { return };
        let start = &mut scenario.start[joint];
        match number % numbers {
            0 => start.0 += by * NUDGE.0 * sigma,
            _ => start.1 += by * NUDGE.0 * sigma / NUDGE.1,
        }
    }

    /// Whether an initial state explains all or most of the model's error in a log.
    fn is_explained_from(&self, u: &[f64], log: usize, by: &[f64]) -> bool {
        let chi = |residual: &Vec<f64>| {
            let finite: Vec<f64> = residual.iter().copied().filter(|r| r.is_finite()).collect();
            (squares(&finite) / finite.len().max(1) as f64).sqrt()
        };
        let both =
            self.residuals(&[ResidualRequest::of(u, log), ResidualRequest { u, log, moved: by }], TimeStep::USUAL);
        let chi: Vec<f64> = both.iter().flatten().map(chi).collect();
        matches!(chi[..], [before, after] if before > NOISE && after < NOISE.max(MOST.sqrt() * before))
    }
}
