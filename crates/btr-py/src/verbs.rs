//! The verbs on a model and its logs: results as the JSON documents of the command line.

use crate::error::{Raise, raised};
use crate::log::{Log, LogArgument};
use crate::model::Model;
use crate::overlay::Overlay;
use crate::page::Page;
use crate::work::{ExecutorChoice, at_once, working};
use btr_identify::LadderStep;
use btr_identify::residual_model::ResidualModel;
use btr_lab::distributed::RemoteModel;
use btr_lab::execution::ExecutionContext;
use btr_lab::experiment;
use btr_lab::experiment::{DamagedLogs, LogSource, Replays, Source};
use btr_lab::failure::Failure;
use btr_lab::verbs;
use btr_lab::verbs::{FitOptions, StartModel, VerbInput};
use btr_report::Subject;
use btr_report::html;
use pyo3::prelude::*;
use serde_json::json;
use std::sync::Arc;
use std::time::{Duration, Instant};

fn sources(logs: Vec<LogArgument>) -> Vec<LogSource> {
    logs.into_iter().map(LogArgument::source).collect()
}

/// The logs of a call; if one cannot be used, the others, unless `strict`.
fn replays(model: &Source, [learn, held_out]: [&[LogSource]; 2], strict: bool) -> PyResult<Replays> {
    let damaged = if strict { DamagedLogs::Refuse } else { DamagedLogs::LeaveOut };
    experiment::replays_of(model, learn, held_out, damaged, &|_| {}).map_err(Raise::raise)
}

/// Why a model cannot replay a log; `None` where it can.
#[pyfunction]
pub(crate) fn unusable(py: Python<'_>, model: &Model, log: LogArgument) -> PyResult<Option<String>> {
    let logs = sources(vec![log]);
    at_once(py, &model.source, || {
        let replays = experiment::replays_of(&model.source, &logs, &[], DamagedLogs::Refuse, &|_| {});
        Ok(replays.err().map(|error| error.to_string()))
    })
}

/// The quality of logs, and which free parameters they identify.
#[pyfunction]
pub(crate) fn check(py: Python<'_>, model: &Model, logs: Vec<LogArgument>, strict: bool) -> PyResult<String> {
    let logs = sources(logs);
    at_once(py, &model.source, || {
        let replays = replays(&model.source, [&logs, &[]], strict)?;
        Ok(verbs::check(replays).document().to_string())
    })
}

/// The model's errors by channel and regime: the result, its page, and both robots for viewers.
#[pyfunction]
pub(crate) fn compare(
    py: Python<'_>,
    model: &Model,
    logs: Vec<LogArgument>,
    strict: bool,
) -> PyResult<(String, Page, Overlay)> {
    let logs = sources(logs);
    at_once(py, &model.source, || {
        let replays = replays(&model.source, [&logs, &[]], strict)?;
        let outcome = verbs::compare(&model.source, replays, &|_, _| {})
            .map_err(|error| Failure::input(error, &[]).of_simulated(&model.source.path).raise())?;
        let (document, outcome) = (outcome.document().to_string(), Arc::new(outcome));
        let overlay = Overlay::new(&model.source, outcome.clone());
        Ok((document, Page::new(&model.source, move || html::compare(&outcome)), overlay))
    })
}

/// The physical effects, or one of them.
#[pyfunction]
#[pyo3(signature = (name = None))]
pub(crate) fn effects(name: Option<&str>) -> PyResult<String> {
    Ok(btr_lab::verbs::effects(name).map_err(Raise::raise)?.to_string())
}

