//! The posterior of a run and the map of controllers.

use crate::terminal;
use crate::terminal::lines;
use btr_core::coevolve::Promise;
use btr_lab::run::conclusions::determined;
use btr_lab::run::report::RunReport;
use btr_report::run_tables::parameters;
use btr_report::table::{Table, maybe};

/// The posterior of the parameters of S, and which of them the tests identify.
pub(super) fn show_posterior(report: &RunReport) {
    let is_estimated = report.iterations.last().is_some_and(|last| last.posterior.is_some());
    if let Some(table) = parameters(report).filter(|_| is_estimated && report.revealed.is_none()) {
        println!();
        terminal::table(&table);
    }
    lines(&determined(report));
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
