//! A run of the loop from its beginning, or from its last checkpoint, to its files; who watches it decides what is shown.

use super::doubts::ReportedDoubts;
use super::folder::Run;
use super::identify;
use super::report;
use super::report::{ByDistance, RunReport};
use crate::experiment::Experiment;
use crate::failure::Failure;
use crate::model_text;
use btr_core::coevolve::{Coevolution, StepOutcome, StopReason};
use btr_core::world::Simulator;
use btr_identify::LadderStep;
use std::path::{Path, PathBuf};

/// Who looks on while a run goes on.
pub trait RunObserver {
    /// A run begins, or goes on with a larger S.
    fn begins(&mut self, experiment: &Experiment, run: &Coevolution);
    /// A step was done and written down; of another distance's identification where there is none.
    fn step(&mut self, run: &Coevolution, step: Option<&StepOutcome>);
    /// The populations lost each other, and the error falls like this while a cause is looked for.
    fn ladder_step(&self, ladder_step: &LadderStep);
    /// Something about a real test is not as it should be.
    fn warn(&mut self, line: &str);
    /// Something is to be said.
    fn say(&mut self, line: &str);
    /// Whether to stop after the step in flight.
    fn stops(&mut self) -> bool;
}

/// What came of a run.
pub struct FinishedRun {
    /// The run, in its folder.
    pub run: Run,
    /// What was found.
    pub report: RunReport,
    /// Everything that was written for people.
    pub files: Vec<PathBuf>,
    /// What is awaited, where the run stopped for a real test that somebody has to do.
    pub waiting: Option<String>,
}

impl FinishedRun {
    /// The document of `--json`.
    ///
    /// # Errors
    /// A report that is no JSON, which does not happen.
    pub fn document(&self) -> Result<serde_json::Value, Failure> {
        let mut document =
            serde_json::to_value(&self.report).map_err(|e| Failure::new("output", e.to_string(), None))?;
        document["files"] = self.files.iter().map(|f| f.display().to_string()).collect::<Vec<_>>().into();
        document["waiting_for"] = self.waiting.clone().into();
        Ok(document)
    }
}

/// How a run left the loop.
enum LoopExit {
    Stopped(StopReason),
    Waiting(String),
    Interrupted,
}

/// Begins or resumes an experiment's run in a folder, turns the loop, and writes its files; `None` where the watcher stopped
/// it.
///
/// # Errors
/// A folder in use or without a run, a disk that refuses.
pub fn coevolve(
    experiment: &mut Experiment,
    folder: &Path,
    resume: bool,
    watch: &mut dyn RunObserver,
) -> Result<Option<FinishedRun>, Failure> {
    let plan = experiment.plan.clone();
    let mut run = match resume {
        true => Run::resume(experiment, plan, folder)?,
        false => Run::begin(experiment, plan, folder)?,
    };
    let mut told = ReportedDoubts::default();
    // What earlier tests showed was told when they were done.
    told.new_in(experiment, run.state().ledger().entries());
    loop {
        watch.begins(experiment, run.state());
        let left = turn(&mut run, experiment, &mut told, watch)?;
        if goes_on(&mut run, experiment, &left, watch)? {
            continue;
        }
        return match left {
            LoopExit::Interrupted => Ok(None),
            LoopExit::Waiting(what) => finish(experiment, run, (None, Some(what)), Vec::new()).map(Some),
            LoopExit::Stopped(reason) => match by_distance(experiment, &run, watch)? {
                Some(others) => finish(experiment, run, (Some(reason), None), others).map(Some),
                None => Ok(None),
            },
        };
    }
}

/// The loop, one step at a time, so that it can be watched and interrupted.
fn turn(
    run: &mut Run,
    experiment: &mut Experiment,
    told: &mut ReportedDoubts,
    watch: &mut dyn RunObserver,
) -> Result<LoopExit, Failure> {
    loop {
        let step = run.step(experiment)?;
        watch.step(run.state(), Some(&step));
        let new = told.new_in(experiment, run.state().ledger().entries());
        new.iter().for_each(|doubt| watch.warn(&doubt.sentence()));
        match step {
            StepOutcome::Stopped(reason) => return Ok(LoopExit::Stopped(reason)),
            StepOutcome::Waiting(what) => return Ok(LoopExit::Waiting(what)),
            StepOutcome::Generation | StepOutcome::Iteration | StepOutcome::Tested => {}
        }
        if watch.stops() {
            return Ok(LoopExit::Interrupted);
        }
    }
}

/// Whether a run that stopped disengaged goes on, in a larger S or from a better estimate, once its real tests have been asked
/// for the cause.
fn goes_on(
    run: &mut Run,
    experiment: &mut Experiment,
    left: &LoopExit,
    watch: &mut dyn RunObserver,
) -> Result<bool, Failure> {
    let LoopExit::Stopped(reason) = left else { return Ok(false) };
    if run.state().disengaged() {
        watch.say("disengaged: looking for the cause in the real tests");
    }
    let goes_on = run.look_for_cause(experiment, reason, &|ladder_step| watch.ladder_step(ladder_step))?;
    if let Some(cause) = run.cause().filter(|_| goes_on) {
        let how = if cause.missing().is_empty() { "from what explains the tests" } else { "with that in S" };
        watch.say(&format!("{}; the run goes on {how}", cause.sentence()));
    }
    Ok(goes_on)
}

/// The same real tests through the other distances of the experiment; `None` when interrupted.
fn by_distance(
    experiment: &mut Experiment,
    run: &Run,
    watch: &mut dyn RunObserver,
) -> Result<Option<Vec<ByDistance>>, Failure> {
    let others = experiment.distances.clone();
    if others.is_empty() {
        return Ok(Some(Vec::new()));
    }
    let mut found = vec![identify::found(experiment, run.state())];
    for (number, spec) in others.into_iter().enumerate() {
        watch.say(&format!("identifying by {}", spec.name()));
        let goes_on = |state: &Coevolution| {
            watch.step(state, None);
            !watch.stops()
        };
        match identify::with_distance(experiment, run, (number, &spec), goes_on)? {
            Some(other) => found.push(other),
            None => return Ok(None),
        }
    }
    identify::confront(experiment, run.state(), &mut found);
    Ok(Some(found))
}

fn finish(
    experiment: &Experiment,
    run: Run,
    (reason, waiting): (Option<StopReason>, Option<String>),
    others: Vec<ByDistance>,
) -> Result<FinishedRun, Failure> {
    let report = report::report(experiment, run.state(), reason, run.cause().cloned(), others)?;
    let files = write_files(experiment, &run, &report)?;
    Ok(FinishedRun { run, report, files, waiting })
}

/// The model as the run adapted it, driven by the best controller that was tried.
///
/// # Errors
/// A model file that cannot be written with these values.
pub fn adapted(experiment: &Experiment, run: &Run) -> Result<String, Failure> {
    let (model, state) = (&experiment.model, run.state());
    let simulation = (model.simulations(), state.simulation());
    let best = state.best_tested().map(|best| (model.controllers(), best.trial.controller.as_slice()));
    let text = model_text::adapted_with_drive(experiment.source(), simulation, best, run.folder());
    text.map_err(|e| Failure::new("output", e.to_string(), None))
}

fn write_files(experiment: &Experiment, run: &Run, report: &RunReport) -> Result<Vec<PathBuf>, Failure> {
    let text = serde_json::to_string_pretty(report).map_err(|e| Failure::new("output", e.to_string(), None))?;
    let mut files = vec![run.write("history.json", text.as_bytes())?];
    files.push(run.write("adapted.toml", adapted(experiment, run)?.as_bytes())?);
    Ok(files)
}
