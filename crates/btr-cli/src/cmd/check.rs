//! `btr check`: the quality of logs, and which free parameters they identify.

use super::common;
use crate::args::{CheckArgs, Global};
use crate::exit::{DONE, MISSED};
use crate::status::Status;
use crate::terminal::{Tone, note, say, table};
use btr_core::signal::dead_time::DeadTime;
use btr_identify::quality::{CommandResponse, Finding, Severity, Topic};
use btr_lab::experiment::CheckedLog;
use btr_lab::failure::Failure;
use btr_lab::verbs;
use btr_lab::verbs::{CheckReport, IdentifiabilityReport, RepeatReport};
use btr_report::table::{Table, maybe, number};
use btr_report::text::word;
use indexmap::IndexMap;

/// Topics whose fine findings are told once for all logs.
const TOLD_TOGETHER: [Topic; 3] = [Topic::Clock, Topic::CommandLag, Topic::DeadTime];

pub(crate) fn run(args: &CheckArgs, global: &Global) -> Result<u8, Failure> {
    let source = common::source_of(&args.model, &args.reading, global)?;
    let replays = common::read(&source, [&args.logs, &[]], &args.reading, global)?;
    let status = Status::new("differentiating the model by its free parameters", global);
    let report = verbs::check(replays);
    drop(status);
    common::tell_left_out(&report.left_out, global);
    if global.json {
        println!("{}", report.document());
    } else {
        report.warnings.iter().filter(|_| !global.quiet).for_each(|warning| eprintln!("warning: {warning}"));
        show(&report, global.verbose);
    }
    let bad = !report.left_out.is_empty() || report.logs.iter().any(|log| log.quality.worst() == Severity::Bad);
    Ok(if bad { MISSED } else { DONE })
}

fn show(report: &CheckReport, verbose: bool) {
    match report.logs.as_slice() {
        [log] => one(log, verbose),
        logs => {
            many(report);
            logs.iter().filter(|_| verbose).for_each(|log| one(log, verbose));
        }
    }
    common::show_in_common(&report.in_common);
    repeatability(&report.repeatability, verbose);
    println!();
    identifiability(&report.identifiability);
}

/// All about one log.
fn one(CheckedLog { log, quality }: &CheckedLog, verbose: bool) {
    say(quality.worst().into(), &format!("{log}: {}", word(quality.worst())));
    for f in &quality.findings {
        let tone = if f.severity == Severity::Fine { Tone::Plain } else { f.severity.into() };
        say(tone, &format!("  {:<9} {}", word(f.severity), f.sentence));
    }
    if verbose {
        let mut channels = Table::new(&["channel", "unit", "min", "max", "noise", "step", "missing %"]);
        for s in &quality.sensors {
            let numbers = [number(s.min), number(s.max), maybe(s.noise), maybe(s.quantum), number(100.0 * s.missing)];
            channels.row([s.name.clone(), s.unit.clone()].into_iter().chain(numbers).collect());
        }
        table(&channels);
    }
    println!();
}

/// What differs between logs, and what they have in common.
fn many(report: &CheckReport) {
    let logs = &report.logs;
    let of = |severity| logs.iter().filter(|log| log.quality.worst() == severity).count();
    let (bad, doubtful) = (of(Severity::Bad), of(Severity::Doubtful));
    let worst = logs.iter().map(|log| log.quality.worst()).max().unwrap_or(Severity::Fine);
    let summary = match (bad, doubtful) {
        (0, 0) => format!("all {} logs are fine", logs.len()),
        (0, doubtful) => format!("{doubtful} of {} logs are doubtful", logs.len()),
        (bad, 0) => format!("{bad} of {} logs are bad", logs.len()),
        (bad, doubtful) => format!("{bad} of {} logs are bad, {doubtful} are doubtful", logs.len()),
    };
    say(worst.into(), &format!("{summary} (-v shows all about each)"));
    println!();
    table(&clocks(logs));
    println!();
    different(report);
    table(&responses(logs));
    note("lag: how long after its command a joint moves; dead time: the part of it in which it does not move at all");
    report.dead_times.sentences.iter().for_each(|sentence| say(Tone::Plain, sentence));
    println!();
}

/// A finding in each log that has it.
type Places<'a> = Vec<(&'a str, &'a Finding)>;

/// Findings that not all logs have alike, and all that are more than fine, the worst first.
fn different(report: &CheckReport) {
    let logs = &report.logs;
    let told = |finding: &Finding| finding.severity > Severity::Fine || !TOLD_TOGETHER.contains(&finding.topic);
    let apart = |finding: &Finding| report.in_common.iter().all(|common| !common.covers(finding));
    let mut findings: IndexMap<(Severity, Topic, &str), Places> = IndexMap::new();
    for CheckedLog { log, quality } in logs {
        for finding in quality.findings.iter().filter(|finding| told(finding) && apart(finding)) {
            let alike = (finding.severity, finding.topic, finding.channel.as_str());
            findings.entry(alike).or_default().push((log, finding));
        }
    }
    findings.sort_by(|(a, ..), _, (b, ..), _| b.cmp(a));
    for ((severity, ..), alike) in &findings {
        let (log, finding) = alike[0];
        let tone = if *severity == Severity::Fine { Tone::Plain } else { (*severity).into() };
        let place = match alike.len() - 1 {
            0 => log.to_owned(),
            more if more + 1 == logs.len() => format!("all logs; as {log} has it"),
            more => format!("{log}, and {more} more"),
        };
        say(tone, &format!("{:<9} {} ({place})", word(*severity), finding.sentence));
    }
    if !findings.is_empty() {
        println!();
    }
}

