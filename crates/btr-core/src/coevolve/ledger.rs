//! The ledger of real tests: trials, their predictions and outcomes.

use crate::text::Text;
use crate::world::{AnnounceError, Behaviour, Outcome, Reality, Trial};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a real test ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TestVerdict {
    /// It returned a behaviour of this fitness.
    Done {
        /// f_r of the trial.
        fitness: f64,
    },
    /// It failed; it still counts as spent.
    Failed {
        /// What went wrong.
        why: String,
    },
}

/// One line of the ledger.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// The trial.
    pub trial: Trial,
    /// The fitness that the simulation predicted before the test; `None` without a simulation.
    pub promised: Option<f64>,
    /// 95 % prediction interval of that over the posterior or the map of that time; `None` without either.
    pub promised_ci95: Option<[f64; 2]>,
    /// Its outcome.
    pub verdict: TestVerdict,
    /// The behaviour itself. Not part of a checkpoint: it is recalled from reality, which keeps the logs.
    #[serde(skip)]
    behaviour: Option<Behaviour>,
}

impl Entry {
    /// What the robot did, unless the test failed.
    pub fn behaviour(&self) -> Option<&Behaviour> {
        self.behaviour.as_ref()
    }

    /// The same test with only this share of its log, from the beginning.
    #[must_use]
    pub fn beginning(&self, share: f64) -> Entry {
        let mut entry = self.clone();
        if let Some(behaviour) = &mut entry.behaviour {
            let samples = (share * behaviour.log.len() as f64).ceil() as usize;
            behaviour.log = behaviour.log.part(0..samples.min(behaviour.log.len()));
        }
        entry
    }

    /// f_r, unless the test failed.
    pub fn fitness(&self) -> Option<f64> {
        match self.verdict {
            TestVerdict::Done { fitness } => Some(fitness),
            TestVerdict::Failed { .. } => None,
        }
    }
}

/// Which older transfers keep counting in step 3 (the paper's historical consistency).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Memory {
    /// All of them.
    #[default]
    All,
    /// None of them, as in the paper's ant experiment.
    None,
    /// This many of those that the present simulation explains worst.
    Worst(usize),
}

/// The fitness predicted for a real test before it is carried out.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PredictedFitness {
    pub value: Option<f64>,
    /// 95 % prediction interval.
    pub ci95: Option<[f64; 2]>,
}

/// Why a trial has no outcome yet.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum NoOutcome {
    /// It waits for this.
    Pending(Text),
    /// Something may still move the robot.
    Unsafe(Text),
    /// Its files are damaged, or cannot be written.
    Storage(Text),
}

impl From<AnnounceError> for NoOutcome {
    fn from(error: AnnounceError) -> Self {
        match error {
            AnnounceError::Storage(why) => NoOutcome::Storage(why),
            other => NoOutcome::Pending(other.text()),
        }
    }
}

/// Error when the ledger of a checkpoint names a real test whose log is gone or damaged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}", self.text())]
pub struct RecallError {
    /// Number of the real test.
    pub number: usize,
    /// What reality reports of it.
    pub why: Text,
}

impl RecallError {
    /// The error as a text.
    pub fn text(&self) -> Text {
        Text::from(format!("real test {} is in the ledger but its log cannot be used: ", self.number))
            + self.why.clone()
    }
}

/// All real tests of a run in their order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ledger {
    entries: Vec<Entry>,
}

impl Ledger {
    /// The tests in their order.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Number of tests spent, failed ones included.
    pub fn spent(&self) -> usize {
        self.entries.len()
    }

    /// Whether this controller was tried before.
    pub(super) fn has_tried(&self, controller: &[f64]) -> bool {
        self.entries.iter().any(|e| e.trial.controller == controller)
    }

    /// Carries out a trial and records it. A trial without an outcome stays out of the ledger.
    pub(super) fn carry_out(
        &mut self,
        trial: Trial,
        predicted: PredictedFitness,
        reality: &mut dyn Reality,
    ) -> Result<(), NoOutcome> {
        let PredictedFitness { value: promised, ci95: promised_ci95 } = predicted;
        let (verdict, behaviour) = match reality.test(&trial) {
            Outcome::Done(behaviour) => (TestVerdict::Done { fitness: behaviour.fitness }, Some(behaviour)),
            Outcome::Failed { why } => (TestVerdict::Failed { why }, None),
            Outcome::Pending { what } => return Err(NoOutcome::Pending(what)),
            Outcome::Unsafe { why } => return Err(NoOutcome::Unsafe(why)),
            Outcome::Storage { why } => return Err(NoOutcome::Storage(why)),
        };
        self.entries.push(Entry { trial, promised, promised_ci95, verdict, behaviour });
        Ok(())
    }

    /// Fetches the behaviours after the ledger was read from a checkpoint.
    ///
    /// # Errors
    /// A trial whose result reality no longer has, or has damaged.
    pub fn recall(&mut self, reality: &mut dyn Reality) -> Result<(), RecallError> {
        for entry in &mut self.entries {
            if matches!(entry.verdict, TestVerdict::Failed { .. }) || entry.behaviour.is_some() {
                continue;
            }
            entry.behaviour = match reality.recall(&entry.trial) {
                Outcome::Done(behaviour) => Some(behaviour),
                Outcome::Failed { why } => return Err(RecallError { number: entry.trial.number, why: why.into() }),
                Outcome::Pending { what: why } | Outcome::Unsafe { why } | Outcome::Storage { why } => {
                    return Err(RecallError { number: entry.trial.number, why });
                }
            };
        }
        Ok(())
    }

    /// The tests of one iteration that gave a behaviour.
    pub fn of_iteration(&self, iteration: usize) -> Vec<&Entry> {
        self.entries.iter().filter(|e| e.trial.iteration == iteration && e.behaviour.is_some()).collect()
    }

    /// The tests that count in step 3: all of this iteration, and of the older ones what `memory` keeps.
    /// `distance_now` is the distance of the present simulation from each entry.
    pub(super) fn counting(&self, iteration: usize, memory: Memory, distance_now: &[f64]) -> Vec<&Entry> {
        let usable = |e: &&Entry| e.behaviour.is_some();
        let is_old = |e: &Entry| e.trial.iteration < iteration;
        match memory {
            Memory::All => self.entries.iter().filter(usable).collect(),
            Memory::None => self.entries.iter().filter(usable).filter(|e| !is_old(e)).collect(),
            Memory::Worst(count) => {
                let mut old: Vec<usize> = (0..self.entries.len())
                    .filter(|&k| is_old(&self.entries[k]) && usable(&&self.entries[k]))
                    .collect();
                old.sort_by(|&a, &b| distance_now[b].total_cmp(&distance_now[a]).then(b.cmp(&a)));
                old.truncate(count);
                old.sort_unstable();
                let new = (0..self.entries.len()).filter(|&k| !is_old(&self.entries[k]) && usable(&&self.entries[k]));
                old.into_iter().chain(new).map(|k| &self.entries[k]).collect()
            }
        }
    }
}
