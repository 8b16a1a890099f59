//! The result of a run on the terminal.

use super::disengagement::show_disengagement;
use super::posterior::{show_map, show_posterior};
use super::truth::{show_by_distance, show_logs, show_revealed};
use crate::terminal;
use crate::terminal::lines;
use btr_lab::run::conclusions::{at_bound, best, doubts, drift, gap, growth};
use btr_lab::run::report::RunReport;
use btr_report::run_tables::{iterations, reason};

pub(super) fn show(report: &RunReport) {
    terminal::table(&iterations(report));
    println!(
        "\nstopped: {}   real tests: {}   simulated: {} ({} failed)",
        reason(report),
        report.real_tests,
        report.simulated_evaluations,
        report.failed_evaluations
    );
    lines(&doubts(report));
    lines(&growth(report));
    lines(&drift(report));
    match report.disengaged {
        true => show_disengagement(report),
        false => lines(&at_bound(report)),
    }
    lines(&best(report));
    show_map(report);
    lines(&gap(report));
    show_posterior(report);
    if report.revealed.is_some() && report.iterations.iter().any(|it| it.phi.is_some()) {
        show_revealed(report);
    }
    show_logs(report);
    show_by_distance(report);
}
