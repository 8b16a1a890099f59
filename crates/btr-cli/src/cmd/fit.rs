//! `btr fit`: fits the free parameters of a model and prints their estimates.

use super::common;
use super::common::{announce, apart_from_progress, write_report, write_text};
use crate::args::{FitArgs, Global};
use crate::exit::DONE;
use crate::status::Status;
use crate::terminal::{Tone, names_last, note, say, table};
use btr_identify::residual_model::ResidualModel;
use btr_lab::experiment::Source;
use btr_lab::failure::Failure;
use btr_lab::output::{OutputKind, guard, inputs};
use btr_lab::verbs;
use btr_lab::verbs::{BaseReport, ErrorUnit, FitOptions, FitReport, StartModel, VerbInput};
use btr_report::Subject;
use btr_report::base_parameters;
use btr_report::html;
use btr_report::table::{Table, number};

pub(crate) fn run(args: &FitArgs, global: &Global) -> Result<u8, Failure> {
    let input = input_of(args, global)?;
    tell_unstated(&input, args, global);
    let unit = input.error_unit();
    let before = input.before.as_ref().map(|before| &before.problem as &dyn ResidualModel);
    let free = input.problem.free().len();
    let status = Status::new(&format!("fitting {free} free parameters"), global);
    status.count(input.problem.model(), None);
    let tell = |step: &_| status.tell(step, unit);
    let (mut report, fit, step) = verbs::fit(&input, &input.problem, before, &tell)
        .map_err(|error| Failure::simulation_failure(&input, &error))?;
    if args.base_parameters {
        status.doing("estimating the base parameters");
        let base = verbs::base_parameters(&input, &fit, step)
            .map_err(|e| Failure::input(e, &input.doubts).of_simulated(&args.logs_args.model))?;
        report.base_parameters = Some(base);
    }
    if let Some(output) = &args.output {
        let into = output.parent().unwrap_or(output);
        let text =
            input.fitted_text(&report, &fit, step, into).map_err(|e| Failure::new("file", e.to_string(), None))?;
        write_text(output, &text)?;
    }
    if let Some(path) = &args.logs_args.report {
        status.doing("drawing the report");
        let [logs, held_out] = input.logs_used();
        let subject = Subject { input: &input, logs: &logs, held_out: &held_out };
        write_report(path, &html::fit(&subject, &report, (&fit.u, step)))?;
    }
    drop(status);
    common::tell_judged(&report.doubts, global);
    if global.json {
        println!("{}", serde_json::json!(report));
    } else {
        apart_from_progress(global);
        show(&report, unit);
        if args.output.is_none() {
            println!("not saved: give -o FILE");
        }
    }
    announce(args.output.as_deref(), "the fitted model", global);
    announce(args.logs_args.report.as_deref(), "the report", global);
    Ok(DONE)
}

/// The model and the logs, with what is added, frozen and begun at; checks that the outputs can be written.
fn input_of(args: &FitArgs, global: &Global) -> Result<VerbInput, Failure> {
    let FitArgs { logs_args, add, from, base_parameters, output } = args;
    let source = common::source_of(&logs_args.model, &logs_args.reading, global)?;
    let start = from.as_ref().map(|path| StartModel::new(Source::read(path)?)).transpose()?;
    let outputs = OutputKind::Report.at(logs_args.report.as_deref()).into_iter();
    let outputs = outputs.chain(OutputKind::FittedModel.at(output.as_deref()));
    guard(outputs, inputs(&source, logs_args.all_logs().chain(from.clone())))?;
    let source = match &start {
        Some(start) => start.completing(source)?,
        None => source,
    };
    let logs = [&logs_args.logs[..], &logs_args.held_out[..]];
    let (replays, doubts) = common::replays(&source, logs, &logs_args.reading, global)?;
    let refused = |error| Failure::input(error, &doubts).of_simulated(&logs_args.model);
    let options = FitOptions { add, freeze: &logs_args.freeze, start: start.as_ref() };
    let input = VerbInput::to_fit(source, replays, options).map_err(refused)?;
    if *base_parameters {
        input.check_base_parameters().map_err(refused)?;
    } else if let Some(failure) = Failure::nothing_to_fit(&input) {
        return Err(failure);
    }
    Ok(input)
}

/// Says which parameters begin at the model's values, where another model states the others.
fn tell_unstated(input: &VerbInput, args: &FitArgs, global: &Global) {
    let unstated = input.unstated();
    if let Some(start) = args.from.as_ref().filter(|_| !unstated.is_empty() && !global.quiet) {
        eprintln!("{} does not state {}: begun as without it", start.display(), unstated.join(", "));
    }
}

fn show(report: &FitReport, unit: ErrorUnit) {
    table(&common::table(&report.error_ladder, unit));
    println!();
    if !report.parameters.is_empty() {
        let mut estimates = Table::new(&btr_report::text::FITTED);
        report.parameters.iter().for_each(|estimate| estimates.row(btr_report::text::fitted(report, estimate)));
        table(&estimates);
    }
    if report.parameters.iter().any(|estimate| report.has_moved(estimate)) {
        note("moved: the value in the model lies outside the 95 % interval");
    }
    btr_report::text::given(&report.frozen, &report.with_prior).iter().for_each(|sentence| note(sentence));
    if report.parameters.iter().any(|estimate| estimate.by_bounds && !estimate.at_bound) {
        note("\nby its bounds: the interval follows from the bounds; the logs alone determine less");
    }
    if let Some(why) = report.withheld.as_ref().filter(|_| !report.parameters.is_empty()) {
        say(Tone::Doubtful, &format!("\nno intervals: {why}; `btr diagnose` looks for it"));
    }
    common::show_reserve(&report.doubts, &report.not_judged);
    let is_idle = |sentence: &String| note(&format!("\n{sentence}"));
    btr_report::text::removable(&report.without_effect).iter().for_each(is_idle);
    for direction in &report.null_directions {
        say(Tone::Plain, &format!("\n{}", direction.sentence));
    }
    report.base_parameters.iter().for_each(show_base);
    btr_report::text::moved_by_noise(report).iter().for_each(|sentence| say(Tone::Plain, &format!("\n{sentence}")));
    println!();
    note(&btr_report::text::floors(&report.noise_floor));
    common::show_repeatability(&report.noise_floor, &report.remaining);
    note(&btr_report::text::integrator(report.integrator_error, report.time_step_s));
    note(&format!("{} rollouts in {} s", report.rollouts, number(report.seconds)));
}

fn show_base(report: &BaseReport) {
    println!();
    names_last(&base_parameters::combinations(report));
    println!();
    table(&base_parameters::remaining(report));
    println!();
    base_parameters::sentences(report).iter().for_each(|sentence| say(Tone::Plain, sentence));
    if let Some(possible) = &report.possible {
        say(Tone::Plain, &format!("\n{}\n", base_parameters::can_be(possible)));
        table(&base_parameters::possible(possible));
    }
}