/// The clock of each log, and its worst finding.
fn clocks(logs: &[CheckedLog]) -> Table {
    let mut clocks = Table::new(&["log", "samples", "s", "per second", "jitter ms", "worst finding"]);
    for CheckedLog { log, quality } in logs {
        let clock = &quality.clock;
        let numbers = [clock.samples.to_string(), format!("{:.2}", clock.duration_s), format!("{:.1}", clock.rate_hz)];
        let jitter = format!("{:.2}", 1e3 * clock.jitter_s);
        let worst = [jitter, word(quality.worst()).to_owned()];
        clocks.row(std::iter::once(log.clone()).chain(numbers).chain(worst).collect());
    }
    clocks
}

/// How each joint follows its command, over all logs.
fn responses(logs: &[CheckedLog]) -> Table {
    let mut joints: IndexMap<&str, Vec<&CommandResponse>> = IndexMap::new();
    logs.iter().flat_map(|log| &log.quality.joints).for_each(|of| joints.entry(&of.joint).or_default().push(of));
    let mut table = Table::new(&["joint", "lag ms", "correlation", "dead time ms"]);
    for (joint, responses) in joints {
        let lags = || responses.iter().filter_map(|of| of.lag);
        let dead_times = responses.iter().filter_map(|of| match of.dead_time {
            Some(DeadTime::Known { seconds, .. }) => Some(1e3 * seconds.max(0.0)),
            _ => None,
        });
        let correlation = span(lags().map(|lag| lag.correlation), 2);
        table.row(vec![
            joint.to_owned(),
            span(lags().map(|lag| 1e3 * lag.seconds), 0),
            correlation,
            span(dead_times, 1),
        ]);
    }
    table
}

/// "21 .. 65", with this many decimals; a dash for nothing.
fn span(values: impl Iterator<Item = f64>, decimals: usize) -> String {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    let [low, high] = [low, high].map(|x| format!("{x:.decimals$}"));
    match low == high {
        _ if low.contains("inf") => "-".to_owned(),
        true => low,
        false => format!("{low} .. {high}"),
    }
}

/// How far runs of the same command differ.
fn repeatability(report: &RepeatReport, verbose: bool) {
    report.runs.iter().for_each(|runs| note(&format!("runs of one command: {}", runs.join(", "))));
    if !report.channels.is_empty() {
        let mut differ =
            Table::new(&["runs differ in", "unit", "by", "x noise floor", "offsets", "half below Hz", "most"]);
        for c in &report.channels {
            let most = c
                .regimes
                .first()
                .map_or_else(String::new, |most| format!("{} ({})", most.regime.words(), number(most.repeatability)));
            let times = number(c.repeatability / c.noise_floor);
            let numbers = [number(c.repeatability), times, number(c.offset), maybe(c.half_below_hz)];
            differ.row([c.channel.clone(), c.unit.clone()].into_iter().chain(numbers).chain([most]).collect());
        }
        table(&differ.columns(&[0, 1, 2, 3, 4]));
        if verbose {
            println!();
            table(&differ.columns(&[0, 5, 6]));
        }
    }
    for run in &report.outliers {
        let question = "was something else different?";
        let sentence =
            format!("{} differs far more from the others of its command in {}: {question}", run.log, run.channel);
        say(Tone::Doubtful, &sentence);
    }
    for drift in &report.drifts {
        let (logs, share) = (drift.logs.join(", "), 100.0 * drift.share);
        let sentence =
            format!("the runs {logs} change in one direction ({share:.0} % of what differs): does the robot warm up?");
        say(Tone::Doubtful, &sentence);
    }
    report.advice.iter().for_each(|advice| say(Tone::Plain, advice));
}

/// The identifiability of the free parameters.
fn identifiability(report: &IdentifiabilityReport) {
    if let Some(why) = &report.not_judged {
        return say(Tone::Plain, &format!("identifiability cannot be judged: {why}"));
    }
    let mut parameters = Table::new(&["parameter", "value", "unit", "sensitivity", "uncertainty left %"]);
    for p in &report.parameters {
        let left = format!("{:.1}", 100.0 * p.uncertainty_left);
        parameters.row(vec![p.name.clone(), number(p.value), p.unit.clone(), number(p.sensitivity), left]);
    }
    table(&parameters);
    note("sensitivity: noise floors per standard deviation of the prior");
    note("uncertainty left: the share of the prior's standard deviation that the logs leave");
    let (rank, of) = (report.rank, report.parameters.len());
    let condition = report.condition_number.map_or("infinite".to_owned(), number);
    say(Tone::Plain, &format!("rank {rank} of {of}, condition number {condition}"));
    if rank < of {
        note("a rank below full is not a defect of the logs: the prior decides what they do not identify");
    }
    report.null_directions.iter().for_each(|direction| say(Tone::Plain, &direction.sentence));
}
