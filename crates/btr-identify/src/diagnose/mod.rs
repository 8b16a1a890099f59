//! Which physical effect is missing.
//!
//! Every effect at every site is screened with finite probes while all that is in doubt may adapt, the leaders are refitted,
//! and the best is believed only if it also explains logs that nothing was fitted to. Effects are added one by one and
//! removed again where others make them btr_corefluous. The answer may be that nothing is missing, or that nothing known
//! explains the error.

mod beginnings;
mod judge;
mod linear;
mod refit;
mod residual_law;
mod round;
mod screen;
mod state;

pub use residual_law::ResidualLaw;

use crate::LadderStep;
use crate::fit::measure::{ComparisonMeasure, NOISE};
use crate::fit::{Estimate, FitPoint, LogSet, Objective, RESTARTS, SearchBudget, estimates};
use residual_law::residual_law;
use round::round;
use serde::{Deserialize, Serialize};
use state::DiagnosisState;

/// What decides. All errors are root mean squares in multiples of the noise floor.
pub mod thresholds {
    /// An effect must lower B by more than this...
    pub const DECISIVE: f64 = 10.0;
    /// ... and the sum of squares by more than this share...
    pub const LEARNT_FALL: f64 = 0.05;
    /// ... and that of the held-out logs by more than this.
    pub const HELD_OUT_FALL: f64 = 0.04;
    /// A difference of B not worth more than a bare mention (R. E. Kass and A. E. Raftery, "Bayes factors", Journal of
    /// the American Statistical Association 90, 1995): the rival with the fewest numbers is named.
    pub const TIE: f64 = 2.0;
    /// Above this error what was found does not explain it.
    pub const EXPLAINED: f64 = 1.5;
}
use thresholds::{EXPLAINED, LEARNT_FALL};

/// How much is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiagnoseOptions {
    /// The most effects to add.
    pub max_effects: usize,
    /// No round begins whose first screening would carry the simulated logs beyond this number, and no law is looked
    /// for beyond it. What a round goes on to (refits, and on the ground a second screening) is not counted in advance.
    pub max_rollouts: usize,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        DiagnoseOptions { max_effects: 3, max_rollouts: usize::MAX }
    }
}

/// The answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The effects named explain the error.
    EffectMissing,
    /// The residual is noise.
    NothingMissing,
    /// There is an error that nothing known explains.
    Unexplained,
}

/// An effect that the model lacks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MissingEffect {
    /// Its name.
    pub effect: String,
    /// Where it sits.
    pub site: String,
    /// `effect@site` of what these logs cannot tell from it.
    pub alike: Vec<String>,
    /// Its share of belief among everything that was fitted in its round, the model without it included; with that of a
    /// larger law which it stands for.
    pub probability: f64,
    /// By how much it lowered B.
    pub delta_bic: f64,
    /// Its parameters.
    pub parameters: Vec<Estimate>,
    /// Index of the candidate.
    #[serde(skip)]
    pub candidate: usize,
}

/// A candidate that was fitted in a round.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RankedCandidate {
    /// `effect@site`.
    pub name: String,
    /// Error on the logs to learn from, in multiples of the noise floor.
    pub train: f64,
    /// Error on held-out logs; none without such, or where it blows up there.
    pub held_out: Option<f64>,
    /// By how much it lowers B; negative where it is not worth its parameters.
    pub delta_bic: f64,
}

/// The whole diagnosis.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// What was fitted in each round, best first.
    pub rounds: Vec<Vec<RankedCandidate>>,
    /// The answer.
    pub verdict: Verdict,
    /// What is missing, or helps without explaining.
    pub effects: Vec<MissingEffect>,
    /// How the error fell.
    pub ladder: Vec<LadderStep>,
    /// The share of the final squared error that is not noise.
    pub unexplained_share: f64,
    /// The integrator's error in multiples of the noise floor: in the logs to learn from or in those to judge on,
    /// whichever is larger.
    pub integrator_error: f64,
    /// Doubtful parameters that ended at a bound.
    pub at_bound: Vec<String>,
    /// The last fit, with everything that was accepted.
    pub fit: FitPoint,
    /// What the last found with any in `alike` was compared with, and first itself: candidate and point, for the next
    /// experiment.
    pub rivals: Vec<(usize, Vec<f64>)>,
    /// With the verdict `Unexplained`: what the error looks like, if it looks like something.
    pub residual_law: Option<ResidualLaw>,
    /// Whether the rollouts that were allowed ended it.
    pub cut_short: bool,
    /// Simulated logs.
    pub rollouts: usize,
}

/// Finds out which effects of the family's candidates are missing; `on_step` hears every step of the ladder as it is reached.
///
/// `None` where the model blows up as it stands.
pub fn diagnose(objective: &Objective, question: DiagnoseOptions, on_step: &dyn Fn(&LadderStep)) -> Option<Diagnosis> {
    let state = begin(objective, on_step)?;
    Some(match objective.model.has_contact() {
        true => go_on(objective, question, state, on_step),
        false => go_on_looking(objective, question, state, on_step, RESTARTS),
    })
}

