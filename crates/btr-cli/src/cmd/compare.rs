//! `btr compare`: where a model fails.

use super::ladder;
use super::output::{Kind, announce, guard, inputs};
use crate::args::{Compare, Global};
use crate::failure::{Failure, MISSED};
use crate::report;
use crate::table::{Table, maybe, number};
use btr_core::compare::{self, Cell, ChannelError, Comparison, Episode};
use btr_core::family::Step;
use btr_core::fit::{FINE_ENOUGH, FINEST};
use btr_core::log::Log;
use btr_core::world::{Simulator, WorldError};
use btr_physics::experiment::Replays;
use btr_physics::verbs::Doubt;
use indexmap::IndexMap;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::process::ExitCode;

/// A channel that errs by more noise floors is not only noise.
const LOUD: f64 = 2.0;
/// Failures in the terminal; `-v` and `--json` have all.
const SHOWN: usize = 8;

/// Everything that was found, with what it was found in.
pub(crate) struct Outcome {
    pub(crate) model: String,
    pub(crate) replays: Replays,
    pub(crate) names: Vec<String>,
    pub(crate) comparison: Comparison,
    /// How much the time step alone changes each simulated channel, in noise floors.
    pub(crate) integrator: IndexMap<String, f64>,
    /// What everything was simulated with.
    pub(crate) step: Step,
}

impl Outcome {
    fn integrator_error(&self) -> f64 {
        self.integrator.values().copied().fold(0.0, f64::max)
    }

    fn time_step_s(&self) -> f64 {
        self.replays.model.setup.dt_s / f64::from(self.step.divides_by())
    }

    /// What there is to say about the time step, if anything.
    pub(crate) fn about_the_step(&self) -> Option<String> {
        let step_ms = number(1e3 * self.time_step_s());
        if self.integrator_error() > 0.5 {
            let error = number(self.integrator_error());
            let what = format!("The time step alone, {step_ms} ms, errs by {error} noise floors");
            return Some(format!("{what}: raise simulation.steps_per_control"));
        }
        let usual_ms = number(1e3 * self.replays.model.setup.dt_s);
        let finer = format!(
            "Simulated in steps of {step_ms} ms: the model's {usual_ms} ms err by more than a fifth of the noise."
        );
        (self.step != Step::USUAL).then_some(finer)
    }
}

pub(crate) fn run(args: &Compare, global: &Global) -> Result<ExitCode, Failure> {
    if let Some(gate) = args.max_chi.filter(|gate| !(*gate > 0.0 && gate.is_finite())) {
        return Err(Failure::usage(format!("--max-chi {gate} must be a positive number")));
    }
    let source = ladder::source(&args.model, global)?;
    guard(Kind::Report.at(args.report.as_deref()), inputs(&source, args.logs.iter().cloned()))?;
    let (replays, doubts) = ladder::replays(&source, &args.logs, &[], global)?;
    let outcome = outcome(replays, &doubts, args)?;
    if outcome.comparison.channels.is_empty() {
        let help = "the log needs a position q_<joint> for the model's joints; [channels] maps foreign names";
        return Err(Failure::new("log", "no channel is both measured and simulated", Some(help.to_owned())));
    }
    if let Some(path) = &args.report {
        report::compare::report(&outcome).write(path)?;
    }
    if global.json {
        println!("{}", document(&outcome));
    } else {
        println!("{}", text(&outcome, if global.verbose { usize::MAX } else { SHOWN }));
    }
    announce(args.report.as_deref(), "the report", global);
    let worst = outcome.comparison.worst().map_or(0.0, |channel| channel.chi);
    let missed = args.max_chi.is_some_and(|gate| worst > gate);
    Ok(if missed { ExitCode::from(MISSED) } else { ExitCode::SUCCESS })
}

