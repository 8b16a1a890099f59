//! `btr check`: the quality of logs, and which free parameters they identify.

use super::common;
use crate::args::{CheckArgs, Global};
use crate::exit::{DONE, MISSED};
use btr_identify::quality::Severity;
use btr_lab::experiment::CheckedLog;
use btr_lab::failure::Failure;
use btr_lab::verbs;
use btr_lab::verbs::{IdentifiabilityReport, RepeatReport};
use btr_report::table::{Table, maybe, number};
use btr_report::text::word;

pub(crate) fn run(args: &CheckArgs, global: &Global) -> Result<u8, Failure> {
    let source = common::source_of(&args.model, &args.reading, global)?;
    let replays = common::read(&source, [&args.logs, &[]], &args.reading)?;
    let report = verbs::check(replays);
    common::tell_left_out(&report.left_out, global);
    if global.json {
        println!("{}", report.document());
    } else {
        report.warnings.iter().filter(|_| !global.quiet).for_each(|warning| eprintln!("warning: {warning}"));
        report.logs.iter().for_each(|log| println!("{}\n", text(log, global.verbose)));
        println!("{}\n", repeatability(&report.repeatability));
        println!("{}", identifiability(&report.identifiability));
    }
    let bad = !report.left_out.is_empty() || report.logs.iter().any(|log| log.quality.worst() == Severity::Bad);
    Ok(if bad { MISSED } else { DONE })
}

fn text(CheckedLog { log, quality }: &CheckedLog, verbose: bool) -> String {
    let mut lines = vec![format!("{log}: {}", word(quality.worst()))];
    lines.extend(quality.findings.iter().map(|f| format!("  {:<9} {}", word(f.severity), f.sentence)));
    if verbose {
        let mut table = Table::new(&["channel", "unit", "min", "max", "noise", "step", "missing %"]);
        for s in &quality.sensors {
            let numbers = [number(s.min), number(s.max), maybe(s.noise), maybe(s.quantum), number(100.0 * s.missing)];
            table.row([s.name.clone(), s.unit.clone()].into_iter().chain(numbers).collect());
        }
        lines.push(table.render());
    }
    lines.join("\n")
}

/// How far runs of the same command differ.
fn repeatability(report: &RepeatReport) -> String {
    let mut lines: Vec<String> =
        report.runs.iter().map(|runs| format!("runs of one command: {}", runs.join(", "))).collect();
    if !report.channels.is_empty() {
        let mut table =
            Table::new(&["runs differ in", "unit", "by", "x noise floor", "offsets", "half below Hz", "most"]);
        for c in &report.channels {
            let most = c
                .regimes
                .first()
                .map_or_else(String::new, |most| format!("{} ({})", most.regime.words(), number(most.repeatability)));
            let times = number(c.repeatability / c.noise_floor);
            let numbers = [number(c.repeatability), times, number(c.offset), maybe(c.half_below_hz)];
            table.row([c.channel.clone(), c.unit.clone()].into_iter().chain(numbers).chain([most]).collect());
        }
        lines.push(table.render());
    }
    lines.extend(report.outliers.iter().map(|run| {
        format!(
            "{} differs far more from the others of its command in {}: was something else different?",
            run.log, run.channel
        )
    }));
    lines.extend(report.drifts.iter().map(|drift| {
        format!(
            "the runs {} change in one direction ({:.0} % of what differs): does the robot warm up?",
            drift.logs.join(", "),
            100.0 * drift.share
        )
    }));
    lines.extend(report.advice.clone());
    lines.join("\n")
}

/// The identifiability of the free parameters.
fn identifiability(report: &IdentifiabilityReport) -> String {
    if let Some(why) = &report.not_judged {
        return format!("identifiability cannot be judged: {why}");
    }
    let mut table = Table::new(&["parameter", "value", "unit", "sensitivity", "uncertainty left %"]);
    for p in &report.parameters {
        let left = format!("{:.1}", 100.0 * p.uncertainty_left);
        table.row(vec![p.name.clone(), number(p.value), p.unit.clone(), number(p.sensitivity), left]);
    }
    let mut lines = vec![table.render()];
    lines.push("sensitivity: noise floors per standard deviation of the prior".to_owned());
    let (rank, of) = (report.rank, report.parameters.len());
    let condition = report.condition_number.map_or("infinite".to_owned(), number);
    lines.push(format!("rank {rank} of {of}, condition number {condition}"));
    if rank < of {
        lines.push(
            "a rank below full is not a defect of the logs: the prior decides what they do not identify".to_owned(),
        );
    }
    lines.extend(report.null_directions.iter().map(|direction| direction.sentence.clone()));
    lines.join("\n")
}