/// Goes on with starts as the model sees them, which are looked at so often at most. Where nothing is touched, starts are
/// believed if nothing else is left to explain: a model that lacks something sees such that make up for it.
fn go_on_looking(
    objective: &Objective,
    question: DiagnoseOptions,
    mut state: DiagnosisState,
    on_step: &dyn Fn(&LadderStep),
    restarts_left: usize,
) -> Diagnosis {
    let contact = objective.model.has_contact();
    let looks_again = leaves_something(objective, &state, &state.fit) || (!contact && state.is_judged_badly(objective));
    if restarts_left == 0 || !looks_again {
        return go_on(objective, question, state, on_step);
    }
    let seen = objective.with_starts_at(&state.fit.u);
    if seen.is_none() && contact {
        return go_on(objective, question, state, on_step);
    }
    let again = objective.going_on(seen.as_deref().unwrap_or(objective.model), &state.fit.u);
    if !contact && !state.is_explained_by(&again) {
        objective.count(&again);
        return go_on(objective, question, state, on_step);
    }
    state.look_again(&again, on_step);
    go_on_looking(&again, question, state, on_step, restarts_left - 1)
}

/// Round after round; once something is found, with starts as the model that has it sees them.
fn go_on(
    objective: &Objective,
    question: DiagnoseOptions,
    mut state: DiagnosisState,
    on_step: &dyn Fn(&LadderStep),
) -> Diagnosis {
    let mut cut_short = false;
    while state.chosen.len() < question.max_effects && leaves_something(objective, &state, &state.fit) {
        cut_short = objective.rollouts().saturating_add(screen::rollouts(objective)) > question.max_rollouts;
        if cut_short {
            break;
        }
        let Some((rival, found)) = round(objective, &mut state) else { break };
        state.accept(objective, rival, found, on_step);
        state.eliminate(objective);
        state.simplify(objective);
        let contact = objective.model.has_contact();
        if leaves_something(objective, &state, &state.fit) || (!contact && state.is_judged_badly(objective)) {
            let restarts_left = if contact { 1 } else { RESTARTS };
            return go_on_looking(objective, question, state, on_step, restarts_left);
        }
    }
    Diagnosis { cut_short, ..conclude(objective, question, state) }
}

/// The model's own parameters at their best.
fn begin(objective: &Objective, on_step: &dyn Fn(&LadderStep)) -> Option<DiagnosisState> {
    let model = objective.model;
    let origin = vec![0.0; model.parameters().len()];
    let mut fit = FitPoint::at(objective, model.free().to_vec(), origin, &[])?;
    let mut state = DiagnosisState {
        held_out: None,
        fit: fit.clone(),
        bare: fit.clone(),
        chosen: Vec::new(),
        ladder: Vec::new(),
        rivals: Vec::new(),
        rounds: Vec::new(),
        integrator: fit.renew_step_error(objective),
    };
    state.fit = fit;
    state.record(objective, "model as it stands".to_owned(), on_step);
    if !model.free().is_empty() {
        state.fit.solve(objective, SearchBudget::FULL);
        state.integrator = state.fit.renew_step_error(objective);
        state.fit.solve(objective, SearchBudget { jacobians: 1, steps: 6 });
        state.record(objective, "its parameters fitted".to_owned(), on_step);
    }
    state.bare = state.fit.clone();
    Some(state)
}

/// Whether any effect could pass beside a fit: below the noise, and what the integrator may have done, there is nothing to win.
fn leaves_something(objective: &Objective, state: &DiagnosisState, fit: &FitPoint) -> bool {
    let squares = fit.squares() / objective.samples(LogSet::Learn).max(1) as f64;
    // Where motion is chaotic the noise floors have the integrator's error in them, and are themselves known roughly.
    if objective.model.is_chaotic() {
        return squares > NOISE.powi(2);
    }
    squares > 1.0 + LEARNT_FALL / 2.0 + state.integrator.powi(2)
}

fn conclude(objective: &Objective, question: DiagnoseOptions, mut state: DiagnosisState) -> Diagnosis {
    let last = state.ladder.last().map_or(f64::INFINITY, |step| step.held_out.unwrap_or(step.train));
    let integrator_error = state.fit.step_error_to_judge_on(objective).max(state.integrator);
    let verdict = match (state.chosen.is_empty(), last) {
        (true, error) if error <= NOISE => Verdict::NothingMissing,
        (false, error) if error <= EXPLAINED => Verdict::EffectMissing,
        _ => Verdict::Unexplained,
    };
    let trusted = last <= NOISE;
    if trusted {
        state.settle(objective);
    }
    let inflation = ComparisonMeasure::of(objective, &state.fit).inflation();
    let all = estimates(objective, &state.fit, inflation, trusted);
    for found in &mut state.chosen {
        let parameters: Vec<usize> = objective.model.candidates()[found.candidate].parameters().collect();
        found.parameters =
            all.iter().filter(|(parameter, _)| parameters.contains(parameter)).map(|(_, e)| e.clone()).collect();
    }
    let found = (!state.chosen.is_empty()).then_some(&state.fit);
    let law = (verdict == Verdict::Unexplained && objective.rollouts() < question.max_rollouts)
        .then(|| state.bare_now(objective))
        .flatten()
        .and_then(|bare| residual_law(objective, &bare, found));
    let free = objective.model.free();
    let at_bound =
        all.iter().filter(|(parameter, e)| free.contains(parameter) && e.at_bound).map(|(_, e)| e.name.clone());
    Diagnosis {
        verdict,
        unexplained_share: (1.0 - last.powi(-2)).max(0.0),
        integrator_error,
        at_bound: at_bound.collect(),
        rounds: state.rounds,
        effects: state.chosen,
        ladder: state.ladder,
        rivals: state.rivals,
        residual_law: law,
        cut_short: false,
        rollouts: objective.rollouts(),
        fit: state.fit,
    }
}
