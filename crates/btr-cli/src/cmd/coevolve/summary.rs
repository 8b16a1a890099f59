//! The result of a run on the terminal.

use super::disengagement::show_disengagement;
use super::format::span;
use super::posterior::{show_drift, show_gap, show_map, show_posterior};
use super::truth::{show_by_distance, show_logs, show_revealed};
use btr_core::coevolve::StopReason;
use btr_lab::run::report::RunReport;
use btr_report::table::{Table, maybe, number};

pub(super) fn show(report: &RunReport) {
    println!("{}", iterations(report).render());
    println!(
        "\nstopped: {}   real tests: {}   simulated: {} ({} failed)",
        report.stop_reason.as_ref().map_or("waiting for reality", reason_text),
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

fn reason_text(reason: &StopReason) -> &'static str {
    match reason {
        StopReason::GoalReached => "the goal was reached",
        StopReason::NothingBetter => "no controller of the map promises much more than the best one tried",
        StopReason::IterationsDone => "all iterations are done",
        StopReason::RealTestsSpent => "the real tests are spent",
        StopReason::Disengaged => "disengaged",
        StopReason::NoRealData => "no real test gave data",
    }
}

fn iterations(report: &RunReport) -> Table {
    let judged = !report.fitness.is_empty();
    let doubted = report.iterations.iter().any(|it| it.fitness_ci95.is_some());
    let fitness: &[&str] = match (judged, doubted) {
        (false, _) => &[],
        (true, true) => &["f promised", "95 %", "f real", "best real"],
        (true, false) => &["f simulated", "f real", "best real", "rank agreement"],
    };
    let mut table = Table::new(&[&["iteration", "tests", "phi predicted", "phi"], fitness].concat());
    for it in &report.iterations {
        let mut row = vec![it.i.to_string(), it.real_tests.to_string(), maybe(it.phi_predicted), maybe(it.phi)];
        if judged && doubted {
            row.extend([maybe(it.fitness_sim), span(it.fitness_ci95), maybe(it.fitness_real), maybe(it.best_real)]);
        } else if judged {
            let cells = [it.fitness_sim, it.fitness_real, it.best_real, it.evidence.rank_agreement];
            row.extend(cells.map(maybe));
        }
        table.row(row);
    }
    table
}
