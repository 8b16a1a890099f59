//! The error's fall, as `diagnose` and `fit` show it while it happens.

use crate::args::Global;
use crate::failure::Failure;
use crate::table::{Table, number};
use btr_identify::fit::Estimate;
use btr_identify::quality::Severity;
use btr_lab::experiment;
use btr_lab::experiment::{Replays, Source};
use btr_lab::verbs;
use btr_lab::verbs::{Doubt, Floor, LadderStep};
use std::path::{Path, PathBuf};

/// The model's text with the settings of the command line.
pub(crate) fn source(model: &Path, global: &Global) -> Result<Source, Failure> {
    let mut source = Source::read(model)?;
    source.set(&global.settings)?;
    Ok(source)
}

/// Reads the logs and tells on stderr what is odd about them, before anything is made of them.
pub(crate) fn replays(
    source: &Source,
    learn: &[PathBuf],
    held_out: &[PathBuf],
    global: &Global,
) -> Result<(Replays, Vec<Doubt>), Failure> {
    let replays = experiment::replays(source, learn, held_out)?;
    let doubts = verbs::doubts(&replays);
    if !global.quiet {
        replays.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
        doubts.iter().for_each(|doubt| eprintln!("{}", line(doubt)));
    }
    Ok((replays, doubts))
}

pub(crate) fn line(Doubt { log, finding }: &Doubt) -> String {
    format!("{}: {log}: {}", super::check::word(finding.severity), finding.sentence)
}

/// What keeps an answer from being believed or from being complete, in sentences to stand below it.
pub(crate) fn reserve(doubts: &[Doubt], not_judged: &[String]) -> Vec<String> {
    let mut sentences = Vec::new();
    if !not_judged.is_empty() {
        sentences.push(unmeasured(not_judged));
    }
    let bad = doubts.iter().any(|doubt| doubt.finding.severity == Severity::Bad);
    match doubts.len() {
        0 => {}
        _ if bad => {
            sentences.push("do not believe this: something in the logs is bad, as `btr check` tells".to_owned());
        }
        1 => sentences.push("the logs leave 1 doubt, which may be behind this: `btr check` tells".to_owned()),
        many => sentences.push(format!("the logs leave {many} doubts, which may be behind this: `btr check` tells")),
    }
    sentences
}

/// Joints that nothing can be said about.
pub(crate) fn unmeasured(joints: &[String]) -> String {
    let was = if joints.len() == 1 { "was" } else { "were" };
    format!("{} {was} not measured, and so not judged", joints.join(", "))
}

/// Tells a step on stderr as it is reached.
pub(crate) fn tell(step: &LadderStep, global: &Global) {
    if !global.quiet {
        let held_out = step.held_out.map_or(String::new(), |x| format!(", {} held out", number(x)));
        eprintln!("{:<44} {} x noise floor{held_out}", step.step, number(step.train));
    }
}

/// The ladder as a table.
pub(crate) fn table(ladder: &[LadderStep]) -> Table {
    let mut table = Table::new(&["step", "error (x noise floor)", "held out"]);
    for step in ladder {
        let held_out = step.held_out.map_or("-".to_owned(), number);
        table.row(vec![step.step.clone(), number(step.train), held_out]);
    }
    table
}

/// The noise floors in a line.
pub(crate) fn floors(floors: &[Floor]) -> String {
    let assumed = |floor: &Floor| if floor.assumed { " (assumed: its readings show no noise)" } else { "" };
    let each = floors.iter().map(|f| format!("{} {} {}{}", f.channel, number(f.sigma), f.unit, assumed(f)));
    format!("noise floor: {}", each.collect::<Vec<_>>().join(", "))
}

/// The integrator's share of the error, and the step that it takes.
pub(crate) fn integrator(error: f64, time_step_s: f64) -> String {
    let (error, step_ms) = (number(error), number(1e3 * time_step_s));
    format!("integrator's own error: {error} x noise floor, in steps of {step_ms} ms")
}

/// A value with its interval, under [`ESTIMATES`].
pub(crate) fn estimate(estimate: &Estimate) -> Vec<String> {
    vec![estimate.name.clone(), number(estimate.value), estimate.unit.clone(), interval(estimate)]
}

/// The interval, or why there is none.
pub(crate) fn interval(estimate: &Estimate) -> String {
    match (estimate.ci95, estimate.at_bound) {
        (_, true) => "at its bound".to_owned(),
        (Some([low, high]), _) => {
            let by = if estimate.by_bounds { " (by its bounds)" } else { "" };
            format!("{} .. {}{by}", number(low), number(high))
        }
        (None, _) => "withheld".to_owned(),
    }
}

/// The head of a table of such values.
pub(crate) const ESTIMATES: [&str; 4] = ["parameter", "value", "unit", "95 % interval"];
