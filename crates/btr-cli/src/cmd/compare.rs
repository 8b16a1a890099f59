//! `btr compare`: shows where a model fails.

use super::common;
use super::common::{announce, write_report};
use crate::args::{CompareArgs, Global};
use crate::exit::{DONE, MISSED};
use crate::status::Status;
use crate::terminal::{Tone, note, say, table};
use btr_core::world::WorldError;
use btr_lab::failure::Failure;
use btr_lab::output::{OutputKind, guard, inputs, unwritable};
use btr_lab::verbs;
use btr_lab::verbs::{CompareReport, Doubt};
use btr_report::html;
use btr_report::table::Table;
use btr_report::text::{CHANNEL_COLUMNS, CHANNEL_HEADER, FURTHER_LEGEND, LEGEND, about_the_step, channel_rows};

/// Number of sentences of the verdict; `-v` and `--json` show all.
const SENTENCES: usize = 5;
/// Number of regimes of each joint; `-v` and `--json` show all.
const OF_EACH_JOINT: usize = 2;
/// What is said of the file with both robots.
const OVERLAY: &str = "the measured and the simulated robot, for viewers
  Rerun opens it as it is; Foxglove has a layout for it, examples/overlay.foxglove-layout.json (docs/howto/compare.md)";

pub(crate) fn run(args: &CompareArgs, global: &Global) -> Result<u8, Failure> {
    if let Some(gate) = args.max_chi.filter(|gate| !(*gate > 0.0 && gate.is_finite())) {
        return Err(Failure::usage(format!("--max-chi {gate} must be a positive number")));
    }
    let source = common::source_of(&args.model, &args.reading, global)?;
    let overlay = OutputKind::Overlay.at(args.output.as_deref());
    let outputs = OutputKind::Report.at(args.report.as_deref()).into_iter().chain(overlay);
    guard(outputs, inputs(&source, args.logs.iter().cloned()))?;
    let (replays, doubts) = common::replays(&source, [&args.logs, &[]], &args.reading, global)?;
    let of = replays.logs.len();
    let status = Status::new("simulating the logs", global);
    let on_log = |begun: usize, log: &str| status.doing(&format!("simulating log {} of {of}: {log}", begun + 1));
    let outcome =
        verbs::compare(&source, replays, &on_log).map_err(|e| Failure::input(e, &doubts).of_simulated(&source.path))?;
    status.doing("comparing");
    if let Some(path) = &args.report {
        status.doing("drawing the report");
        write_report(path, &html::compare(&outcome))?;
    }
    if let Some(path) = &args.output {
        let overlay = outcome.overlay().map_err(WorldError::from)?;
        btr_io::write_overlay(path, &overlay).map_err(|error| unwritable(&error))?;
    }
    drop(status);
    let joints = outcome.verdict().joints;
    let explains = |joint: &str| joints.iter().any(|other| other.joint == joint && other.sentence.is_none());
    let left: Vec<Doubt> = doubts.into_iter().filter(|doubt| !doubt.is_dispelled(explains)).collect();
    common::tell_judged(&left, global);
    if global.json {
        println!("{}", outcome.document());
    } else {
        show(&outcome, global.verbose);
    }
    announce(args.report.as_deref(), "the report", global);
    announce(args.output.as_deref(), OVERLAY, global);
    let worst = outcome.comparison.worst().map_or(0.0, |channel| channel.chi);
    let missed = args.max_chi.is_some_and(|gate| worst > gate);
    Ok(if missed { MISSED } else { DONE })
}

fn show(outcome: &CompareReport, verbose: bool) {
    verdict(&outcome.verdict().sentences, verbose);
    println!();
    channels(outcome, verbose);
    btr_report::text::runs_differ(outcome).iter().for_each(|sentence| note(sentence));
    let not_judged = outcome.replays.not_judged();
    if !not_judged.is_empty() {
        say(Tone::Doubtful, &btr_report::text::unmeasured(&not_judged));
    }
    map(outcome, verbose);
    if let Some(step) = about_the_step(outcome) {
        println!();
        note(&step);
    }
}

fn verdict(sentences: &[String], verbose: bool) {
    let shown = if verbose { sentences.len() } else { SENTENCES };
    sentences.iter().take(shown).for_each(|sentence| say(Tone::Lead, sentence));
    if sentences.len() > shown {
        say(Tone::Lead, &format!("and {} more; -v shows all", sentences.len() - shown));
    }
}

fn channels(outcome: &CompareReport, verbose: bool) {
    let mut channels = Table::new(&CHANNEL_HEADER);
    channel_rows(outcome).into_iter().for_each(|row| channels.row(row));
    let [first, further] = CHANNEL_COLUMNS;
    table(&channels.columns(first));
    LEGEND.iter().for_each(|line| note(line));
    if verbose {
        println!();
        table(&channels.columns(further));
        FURTHER_LEGEND.iter().for_each(|line| note(line));
    }
}

/// Where the model fails: the regimes of motion that say most of each joint.
fn map(outcome: &CompareReport, verbose: bool) {
    let all = outcome.comparison.failures();
    let telling = outcome.most_telling(OF_EACH_JOINT);
    let cells = if verbose { &all } else { &telling };
    if cells.is_empty() {
        return;
    }
    let more = if cells.len() < all.len() { format!(" (-v shows all {})", all.len()) } else { String::new() };
    println!("\nWhere it fails{more}");
    for cell in cells {
        let share = format!("{:.0} % of the squared error", 100.0 * cell.share);
        say(Tone::Plain, &format!("  {}", cell.hint));
        note(&format!("    {share}; most of it in {}, at {:.2} to {:.2} s", cell.log, cell.t0_s, cell.t1_s));
    }
}
