//! `btr compare`: shows where a model fails.

use super::common;
use super::common::{announce, write_report};
use crate::args::{CompareArgs, Global};
use crate::exit::{DONE, MISSED};
use btr_lab::failure::Failure;
use btr_lab::output::{OutputKind, guard, inputs};
use btr_lab::verbs;
use btr_lab::verbs::CompareReport;
use btr_report::html;
use btr_report::table::Table;
use btr_report::text::{CHANNEL_HEADER, LEGEND, about_the_step, channel_rows};

/// Error in noise floors above which a channel's residual is more than noise.
const LOUD: f64 = 2.0;
/// Number of failures in the terminal; `-v` and `--json` show all.
const SHOWN: usize = 8;

pub(crate) fn run(args: &CompareArgs, global: &Global) -> Result<u8, Failure> {
    if let Some(gate) = args.max_chi.filter(|gate| !(*gate > 0.0 && gate.is_finite())) {
        return Err(Failure::usage(format!("--max-chi {gate} must be a positive number")));
    }
    let source = common::source_of(&args.model, &args.reading, global)?;
    guard(OutputKind::Report.at(args.report.as_deref()), inputs(&source, args.logs.iter().cloned()))?;
    let (replays, doubts) = common::replays(&source, [&args.logs, &[]], &args.reading, global)?;
    let outcome =
        verbs::compare(&source, replays).map_err(|e| Failure::input(e, &doubts).of_simulated(&source.path))?;
    if let Some(path) = &args.report {
        write_report(path, &html::compare(&outcome))?;
    }
    if global.json {
        println!("{}", outcome.document());
    } else {
        println!("{}", text(&outcome, if global.verbose { usize::MAX } else { SHOWN }));
    }
    announce(args.report.as_deref(), "the report", global);
    let worst = outcome.comparison.worst().map_or(0.0, |channel| channel.chi);
    let missed = args.max_chi.is_some_and(|gate| worst > gate);
    Ok(if missed { MISSED } else { DONE })
}

fn text(outcome: &CompareReport, most: usize) -> String {
    let mut channels = Table::new(&CHANNEL_HEADER);
    channel_rows(outcome).into_iter().for_each(|row| channels.row(row));
    let failures = outcome.comparison.failures();
    // Regimes are classified by positions; a torque can be wrong where no position is.
    let loud = outcome.comparison.worst().filter(|channel| channel.chi > LOUD).map(|channel| {
        format!(
            "No joint's position fails in any regime, but the error of {} is {:.1} noise floors.",
            channel.name, channel.chi
        )
    });
    let mut lines = vec![channels.render(), String::new()];
    lines.extend(LEGEND.map(str::to_owned));
    lines.extend(btr_report::text::runs_differ(outcome));
    let not_judged = outcome.replays.not_judged();
    if !not_judged.is_empty() {
        lines.push(btr_report::text::unmeasured(&not_judged));
    }
    lines.push(String::new());
    match failures.len() {
        0 if loud.is_some() => lines.extend(loud),
        0 => lines.push("No joint fails in any regime: the residual is noise.".to_owned()),
        n if n > most => lines.push(format!("Where it fails ({most} of {n}; -v shows all)")),
        _ => lines.push("Where it fails".to_owned()),
    }
    for cell in failures.iter().take(most) {
        let share = format!("{:.0} % of the squared error", 100.0 * cell.share);
        lines.push(format!("  {}", cell.hint));
        lines.push(format!("    {share}; most of it in {}, at {:.2} to {:.2} s", cell.log, cell.t0_s, cell.t1_s));
    }
    lines.extend(about_the_step(outcome).map(|step| format!("\n{step}")));
    lines.join("\n")
}
