//! Tables and sentences of base parameters, for the terminal and the HTML report.

use crate::table::{Table, maybe, number};
use btr_identify::base_parameters::Combination;
use btr_identify::fit::RelativeError;
use btr_lab::verbs::BaseReport;

/// Columns of the table of combinations.
pub const COMBINATIONS: [&str; 6] = ["estimate", "sd", "sd %", "model", "unit", "combination that the logs tell"];

/// A row of the table of combinations.
pub fn combination(of: &Combination) -> Vec<String> {
    let sd = of.sd.map_or_else(|| "withheld".to_owned(), number);
    let percent = of.sd_percent.map_or_else(String::new, |percent| format!("{percent:.1}"));
    vec![number(of.value), sd, percent, number(of.model), of.unit.clone(), of.name.clone()]
}

/// The table of combinations.
pub fn combinations(report: &BaseReport) -> Table {
    let mut table = Table::new(&COMBINATIONS);
    report.base.combinations.iter().for_each(|of| table.row(combination(of)));
    table
}

/// What is left of each torque.
pub fn remaining(report: &BaseReport) -> Table {
    let mut table = Table::new(&["torque", "residual, % of rms", "held out"]);
    let percent = |of: Option<f64>| of.map_or_else(|| maybe(None), |percent| format!("{percent:.1}"));
    let row = |of: &RelativeError| vec![of.channel.clone(), percent(of.train_percent), percent(of.held_out_percent)];
    report.base.remaining.iter().for_each(|of| table.row(row(of)));
    table
}

/// What the tables do not say.
pub fn sentences(report: &BaseReport) -> Vec<String> {
    let base = &report.base;
    let held_out = base.held_out.map_or_else(String::new, |error| format!(", {} held out", number(error)));
    let error = format!("error with these values: {} noise floors{held_out}", number(base.train));
    let nothing = (!base.not_identifiable.is_empty())
        .then(|| format!("without any effect in these logs: {}", base.not_identifiable.join(", ")));
    let withheld = base.withheld.as_ref().map(|why| format!("no standard deviations: {why}"));
    std::iter::once(error).chain(nothing).chain(withheld).collect()
}
