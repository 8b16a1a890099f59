//! The steps of a fit.

use crate::LadderStep;
use crate::fit::measure::held_out_squares;
use crate::fit::objective::{LogSet, Objective};
use crate::fit::residual_vector::chi;
use crate::fit::solve::FitPoint;

/// The steps so far, and the listener that is called with each.
pub(super) struct LadderRecorder<'a> {
    pub(super) steps: Vec<LadderStep>,
    pub(super) on_step: &'a dyn Fn(&LadderStep),
}

impl LadderRecorder<'_> {
    pub(super) fn record(&mut self, objective: &Objective, step: &str, fit: &FitPoint) {
        let step = measured(objective, step, fit);
        (self.on_step)(&step);
        self.steps.push(step);
    }

    /// Updates the last step to the errors of a fit that differs little from it.
    pub(super) fn renew(&mut self, objective: &Objective, fit: &FitPoint) {
        if let Some(last) = self.steps.last_mut() {
            *last = measured(objective, &last.step, fit);
        }
    }

    /// The last errors on training logs and on held-out ones, if there are any.
    pub(super) fn errors(&self) -> (f64, Option<f64>) {
        self.steps.last().map_or((f64::INFINITY, None), |step| (step.train, step.held_out))
    }

    /// The last error on held-out logs; without such, on training logs.
    pub(super) fn error(&self) -> f64 {
        let (train, held_out) = self.errors();
        held_out.unwrap_or(train)
    }
}

/// A step that led to a fit, with its errors.
fn measured(objective: &Objective, step: &str, fit: &FitPoint) -> LadderStep {
    let train = chi(fit.squares(), objective.samples(LogSet::Learn));
    let held_out = held_out_squares(objective, &fit.u).filter(|_| !objective.logs(LogSet::HeldOut).is_empty());
    let held_out = held_out.map(|squares| chi(squares, objective.samples(LogSet::HeldOut)));
    LadderStep { step: step.to_owned(), train, held_out, u: fit.u.clone() }
}
