//! Why a run disengaged, and the commands that continue it.

use super::format::span;
use crate::args::{CoevolveArgs, Global};
use btr_lab::run::augment::Cause;
use btr_lab::run::report::RunReport;
use btr_report::table::{maybe, number};
use std::path::Path;

pub(super) fn show_disengagement(report: &RunReport) {
    let Some(last) = report.iterations.last() else { return };
    let e = &last.evidence;
    println!("\ndisengaged: the space of simulations does not reproduce what the robot does");
    if last.posterior.is_some() {
        println!("  no simulation in it explains the real tests: {} x noise, from every start", maybe(last.phi));
        if let Some(cause) = &report.diagnosis {
            show_cause(cause);
        }
        return;
    }
    println!("  phi is {} of its initial value and no longer decreases", maybe(e.phi_share));
    println!("  on fresh transfers, phi is {} of its initial value", maybe(e.predicted_share));
    println!("  rank agreement of controllers, promised against real: {}", maybe(e.rank_agreement));
    println!("  pressure of controllers on simulations: {}", maybe(e.pressure_on_simulations));
    println!("  pressure of simulations on controllers: {}", maybe(e.pressure_on_controllers));
    if let Some(cause) = &report.diagnosis {
        show_cause(cause);
    }
    if !e.at_bound.is_empty() {
        println!("  at a bound of S (the true value may lie beyond it): {}", e.at_bound.join(", "));
    }
}

/// The cause of a disengagement: the missing effects, their parameters, and effects that the tests cannot tell apart.
fn show_cause(cause: &Cause) {
    println!("  {}", cause.sentence());
    for found in &cause.effects {
        for parameter in &found.parameters {
            let interval = parameter.ci95.map_or_else(String::new, |_| format!(" (95 %: {})", span(parameter.ci95)));
            println!("    {} = {} {}{interval}", parameter.name, number(parameter.value), parameter.unit);
        }
        if !found.alike.is_empty() {
            println!("    these tests cannot tell it from {}", found.alike.join(", "));
        }
    }
}

/// Prints the commands that add the missing effects and resume the run.
pub(super) fn next_step(cause: &Cause, folder: &Path, args: &CoevolveArgs, global: &Global) {
    let missing = cause.missing();
    if missing.is_empty() {
        return;
    }
    let (model, larger) = (args.experiment.display(), args.experiment.with_extension("larger.toml"));
    // `--set` values are part of the experiment; `btr add` writes them into the file.
    let settings: String = global.settings.iter().map(|setting| format!(" --set '{setting}'")).collect();
    let seed = global.seed.map_or_else(String::new, |seed| format!(" --seed {seed}"));
    let (larger, folder) = (larger.display(), folder.display());
    println!(
        "  next: btr add {model} {}{settings} -o {larger} && btr coevolve {larger}{seed} --out {folder} --resume",
        missing.join(" ")
    );
}
