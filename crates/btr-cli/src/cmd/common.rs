//! What several verbs share: reading the model and the logs, showing the error ladder, writing files.

use crate::args::{Global, Reading};
use crate::exit::INTERRUPTED;
use crate::status::Status;
use crate::terminal;
use crate::terminal::{Tone, complain, note, say};
use btr_core::log::Log;
use btr_identify::LadderStep;
use btr_identify::fit::RemainingError;
use btr_identify::quality::{Finding, Severity};
use btr_io::{IoError, Mapping, Warning, write_whole};
use btr_lab::execution::ExecutionContext;
use btr_lab::experiment;
use btr_lab::experiment::{LeftOutLog, LogSource, Replays, Source};
use btr_lab::failure::Failure;
use btr_lab::verbs;
use btr_lab::verbs::{CommonFinding, Doubt, ErrorUnit, NoiseFloor};
use btr_report::table::{Table, number};
use std::cell::Cell;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether a path stands for the standard input.
fn is_stdin(path: &Path) -> bool {
    path == Path::new("-")
}

/// The log at a path; `-` is the standard input.
pub(crate) fn log_at(path: &Path) -> LogSource {
    if is_stdin(path) { LogSource::Stdin } else { LogSource::File(path.to_owned()) }
}

/// Reads a log, without a robot; its columns mean what the mapping says.
pub(crate) fn read_log(path: &Path, mapping: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
    match log_at(path) {
        source @ LogSource::Stdin => btr_io::read_stream(source.path(), std::io::stdin().lock(), mapping),
        _ => btr_io::read_log(path, mapping),
    }
}

/// The model's text with the settings of the command line.
pub(crate) fn source(model: &Path, global: &Global) -> Result<Source, Failure> {
    let mut source = if is_stdin(model) { Source::read_stdin()? } else { Source::read(model)? };
    source.set(&global.settings)?;
    Ok(source)
}

/// The same for a verb that reads logs.
pub(crate) fn source_of(model: &Path, reading: &Reading, global: &Global) -> Result<Source, Failure> {
    let mut source = source(model, global)?;
    if reading.keep_glitches {
        source.set(&["channels.keep_glitches=true".to_owned()])?;
    }
    Ok(source)
}

fn reading_of(logs: usize) -> String {
    if logs == 1 { "reading the log".to_owned() } else { format!("reading {logs} logs") }
}

/// Reads the logs.
pub(crate) fn read(
    source: &Source,
    logs: [&[PathBuf]; 2],
    reading: &Reading,
    global: &Global,
) -> Result<Replays, Failure> {
    let of = logs[0].len() + logs[1].len();
    let status = Status::new(&reading_of(of), global);
    let begun = Cell::new(0);
    let on_log = |path: &Path| {
        begun.set(begun.get() + 1);
        status.doing(&format!("reading log {} of {of}: {}", begun.get(), path.display()));
    };
    let [training, held_out] = logs.map(|logs| logs.iter().map(|path| log_at(path)).collect::<Vec<_>>());
    Ok(experiment::replays_of(source, &training, &held_out, reading.damaged(), &on_log)?)
}

/// Reads the logs and prints on stderr which were left out, warnings and findings.
pub(crate) fn replays(
    source: &Source,
    [training, held_out]: [&[PathBuf]; 2],
    reading: &Reading,
    global: &Global,
) -> Result<(Replays, Vec<Doubt>), Failure> {
    let replays = read(source, [training, held_out], reading, global)?;
    let doubts = verbs::doubts(&replays);
    tell_left_out(&replays.left_out, global);
    if !global.quiet {
        replays.warnings.iter().for_each(|warning| complain(Tone::Doubtful, "warning", warning));
        tell_doubts(&replays, &doubts);
    }
    Ok((replays, doubts))
}

/// Prints findings on stderr that could only be judged beside a simulation.
pub(crate) fn tell_judged(doubts: &[Doubt], global: &Global) {
    for Doubt { log, finding } in doubts.iter().filter(|doubt| doubt.awaits_a_model() && !global.quiet) {
        let word = btr_report::text::word(finding.severity);
        complain(finding.severity.into(), word, &format!("{log}: {}", finding.sentence));
    }
}

