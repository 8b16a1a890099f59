//! The Back-to-Reality loop, optionally with a Python function as the robot.

use crate::error::{Raise, TestFailed, in_python, raised};
use crate::log::{Log, warn};
use crate::model::Model;
use crate::work::{ExecutorChoice, working};
use btr_core::coevolve::{Coevolution, StepOutcome};
use btr_identify::LadderStep;
use btr_lab::execution::ExecutionContext;
use btr_lab::experiment::Experiment;
use btr_lab::failure::Failure;
use btr_lab::reality::{RobotFunction, TestFailure, TestRequest};
use btr_lab::run::Snapshot;
use btr_lab::run::execute;
use btr_lab::run::execute::{RunObserver, RunStart};
use btr_report::figures;
use pyo3::prelude::*;
use serde_json::json;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// The exception that a robot's function ended with.
type Raised = Arc<Mutex<Option<PyErr>>>;

/// Begins or resumes a run in `folder`; the document of `btr coevolve --json`, or nothing where it was stopped. `robot`
/// is asked for every real test (number, iteration, scenario, names and values of the controller, its commands, where
/// joints begin) and gives back a log; `tell` hears every closed iteration, as JSON, and `warned` what is bad about a
/// real test.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "called from one place, by name there")]
pub(crate) fn coevolve(
    py: Python<'_>,
    model: &Model,
    folder: PathBuf,
    seed: Option<u64>,
    resume: bool,
    robot: Option<Py<PyAny>>,
    tell: Py<PyAny>,
    warned: Py<PyAny>,
    executor: Option<ExecutorChoice>,
) -> PyResult<Option<String>> {
    let (context, raised_there) = (model.context(py, executor)?, Raised::default());
    let robot = robot.map(|function| robotic(function, raised_there.clone()));
    let source = model.source.clone();
    let asked = robot.is_some();
    let begin = || Experiment::on(source, seed, &folder, robot, context.clone()).map_err(Raise::raise);
    let mut experiment = working(py, &context, begin)?;
    warn(py, &experiment.warnings)?;
    let (document, waiting) = working(py, &context, || {
        let mut watcher = Watcher { context: context.clone(), tell, warned, told: 0 };
        let start = if resume { RunStart::Resume } else { RunStart::Begin };
        let mut ended = execute::coevolve(&mut experiment, &folder, start, &mut watcher).map_err(Raise::raise)?;
        if let Some(ended) = &mut ended {
            ended.files.extend(figures::write(&experiment, &ended.run, &ended.report).map_err(Raise::raise)?);
        }
        let document = ended.as_ref().map(|ended| ended.document()).transpose().map_err(Raise::raise)?;
        let waiting = ended.and_then(|ended| ended.waiting);
        let said = document.map(|mut document| {
            document["waiting_for"] = waiting.as_ref().map(in_python).into();
            document.to_string()
        });
        Ok((said, waiting))
    })?;
    match (raised_there.lock().unwrap_or_else(PoisonError::into_inner).take(), waiting) {
        (Some(error), _) => Err(error),
        // Nobody but the function could have done what is awaited.
        (None, Some(what)) if asked => Err(raised(what, None)),
        (None, _) => Ok(document),
    }
}

/// The run in a folder as its last checkpoint has it, as JSON. Nothing there is written or locked.
#[pyfunction]
pub(crate) fn snapshot(py: Python<'_>, folder: PathBuf) -> PyResult<String> {
    let read = || Snapshot::read(&folder).map_err(|error| Failure::from(error).raise());
    py.detach(|| Ok(json!(read()?).to_string()))
}

/// A Python function as a robot. What it raises, but `TestFailed`, ends the run, which can be resumed with the same
/// test.
fn robotic(function: Py<PyAny>, ended_with: Raised) -> RobotFunction {
    Arc::new(move |asked: &TestRequest| {
        Python::attach(|py| {
            let references = Log::made_here("references", asked.references.clone());
            let trial = asked.trial;
            let asked = (
                trial.number,
                trial.iteration,
                trial.scenario,
                &asked.names,
                &trial.controller,
                references,
                &asked.start,
                asked.base,
                asked.duration_s,
            );
            let log = function.call1(py, asked).and_then(|log| Ok(log.extract::<Py<Log>>(py)?.get().log.clone()));
            log.map_err(|error| match error.is_instance_of::<TestFailed>(py) {
                true => TestFailure::Failed(error.value(py).to_string()),
                false => {
                    let why = error.to_string();
                    *ended_with.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                    TestFailure::Broken(why)
                }
            })
        })
    })
}

/// Calls a Python function after every iteration.
struct Watcher {
    context: Arc<ExecutionContext>,
    tell: Py<PyAny>,
    warned: Py<PyAny>,
    told: usize,
}

impl RunObserver for Watcher {
    fn begins(&mut self, _: &Experiment, run: &Coevolution) {
        self.told = run.history().iterations.len();
    }

    fn step(&mut self, run: &Coevolution, step: Option<&StepOutcome>) {
        let iterations = &run.history().iterations;
        if step != Some(&StepOutcome::Iteration) || iterations.len() <= self.told {
            return;
        }
        self.told = iterations.len();
        let heard = Python::attach(|py| {
            let last = iterations.last().map(|it| serde_json::json!(it).to_string());
            self.tell.call1(py, (last,))
        });
        if let Err(error) = heard {
            self.context.fail(Box::new(error));
        }
    }

    fn ladder_step(&self, _: &LadderStep) {}

    fn warn(&mut self, line: &str) {
        if let Err(error) = Python::attach(|py| self.warned.call1(py, (line,))) {
            self.context.fail(Box::new(error));
        }
    }

    fn say(&mut self, _: &str) {}

    fn stops(&mut self) -> bool {
        self.context.is_cancelled()
    }
}
