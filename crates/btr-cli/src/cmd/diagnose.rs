//! `btr diagnose`: finds the missing physical effect.

use super::common;
use super::common::{announce, apart_from_progress, watch_for_interrupts, write_report, write_text};
use crate::args::{DiagnoseArgs, Global};
use crate::exit::{DONE, INTERRUPTED, MISSED};
use crate::status::Status;
use crate::terminal;
use crate::terminal::{Tone, note, say, table};
use btr_core::world::WorldError;
use btr_identify::LadderStep;
use btr_identify::diagnose::Verdict;
use btr_identify::fit::Degree;
use btr_identify::residual_model::{ResidualRequest, TimeStep};
use btr_io::{Mapping, Meta};
use btr_lab::failure::Failure;
use btr_lab::output::{OutputKind, Overwrite, guard, inputs};
use btr_lab::verbs;
use btr_lab::verbs::{DiagnoseReport, Support, VerbInput};
use btr_report::Subject;
use btr_report::fell::fell;
use btr_report::finding::{PROBABILITY, capped, evidence, helps, likelihood, rivals};
use btr_report::html;
use btr_report::table::{Table, number};
use btr_report::text::{alike, diagnose_command, findings, fit_command, stand_in, what_remains};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// A search that may take longer than this is announced, in min.
const WORTH_SAYING_MIN: f64 = 2.0;

pub(crate) fn run(args: &DiagnoseArgs, global: &Global) -> Result<u8, Failure> {
    let source = common::source_of(&args.logs_args.model, &args.logs_args.reading, global)?;
    let commands = OutputKind::Log(Overwrite::Commands).at(args.next.as_deref());
    let model = OutputKind::FittedModel.at(args.output.as_deref());
    let outputs = OutputKind::Report.at(args.logs_args.report.as_deref()).into_iter().chain(commands).chain(model);
    guard(outputs, inputs(&source, args.logs_args.all_logs()))?;
    let logs = [&args.logs_args.logs[..], &args.logs_args.held_out[..]];
    let (replays, doubts) = common::replays(&source, logs, &args.logs_args.reading, global)?;
    let input = VerbInput::of(source, replays)
        .and_then(|input| input.freezing(&args.logs_args.freeze))
        .map_err(|e| Failure::input(e, &doubts).of_simulated(&args.logs_args.model))?;
    let question = input.options(args.max_effects, args.max_rollouts);
    let unit = input.error_unit();
    forecast(&input, question.max_rollouts, global);
    let interrupted = watch_for_interrupts(|| "finishing with the best so far", Arc::default())?;
    let (flag, deadline) = (interrupted.clone(), args.max_time.map(|time| Instant::now() + time));
    let stop_signal =
        Arc::new(move || flag.load(Ordering::Relaxed) || deadline.is_some_and(|deadline| Instant::now() >= deadline));
    let status = Status::new("fitting the free parameters", global);
    let most = (question.max_rollouts < usize::MAX).then_some(question.max_rollouts_while_falling);
    status.count(input.problem.model(), most);
    let candidates = input.problem.candidates().len();
    let tell = |step: &LadderStep| {
        status.tell(step, unit);
        status.doing(&format!("trying {candidates} candidates, best {} x", number(step.train)));
    };
    let (report, diagnosed) = verbs::diagnose(&input, &input.problem, question, stop_signal, &tell)
        .map_err(|error| Failure::simulation_failure(&input, &error))?;
    if let Some(output) = &args.output {
        write_text(output, &input.diagnosed_text(&diagnosed, output.parent().unwrap_or(output))?)?;
    }
    let [logs, held_out] = input.logs_used();
    let subject = Subject { input: &input, logs: &logs, held_out: &held_out };
    let written = match &args.next {
        Some(path) => write_next(&report, path, &subject.input.source.parse()?.channels)?,
        None => None,
    };
    if let Some(path) = &args.logs_args.report {
        status.doing("drawing the report");
        write_report(path, &html::diagnose(&subject, &report, (&diagnosed.fit.u, diagnosed.step)))?;
    }
    drop(status);
    common::tell_judged(&report.doubts, global);
    if global.json {
        println!("{}", serde_json::json!(report));
    } else {
        apart_from_progress(global);
        show(&report, args, &subject, interrupted.load(Ordering::Relaxed));
    }
    announce(args.output.as_deref(), "the model as diagnosed", global);
    announce(args.logs_args.report.as_deref(), "the report", global);
    if let Some(what) = &written {
        announce(args.next.as_deref(), what, global);
    }
    if interrupted.load(Ordering::Relaxed) {
        return Ok(INTERRUPTED);
    }
    let met = args.expect.as_ref().is_none_or(|word| *word == word_of(report.verdict));
    Ok(if met { DONE } else { MISSED })
}

