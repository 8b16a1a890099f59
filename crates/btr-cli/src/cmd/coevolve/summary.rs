//! The result of a run on the terminal.

use super::disengagement::show_disengagement;
use super::posterior::{show_drift, show_gap, show_map, show_posterior};
use super::truth::{show_by_distance, show_logs, show_revealed};
use crate::terminal;
use btr_lab::run::report::RunReport;
use btr_report::run_tables::{iterations, reason};
use btr_report::table::number;

pub(super) fn show(report: &RunReport) {
    terminal::table(&iterations(report));
    println!(
        "\nstopped: {}   real tests: {}   simulated: {} ({} failed)",
        reason(report),
        report.real_tests,
        report.simulated_evaluations,
        report.failed_evaluations
    );
    for doubt in &report.doubts {
        println!("bad: {}", doubt.sentence());
    }
    let at_bound = report.iterations.last().map_or(&[][..], |last| &last.evidence.at_bound);
    for grown in &report.augmentations {
        println!("S has grown after iteration {}: {}", grown.after_iteration, grown.parameters.join(", "));
    }
    show_drift(report);
    if report.disengaged {
        show_disengagement(report);
    } else if !at_bound.is_empty() {
        println!("at a bound of S (the true value may lie beyond it): {}", at_bound.join(", "));
    }
    if let Some(best) = report.recommended.as_ref().filter(|_| !report.fitness.is_empty()) {
        println!("best in reality: fitness {}, in transfers/{:04}", number(best.fitness_real), best.test);
    }
    show_map(report);
    show_gap(report);
    show_posterior(report);
    if let Some(revealed) = report.revealed.as_ref().filter(|_| report.iterations.iter().any(|it| it.phi.is_some())) {
        show_revealed(report, revealed);
    }
    show_logs(report);
    show_by_distance(report);
}
