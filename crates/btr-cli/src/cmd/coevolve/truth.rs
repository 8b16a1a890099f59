//! Comparisons with known truth: a hidden twin, recorded logs, and the estimates of each distance.

use crate::terminal;
use btr_lab::run::report;
use btr_lab::run::report::{ByDistance, RunReport, TwinComparison};
use btr_report::run_tables::parameters;
use btr_report::table::{Table, maybe, number};

pub(super) fn show_revealed(report: &RunReport, revealed: &TwinComparison) {
    let Some(table) = parameters(report) else { return };
    println!("\nthe hidden twin");
    terminal::table(&table);
    if !revealed.truth.effects.is_empty() {
        println!("hidden effects: {}", revealed.truth.effects.join(", "));
    }
    let state: Vec<String> = revealed.state_match.iter().map(|(unit, x)| format!("{} {unit}", number(*x))).collect();
    println!("state match (rms of simulated − real, best controller): {}", state.join(", "));
}

pub(super) fn show_logs(report: &RunReport) {
    let mut table = Table::new(&["log", "", "channel", "mean |error| before", "after", "fit % before", "after"]);
    for score in &report.logs {
        table.row(vec![
            score.log.clone(),
            if score.held_out { "held out" } else { "learnt" }.to_owned(),
            format!("{} ({})", score.channel, score.unit),
            number(score.before.mean_abs),
            number(score.after.mean_abs),
            number(score.before.fit_percent),
            number(score.after.fit_percent),
        ]);
    }
    if table.is_empty() {
        return;
    }
    println!("\nrecorded logs");
    terminal::table(&table);
    for (held_out, title) in [(false, "learnt"), (true, "held out")] {
        let scores: Vec<_> =
            report.logs.iter().filter(|s| s.held_out == held_out && s.after.mean_abs.is_finite()).collect();
        let mean = |of: &dyn Fn(&&report::LogScore) -> f64| scores.iter().map(of).sum::<f64>() / scores.len() as f64;
        if !scores.is_empty() {
            let (before, after) = (mean(&|s| s.before.mean_abs), mean(&|s| s.after.mean_abs));
            println!("{title}: mean |error| {} before, {} after", number(before), number(after));
            if after > before {
                println!("  the adapted model is worse than the initial one: do not use it");
            }
        }
    }
}

pub(super) fn show_by_distance(report: &RunReport) {
    let Some(first) = report.by_distance.first() else { return };
    println!(
        "\nerror % of each parameter by distance; in brackets how far it must move, alone or to another\n\
         distance's estimate, before the distance tells; misled: it claims to tell, and errs by more"
    );
    let distances: Vec<&str> = report.by_distance.iter().map(|by| by.distance.as_str()).collect();
    let mut table = Table::new(&[&["parameter"], distances.as_slice()].concat());
    for (k, name) in ["phi before", "phi after"].into_iter().enumerate() {
        let phis = report.by_distance.iter().map(|by| number(by.phi[k]));
        table.row(std::iter::once(name.to_owned()).chain(phis).collect());
    }
    if first.phi_of_truth.is_some() {
        let phis = report.by_distance.iter().map(|by| maybe(by.phi_of_truth));
        table.row(std::iter::once("phi of the truth".to_owned()).chain(phis).collect());
    }
    for name in first.parameters.keys() {
        let cell = |by: &ByDistance| {
            let wrong = by.error_percent.get(name).copied();
            let error = maybe(wrong);
            match by.resolution_percent.get(name).copied().flatten() {
                Some(told) if wrong.is_some_and(|wrong| wrong.abs() > told) => format!("{error} [misled]"),
                Some(resolution) => format!("{error} [{}%]", number(resolution)),
                None => format!("{error} [unseen]"),
            }
        };
        table.row(std::iter::once(name.clone()).chain(report.by_distance.iter().map(cell)).collect());
    }
    terminal::table(&table);
    let fooled = |by: &&ByDistance| by.phi_of_truth.is_some_and(|truth| truth > by.telling);
    for by in report.by_distance.iter().filter(fooled) {
        println!(
            "{} prefers its own estimate to the truth: do not rely on its estimate from this recording",
            by.distance
        );
    }
}
