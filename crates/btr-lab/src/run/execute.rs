//! Runs the loop from its beginning or from its last checkpoint and writes the result files; an observer decides what
//! is shown.

use super::conclusions::conclusions;
use super::doubts::ReportedDoubts;
use super::folder::Run;
use super::identify;
use super::report;
use super::report::{ByDistance, RunReport};
use crate::experiment::Experiment;
use crate::failure::{Failure, STORAGE};
use crate::model_text;
use crate::model_text::SpacePoint;
use btr_core::coevolve::{Coevolution, StepOutcome, StopReason};
use btr_core::text::{Mention, Text};
use btr_core::world::Simulator;
use btr_identify::LadderStep;
use std::path::{Path, PathBuf};

/// Observer of a run.
pub trait RunObserver {
    /// A run begins, or continues with a larger S.
    fn begins(&mut self, experiment: &Experiment, run: &Coevolution);
    /// A step is complete and saved; `None` for a step of the identification with another distance.
    fn step(&mut self, run: &Coevolution, step: Option<&StepOutcome>);
    /// The populations disengaged, and the diagnosis reached this step of the error ladder.
    fn ladder_step(&self, ladder_step: &LadderStep);
    /// A warning about a real test.
    fn warn(&mut self, line: &str);
    /// A progress message.
    fn say(&mut self, line: &str);
    /// Whether to stop after the current step.
    fn stops(&mut self) -> bool;
}

/// How a run in a folder starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunStart {
    /// From its beginning.
    Begin,
    /// From the last checkpoint in the folder.
    Resume,
}

/// The outcome of a run.
pub struct FinishedRun {
    /// The run with its folder.
    pub run: Run,
    /// The report.
    pub report: RunReport,
    /// The result files that were written.
    pub files: Vec<PathBuf>,
    /// The real test that the run waits for, if it stopped for one that a person has to carry out.
    pub waiting: Option<Text>,
}

impl FinishedRun {
    /// The document of `--json`.
    ///
    /// # Errors
    /// A report that cannot be serialised, which does not happen.
    pub fn document(&self) -> Result<serde_json::Value, Failure> {
        let mut document = document(&self.report)?;
        document["files"] = self.files.iter().map(|f| f.display().to_string()).collect::<Vec<_>>().into();
        document["waiting_for"] = self.waiting.as_ref().map(Text::to_string).into();
        Ok(document)
    }
}

/// A report with its conclusions in words.
fn document(report: &RunReport) -> Result<serde_json::Value, Failure> {
    let mut document = serde_json::to_value(report).map_err(|e| Failure::new("output", e.to_string(), None))?;
    document["conclusions"] = conclusions(report).into();
    Ok(document)
}

/// How a run left the loop.
enum LoopExit {
    Stopped(StopReason),
    Waiting(Text),
    Interrupted,
}

/// Begins or resumes an experiment's run in a folder, executes the loop, and writes its files; `None` if the observer
/// stopped it.
///
/// # Errors
/// A folder that already holds a run, or none to resume; a failed write.
pub fn coevolve(
    experiment: &mut Experiment,
    folder: &Path,
    start: RunStart,
    watch: &mut dyn RunObserver,
) -> Result<Option<FinishedRun>, Failure> {
    let plan = experiment.plan.clone();
    let mut run = match start {
        RunStart::Begin => Run::begin(experiment, plan, folder)?,
        RunStart::Resume => Run::resume(experiment, plan, folder)?,
    };
    let mut reported = ReportedDoubts::default();
    // Findings of earlier tests were reported when those tests were done.
    reported.new_in(experiment, run.state().ledger().entries());
    let mut repaired = run.repaired().map(str::to_owned);
    loop {
        watch.begins(experiment, run.state());
        repaired.take().iter().for_each(|told| watch.warn(told));
        let exit = turn(&mut run, experiment, &mut reported, watch)?;
        if goes_on(&mut run, experiment, &exit, watch)? {
            continue;
        }
        return match exit {
            LoopExit::Interrupted => Ok(None),
            LoopExit::Waiting(what) => finish(experiment, run, None, Some(what), Vec::new()).map(Some),
            LoopExit::Stopped(reason) => match by_distance(experiment, &run, watch)? {
                Some(others) => finish(experiment, run, Some(reason), None, others).map(Some),
                None => Ok(None),
            },
        };
    }
}

