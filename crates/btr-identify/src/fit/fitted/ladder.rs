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
        let train = chi(fit.squares(), objective.samples(LogSet::Learn));
        let held_out = held_out_squares(objective, &fit.u).filter(|_| !objective.logs(LogSet::HeldOut).is_empty());
        let held_out = held_out.map(|squares| chi(squares, objective.samples(LogSet::HeldOut)));
        let step = LadderStep { step: step.to_owned(), train, held_out, u: fit.u.clone() };
        (self.on_step)(&step);
        self.steps.push(step);
    }

    /// The last error on held-out logs; without such, on training logs.
    pub(super) fn error(&self) -> f64 {
        self.steps.last().map_or(f64::INFINITY, |step| step.held_out.unwrap_or(step.train))
    }
}
