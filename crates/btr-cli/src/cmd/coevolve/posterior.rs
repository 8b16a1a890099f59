//! The posterior of a run, detected drift of the robot, the map of controllers and the reality gap.

use super::format::span;
use crate::progress::tests;
use crate::terminal;
use btr_core::coevolve::{Change, Iteration, Promise};
use btr_lab::run::report::RunReport;
use btr_report::run_tables::parameters;
use btr_report::table::{Table, maybe, number};

/// The posterior of the parameters of S, and which of them the tests identify.
pub(super) fn show_posterior(report: &RunReport) {
    let Some(estimate) = report.iterations.last().and_then(|last| last.posterior.as_ref()) else { return };
    if let Some(table) = parameters(report).filter(|_| report.revealed.is_none()) {
        println!();
        terminal::table(&table);
    }
    if estimate.parameters.values().all(|belief| belief.ci95.is_none()) {
        println!("the estimates do not explain the tests: do not use them");
    }
    if estimate.not_told.is_empty() {
        println!("determined: all {} parameters, by {}", estimate.parameters.len(), tests(told_by(report)));
    } else {
        println!("not determined by these tests: {}", estimate.not_told.join(", "));
    }
    for open in &estimate.open_directions {
        let parts = open.parameters.iter().map(|(name, share)| format!("{share:+.2} {name}"));
        println!("hardly determined: {}", parts.collect::<Vec<_>>().join(" "));
    }
}

/// Number of real tests after which all parameters have been identified.
fn told_by(report: &RunReport) -> usize {
    let told = |it: &&Iteration| it.posterior.as_ref().is_some_and(|estimate| estimate.not_told.is_empty());
    report.iterations.iter().rev().take_while(told).last().map_or(0, |it| it.real_tests)
}

/// Detected changes of the robot.
pub(super) fn show_drift(report: &RunReport) {
    for drift in &report.drifts {
        let change = |c: &Change| {
            format!("{} {} -> {} ({} sd)", c.parameter, number(c.before), number(c.after), number(c.deviations))
        };
        let changed: Vec<String> = drift.changed.iter().map(change).collect();
        let what = match (drift.explained, changed.is_empty()) {
            (true, false) => changed.join(", "),
            (true, true) => "what has changed is not determined yet".to_owned(),
            (false, _) => "S does not contain what has changed".to_owned(),
        };
        println!("the robot changed before test {}: {what}", drift.before_test);
    }
    if let Some(test) = report.suspicion {
        println!(
            "nothing explains test {test} together with those before it: the robot has changed, or S lacks something; one \
             more iteration repeats test {} to decide",
            test.saturating_sub(1)
        );
    }
}

/// Coverage of the map of controllers, and its best simulated, promised and real fitness.
pub(super) fn show_map(report: &RunReport) {
    let Some(map) = &report.map else { return };
    let elites = &map.outlook.elites;
    let most = |of: &dyn Fn(&Promise) -> Option<f64>| maybe(elites.iter().filter_map(of).max_by(f64::total_cmp));
    let mut table = Table::new(&["cells", "filled", "best simulated", "best promised", "best real", "tests"]);
    table.row(vec![
        map.outlook.cells.to_string(),
        map.filled.to_string(),
        most(&|elite| Some(elite.simulated)),
        most(&|elite| Some(elite.promised)),
        most(&|elite| elite.real),
        report.real_tests.to_string(),
    ]);
    println!("\nthe map of controllers");
    terminal::table(&table);
}

/// The reality gap: real fitness against promised fitness, and how many promises held.
pub(super) fn show_gap(report: &RunReport) {
    let Some(gap) = report.reality_gap.filter(|gap| gap.within[1] > 0) else { return };
    let interval = gap.ci95.map_or_else(String::new, |_| format!(" (95 %: {})", span(gap.ci95)));
    println!(
        "reality gap: {}{interval} from promised to real fitness, over {}; {} of {} within their interval",
        number(gap.mean),
        tests(gap.tests),
        gap.within[0],
        gap.within[1]
    );
}
