//! Sentences and table rows shared by the terminal and the HTML reports.

use crate::Subject;
use crate::paths;
use crate::paths::shell_word;
use crate::table::{maybe, number};
use btr_identify::compare::ChannelError;
use btr_identify::diagnose::{StandIn, Verdict};
use btr_identify::fit::{Degree, Estimate, RemainingError};
use btr_identify::quality::Severity;
use btr_identify::residual_model::TimeStep;
use btr_lab::experiment::LeftOutLog;
use btr_lab::verbs::{CompareReport, CorrectedValue, DiagnoseReport, Doubt, FitReport, NoiseFloor, Support};
use std::path::{Path, PathBuf};

/// The severity of a finding as a word.
pub fn word(severity: Severity) -> &'static str {
    match severity {
        Severity::Fine => "fine",
        Severity::Doubtful => "doubtful",
        Severity::Bad => "bad",
    }
}

/// One line for a doubt about a log.
pub fn line(Doubt { log, finding }: &Doubt) -> String {
    format!("{}: {log}: {}", word(finding.severity), finding.sentence)
}

/// One line for a log that was left out: which, why, and the remedy.
pub fn left_out(log: &LeftOutLog) -> String {
    let help = log.help.as_ref().map_or_else(String::new, |help| format!("; {help}"));
    format!("left out: {}{help}", log.reason)
}

/// Reservations about a result: joints that were not judged, and findings about the logs.
pub fn reserve(doubts: &[Doubt], not_judged: &[String]) -> Vec<String> {
    let mut sentences = Vec::new();
    if !not_judged.is_empty() {
        sentences.push(unmeasured(not_judged));
    }
    let bad = doubts.iter().any(|doubt| doubt.finding.severity == Severity::Bad);
    match doubts.len() {
        0 => {}
        _ if bad => {
            sentences.push("do not rely on this result: the logs have a bad finding, see `btr check`".to_owned());
        }
        1 => sentences.push("the logs have 1 finding that may affect this result, see `btr check`".to_owned()),
        many => sentences.push(format!("the logs have {many} findings that may affect this result, see `btr check`")),
    }
    sentences
}

/// States which parameters kept the model's values, and which have a prior of earlier logs, where there are any.
pub fn given(frozen: &[String], with_prior: &[String]) -> Vec<String> {
    let list = |what: &str, names: &[String]| (!names.is_empty()).then(|| format!("{what}: {}", names.join(", ")));
    let prior = "prior from earlier logs (sd in the model file), which must not be among these";
    list("frozen at the model's values", frozen).into_iter().chain(list(prior, with_prior)).collect()
}

/// States which joints were not measured.
pub fn unmeasured(joints: &[String]) -> String {
    let was = if joints.len() == 1 { "was" } else { "were" };
    format!("{} {was} not measured, and so not judged", joints.join(", "))
}

/// One line with the noise floor of each channel.
pub fn floors(floors: &[NoiseFloor]) -> String {
    let assumed = |floor: &NoiseFloor| if floor.assumed { " (assumed: its readings show no noise)" } else { "" };
    let each = floors.iter().map(|f| format!("{} {} {}{}", f.channel, number(f.sigma), f.unit, assumed(f)));
    format!("noise floor: {}", each.collect::<Vec<_>>().join(", "))
}

/// Where runs of the same command differ by more than the sensors' noise: by how much in each channel.
pub fn repeatability(floors: &[NoiseFloor]) -> Option<String> {
    let known = floors.iter().filter_map(|floor| Some((floor, floor.repeatability?)));
    let each: Vec<String> = known
        .map(|(floor, spread)| {
            let times = number(spread / floor.sigma);
            let offset = floor.run_offset.map_or_else(String::new, |offset| {
                format!(" and an offset per run of {} {}, which is left open", number(offset), floor.unit)
            });
            format!("{} {} {} ({times} x noise floor){offset}", floor.channel, number(spread), floor.unit)
        })
        .collect();
    let of = "repeatability, how far runs of the same command differ";
    (!each.is_empty()).then(|| format!("{of}: {}; errors are in multiples of it", each.join(", ")))
}

