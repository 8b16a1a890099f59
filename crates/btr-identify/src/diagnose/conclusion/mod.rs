//! The end of a diagnosis: verdict, probabilities and estimates.

mod stand_ins;

use crate::diagnose::evidence::{NoiseBound, doubt_same_place, doubt_series, doubt_size, weigh};
use crate::diagnose::own;
use crate::diagnose::report::{
    CapReason, DiagnoseOptions, Diagnosis, MissingEffect, RankedCandidate, StandIn, Verdict,
};
use crate::diagnose::residual_law::{ResidualLaw, residual_law};
use crate::diagnose::state::DiagnosisState;
use crate::diagnose::thresholds::{AT_MOST_AT_BOUNDS, AT_MOST_WITH_LEFT_OVER, LEFT_OVER};
use crate::fit::measure::ComparisonMeasure;
use crate::fit::{Degree, Estimate, Intervals, Objective, estimates, remaining};
use stand_ins::stand_ins;

/// How many logs are left out in a fit of its own, those first on which the findings seem to depend most.
const REFITTED: usize = 4;

/// The diagnosis that a state comes to.
pub(super) fn conclude(objective: &mut Objective, question: DiagnoseOptions, mut state: DiagnosisState) -> Diagnosis {
    let stopped = objective.is_stopped();
    objective.set_stoppable(false);
    if stopped {
        // The last step may not have been judged any more.
        state.judge_last_step(objective);
    }
    let integrator_error = state.fit.held_out_step_error(objective).max(state.integrator);
    state.leave_one_out(objective, if stopped { 0 } else { REFITTED });
    let verdict = verdict(objective, &mut state);
    let leaves = matches!(verdict, Verdict::Unexplained | Verdict::PartlyExplained);
    let left_over = certain_left_over(&mut state, !leaves && verdict != Verdict::NothingMissing);
    state.declare_larger_laws(objective, left_over.as_ref());
    let left = error_left(&state, leaves);
    let at_bound = estimate(objective, &mut state, left);
    let found = (!state.chosen.is_empty()).then_some(&state.fit);
    let asks_law = leaves && !stopped && objective.rollouts() < question.max_rollouts;
    let bare = if asks_law { state.bare_now(objective) } else { None };
    let residual_law: Option<ResidualLaw> = bare.and_then(|bare| residual_law(objective, &bare, found));
    let stand_ins: Vec<StandIn> = match leaves || stopped || objective.description.is_decoupled {
        true => Vec::new(),
        false => stand_ins(objective, &state),
    };
    let rollouts = objective.rollouts();
    let channels = remaining(objective, &state.fit.u);
    let degree = match verdict {
        Verdict::Unexplained => Degree::Unexplained,
        Verdict::PartlyExplained => Degree::PartlyExplained,
        Verdict::EffectMissing | Verdict::ValueWrong | Verdict::NothingMissing => Degree::of_noise(&channels),
    };
    Diagnosis {
        verdict,
        degree,
        left: channels,
        left_over,
        unexplained_share: (1.0 - left.powi(-2)).max(0.0),
        integrator_error,
        at_bound,
        rounds: state.rounds,
        effects: state.chosen,
        ladder: state.ladder,
        rivals: state.rivals,
        residual_law,
        stand_ins,
        cut_short: false,
        glitches: objective.description.glitches.clone(),
        logs: objective.description.logs.clone(),
        rollouts,
        fit: state.fit,
    }
}

/// The verdict; marks which findings are established, and bounds their probabilities.
fn verdict(objective: &Objective, state: &mut DiagnosisState) -> Verdict {
    let bound = NoiseBound { noise: objective.noise_bound(), roughly: objective.has_rough_floors() };
    let at_first = state.unexplained_at_first.judged;
    state.ladder.last().map_or(Verdict::Unexplained, |last| weigh(last, at_first, bound, &mut state.chosen))
}

/// What the last round ranked first, where it shows for certain that the findings, which explain the logs, leave
/// something. Bounds their probabilities.
fn certain_left_over(state: &mut DiagnosisState, explains: bool) -> Option<RankedCandidate> {
    let left_over = state.left_over.take().filter(|ranked| explains && ranked.delta_bic > LEFT_OVER)?;
    state.chosen.iter_mut().for_each(|found| found.cap(AT_MOST_WITH_LEFT_OVER, CapReason::LeftOver));
    Some(left_over)
}

/// The error that is left: that of the logs that judge, or where it is no noise the larger one.
fn error_left(state: &DiagnosisState, leaves: bool) -> f64 {
    let judged = state.ladder.last().map_or(f64::INFINITY, |step| step.held_out.unwrap_or(step.train));
    let learnt = state.ladder.last().map_or(f64::INFINITY, |step| step.train);
    if leaves { judged.max(learnt) } else { judged }
}

/// Estimates all parameters, which may make findings doubtful. Returns the names of the free ones at a bound.
fn estimate(objective: &Objective, state: &mut DiagnosisState, left: f64) -> Vec<String> {
    let intervals = if left <= objective.noise_bound() { Intervals::Given } else { Intervals::Withheld };
    if intervals == Intervals::Given {
        state.settle(objective);
    }
    let inflation = ComparisonMeasure::of(objective, &state.fit).inflation();
    let all = estimates(objective, &state.fit, inflation, intervals);
    state.chosen.iter_mut().for_each(|found| note_estimates(objective, found, &all));
    doubt_series(objective.candidates(), &mut state.chosen);
    // Where the motion is prescribed, the torque of each joint is a sum of laws that are told apart one by one; what a
    // link lacks is not.
    let is_apart = |candidate: usize| own::is_apart(objective, candidate);
    doubt_same_place(objective.candidates(), &mut state.chosen, is_apart);
    let is_free = |parameter: &usize| objective.description.free.contains(parameter);
    let at_bound: Vec<&Estimate> =
        all.iter().filter(|(parameter, e)| is_free(parameter) && e.at_bound).map(|(_, e)| e).collect();
    // A bound of zero is physics, as of friction; any other one says that what is named does not suffice.
    if at_bound.iter().any(|estimate| estimate.value != 0.0) {
        state.chosen.iter_mut().for_each(|found| found.cap(AT_MOST_AT_BOUNDS, CapReason::ParameterAtBound));
    }
    at_bound.into_iter().map(|estimate| estimate.name.clone()).collect()
}

/// Gives a finding its parameters' estimates, which may tell that its size is uncertain.
fn note_estimates(objective: &Objective, found: &mut MissingEffect, all: &[(usize, Estimate)]) {
    let candidate = &objective.candidates()[found.candidate];
    let of = |(parameter, _): &&(usize, Estimate)| candidate.parameters().any(|own| own == *parameter);
    found.parameters = all.iter().filter(of).map(|(_, estimate)| estimate.clone()).collect();
    let is_size = |(parameter, _): &&(usize, Estimate)| candidate.amplitudes.contains(parameter);
    let none = |parameter: usize| objective.parameters()[parameter].value(0.0);
    let sizes: Vec<(f64, &Estimate)> =
        all.iter().filter(is_size).map(|(parameter, estimate)| (none(*parameter), estimate)).collect();
    doubt_size(found, &sizes);
}
