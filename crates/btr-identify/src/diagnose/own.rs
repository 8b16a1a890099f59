//! Errors where a candidate acts. Where the motion is prescribed, what acts in a joint shows in that joint's torque
//! alone: whether it explains enough is then a question about this channel, however much is left in others.

use crate::fit::measure;
use crate::fit::residual_vector::{chi, squares};
use crate::fit::{FitPoint, FitStop, LogSet, Objective, SearchBudget};
use std::ops::Range;

/// The channels in which a candidate shows, where it does not show in all.
fn channels<'a>(objective: &'a Objective, candidate: usize) -> Option<&'a [String]> {
    let near = objective.description.channels_of(candidate);
    (objective.description.is_decoupled && !near.is_empty()).then_some(near)
}

/// Whether a candidate shows in some channels alone.
pub(super) fn is_apart(objective: &Objective, candidate: usize) -> bool {
    channels(objective, candidate).is_some()
}

/// Whether two candidates show in the same channels.
pub(super) fn are_together(objective: &Objective, a: usize, b: usize) -> bool {
    channels(objective, a) == channels(objective, b)
}

/// The channels in which a joint's candidates show, one entry for each joint in the order of `of`; none where all
/// candidates show in all.
pub(super) fn joints<'a>(objective: &'a Objective, of: impl Iterator<Item = usize>) -> Vec<&'a [String]> {
    let mut joints: Vec<&[String]> = Vec::new();
    for near in of.filter_map(|candidate| channels(objective, candidate)) {
        if !joints.contains(&near) {
            joints.push(near);
        }
    }
    joints
}

/// Whether a candidate shows in these channels alone.
pub(super) fn shows_in(objective: &Objective, candidate: usize, joint: &[String]) -> bool {
    channels(objective, candidate) == Some(joint)
}

/// Which parameters adapt to a candidate while it competes: where that shows in a joint's channel alone, those that do
/// so as well. What the robot's links have is known from all channels, and follows once the candidate is accepted.
pub(super) fn adapting<'a>(objective: &'a Objective, candidate: usize) -> impl Fn(usize) -> bool + 'a {
    let near = channels(objective, candidate);
    move |parameter| near.is_none_or(|near| objective.channels_of(parameter) == near)
}

/// Lowers the cost of a fit with a candidate, by what adapts to it.
pub(super) fn solve(objective: &Objective, candidate: usize, fit: &mut FitPoint, budget: SearchBudget) -> FitStop {
    if is_apart(objective, candidate) {
        fit.solve_among(objective, &adapting(objective, candidate), budget)
    } else {
        fit.solve(objective, budget)
    }
}

/// The rows of the channels where a candidate shows, in the residual of some logs; none where it shows in all.
pub(super) fn rows(objective: &Objective, candidate: usize, logs: LogSet) -> Vec<Range<usize>> {
    channels(objective, candidate).map_or_else(Vec::new, |near| objective.rows_near(logs, near))
}

/// Sum of squares of a residual of some logs, in the channels where a candidate shows.
fn squares_of(objective: &Objective, candidate: usize, logs: LogSet, residual: &[f64]) -> f64 {
    match channels(objective, candidate) {
        None => squares(residual),
        Some(near) => objective.rows_near(logs, near).into_iter().map(|rows| squares(&residual[rows])).sum(),
    }
}

/// Sum of squares of a fit on the training logs.
pub(super) fn learnt(objective: &Objective, candidate: usize, fit: &FitPoint) -> f64 {
    squares_of(objective, candidate, LogSet::Learn, &fit.residual)
}

/// Sum of squares on the held-out logs; `None` where they cannot be simulated.
pub(super) fn held_out(objective: &Objective, candidate: usize, u: &[f64]) -> Option<f64> {
    let residual = measure::held_out(objective, u)?;
    Some(squares_of(objective, candidate, LogSet::HeldOut, &residual))
}

/// The error of a fit on the training logs.
pub(super) fn error(objective: &Objective, candidate: usize, fit: &FitPoint) -> f64 {
    chi(learnt(objective, candidate, fit), samples(objective, candidate, LogSet::Learn))
}

/// Number of samples of some logs where a candidate shows.
pub(super) fn samples(objective: &Objective, candidate: usize, logs: LogSet) -> usize {
    channels(objective, candidate).map_or_else(|| objective.samples(logs), |near| objective.present_near(logs, near))
}
