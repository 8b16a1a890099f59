//! Tables and words of a run of the loop, for the terminal and for its page.

use crate::table::{Table, maybe, number, span};
use btr_core::coevolve::{Entry, StopReason, TestVerdict};
use btr_lab::run::report::{RunReport, TwinComparison};

/// Why a run ended.
pub fn reason(report: &RunReport) -> &'static str {
    match report.stop_reason {
        None => "waiting for reality",
        Some(StopReason::GoalReached) => "the goal was reached",
        Some(StopReason::NothingBetter) => "no controller of the map promises much more than the best one tried",
        Some(StopReason::IterationsDone) => "all iterations are done",
        Some(StopReason::RealTestsSpent) => "the real tests are spent",
        Some(StopReason::Disengaged) => "disengaged",
        Some(StopReason::NoRealData) => "no real test gave data",
    }
}

/// A row for each iteration.
pub fn iterations(report: &RunReport) -> Table {
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

/// A row for each parameter of S: its estimate, and the truth where it is revealed.
pub fn parameters(report: &RunReport) -> Option<Table> {
    let last = report.iterations.last()?;
    let twin = report.revealed.as_ref();
    let mut header = vec!["parameter"];
    header.extend(twin.map(|_| "truth"));
    header.push("estimate");
    header.extend(last.posterior.as_ref().map(|_| "95 %"));
    header.extend(twin.into_iter().flat_map(|_| ["error %", "error % at first"]));
    let mut table = Table::new(&header);
    for (name, value) in &last.parameters {
        let mut row = vec![name.clone()];
        row.extend(twin.map(|twin| maybe(twin.truth.parameters.get(name).copied())));
        row.push(number(*value));
        let interval = |name: &str| last.posterior.as_ref()?.parameters.get(name)?.ci95;
        row.extend(last.posterior.as_ref().map(|_| span(interval(name))));
        row.extend(twin.into_iter().flat_map(|TwinComparison { error_percent, error_percent_before, .. }| {
            [error_percent, error_percent_before].map(|errors| maybe(errors.get(name).copied()))
        }));
        table.row(row);
    }
    Some(table)
}

/// A row for each real test.
pub fn real_tests(report: &RunReport) -> Table {
    let judged = !report.fitness.is_empty();
    let doubted = judged && report.tests.iter().any(|test| test.promised_ci95.is_some());
    let mut header = vec!["test", "iteration"];
    header.extend(judged.then_some("f promised"));
    header.extend(doubted.then_some("95 %"));
    header.extend(judged.then_some("f real"));
    header.push("outcome");
    let mut table = Table::new(&header);
    for test in &report.tests {
        let mut row = vec![test.trial.number.to_string(), test.trial.iteration.to_string()];
        row.extend(judged.then(|| maybe(test.promised)));
        row.extend(doubted.then(|| span(test.promised_ci95)));
        row.extend(judged.then(|| maybe(test.fitness())));
        row.push(outcome(test));
        table.row(row);
    }
    table
}

fn outcome(test: &Entry) -> String {
    match &test.verdict {
        TestVerdict::Done { .. } => "done".to_owned(),
        TestVerdict::Failed { why } => format!("failed: {why}"),
    }
}
