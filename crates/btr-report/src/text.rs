//! Sentences and rows that the terminal and the reports share.

use crate::Subject;
use crate::table::{maybe, number};
use btr_identify::compare::ChannelError;
use btr_identify::diagnose::Verdict;
use btr_identify::fit::Estimate;
use btr_identify::quality::Severity;
use btr_identify::residual_model::TimeStep;
use btr_lab::verbs::{CompareReport, DiagnoseReport, Doubt, NoiseFloor};
use std::path::PathBuf;

/// How bad a finding is.
pub fn word(severity: Severity) -> &'static str {
    match severity {
        Severity::Fine => "fine",
        Severity::Doubtful => "doubtful",
        Severity::Bad => "bad",
    }
}

/// A doubt in a line.
pub fn line(Doubt { log, finding }: &Doubt) -> String {
    format!("{}: {log}: {}", word(finding.severity), finding.sentence)
}

/// What keeps an answer from being believed or from being complete, in sentences to stand below it.
pub fn reserve(doubts: &[Doubt], not_judged: &[String]) -> Vec<String> {
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
pub fn unmeasured(joints: &[String]) -> String {
    let was = if joints.len() == 1 { "was" } else { "were" };
    format!("{} {was} not measured, and so not judged", joints.join(", "))
}

/// The noise floors in a line.
pub fn floors(floors: &[NoiseFloor]) -> String {
    let assumed = |floor: &NoiseFloor| if floor.assumed { " (assumed: its readings show no noise)" } else { "" };
    let each = floors.iter().map(|f| format!("{} {} {}{}", f.channel, number(f.sigma), f.unit, assumed(f)));
    format!("noise floor: {}", each.collect::<Vec<_>>().join(", "))
}

/// The integrator's share of the error, and the step that it takes.
pub fn integrator(error: f64, time_step_s: f64) -> String {
    let (error, step_ms) = (number(error), number(1e3 * time_step_s));
    format!("integrator's own error: {error} x noise floor, in steps of {step_ms} ms")
}

/// A value with its interval, under [`ESTIMATES`].
pub fn estimate(estimate: &Estimate) -> Vec<String> {
    vec![estimate.name.clone(), number(estimate.value), estimate.unit.clone(), interval(estimate)]
}

/// The interval, or why there is none.
pub fn interval(estimate: &Estimate) -> String {
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
pub const ESTIMATES: [&str; 4] = ["parameter", "value", "unit", "95 % interval"];

/// The head of a table of channels.
pub const CHANNEL_HEADER: [&str; 10] =
    ["channel", "unit", "rmse", "fit %", "bias", "lag ms", "noise floor", "x noise floor", "white", "step error"];

/// What its columns mean.
pub const LEGEND: [&str; 3] = [
    "x noise floor: the error in multiples of what the sensor alone would leave (chi in --json); 1 is as good as any model can be",
    "white: whether what is left looks like noise; fit %: the share of the motion that is right; lag: how late it was measured",
    "step error: what the simulation's time step alone does, in noise floors",
];

/// One row per channel, under [`CHANNEL_HEADER`].
pub fn channel_rows(outcome: &CompareReport) -> Vec<Vec<String>> {
    let tenth = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.1}"));
    let row = |c: &ChannelError| {
        vec![
            c.name.clone(),
            c.unit.clone(),
            number(c.rmse),
            tenth(c.fit_percent),
            number(c.bias),
            tenth(c.lag_s.map(|lag| 1e3 * lag)),
            number(c.noise_floor),
            format!("{:.2}", c.chi),
            if c.white { "yes" } else { "no" }.to_owned(),
            maybe(outcome.integrator.get(&c.name).copied()),
        ]
    };
    outcome.comparison.channels.iter().map(row).collect()
}

/// What there is to say about the time step, if anything.
pub fn about_the_step(outcome: &CompareReport) -> Option<String> {
    let step_ms = number(1e3 * outcome.time_step_s());
    if outcome.integrator_error() > 0.5 {
        let error = number(outcome.integrator_error());
        let what = format!("The time step alone, {step_ms} ms, errs by {error} noise floors");
        return Some(format!("{what}: raise simulation.steps_per_control"));
    }
    let usual_ms = number(1e3 * outcome.replays.model.setup.dt_s);
    let finer =
        format!("Simulated in steps of {step_ms} ms: the model's {usual_ms} ms err by more than a fifth of the noise.");
    (outcome.step != TimeStep::USUAL).then_some(finer)
}

/// What to type next, once it is known what is missing; nothing where the model or a log is no file.
pub fn fit_command(report: &DiagnoseReport, asked: &Subject) -> Option<String> {
    let model = &asked.input.source.path;
    let on_disk = std::iter::once(model).chain(asked.logs).chain(asked.held_out).all(|path| path.exists());
    if report.verdict != Verdict::EffectMissing || !on_disk {
        return None;
    }
    let adds: Vec<String> = report.effects.iter().flat_map(|e| e.names()).map(|name| format!("--add {name}")).collect();
    let paths = |paths: &[PathBuf]| paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(" ");
    let held_out =
        if asked.held_out.is_empty() { String::new() } else { format!(" --held-out {}", paths(asked.held_out)) };
    let (model, logs, adds) = (model.display(), paths(asked.logs), adds.join(" "));
    Some(format!("btr fit {model} {logs}{held_out} {adds} -o fitted.toml"))
}