/// The same for a comparison, with the error in multiples of it.
pub fn runs_differ(outcome: &CompareReport) -> Option<String> {
    let channel = |c: &ChannelError| {
        let spread = outcome.repeatability(&c.name)?;
        Some(format!("{} {} {} (error {} x)", c.name, number(spread), c.unit, number(c.rmse / spread)))
    };
    let each: Vec<String> = outcome.comparison.channels.iter().filter_map(channel).collect();
    let of = "repeatability, how far runs of the same command differ";
    (!each.is_empty()).then(|| format!("{of}: {}", each.join(", ")))
}

/// Header of a table of what is left.
pub const REMAINING: [&str; 5] = ["left in", "unit", "rmse", "x noise floor", "x repeatability"];

/// The table row of what is left in a channel, under [`REMAINING`].
pub fn remaining(left: &RemainingError) -> Vec<String> {
    let (rmse, noise) = (number(left.rmse), number(left.x_noise_floor));
    vec![left.channel.clone(), left.unit.clone(), rmse, noise, maybe(left.x_repeatability)]
}

/// What remains where an error is explained, as it completes a sentence.
pub fn what_remains(degree: Degree) -> &'static str {
    match degree {
        Degree::ExplainedToRepeatability => "what remains is no more than runs of the same command differ by",
        _ => "what remains is noise",
    }
}

/// The integrator's own error and its time step.
pub fn integrator(error: f64, time_step_s: f64) -> String {
    let (error, step_ms) = (number(error), number(1e3 * time_step_s));
    format!("integrator's own error: {error} x noise floor, in steps of {step_ms} ms")
}

/// That effects do nothing, and how to be rid of them.
pub fn removable(without_effect: &[String]) -> Option<String> {
    let first = without_effect.first()?;
    let (effect, site) = first.split_once('@').unwrap_or((first, "*"));
    let (does, they) = if without_effect.len() == 1 { ("does", "it") } else { ("do", "them") };
    Some(format!(
        "{} {does} nothing in these logs; to remove {they}, leave {they} out of --add, or delete the lines in the model file \
         (\"{effect}.*@{site}\" in [parameters], and an entry in [[effects]])",
        without_effect.join(", ")
    ))
}

/// Header of a table of fitted parameters.
pub const FITTED: [&str; 6] = ["parameter", "in the model", "fitted", "unit", "95 % interval", "moved"];

/// The table row of a fitted parameter, under [`FITTED`].
pub fn fitted(report: &FitReport, estimate: &Estimate) -> Vec<String> {
    let in_model = maybe(report.in_model.get(&estimate.name).copied());
    let moved = if report.has_moved(estimate) { "yes" } else { "" };
    let (value, unit) = (number(estimate.value), estimate.unit.clone());
    vec![estimate.name.clone(), in_model, value, unit, interval(estimate), moved.to_owned()]
}

/// Where an output would change many numbers by noise alone: what keeps them.
pub fn moved_by_noise(report: &FitReport) -> Option<String> {
    let (count, names) = report.moved_by_noise()?;
    let of = report.parameters.len();
    let freeze: Vec<String> = names.iter().map(|name| format!("--freeze {}", shell_word(name))).collect();
    Some(format!(
        "{count} of {of} parameters changed by no more than their uncertainty: saved or exported, they change {count} numbers by \
         noise alone; to keep the model's values: {}",
        freeze.join(" ")
    ))
}

/// The table row of an estimate, under [`ESTIMATES`].
pub fn estimate(estimate: &Estimate) -> Vec<String> {
    vec![estimate.name.clone(), number(estimate.value), estimate.unit.clone(), interval(estimate)]
}

/// The 95 % interval, or the reason why there is none.
pub fn interval(estimate: &Estimate) -> String {
    match (estimate.ci95, estimate.at_bound) {
        // It has two values.
        _ if estimate.name.starts_with(DIRECTION) => String::new(),
        (_, true) => "at its bound".to_owned(),
        (Some([low, high]), _) => {
            let by = if estimate.by_bounds { " (by its bounds)" } else { "" };
            format!("{} .. {}{by}", number(low), number(high))
        }
        (None, _) => "withheld".to_owned(),
    }
}

