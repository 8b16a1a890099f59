//! Tables and sentences of base parameters, for the terminal and the HTML report.

use crate::table::{Table, maybe, number};
use btr_identify::base_parameters::{Combination, Membership};
use btr_identify::fit::RelativeError;
use btr_lab::verbs::{BaseReport, PossibleBody, PossibleReport};
use btr_physics::inertials::StatedInertials;

/// Larger deviations in percent only say that the value may be 0.
const MOST_PERCENT: f64 = 999.0;

/// Columns of the table of combinations.
pub const COMBINATIONS: [&str; 6] = ["estimate", "sd", "sd %", "model", "unit", "combination that the logs tell"];

/// A row of the table of combinations.
pub fn combination(of: &Combination) -> Vec<String> {
    let sd = of.sd.map_or_else(|| "withheld".to_owned(), number);
    let percent = of.sd_percent.map_or_else(String::new, |percent| match percent < MOST_PERCENT {
        true => format!("{percent:.1}"),
        false => format!("> {MOST_PERCENT}"),
    });
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

/// The bodies of a possible set.
pub fn possible(report: &PossibleReport) -> Table {
    let mut table = Table::new(&POSSIBLE);
    let row = |body: &PossibleBody| {
        let StatedInertials { mass_kg, com_m, inertia_kg_m2 } = &body.inertials;
        let numbers = std::iter::once(mass_kg).chain(com_m).chain(inertia_kg_m2);
        [body.link.clone()].into_iter().chain(numbers.copied().map(number)).collect()
    };
    report.links.iter().for_each(|body| table.row(row(body)));
    table
}

/// Columns of the table of bodies, in SI units.
const POSSIBLE: [&str; 11] = ["link", "mass", "com x", "y", "z", "I xx", "yy", "zz", "xy", "xz", "yz"];

/// Whether rigid bodies can have what was estimated.
pub fn can_be(report: &PossibleReport) -> String {
    let says = match report.membership {
        Membership::AsEstimated => "rigid bodies can have these combinations",
        Membership::WithinUncertainty => {
            "no rigid bodies have exactly these combinations; some have others that the logs do not tell from them"
        }
        Membership::Contradicted => "no rigid bodies have such combinations: something is missing in the model",
    };
    let held_out = report.held_out.map_or_else(String::new, |error| format!(", {} held out", number(error)));
    let (distance, error) = (number(report.distance), number(report.train));
    format!(
        "{says}.\nThe possible ones nearest to the model are {distance} sd away; error with them: {error} noise \
         floors{held_out}"
    )
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