/// Prints findings on stderr, but those that a simulation may dispel; those that several joints have in common once.
fn tell_doubts(replays: &Replays, doubts: &[Doubt]) {
    let joints = replays.model.robot.movable().count();
    let findings: Vec<&Finding> = doubts.iter().map(|doubt| &doubt.finding).collect();
    let common = verbs::in_common(&findings, joints);
    for CommonFinding { severity, sentence, fix, .. } in &common {
        complain((*severity).into(), btr_report::text::word(*severity), &format!("{sentence}\n{fix}"));
    }
    let apart = |doubt: &&Doubt| common.iter().all(|common| !common.covers(&doubt.finding));
    for Doubt { log, finding } in doubts.iter().filter(apart).filter(|doubt| !doubt.awaits_a_model()) {
        let word = btr_report::text::word(finding.severity);
        complain(finding.severity.into(), word, &format!("{log}: {}", finding.sentence));
    }
}

/// What several joints have in common, and the lines that mend it.
pub(crate) fn show_in_common(common: &[CommonFinding]) {
    for CommonFinding { severity, sentence, fix, .. } in common {
        say((*severity).into(), &format!("{}: {sentence}\n", btr_report::text::word(*severity)));
        terminal::show(Tone::Plain, &format!("{fix}\n"));
    }
}

/// Prints on stderr which logs were left out.
pub(crate) fn tell_left_out(left_out: &[LeftOutLog], global: &Global) {
    if !global.quiet {
        left_out.iter().for_each(|log| eprintln!("{}", btr_report::text::left_out(log)));
    }
}

/// Handles Ctrl-C and SIGTERM: the first one sets the flag, interrupts the work and says what is done then, the
/// second one stops as soon as no program moves the robot.
pub(crate) fn watch_for_interrupts(
    then: impl Fn() -> &'static str + Send + 'static,
    context: Arc<ExecutionContext>,
) -> Result<Arc<AtomicBool>, Failure> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = interrupted.clone();
    ctrlc::set_handler(move || {
        context.interrupt();
        if flag.swap(true, Ordering::Relaxed) {
            // Held until the end, so that no program begins to.
            let _robot = context.robot();
            std::process::exit(i32::from(INTERRUPTED));
        }
        // In the place of a status line. The terminal may be gone.
        let over = if std::io::stderr().is_terminal() { "\r\x1b[2K" } else { "\n" };
        let _ = writeln!(std::io::stderr(), "{over}{}; press again to stop at once", then());
    })
    .map_err(|e| Failure::new("signal", e.to_string(), None))?;
    Ok(interrupted)
}

/// An empty line between the steps that were told on stderr and the result; none where these were not told.
pub(crate) fn apart_from_progress(global: &Global) {
    if !global.quiet {
        println!();
    }
}

/// The error ladder as a table.
pub(crate) fn table(ladder: &[LadderStep], unit: ErrorUnit) -> Table {
    let mut table = Table::new(&["step", &format!("error (x {})", unit.name()), "held out"]);
    for step in ladder {
        let held_out = step.held_out.map_or("-".to_owned(), number);
        table.row(vec![step.step.clone(), number(step.train), held_out]);
    }
    table
}

/// Where runs of the same command count: how far they differ, and what is left beside that and the noise.
pub(crate) fn show_repeatability(floors: &[NoiseFloor], remaining: &[RemainingError]) {
    let Some(sentence) = btr_report::text::repeatability(floors) else { return };
    note(&sentence);
    let mut left_over = Table::new(&btr_report::text::REMAINING);
    remaining.iter().for_each(|left| left_over.row(btr_report::text::remaining(left)));
    println!();
    terminal::table(&left_over);
}

/// Reservations about a result: joints that were not judged, and findings about the logs.
pub(crate) fn show_reserve(doubts: &[Doubt], not_judged: &[String]) {
    let tone = doubts.iter().map(|doubt| doubt.finding.severity).max().unwrap_or(Severity::Doubtful).into();
    btr_report::text::reserve(doubts, not_judged).iter().for_each(|sentence| say(tone, sentence));
}

/// Writes a text file, whole or not at all.
pub(crate) fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    write_whole(path, |out| out.write_all(text.as_bytes()))
        .map_err(|source| Failure::from(IoError::File { path: path.to_owned(), source }))
}

/// Writes a report.
pub(crate) fn write_report(path: &Path, page: &str) -> Result<(), Failure> {
    btr_report::html::write(path, page).map_err(|error| btr_lab::output::unwritable(&error))
}

/// Prints the path of a written file below the result.
pub(crate) fn announce(path: Option<&Path>, what: &str, global: &Global) {
    if let Some(path) = path.filter(|_| !global.quiet && !global.json) {
        println!("\n{}: {what}", path.display());
    }
}