/// Begins the name of a value that says which way a joint counts.
const DIRECTION: &str = "direction@";

/// What to do about a wrong value, where its numbers do not say it.
pub fn remedy(value: &CorrectedValue) -> Option<String> {
    let joint = value.estimate.name.strip_prefix(DIRECTION)?;
    Some(format!(
        "{joint} counts the other way round than the model says: turn its axis round in the robot's file, or give q_{joint} and \
         cmd_{joint} the factor -1 in [channels]"
    ))
}

/// Header of a table of estimates.
pub const ESTIMATES: [&str; 4] = ["parameter", "value", "unit", "95 % interval"];

/// Header of a table of corrected values.
pub const CORRECTED: [&str; 5] = ["value", "in the model", "in the logs", "unit", "95 % interval"];

/// The table row of a corrected value, under [`CORRECTED`].
pub fn corrected(value: &CorrectedValue) -> Vec<String> {
    let CorrectedValue { estimate, in_model } = value;
    vec![estimate.name.clone(), number(*in_model), number(estimate.value), estimate.unit.clone(), interval(estimate)]
}

/// A free parameter that may stand in for an effect.
pub fn stand_in(stand_in: &StandIn) -> String {
    let StandIn { parameter, unit, in_model, value, effects } = stand_in;
    let (value, in_model, effects) = (number(*value), number(*in_model), effects.join(" or "));
    format!(
        "{parameter} ended at {value} {unit}, and the model states {in_model}: with that, {effects} would explain these logs \
         as well; --freeze {parameter} if you know it"
    )
}

/// "coulomb_friction on yaw; backlash on elbow", and likewise for values; only the established ones if any is.
pub fn findings(report: &DiagnoseReport) -> (Vec<String>, Vec<String>) {
    let any = report.support().any(|support| support.established);
    let effects = report.effects.iter().filter(|e| e.support.established || !any);
    let values = report.wrong_values.iter().filter(|v| v.support.established || !any);
    (
        effects.map(|e| format!("{} on {}", e.effect, e.site)).collect(),
        values.map(|v| format!("{} of {}", v.value, v.site)).collect(),
    )
}

/// Which of the findings' names these logs cannot tell from others, a sentence each; of those that are `meant`.
pub fn alike(report: &DiagnoseReport, meant: impl Fn(&Support) -> bool) -> Vec<String> {
    let effects = report.effects.iter().map(|e| (format!("{} on {}", e.effect, e.site), &e.support));
    let values = report.wrong_values.iter().map(|v| (format!("{} of {}", v.value, v.site), &v.support));
    let unclear = effects.chain(values).filter(|(_, support)| !support.alike.is_empty() && meant(support));
    unclear
        .map(|(name, support)| format!("these logs cannot tell {name} from {}", support.alike.join(" or ")))
        .collect()
}

/// Header of a table of channels.
pub const CHANNEL_HEADER: [&str; 11] = [
    "channel",
    "unit",
    "rmse",
    "error %",
    "fit %",
    "bias",
    "lag ms",
    "noise floor",
    "x noise floor",
    "white",
    "step error",
];

/// Columns of [`CHANNEL_HEADER`] that the terminal shows first, and the others.
pub const CHANNEL_COLUMNS: [&[usize]; 2] = [&[0, 8, 2, 1, 4, 6, 9], &[0, 7, 1, 5, 3, 10]];

/// Explanation of the columns in the first part of [`CHANNEL_COLUMNS`].
pub const LEGEND: [&str; 2] = [
    "x noise floor: the error in multiples of the sensor's noise floor (chi in --json); 1 is the best that any model can reach",
    "fit %: the share of the motion that is reproduced; lag: delay of the measurement; white: whether the residual looks like noise",
];

/// Explanation of the columns in the second part.
pub const FURTHER_LEGEND: [&str; 1] = [
    "error %: the error's root mean square (rmse) in percent of that of the readings; step error: the error of the simulation's \
     time step alone, in noise floors",
];

