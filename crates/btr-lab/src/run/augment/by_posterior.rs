//! Diagnosis of a disengaged run with a posterior: the effects that, added to S, explain its real tests. Effects are
//! added one by one; each is screened at every site, the most promising ones are estimated with all of S free, and
//! held-out tests judge the result.

use super::cause::{Cause, DiagnosisError};
use super::cause_search::CauseSearch;
use crate::experiment::Experiment;
use crate::scales::RobotScales;
use btr_core::coevolve::{Abduction, Coevolution, Cost, Entry, Explanation, FittedExtension, PosteriorPhase};
use btr_core::world::{Simulator, WorldError};
use btr_identify::LadderStep;
use btr_identify::diagnose::Verdict;
use btr_physics::model::Model;

/// Most real tests that are used.
const MOST_TESTS: usize = 4;
/// Most effects that are reported.
const MOST_EFFECTS: usize = 3;
/// Shares of each test that are estimated before all of it; effects are screened on the first share.
const BEGINNINGS: [f64; 3] = [0.3, 0.5, 0.7];
/// Most turns of an estimate: a diagnosis is not time-critical.
const TURNS: usize = 12;

/// Diagnoses the real tests of a run. Returns the cause, and the explanation of the tests if there is one. `unanswered`
/// is the cause without a verdict.
pub(super) fn cause(
    experiment: &Experiment,
    run: &Coevolution,
    unanswered: Cause,
    on_step: &dyn Fn(&LadderStep),
) -> Result<(Cause, Option<Explanation>), DiagnosisError> {
    let (model, plan) = (experiment.model.as_ref(), run.plan());
    let phase = plan.posterior.clone().ok_or_else(|| DiagnosisError::why("the run has no posterior"))?;
    let distance = plan.distance.build();
    let tests = chosen(run);
    if tests.is_empty() {
        return Err(DiagnosisError::why("no real test gave a log"));
    }
    let (learn, held_out) = tests.split_at(tests.len() - usize::from(tests.len() > 1));
    let numbers = |tests: &[&Entry]| tests.iter().map(|test| test.trial.number).collect();
    let part = |share: &f64| learn.iter().map(|test| test.beginning(*share)).collect();
    let beginnings: Vec<Vec<Entry>> = BEGINNINGS.iter().map(part).collect();
    let parts = beginnings.iter().map(|part| part.iter().collect());
    let abduction = Abduction {
        distance: distance.as_ref(),
        learn: parts.chain([learn.to_vec()]).collect(),
        held_out: held_out.to_vec(),
        phase: PosteriorPhase { restarts: 0, turns: TURNS, ..phase },
        seed: experiment.seed,
    };
    let scales = scales(model, learn).map_err(|error| DiagnosisError::why(&error))?;
    let mut cost = Cost::default();
    let search = CauseSearch { abduction, model, scales, context: &experiment.context, start: run.start().to_vec() };
    let mut ladder = Vec::new();
    let mut record_step = |step: String, fitted: &FittedExtension| {
        let ladder_step = LadderStep { step, train: fitted.estimated.chi, held_out: fitted.held_out, u: Vec::new() };
        on_step(&ladder_step);
        ladder.push(ladder_step);
    };
    let mut state = search
        .begin(&mut cost)?
        .ok_or_else(|| DiagnosisError::why("the model diverges on the real tests at its current values"))?;
    record_step("S as it stands".to_owned(), &state.fitted);
    let mut effects = Vec::new();
    while !state.fitted.estimated.explains && effects.len() < MOST_EFFECTS {
        let Some((next, found)) = search.round(&state, &mut cost)? else { break };
        record_step(format!("+ {}@{}", found.effect, found.site), &next.fitted);
        effects.push(found);
        state = next;
    }
    state = search.pruned(state, &mut effects, &mut cost)?;
    state = search.simplified(state, &mut effects, &mut cost)?;
    // Later effects change the estimates of earlier ones, so all parameters are read from the final state.
    for (k, found) in effects.iter_mut().enumerate() {
        found.parameters = search.parameters(&state, k);
    }
    let explained = state.fitted.estimated.explains && state.fitted.confirmed;
    let verdict = match (explained, effects.is_empty()) {
        (true, true) => Verdict::NothingMissing,
        (true, false) => Verdict::EffectMissing,
        (false, _) => Verdict::Unexplained,
    };
    let space = state.extended.simulations().clone();
    let explanation = explained.then(|| Explanation { space, estimated: state.fitted.estimated.clone() });
    let cause = Cause {
        verdict: Some(verdict),
        effects,
        error_ladder: ladder,
        learnt: numbers(learn),
        held_out: numbers(held_out),
        rollouts: cost.evaluations as usize,
        ..unanswered
    };
    Ok((cause, explanation))
}

/// The last tests that gave a log: the test selection chose them for their information.
fn chosen(run: &Coevolution) -> Vec<&Entry> {
    let gave_a_log = |entry: &&Entry| entry.behaviour().is_some_and(|behaviour| behaviour.log.len() > 1);
    let usable: Vec<&Entry> = run.lately().iter().filter(gave_a_log).collect();
    usable[usable.len().saturating_sub(MOST_TESTS)..].to_vec()
}

/// Typical magnitudes for this robot in the training tests.
fn scales(model: &Model, learn: &[&Entry]) -> Result<RobotScales, WorldError> {
    let nominal = model.simulations().nominal();
    let simulated = learn
        .iter()
        .map(|test| model.simulate(model.request(&nominal, test.trial.scenario).controller(&test.trial.controller)));
    RobotScales::seen(&model.robot, &simulated.collect::<Result<Vec<_>, _>>()?)
}
