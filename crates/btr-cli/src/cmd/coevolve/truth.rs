//! Comparisons with known truth: a hidden twin, recorded logs, and the estimates of each distance.

use crate::terminal;
use crate::terminal::lines;
use btr_lab::run::conclusions::{hidden, misled, recorded};
use btr_lab::run::report::{ByDistance, RunReport};
use btr_report::run_tables::parameters;
use btr_report::table::{Table, maybe, number};

pub(super) fn show_revealed(report: &RunReport) {
    let Some(table) = parameters(report) else { return };
    println!("\nthe hidden twin");
    terminal::table(&table);
    lines(&hidden(report));
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
    lines(&recorded(report));
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
    lines(&misled(report));
}
