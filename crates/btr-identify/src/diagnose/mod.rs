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

use crate::fit::measure::{ComparisonMeasure, NOISE};
use crate::fit::{Estimate, FitPoint, LOOKS, LogSet, Objective, SearchBudget, estimates};
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

/// One step of the error's fall.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rung {
    /// What was done.
    pub step: String,
    /// Error on the logs to learn from, in multiples of the noise floor.
    pub train: f64,
    /// Error on held-out logs; none without such.
    pub held_out: Option<f64>,
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
    pub ladder: Vec<Rung>,
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

/// Finds out which effects of the family's candidates are missing; `tell` hears every step of the ladder as it is reached.
///
/// `None` where the model blows up as it stands.
pub fn diagnose(bench: &Objective, question: DiagnoseOptions, tell: &dyn Fn(&Rung)) -> Option<Diagnosis> {
    let state = begin(bench, tell)?;
    Some(match bench.family.has_contact() {
        true => go_on(bench, question, state, tell),
        false => go_on_looking(bench, question, state, tell, LOOKS),
    })
}

/// Goes on with starts as the model sees them, which are looked at so often at most. Where nothing is touched, starts are
/// believed if nothing else is left to explain: a model that lacks something sees such that make up for it.
fn go_on_looking(
    bench: &Objective,
    question: DiagnoseOptions,
    mut state: DiagnosisState,
    tell: &dyn Fn(&Rung),
    looks: usize,
) -> Diagnosis {
    let contact = bench.family.has_contact();
    let looks_again = leaves_something(bench, &state, &state.fit) || (!contact && state.is_judged_badly(bench));
    if looks == 0 || !looks_again {
        return go_on(bench, question, state, tell);
    }
    let seen = bench.seen_from(&state.fit.u);
    if seen.is_none() && contact {
        return go_on(bench, question, state, tell);
    }
    let again = bench.going_on(seen.as_deref().unwrap_or(bench.family), &state.fit.u);
    if !contact && !state.is_explained_by(&again) {
        bench.count(&again);
        return go_on(bench, question, state, tell);
    }
    state.look_again(&again, tell);
    go_on_looking(&again, question, state, tell, looks - 1)
}

/// Round after round; once something is found, with starts as the model that has it sees them.
fn go_on(bench: &Objective, question: DiagnoseOptions, mut state: DiagnosisState, tell: &dyn Fn(&Rung)) -> Diagnosis {
    let mut cut_short = false;
    while state.chosen.len() < question.max_effects && leaves_something(bench, &state, &state.fit) {
        cut_short = bench.rollouts().saturating_add(screen::rollouts(bench)) > question.max_rollouts;
        if cut_short {
            break;
        }
        let Some((rival, found)) = round(bench, &mut state) else { break };
        state.accept(bench, rival, found, tell);
        state.eliminate(bench);
        state.simplify(bench);
        let contact = bench.family.has_contact();
        if leaves_something(bench, &state, &state.fit) || (!contact && state.is_judged_badly(bench)) {
            let looks = if contact { 1 } else { LOOKS };
            return go_on_looking(bench, question, state, tell, looks);
        }
    }
    Diagnosis { cut_short, ..conclude(bench, question, state) }
}

/// The model's own parameters at their best.
fn begin(bench: &Objective, tell: &dyn Fn(&Rung)) -> Option<DiagnosisState> {
    let family = bench.family;
    let origin = vec![0.0; family.knobs().len()];
    let mut fit = FitPoint::at(bench, family.doubtful().to_vec(), origin, &[])?;
    let mut state = DiagnosisState {
        held_out: None,
        fit: fit.clone(),
        bare: fit.clone(),
        chosen: Vec::new(),
        ladder: Vec::new(),
        rivals: Vec::new(),
        rounds: Vec::new(),
        integrator: fit.renew_step_error(bench),
    };
    state.fit = fit;
    state.climb(bench, "model as it stands".to_owned(), tell);
    if !family.doubtful().is_empty() {
        state.fit.solve(bench, SearchBudget::FULL);
        state.integrator = state.fit.renew_step_error(bench);
        state.fit.solve(bench, SearchBudget { jacobians: 1, steps: 6 });
        state.climb(bench, "its parameters fitted".to_owned(), tell);
    }
    state.bare = state.fit.clone();
    Some(state)
}

/// Whether any effect could pass beside a fit: below the noise, and what the integrator may have done, there is nothing to win.
fn leaves_something(bench: &Objective, state: &DiagnosisState, fit: &FitPoint) -> bool {
    let squares = fit.squares() / bench.samples(LogSet::Learn).max(1) as f64;
    // Where motion is chaotic the noise floors have the integrator's error in them, and are themselves known roughly.
    if bench.family.is_chaotic() {
        return squares > NOISE.powi(2);
    }
    squares > 1.0 + LEARNT_FALL / 2.0 + state.integrator.powi(2)
}

fn conclude(bench: &Objective, question: DiagnoseOptions, mut state: DiagnosisState) -> Diagnosis {
    let last = state.ladder.last().map_or(f64::INFINITY, |rung| rung.held_out.unwrap_or(rung.train));
    let integrator_error = state.fit.step_error_to_judge_on(bench).max(state.integrator);
    let verdict = match (state.chosen.is_empty(), last) {
        (true, error) if error <= NOISE => Verdict::NothingMissing,
        (false, error) if error <= EXPLAINED => Verdict::EffectMissing,
        _ => Verdict::Unexplained,
    };
    let trusted = last <= NOISE;
    if trusted {
        state.settle(bench);
    }
    let inflation = ComparisonMeasure::of(bench, &state.fit).inflation();
    let all = estimates(bench, &state.fit, inflation, trusted);
    for found in &mut state.chosen {
        let knobs: Vec<usize> = bench.family.candidates()[found.candidate].knobs().collect();
        found.parameters = all.iter().filter(|(knob, _)| knobs.contains(knob)).map(|(_, e)| e.clone()).collect();
    }
    let found = (!state.chosen.is_empty()).then_some(&state.fit);
    let law = (verdict == Verdict::Unexplained && bench.rollouts() < question.max_rollouts)
        .then(|| state.bare_now(bench))
        .flatten()
        .and_then(|bare| residual_law(bench, &bare, found));
    let doubtful = bench.family.doubtful();
    let at_bound = all.iter().filter(|(knob, e)| doubtful.contains(knob) && e.at_bound).map(|(_, e)| e.name.clone());
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
        rollouts: bench.rollouts(),
        fit: state.fit,
    }
}