/// Table rows, one per channel, under [`CHANNEL_HEADER`]: those of the worst joint first.
pub fn channel_rows(outcome: &CompareReport) -> Vec<Vec<String>> {
    let tenth = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.1}"));
    let row = |c: &&ChannelError| {
        vec![
            c.name.clone(),
            c.unit.clone(),
            number(c.rmse),
            tenth(c.error_percent),
            tenth(c.fit_percent),
            number(c.bias),
            tenth(c.lag_s.map(|lag| 1e3 * lag)),
            number(c.noise_floor),
            format!("{:.2}", c.chi),
            if c.white { "yes" } else { "no" }.to_owned(),
            maybe(outcome.integrator.get(&c.name).copied()),
        ]
    };
    let joints = outcome.verdict().joints;
    let place = |channel: &str| {
        let joint = channel.split_once('_').map_or("", |(_, joint)| joint);
        joints.iter().position(|verdict| verdict.joint == joint).unwrap_or(joints.len())
    };
    let mut channels: Vec<&ChannelError> = outcome.comparison.channels.iter().collect();
    channels.sort_by_key(|channel| place(&channel.name));
    channels.iter().map(row).collect()
}

/// A remark on the time step, where the step's own error matters or a finer step was used.
pub fn about_the_step(outcome: &CompareReport) -> Option<String> {
    let step_ms = number(1e3 * outcome.time_step_s());
    if outcome.integrator_error() > 0.5 {
        let error = number(outcome.integrator_error());
        let what = format!("The time step of {step_ms} ms alone causes an error of {error} noise floors");
        return Some(format!("{what}: raise simulation.steps_per_control"));
    }
    let usual_ms = number(1e3 * outcome.replays.model.setup.dt_s);
    let finer = format!(
        "Simulated in steps of {step_ms} ms: with the model's {usual_ms} ms the integrator's error exceeds a fifth of the noise."
    );
    (outcome.step != TimeStep::USUAL).then_some(finer)
}

/// The `btr fit` command that adds what is established. `None` unless something is and the model and all logs are
/// files.
pub fn fit_command(report: &DiagnoseReport, subject: &Subject) -> Option<String> {
    let model = &subject.input.source.path;
    let adds: Vec<String> = report.names_to_add().iter().map(|name| format!("--add {}", shell_word(name))).collect();
    if report.verdict == Verdict::Unexplained || adds.is_empty() {
        return None;
    }
    let arguments = arguments(model, subject)?;
    // A fit does not overwrite the model that it reads.
    let output = if model.ends_with("fitted.toml") { "fitted_again.toml" } else { "fitted.toml" };
    Some(format!("btr fit {arguments} {} -o {output}", adds.join(" ")))
}

/// The command that continues a diagnosis that was stopped at a limit and leaves an error: from the model that it has
/// written, or else with twice as many rollouts. `None` unless the model and all logs are files.
pub fn diagnose_command(report: &DiagnoseReport, subject: &Subject, written: Option<&Path>) -> Option<String> {
    if !report.cut_short || !report.leaves_something() {
        return None;
    }
    match written {
        Some(written) => Some(format!("btr diagnose {}", arguments(written, subject)?)),
        None => {
            let arguments = arguments(&subject.input.source.path, subject)?;
            Some(format!("btr diagnose {arguments} --max-rollouts {}", 2 * report.rollouts))
        }
    }
}

/// The model, the logs and what is frozen, as arguments; `None` unless all are files.
fn arguments(model: &Path, subject: &Subject) -> Option<String> {
    let logs = || subject.logs.iter().chain(subject.held_out).map(PathBuf::as_path);
    if !std::iter::once(model).chain(logs()).all(Path::exists) {
        return None;
    }
    let held_out = if subject.held_out.is_empty() {
        String::new()
    } else {
        format!(" --held-out {}", paths::arguments(subject.held_out))
    };
    let freezes: String = subject.input.frozen.iter().map(|name| format!(" --freeze {}", shell_word(name))).collect();
    let (model, logs) = (shell_word(&model.display().to_string()), paths::arguments(subject.logs));
    Some(format!("{model} {logs}{held_out}{freezes}"))
}
