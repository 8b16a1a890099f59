//! The candidates of a diagnosis: the errors that each leaves, and the evidence for it.

use super::ladder::{ShownLogs, axis, least, pair, training_and_held_out};
use super::page::{Block, Section};
use crate::plot::Ink;
use crate::plot::rows::{Pin, Row, RowScale, Rows, rows};
use crate::table::number;
use btr_identify::LadderStep;
use btr_identify::diagnose::RankedCandidate;
use btr_lab::verbs::{DiagnoseReport, EffectReport, ErrorUnit};

/// Number of candidates drawn per round, the best first.
const CANDIDATES_SHOWN: usize = 12;
/// A difference of the evidence beyond which there is no doubt, and the largest one that is drawn in its length.
const DECISIVE: f64 = 10.0;
const FAR: f64 = 50.0;

/// The ladder step from which a round (from 0) began: the one before the effect that it added, or the last.
pub(super) fn base(ladder: &[LadderStep], round: usize) -> Option<&LadderStep> {
    let added = ladder.iter().enumerate().filter(|(_, step)| step.step.starts_with('+')).nth(round);
    added.map_or_else(|| ladder.last(), |(k, _)| ladder.get(k.checked_sub(1)?))
}

/// The candidates of every round.
pub(super) fn candidates(found: &DiagnoseReport) -> Section {
    let of = |(k, round): (usize, &Vec<RankedCandidate>)| [ranking(found, k, round), evidence(found, k, round)];
    let plots: Vec<String> = found.ranking.iter().enumerate().flat_map(of).collect();
    let text = match plots.len() {
        0 => "No effect was fitted: the error is already at the noise floor.",
        _ => {
            "Every effect at every site was screened; these were fitted, the most probable first. delta BIC is the evidence for \
             each: the gain in likelihood minus the cost of its parameters, decisive above 10. Candidates within 10 of the best cannot \
             be told apart from it. An effect is accepted if the held-out logs confirm it."
        }
    };
    Section { title: "Candidates".to_owned(), blocks: vec![Block::Text(text.to_owned()), Block::Maps(plots)] }
}

fn ranking(found: &DiagnoseReport, k: usize, round: &[RankedCandidate]) -> String {
    let shown = ShownLogs::of(round.iter().map(|ranked| ranked.held_out));
    let before = base(&found.error_ladder, k).map(|step| step.train);
    let names = accepted(found);
    let row = |ranked: &RankedCandidate| {
        let stem = before.map(|before| Pin::Stem(Ink::Truth, before, ranked.train));
        Row {
            name: ranked.name.clone(),
            pins: stem.into_iter().chain(training_and_held_out(ranked.train, ranked.held_out)).collect(),
            note: format!("{}, {}", pair(ranked.train, ranked.held_out), number(ranked.delta_bic)),
            strong: names.contains(&ranked.name),
        }
    };
    let without = before.map(|before| (Ink::Third, before, "training logs, without any".to_owned()));
    rows(&Rows {
        title: format!("Round {}: the error with each candidate", k + 1),
        label: axis(ErrorUnit::of(&found.noise_floor)),
        notes: format!("{}, delta BIC", shown.head()),
        scale: RowScale::Ratio,
        lines: std::iter::once(least(ErrorUnit::of(&found.noise_floor))).chain(without).collect(),
        legend: shown.legend(),
        rows: round.iter().take(CANDIDATES_SHOWN).map(row).collect(),
        joined: false,
    })
}

/// How far the evidence for each candidate, and for none of them, is behind that for the best.
fn evidence(found: &DiagnoseReport, k: usize, round: &[RankedCandidate]) -> String {
    let names = accepted(found);
    let best = round.iter().map(|ranked| ranked.delta_bic).fold(0.0, f64::max);
    let row = |name: &str, delta_bic: f64| {
        let strong = names.iter().any(|accepted| accepted == name);
        let (behind, ink) = (best - delta_bic, if strong { Ink::Main } else { Ink::Third });
        let bar = Pin::Span(ink, 0.0, behind.min(FAR));
        let note = if behind > FAR { format!("{} (off the scale)", number(behind)) } else { number(behind) };
        Row { name: name.to_owned(), pins: vec![bar, Pin::Dot(ink, behind.min(FAR))], note, strong }
    };
    let candidates = round.iter().take(CANDIDATES_SHOWN).map(|ranked| row(&ranked.name, ranked.delta_bic));
    rows(&Rows {
        title: format!("Round {}: the evidence behind that for the best", k + 1),
        label: "difference of delta BIC".to_owned(),
        notes: "behind the best".to_owned(),
        scale: RowScale::Amount,
        lines: vec![(Ink::Truth, DECISIVE, "decisive".to_owned())],
        legend: Vec::new(),
        rows: candidates.chain([row("none of them", 0.0)]).collect(),
        joined: false,
    })
}

/// What was found, as candidates are named.
fn accepted(found: &DiagnoseReport) -> Vec<String> {
    let values = found.wrong_values.iter().map(|value| format!("{}@{}", value.value, value.site));
    found.effects.iter().flat_map(EffectReport::names).chain(values).collect()
}
