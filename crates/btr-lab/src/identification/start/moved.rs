//! Where a robot's logs begin: what moves that, and what a model that stands there has to say of it.

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

/// Positions at the start are moved by so many noise floors, velocities by what comes to as much after so many seconds.
const NUDGE: (f64, f64) = (3.0, 0.05);
/// What the first readings of a fixed robot leave open, in these: the standard deviation of positions and of
/// velocities.
pub(crate) const OPEN: [f64; 2] = [1.0, 30.0];
/// A log whose squares fall to this share, or to noise, began elsewhere than its readings seem to say.
const MOST: f64 = 0.5;

/// The situations of a fixed robot's logs with starts as the model that stands there sees them, where these explain all
/// or most of what it is off. `None` where there are no such.
pub(crate) fn seen_starts(model: &Model, recorded: &[Log]) -> Option<Vec<Scenario>> {
    if model.robot.base != Base::Fixed {
        return None;
    }
    let own = Arc::new(model.in_situations(model.scenarios.clone()));
    let mut problem = IdentificationProblem::without_effects(own, recorded.to_vec(), whole(recorded)).ok()?;
    problem.measure().ok()?;
    let origin = vec![0.0; problem.parameters.len()];
    let (mut moved, _) = nearest_starts(&problem, &problem.description(), &origin, 0.0);
    moved.retain(|start| problem.is_explained_from(&origin, start.log, &start.by));
    (!moved.is_empty()).then(|| problem.begun_elsewhere(&moved).situations)
}

impl IdentificationProblem {
    /// The same where the recordings of some logs begin elsewhere.
    pub fn begun_elsewhere(&self, moved: &[MovedStart]) -> IdentificationProblem {
        let mut other = self.clone();
        for MovedStart { log, by } in moved {
            other.situations[self.parts[*log].scenario] = self.begun_from(*log, by).into_owned();
        }
        other
    }

    /// The situation of a log whose start is moved.
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

    /// The start of a log, in which a number is moved by so many nudges.
    fn nudge(&self, log: usize, scenario: &mut Scenario, number: usize, by: f64) {
        // Where one rests nothing moves, so that positions are all there is.
        let numbers = if self.rests { 1 } else { 2 };
        let Some((joint, sigma)) = self.nudged(log).nth(number / numbers) else { return };
        let start = &mut scenario.start[joint];
        match number % numbers {
            0 => start.0 += by * NUDGE.0 * sigma,
            _ => start.1 += by * NUDGE.0 * sigma / NUDGE.1,
        }
    }

    /// Whether a start explains all or most of what the model is off in a log.
    fn is_explained_from(&self, u: &[f64], log: usize, by: &[f64]) -> bool {
        let chi = |residual: &Vec<f64>| {
            let there: Vec<f64> = residual.iter().copied().filter(|r| r.is_finite()).collect();
            (squares(&there) / there.len().max(1) as f64).sqrt()
        };
        let both =
            self.residuals(&[ResidualRequest::of(u, log), ResidualRequest { u, log, moved: by }], TimeStep::USUAL);
        let chi: Vec<f64> = both.iter().flatten().map(chi).collect();
        matches!(chi[..], [before, after] if before > NOISE && after < NOISE.max(MOST.sqrt() * before))
    }
}
