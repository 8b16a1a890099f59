//! Sections shared by the reports of `diagnose` and `fit`: the input, the error ladder, and the noise floors behind the
//! numbers.

use super::page::{Block, Section};
use crate::Subject;
use crate::plot::Ink;
use crate::plot::rows::{Pin, Row, RowScale, Rows, rows};
use crate::table::{maybe, number};
use crate::text::{given, left_out, line, reserve};
use btr_identify::LadderStep;
use btr_lab::verbs::{Doubt, ErrorUnit, NoiseFloor};
use std::path::{Path, PathBuf};

/// Axis label of errors.
pub(super) fn axis(unit: ErrorUnit) -> String {
    format!("error ({}, logarithmic)", unit.times())
}

impl Subject<'_> {
    /// The model's file name.
    pub(super) fn model(&self) -> String {
        file(&self.input.source.path)
    }

    /// The model, the training logs and the held-out logs.
    pub(super) fn input_block(&self) -> Block {
        let files = |paths: &[PathBuf]| paths.iter().map(|path| file(path)).collect::<Vec<_>>().join(", ");
        let evaluated_on = match self.held_out {
            [] => "the last 30 % of each, to which nothing was fitted".to_owned(),
            held_out => format!("{}, to which nothing was fitted", files(held_out)),
        };
        let (model, logs) = (self.model(), files(self.logs));
        let of = match self.input.error_unit() {
            ErrorUnit::NoiseFloor => "the sensors' noise floor",
            ErrorUnit::Repeatability => "what runs of the same command differ by",
        };
        Block::Text(format!(
            "{model} against {logs}, evaluated on {evaluated_on}. Errors are in multiples of {of}: 1 is the best that any \
             model can reach."
        ))
    }

    /// Which logs were left out, reservations about the result with these `doubts`, and what was known before.
    pub(super) fn reserve(&self, doubts: &[Doubt]) -> impl Iterator<Item = Block> + use<> {
        let without = self.input.left_out.iter().map(left_out).collect::<Vec<_>>();
        let sentences = reserve(doubts, &self.input.not_judged);
        let known = given(&self.input.frozen, &self.input.with_prior());
        without.into_iter().chain(sentences).chain(known).map(Block::Text)
    }
}

/// The error ladder: the error after each step.
pub(super) fn fall(ladder: &[LadderStep], unit: ErrorUnit) -> Section {
    let row = |step: &LadderStep| Row {
        name: step.step.clone(),
        pins: training_and_held_out(step.train, step.held_out),
        note: pair(step.train, step.held_out),
        strong: false,
    };
    let shown = ShownLogs::of(ladder.iter().map(|step| step.held_out));
    let plot = rows(&Rows {
        title: "The error, step by step".to_owned(),
        label: axis(unit),
        notes: shown.head().to_owned(),
        scale: RowScale::Ratio,
        lines: vec![least(unit)],
        legend: shown.legend(),
        rows: ladder.iter().map(row).collect(),
        joined: true,
    });
    Section { title: "How the error fell".to_owned(), blocks: vec![Block::Maps(vec![plot])] }
}

/// Training and held-out errors as dots.
pub(super) fn training_and_held_out(train: f64, held_out: Option<f64>) -> Vec<Pin> {
    std::iter::once(Pin::Dot(Ink::Main, train)).chain(held_out.map(|error| Pin::Dot(Ink::Second, error))).collect()
}

/// Training and held-out errors as text.
pub(super) fn pair(train: f64, held_out: Option<f64>) -> String {
    held_out.map_or_else(|| number(train), |held_out| format!("{} / {}", number(train), number(held_out)))
}

/// Of which logs a plot shows errors.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum ShownLogs {
    Training,
    TrainingAndHeldOut,
}

impl ShownLogs {
    /// By the held-out errors of the rows.
    pub(super) fn of(mut held_out: impl Iterator<Item = Option<f64>>) -> Self {
        if held_out.any(|error| error.is_some()) { ShownLogs::TrainingAndHeldOut } else { ShownLogs::Training }
    }

    /// Header of [`pair`].
    pub(super) fn head(self) -> &'static str {
        match self {
            ShownLogs::Training => "training",
            ShownLogs::TrainingAndHeldOut => "training / held out",
        }
    }

    /// Legend of [`training_and_held_out`].
    pub(super) fn legend(self) -> Vec<(Ink, String)> {
        let training = (Ink::Main, "training logs".to_owned());
        let held_out = (Ink::Second, "held-out logs".to_owned());
        match self {
            ShownLogs::Training => vec![training],
            ShownLogs::TrainingAndHeldOut => vec![training, held_out],
        }
    }
}

/// The line at the lower limit of any model's error.
pub(super) fn least(unit: ErrorUnit) -> (Ink, f64, String) {
    (Ink::Truth, 1.0, unit.name().to_owned())
}

/// Noise floors, the integrator's error, the number of rollouts, and findings about the logs: those that the result
/// counts, without what its model explains.
pub(super) fn fine_print(doubts: &[Doubt], floors: &[NoiseFloor], integrator: &str, rollouts: usize) -> Section {
    let of_runs = ErrorUnit::of(floors) == ErrorUnit::Repeatability;
    let columns = ["channel", "noise floor", "unit"].into_iter().chain(of_runs.then_some("repeatability"));
    let header = columns.map(str::to_owned).collect();
    let row = |f: &NoiseFloor| {
        let floor = vec![f.channel.clone(), number(f.sigma), f.unit.clone()];
        floor.into_iter().chain(of_runs.then(|| maybe(f.repeatability))).collect()
    };
    let rows = floors.iter().map(row).collect();
    let spent = format!("The {integrator}. Simulated logs: {rollouts}.");
    let doubts = (!doubts.is_empty()).then(|| Block::List(doubts.iter().map(line).collect()));
    let blocks = [Block::Table { header, rows }, Block::Text(spent)].into_iter().chain(doubts);
    Section { title: "Noise floors and doubts".to_owned(), blocks: blocks.collect() }
}

/// A file's name without its folder, which means nothing to other readers of the report.
fn file(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
