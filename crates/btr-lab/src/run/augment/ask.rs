//! Diagnoses the cause of a run's disengagement from its real tests.

use super::by_posterior;
use super::cause::{Cause, DiagnosisError};
use crate::distributed::RemoteModel;
use crate::experiment::Experiment;
use crate::identification::IdentificationProblem;
use btr_core::coevolve::{Coevolution, Entry, Explanation, Ledger};
use btr_core::log::Log;
use btr_core::world::{Cancelled, Trial, WorldError};
use btr_identify::LadderStep;
use btr_identify::diagnose::{DiagnoseOptions, diagnose};
use btr_identify::fit::Objective;
use btr_physics::robot::Base;
use std::sync::Arc;

/// Most real tests that are used: for a fixed base, and for a floating one.
const MOST_TESTS: (usize, usize) = (8, 4);
/// One in this many tests is held out.
const HELD_OUT: usize = 4;
/// Most physics steps of a diagnosis of a floating robot: contact needs the general engine, which is slow. About a
/// minute on two cores.
const FLOATING_STEPS: f64 = 1e6;

impl Cause {
    /// Diagnoses the real tests of a run; `on_step` is called with every step of the error ladder. For a run with a
    /// posterior, also returns the explanation of the tests, if there is one.
    ///
    /// # Errors
    /// Cancelled work.
    pub(crate) fn of(
        experiment: &Experiment,
        run: &Coevolution,
        on_step: &dyn Fn(&LadderStep),
    ) -> Result<(Self, Option<Explanation>), Cancelled> {
        let unanswered = Cause { after_iteration: run.history().iterations.len(), ..Cause::default() };
        let answer = match run.plan().posterior {
            Some(_) => by_posterior::cause(experiment, run, unanswered.clone(), on_step),
            None => unanswered.clone().answered(experiment, run.ledger(), on_step).map(|answered| (answered, None)),
        };
        match answer {
            Ok(answer) => Ok(answer),
            Err(DiagnosisError::NotPossible(why)) => Ok((Cause { not_diagnosed: Some(why), ..unanswered }, None)),
            Err(DiagnosisError::Cancelled(cancelled)) => Err(cancelled),
        }
    }

    fn answered(
        self,
        experiment: &Experiment,
        ledger: &Ledger,
        on_step: &dyn Fn(&LadderStep),
    ) -> Result<Self, DiagnosisError> {
        let fixed = experiment.model.robot.base == Base::Fixed;
        let tests = chosen(ledger, if fixed { MOST_TESTS.0 } else { MOST_TESTS.1 });
        let learn = tests.len() - tests.len() / HELD_OUT;
        let known = tests.iter().filter_map(|test| Some((&test.trial, &test.behaviour()?.log)));
        let known: Vec<(&Trial, &Log)> = known.collect();
        if known.is_empty() {
            return Err(DiagnosisError::why("no real test gave a log"));
        }
        let whole = known.iter().map(|(trial, log)| experiment.from_the_beginning(trial, log));
        let logs: Vec<Log> = whole.collect::<Result<_, _>>().map_err(|error| DiagnosisError::why(&error))?;
        let tests_with_logs: Vec<(&Trial, &Log)> = known.iter().map(|(trial, _)| *trial).zip(&logs).collect();
        let model = experiment.replaying(&tests_with_logs, learn).map_err(|error| DiagnosisError::why(&error))?;
        let problem =
            IdentificationProblem::new(Arc::new(model), logs, &[]).map_err(|error| DiagnosisError::why(&error))?;
        let options = DiagnoseOptions {
            max_rollouts: allowance(experiment),
            max_rollouts_while_falling: allowance(experiment),
            ..DiagnoseOptions::default()
        };
        let residual_model = RemoteModel::here(Arc::new(problem), experiment.context.clone());
        let found = diagnose(&mut Objective::new(&residual_model), options, on_step).map_err(|error| match error {
            WorldError::Cancelled(cancelled) => cancelled.into(),
            _ => DiagnosisError::why("the model diverges on the real tests at its current values"),
        })?;
        if found.cut_short && found.effects.is_empty() {
            return Err(DiagnosisError::why(&format!(
                "a floating robot needs the slow engine, and more than the {} rollouts allowed here; `btr diagnose` with the \
                 logs under transfers/ has no such limit",
                options.max_rollouts
            )));
        }
        let numbers = |tests: &[&Entry]| tests.iter().map(|test| test.trial.number).collect();
        Ok(Cause {
            verdict: Some(found.verdict),
            effects: found.effects,
            error_ladder: found.ladder.clone(),
            learnt: numbers(&tests[..learn]),
            held_out: numbers(&tests[learn..]),
            rollouts: found.rollouts,
            ..self
        })
    }
}

/// Real tests that gave a log: all of them, or at most `most`, spread evenly over the run and including the last one.
fn chosen(ledger: &Ledger, most: usize) -> Vec<&Entry> {
    let gave_a_log = |entry: &&Entry| entry.behaviour().is_some_and(|behaviour| behaviour.log.len() > 1);
    let usable: Vec<&Entry> = ledger.entries().iter().filter(gave_a_log).collect();
    let count = usable.len().min(most);
    (1..=count).map(|k| usable[k * usable.len() / count - 1]).collect()
}

/// Most rollouts of a diagnosis. The limit counts steps, not seconds: a result must not depend on the machine.
fn allowance(experiment: &Experiment) -> usize {
    let model = &experiment.model;
    let steps = model.scenarios.iter().map(|s| s.duration_s).fold(0.0, f64::max) / model.setup.dt_s;
    match model.robot.base {
        Base::Fixed => usize::MAX,
        Base::Floating => (FLOATING_STEPS / steps.max(1.0)) as usize,
    }
}