/// Simulates every log, and once more with half the time step, and compares; with finer steps where those are too coarse.
fn outcome(replays: Replays, doubts: &[Doubt], args: &Compare) -> Result<Outcome, Failure> {
    let model = &replays.model;
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let simulate = |step: Step| -> Result<Vec<Log>, Failure> {
        let logs = (0..replays.logs.len()).into_par_iter();
        let simulated = logs.map(|k| model.simulate_in_steps(&s, &c, k, None, step));
        simulated.collect::<Result<_, WorldError>>().map_err(|e| Failure::simulation(&e, doubts))
    };
    let beyond = 1.0 + 1.0 / (2.0f64.powi(model.order()) - 1.0);
    let (mut step, mut simulated) = (Step::USUAL, simulate(Step::USUAL)?);
    loop {
        let halved = simulate(step.halved())?;
        let comparison = comparison(&replays, &simulated);
        let error = |c: &ChannelError| (c.name.clone(), integrator_error(c, beyond, &simulated, &halved));
        let integrator: IndexMap<String, f64> = comparison.channels.iter().map(error).collect();
        let coarse = integrator.values().any(|error| *error > FINE_ENOUGH);
        if coarse && step.divides_by() < FINEST && !model.has_contact() {
            (step, simulated) = (step.halved(), halved);
            continue;
        }
        let names = model.scenarios.iter().map(|scenario| scenario.name.clone()).collect();
        let model = args.model.file_name().unwrap_or_default().to_string_lossy().into_owned();
        return Ok(Outcome { model, replays, names, comparison, integrator, step });
    }
}

fn comparison(replays: &Replays, simulated: &[Log]) -> Comparison {
    let model = &replays.model;
    let scenarios = model.scenarios.iter().zip(&replays.logs).zip(simulated);
    let episodes: Vec<Episode> =
        scenarios.map(|((scenario, real), simulated)| Episode { name: &scenario.name, real, simulated }).collect();
    compare::compare(&episodes, |channel, readings| model.setup.noise.floor(channel, readings))
}

/// Root mean square error of a simulated channel that comes from its time step, in noise floors: what halving the step changes and
/// what lies `beyond` that (L. F. Richardson 1911), twice as much in all for a method of first order, 4/3 for one of second.
fn integrator_error(channel: &ChannelError, beyond: f64, simulated: &[Log], halved: &[Log]) -> f64 {
    let pairs = simulated.iter().zip(halved).filter_map(|(usual, halved)| {
        Some((&usual.channel(&channel.name)?.values, &halved.channel(&channel.name)?.values))
    });
    let (sum, n) = pairs.flat_map(|(usual, halved)| usual.iter().zip(halved)).fold((0.0, 0.0), |(sum, n), (a, b)| {
        let error = beyond * (b - a);
        if error.is_finite() { (sum + error * error, n + 1.0) } else { (sum, n) }
    });
    if n > 0.0 { f64::sqrt(sum / n) / channel.noise_floor } else { 0.0 }
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
pub(crate) fn channel_rows(outcome: &Outcome) -> Vec<Vec<String>> {
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

fn text(outcome: &Outcome, most: usize) -> String {
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
    lines.extend(outcome.about_the_step().map(|step| format!("\n{step}")));
    lines.join("\n")
}

fn document(outcome: &Outcome) -> Value {
    let channel = |c: &ChannelError| {
        json!({
            "name": c.name,
            "unit": c.unit,
            "samples": c.samples,
            "rmse": c.rmse,
            "fit_percent": c.fit_percent,
            "bias": c.bias,
            "lag_s": c.lag_s,
            "noise_floor": c.noise_floor,
            "chi": c.chi,
            "white": c.white,
            "independent": c.independent,
            "integrator_error": outcome.integrator.get(&c.name),
        })
    };
    let failure = |cell: &&Cell| {
        json!({
            "joint": cell.joint,
            "regime": cell.regime.name(),
            "log": cell.log,
            "t0": cell.t0_s,
            "t1": cell.t1_s,
            "rmse": cell.rmse,
            "chi": cell.chi,
            "share": cell.share,
            "follows": cell.clue.map(|found| found.clue),
            "hint": cell.hint,
        })
    };
    json!({
        "ok": true,
        "channels": outcome.comparison.channels.iter().map(channel).collect::<Vec<_>>(),
        "failures": outcome.comparison.failures().iter().map(failure).collect::<Vec<_>>(),
        "integrator_error": outcome.integrator_error(),
        "time_step_s": outcome.time_step_s(),
        "not_judged": outcome.replays.not_judged(),
        "warnings": outcome.replays.warnings,
    })
}
