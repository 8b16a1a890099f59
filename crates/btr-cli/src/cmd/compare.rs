//! `btr compare`: where a model fails.

use super::ladder;
use super::output::{Kind, announce, guard, inputs, write_report};
use crate::args::{Compare, Global};
use crate::failure::{DONE, Failure, MISSED};
use crate::report;
use crate::table::{Table, maybe, number};
use btr_identify::compare::ChannelError;
use btr_identify::residual_model::Step;
use btr_lab::verbs;
use btr_lab::verbs::Compared;

/// A channel that errs by more noise floors is not only noise.
const LOUD: f64 = 2.0;
/// Failures in the terminal; `-v` and `--json` have all.
const SHOWN: usize = 8;

pub(crate) fn run(args: &Compare, global: &Global) -> Result<u8, Failure> {
    if let Some(gate) = args.max_chi.filter(|gate| !(*gate > 0.0 && gate.is_finite())) {
        return Err(Failure::usage(format!("--max-chi {gate} must be a positive number")));
    }
    let source = ladder::source(&args.model, global)?;
    guard(Kind::Report.at(args.report.as_deref()), inputs(&source, args.logs.iter().cloned()))?;
    let (replays, doubts) = ladder::replays(&source, &args.logs, &[], global)?;
    let outcome = verbs::compare(&source, replays).map_err(|e| Failure::problem(e, &doubts))?;
    if let Some(path) = &args.report {
        write_report(path, &report::compare(&outcome))?;
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

pub(crate) const CHANNEL_HEADER: [&str; 10] =
    ["channel", "unit", "rmse", "fit %", "bias", "lag ms", "noise floor", "x noise floor", "white", "step error"];

/// What its columns mean.
pub(crate) const LEGEND: [&str; 3] = [
    "x noise floor: the error in multiples of what the sensor alone would leave (chi in --json); 1 is as good as any model can be",
    "white: whether what is left looks like noise; fit %: the share of the motion that is right; lag: how late it was measured",
    "step error: what the simulation's time step alone does, in noise floors",
];

/// One row per channel, under [`CHANNEL_HEADER`].
pub(crate) fn channel_rows(outcome: &Compared) -> Vec<Vec<String>> {
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

fn text(outcome: &Compared, most: usize) -> String {
    let mut channels = Table::new(&CHANNEL_HEADER);
    channel_rows(outcome).into_iter().for_each(|row| channels.row(row));
    let failures = outcome.comparison.failures();
    // Regimes are told apart by positions; a torque can be wrong where no position is.
    let loud = outcome.comparison.worst().filter(|channel| channel.chi > LOUD).map(|channel| {
        format!(
            "No joint's position fails in any regime, but {} errs by {:.1} noise floors.",
            channel.name, channel.chi
        )
    });
    let mut lines = vec![channels.render(), String::new()];
    lines.extend(LEGEND.map(str::to_owned));
    let not_judged = outcome.replays.not_judged();
    if !not_judged.is_empty() {
        lines.push(ladder::unmeasured(&not_judged));
    }
    lines.push(String::new());
    match failures.len() {
        0 if loud.is_some() => lines.extend(loud),
        0 => lines.push("No joint fails in any regime: what is left is noise.".to_owned()),
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

/// What there is to say about the time step, if anything.
pub(crate) fn about_the_step(outcome: &Compared) -> Option<String> {
    let step_ms = number(1e3 * outcome.time_step_s());
    if outcome.integrator_error() > 0.5 {
        let error = number(outcome.integrator_error());
        let what = format!("The time step alone, {step_ms} ms, errs by {error} noise floors");
        return Some(format!("{what}: raise simulation.steps_per_control"));
    }
    let usual_ms = number(1e3 * outcome.replays.model.setup.dt_s);
    let finer =
        format!("Simulated in steps of {step_ms} ms: the model's {usual_ms} ms err by more than a fifth of the noise.");
    (outcome.step != Step::USUAL).then_some(finer)
}