/// Which effect is missing: the answer, its page, the commands of the next experiment if there is one, and the text of
/// the model with what was found. `tell`,
/// which may raise to end it, is called with every step of the ladder: what was done, the error on the logs to learn
/// from and on those held out, in multiples of the noise floor.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "called from one place, by name there")]
pub(crate) fn diagnose(
    py: Python<'_>,
    model: &Model,
    logs: Vec<LogArgument>,
    held_out: Vec<LogArgument>,
    max_effects: Option<usize>,
    max_rollouts: Option<usize>,
    max_time_s: Option<f64>,
    freeze: Vec<String>,
    strict: bool,
    tell: Py<PyAny>,
    executor: Option<ExecutorChoice>,
) -> PyResult<(String, Page, Option<Log>, String)> {
    let (logs, held_out, context) = (sources(logs), sources(held_out), model.context(py, executor)?);
    working(py, &context, || {
        let source = model.source.clone();
        let replays = replays(&source, [&logs, &held_out], strict)?;
        let input = VerbInput::of(source, replays).and_then(|input| input.freezing(&freeze));
        let input = input.map_err(Raise::raise)?;
        let question = input.options(max_effects, max_rollouts);
        let heard = |ladder_step: &LadderStep| say(&context, &tell, ladder_step);
        let family = served(&input, &context)?;
        let deadline = max_time_s.and_then(|s| Duration::try_from_secs_f64(s).ok()).map(|time| Instant::now() + time);
        let stop_signal = Arc::new(move || deadline.is_some_and(|deadline| Instant::now() >= deadline));
        let (found, diagnosed) = verbs::diagnose(&input, &family, question, stop_signal, &heard)
            .map_err(|error| Failure::simulation_failure(&input, &error).raise())?;
        let document = json!(found).to_string();
        let next = found.next_experiment.as_ref().and_then(|next| next.commands.clone());
        let next = next.map(|commands| Log::made_here("next experiment", commands));
        let text = input.diagnosed_text(&diagnosed, input.source.folder()).map_err(Raise::raise)?;
        let ([logs, held_out], u, step) = (input.logs_used(), diagnosed.fit.u, diagnosed.step);
        let page =
            move || html::diagnose(&Subject { input: &input, logs: &logs, held_out: &held_out }, &found, (&u, step));
        Ok((document, Page::new(&model.source, page), next, text))
    })
}

/// The free parameters at their best, with effects added first and some parameters frozen, from the values of the model
/// `start` if there is one, and the base parameters if
/// asked for: the answer, its page, the numbers as they were (JSON) and the fitted model's text.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "called from one place, by name there")]
pub(crate) fn fit(
    py: Python<'_>,
    model: &Model,
    logs: Vec<LogArgument>,
    held_out: Vec<LogArgument>,
    add: Vec<String>,
    start: Option<&Model>,
    freeze: Vec<String>,
    base_parameters: bool,
    strict: bool,
    tell: Py<PyAny>,
    executor: Option<ExecutorChoice>,
) -> PyResult<(String, Page, String, String)> {
    let (logs, held_out, context) = (sources(logs), sources(held_out), model.context(py, executor)?);
    let start = start.map(|start| start.source.clone());
    working(py, &context, || {
        let start = start.map(StartModel::new).transpose().map_err(Raise::raise)?;
        let options = FitOptions { add: &add, freeze: &freeze, start: start.as_ref() };
        let input = fitted_input(model, [&logs, &held_out], strict, options)?;
        if base_parameters {
            input.check_base_parameters().map_err(Raise::raise)?;
        } else if let Some(failure) = Failure::nothing_to_fit(&input) {
            return Err(failure.raise());
        }
        let heard = |ladder_step: &LadderStep| say(&context, &tell, ladder_step);
        let family = served(&input, &context)?;
        let before = input.before.as_ref().map(|before| served(before, &context)).transpose()?;
        let before = before.as_ref().map(|before| before as &dyn ResidualModel);
        let (mut found, fit, step) = verbs::fit(&input, &family, before, &heard)
            .map_err(|error| Failure::simulation_failure(&input, &error).raise())?;
        if base_parameters {
            found.base_parameters = Some(verbs::base_parameters(&input, &fit, step).map_err(Raise::raise)?);
        }
        let text = input.fitted_text(&found, &fit, step, input.source.folder());
        let text = text.map_err(|e| raised(e.to_string(), None))?;
        let space = json!(input.free_dims().collect::<Vec<_>>()).to_string();
        let document = json!(found).to_string();
        let ([logs, held_out], u) = (input.logs_used(), fit.u);
        let page = move || html::fit(&Subject { input: &input, logs: &logs, held_out: &held_out }, &found, (&u, step));
        Ok((document, Page::new(&model.source, page), space, text))
    })
}

/// The input of a fit of a model to logs.
fn fitted_input(model: &Model, logs: [&[LogSource]; 2], strict: bool, options: FitOptions) -> PyResult<VerbInput> {
    let source = match options.start {
        Some(start) => start.completing(model.source.clone()).map_err(Raise::raise)?,
        None => model.source.clone(),
    };
    let replays = replays(&source, logs, strict)?;
    VerbInput::to_fit(source, replays, options).map_err(Raise::raise)
}

/// Calls a listener in Python. An exception in it cancels the work.
fn say(context: &ExecutionContext, tell: &Py<PyAny>, ladder_step: &LadderStep) {
    let LadderStep { step, train, held_out, .. } = ladder_step;
    if let Err(error) = Python::attach(|py| tell.call1(py, (step, train, held_out))) {
        context.fail(Box::new(error));
    }
}

/// The problem's family as `context` serves it.
fn served(input: &VerbInput, context: &Arc<ExecutionContext>) -> PyResult<RemoteModel> {
    RemoteModel::new(input, context.clone()).map_err(Raise::raise)
}