/// Says how long the search takes at most, where that is long: measured on one simulation of each training log.
fn forecast(input: &VerbInput, max_rollouts: usize, global: &Global) {
    if global.quiet || max_rollouts == usize::MAX {
        return;
    }
    let (problem, began) = (&input.problem, Instant::now());
    let nominal = vec![0.0; problem.parameters().len()];
    let logs: Vec<usize> = (0..problem.logs().len()).filter(|log| !problem.logs()[*log].held_out).collect();
    for &log in &logs {
        // A simulation that fails is told by the search.
        let _ = problem.residual(ResidualRequest::of(&nominal, log), TimeStep::USUAL);
    }
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let rollout_s = began.elapsed().as_secs_f64() / logs.len().max(1) as f64;
    let most_min = max_rollouts as f64 * rollout_s / threads as f64 / 60.0;
    if most_min > WORTH_SAYING_MIN {
        let rollout = format!("{max_rollouts} rollouts of {} s", number(rollout_s));
        eprintln!("at most {rollout}: {most_min:.0} min; --max-time ends the search earlier, with the best so far");
    }
}

/// Writes the commands of the next experiment, for `btr simulate --log` and for the robot, in the names and units in
/// which the model reads logs. What they are in words; `None` if there are none.
fn write_next(report: &DiagnoseReport, path: &Path, mapping: &Mapping) -> Result<Option<String>, Failure> {
    let rivals: Vec<&str> = report.support().flat_map(|support| &support.alike).map(String::as_str).collect();
    match report.next_experiment.as_ref().and_then(|next| next.commands.as_ref()) {
        Some(commands) => {
            let written = btr_io::as_mapped(path, commands, mapping).map_err(WorldError::from)?;
            btr_io::write_log(path, &written, &Meta::default())?;
            let units = if written.is_same(commands) { "in SI units" } else { "in the names and units of [channels]" };
            return Ok(Some(format!(
                "the commands of the next experiment, {units}, for the robot and for simulate --log"
            )));
        }
        None if rivals.is_empty() => eprintln!("{} was not written: there are no effects to separate", path.display()),
        None => eprintln!(
            "{} was not written: no motion in the range of these logs separates what was found from {}",
            path.display(),
            rivals.join(", ")
        ),
    }
    Ok(None)
}

fn word_of(verdict: Verdict) -> String {
    serde_json::json!(verdict).as_str().unwrap_or_default().to_owned()
}

fn show(report: &DiagnoseReport, args: &DiagnoseArgs, subject: &Subject, interrupted: bool) {
    let so_far = if report.cut_short { "cut short; so far: " } else { "" };
    say(Tone::Lead, &format!("{so_far}{}", sentence(report)));
    if report.cut_short {
        say(Tone::Doubtful, &stopped(report, args, interrupted));
    }
    let plain = |sentence: &String| say(Tone::Plain, sentence);
    report.shows_noise().iter().for_each(plain);
    report.shows_left_over().iter().for_each(plain);
    report.stand_ins.iter().map(stand_in).for_each(|sentence| plain(&sentence));
    report.shows_where_judged().iter().for_each(plain);
    common::show_reserve(&report.doubts, &report.not_judged);
    btr_report::text::given(&report.frozen, &report.with_prior).iter().for_each(|sentence| note(sentence));
    println!();
    table(&common::table(&report.error_ladder, subject.input.error_unit()));
    found(report);
    law(report);
    if let Some(next) = &report.next_experiment {
        say(Tone::Plain, &format!("\nnext experiment: {}", next.sentence));
        if args.next.is_none() {
            note("`--next FILE.csv` writes its commands, for `btr simulate --log` and for the robot");
        }
    }
    println!();
    note(&btr_report::text::floors(&report.noise_floor));
    common::show_repeatability(&report.noise_floor, &report.remaining);
    note(&btr_report::text::integrator(report.integrator_error, report.time_step_s));
    btr_report::bounds::about_bounds(report).iter().for_each(|sentence| say(Tone::Doubtful, sentence));
    btr_report::text::removable(&report.without_effect).iter().for_each(|sentence| note(sentence));
    note(&format!("{} rollouts in {} s", report.rollouts, number(report.seconds)));
    let on = diagnose_command(report, subject, args.output.as_deref());
    if let Some(command) = on.or_else(|| fit_command(report, subject)) {
        terminal::show(Tone::Plain, &format!("\nnext: {command}"));
    }
}

/// What was found, with its evidence and its values.
fn found(report: &DiagnoseReport) {
    for effect in &report.effects {
        let fell = fell(report, &effect.names());
        finding(&format!("{}@{}", effect.effect, effect.site), &effect.support, fell.as_deref());
        let mut values = Table::new(&btr_report::text::ESTIMATES);
        effect.parameters.iter().for_each(|estimate| values.row(btr_report::text::estimate(estimate)));
        table(&values);
    }
    for value in &report.wrong_values {
        let fell = fell(report, &[format!("{}@{}", value.value, value.site)]);
        finding(&format!("{} of {}", value.value, value.site), &value.support, fell.as_deref());
        let mut values = Table::new(&btr_report::text::CORRECTED);
        value.parameters.iter().for_each(|corrected| values.row(btr_report::text::corrected(corrected)));
        table(&values);
        value.parameters.iter().filter_map(btr_report::text::remedy).for_each(|remedy| say(Tone::Plain, &remedy));
    }
    if report.support().next().is_some() {
        note(PROBABILITY);
    }
}

