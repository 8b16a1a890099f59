//! The report of a run of `btr coevolve`.

use super::page::{Block, Report, Section};
use super::player::{Player, Replayed, ReplayedState};
use crate::best_test::BestTest;
use crate::plot::{Panel, figure};
use crate::run_tables::{iterations, parameters, real_tests, reason};
use crate::table::Table;
use btr_identify::compare::LogPair;
use btr_lab::experiment::Experiment;
use btr_lab::run::conclusions::conclusions;
use btr_lab::run::report::RunReport;
use btr_lab::verbs::compare_pairs;

/// The page of a run; `panels` are its progress and how joints follow their references.
pub(crate) fn run(
    experiment: &Experiment,
    report: &RunReport,
    best: Option<&BestTest>,
    (progress, following): (&[Panel], &[Panel]),
) -> String {
    let mut sections = vec![result(report)];
    sections.extend(drawn("Progress", PROGRESS, progress, progress.len()));
    sections.push(table(
        "Real tests",
        "In the order of the run; f is the fitness of a controller.",
        real_tests(report),
    ));
    if let Some(estimates) = parameters(report) {
        sections.push(table("Parameters", "The values of the simulation.", estimates));
    }
    sections.extend(best.and_then(|best| drawn("Following", &following_words(best), following, 2)));
    let player = best.and_then(|best| player(experiment, best));
    Report { title: format!("{}: controllers and simulations", report.name), sections, player }.html()
}

/// What the panels of the progress show.
const PROGRESS: &str = "Each dot of a parameter is a simulation that was tried; darker ones are closer to reality.";

fn following_words(best: &BestTest) -> String {
    format!(
        "The joints that the search for simulations changed most, in real test {}: before the search and after it.",
        best.number
    )
}

fn result(report: &RunReport) -> Section {
    let mut blocks = vec![Block::Lead(format!("The run has ended: {}.", reason(report)))];
    if report.stop_reason.is_none() {
        blocks = vec![Block::Lead("The run waits for a real test.".to_owned())];
    }
    blocks.push(Block::Text(format!(
        "Real tests: {}. Simulated: {} ({} failed).",
        report.real_tests, report.simulated_evaluations, report.failed_evaluations
    )));
    blocks.push(Block::List(conclusions(report)));
    let (header, rows) = iterations(report).into_parts();
    blocks.push(Block::Table { header, rows });
    Section { title: "Result".to_owned(), blocks }
}

/// Panels with so many side by side at most.
fn drawn(title: &str, words: &str, panels: &[Panel], beside: usize) -> Option<Section> {
    let alone = |panel: &Panel| figure(std::slice::from_ref(panel), 1);
    let rows = panels.chunks(beside.max(1)).map(|row| Block::Plots(row.iter().map(alone).collect()));
    let blocks = std::iter::once(Block::Text(words.to_owned())).chain(rows).collect();
    (!panels.is_empty()).then(|| Section { title: title.to_owned(), blocks })
}

fn table(title: &str, words: &str, table: Table) -> Section {
    let (header, rows) = table.into_parts();
    Section { title: title.to_owned(), blocks: vec![Block::Text(words.to_owned()), Block::Table { header, rows }] }
}

/// The best real test beside the simulations of the beginning and of the end, with the errors of positions: a twin may
/// have no noise in other channels.
fn player(experiment: &Experiment, best: &BestTest) -> Option<Player> {
    let name = format!("real test {}", best.number);
    let compared = |simulated| {
        let mut comparison = compare_pairs(&experiment.model, &[LogPair { name: &name, real: best.real, simulated }]);
        comparison.residuals.retain(|residual| residual.channel.starts_with("q_"));
        comparison
    };
    let (before, after) = (compared(&best.before), compared(&best.after));
    let (logs, names) = ([best.real.clone()], [name.as_str()]);
    let simulated = [[best.before.clone()], [best.after.clone()]];
    let states = [("before", &before, &simulated[0]), ("after", &after, &simulated[1])];
    let states = states.map(|(name, comparison, simulated)| ReplayedState {
        name: name.to_owned(),
        error: None,
        comparison,
        simulated,
    });
    let model = &experiment.model;
    Player::of(&Replayed {
        model,
        names: &names,
        logs: &logs,
        states: states.into(),
        errors_are: None,
        in_windows: false,
    })
}