/// Executes the loop one step at a time, so that it can be observed and interrupted.
fn turn(
    run: &mut Run,
    experiment: &mut Experiment,
    reported: &mut ReportedDoubts,
    watch: &mut dyn RunObserver,
) -> Result<LoopExit, Failure> {
    loop {
        let step = run.step(experiment)?;
        watch.step(run.state(), Some(&step));
        let new = reported.new_in(experiment, run.state().ledger().entries());
        new.iter().for_each(|doubt| watch.warn(&doubt.sentence()));
        match step {
            StepOutcome::Stopped(reason) => return Ok(LoopExit::Stopped(reason)),
            StepOutcome::Unsafe(why) => return Err(robot_not_known_to_stand_still(why)),
            StepOutcome::Storage(why) => return Err(not_stored(why)),
            // What ends as the run is interrupted is not waited for.
            StepOutcome::Waiting(_) if watch.stops() => return Ok(LoopExit::Interrupted),
            StepOutcome::Waiting(what) => return Ok(LoopExit::Waiting(what)),
            StepOutcome::Generation | StepOutcome::Iteration | StepOutcome::Tested => {}
        }
        if watch.stops() {
            return Ok(LoopExit::Interrupted);
        }
    }
}

fn robot_not_known_to_stand_still(why: Text) -> Failure {
    let help = Text::from("see that the robot stands still, then ") + Mention::RunAgain;
    Failure::new("robot", why, Some(help))
}

fn not_stored(why: Text) -> Failure {
    let help = Text::from("put an undamaged file back, or see that there is room to write, then ") + Mention::RunAgain;
    Failure::new(STORAGE, why, Some(help))
}

/// Diagnoses a run that stopped disengaged. Whether it continues, in a larger S or from a better estimate.
fn goes_on(
    run: &mut Run,
    experiment: &mut Experiment,
    exit: &LoopExit,
    watch: &mut dyn RunObserver,
) -> Result<bool, Failure> {
    let LoopExit::Stopped(reason) = exit else { return Ok(false) };
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

/// Identification with the other distances of the experiment on the same real tests; `None` if interrupted.
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
        match identify::with_distance(experiment, run, number, &spec, goes_on)? {
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
    reason: Option<StopReason>,
    waiting: Option<Text>,
    others: Vec<ByDistance>,
) -> Result<FinishedRun, Failure> {
    let report = report::report(experiment, run.state(), reason, run.cause().cloned(), others)?;
    let files = write_files(experiment, &run, &report)?;
    Ok(FinishedRun { run, report, files, waiting })
}

/// The adapted model, driven by the best controller that was tested.
///
/// # Errors
/// A model file that cannot be written with these values.
pub fn adapted(experiment: &Experiment, run: &Run) -> Result<String, Failure> {
    let (model, state) = (&experiment.model, run.state());
    let best = state.best_tested();
    let best = best.map(|best| SpacePoint { space: model.controllers(), point: &best.trial.controller });
    let text = model_text::adapted_with_drive(experiment.source(), model, state.simulation(), best, run.folder());
    text.map_err(|e| Failure::new("output", e.to_string(), None))
}

fn write_files(experiment: &Experiment, run: &Run, report: &RunReport) -> Result<Vec<PathBuf>, Failure> {
    let text = format!("{:#}", document(report)?);
    let mut files = vec![run.write("history.json", text.as_bytes())?];
    files.push(run.write("adapted.toml", adapted(experiment, run)?.as_bytes())?);
    Ok(files)
}