/// That the search had not finished, and at which limit.
fn stopped(report: &DiagnoseReport, args: &DiagnoseArgs, interrupted: bool) -> String {
    let limit = match (args.max_time, args.max_rollouts) {
        _ if interrupted => "by an interrupt".to_owned(),
        (Some(time), _) if report.seconds >= time.as_secs_f64() => "at --max-time".to_owned(),
        (_, Some(most)) => format!("at --max-rollouts {most}"),
        (_, None) => {
            format!("after {} rollouts, about the usual number (--max-rollouts sets another)", report.rollouts)
        }
    };
    format!("the search was stopped {limit}: what it had not tried yet may explain the logs as well, or better")
}

/// A finding and what speaks for it.
fn finding(name: &str, support: &Support, fell: Option<&str>) {
    let (sure, delta) = (likelihood(support), number(support.delta_bic));
    say(Tone::Lead, &format!("\n{name}   probability {sure}   delta BIC {delta}"));
    if !support.alike.is_empty() {
        say(Tone::Doubtful, &format!("  these logs cannot tell it from: {}", support.alike.join(", ")));
    }
    capped(support).iter().for_each(|why| say(Tone::Doubtful, &format!("  {why}")));
    rivals(support).iter().for_each(|who| say(Tone::Plain, &format!("  {who}")));
    say(Tone::Plain, &format!("  {}", evidence(support, fell)));
}

fn sentence(report: &DiagnoseReport) -> String {
    let (effects, values) = findings(report);
    let share = format!("{:.0} % of the squared error is not noise", 100.0 * report.unexplained_share);
    let (effects, values) = (effects.join("; "), values.join("; "));
    let both = match (effects.is_empty(), values.is_empty()) {
        (false, true) => format!("missing: {effects}"),
        (true, false) => format!("wrong in the model: {values}"),
        _ => format!("missing: {effects}; wrong in the model: {values}"),
    };
    let helping: Vec<&str> = [&*effects, &*values].into_iter().filter(|names| !names.is_empty()).collect();
    match (report.verdict, helping.is_empty()) {
        (Verdict::EffectMissing | Verdict::ValueWrong, _) => {
            format!("{both}{}{}", unsure(report), to_repeatability(report))
        }
        (Verdict::PartlyExplained, _) => format!("partly explained: {both}; something else is missing: {share}"),
        (Verdict::NothingMissing, _) => {
            format!("nothing is missing{}: {}", judged(report), what_remains(report.degree))
        }
        (Verdict::Unexplained, true) if report.cut_short => {
            format!("unexplained: nothing that was tried helps; {share}")
        }
        (Verdict::Unexplained, true) => format!("unexplained: no effect of the library helps; {share}"),
        (Verdict::Unexplained, false) => {
            format!("unexplained: {} {} explain the error; {share}", helping.join("; "), helps(report))
        }
    }
}

/// Where runs of the same command limit what can be explained.
fn to_repeatability(report: &DiagnoseReport) -> String {
    match report.degree {
        Degree::ExplainedToRepeatability => format!("; {}", what_remains(report.degree)),
        _ => String::new(),
    }
}

/// Where a name is not nearly certain: which others it may be.
fn unsure(report: &DiagnoseReport) -> String {
    alike(report, |support| support.probability < 0.8).iter().map(|sentence| format!("; {sentence}")).collect()
}

/// The joints that a verdict is about, where these are not all.
fn judged(report: &DiagnoseReport) -> String {
    if report.not_judged.is_empty() {
        return String::new();
    }
    let joints = report.noise_floor.iter().filter_map(|floor| floor.channel.split_once('_').map(|(_, joint)| joint));
    let judged: Vec<&str> = joints.filter(|joint| !report.not_judged.iter().any(|other| other == joint)).collect();
    format!(" on {}", judged.join(", "))
}

/// What the error looks like, ready to be pasted into the model.
fn law(report: &DiagnoseReport) {
    let Some(law) = &report.residual_law else { return };
    let beside = if law.beside.is_empty() { String::new() } else { format!(" beside {}", law.beside.join(", ")) };
    let share = format!("{:.0} % of the squared error above the noise", 100.0 * law.explains);
    say(Tone::Plain, &format!("\nthe error looks like this law{beside}; it explains {share} on held-out data:\n"));
    terminal::show(Tone::Plain, &law.toml);
}
