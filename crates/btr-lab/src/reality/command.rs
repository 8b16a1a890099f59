//! An external command per test: a program that drives the robot (or another simulator) and writes a log.
//!
//! Every attempt writes to a separate file, which is renamed to the trial's log only if the program succeeded and the
//! log can be read. A killed run never mistakes an incomplete log for a complete one, and no attempt is overwritten.
//!
//! A program is watched until nothing of it is left, and `on_stop` makes the robot safe where it did not end well. What
//! ends because the run was interrupted has no outcome. `running.toml` leads a resumed run to what a killed one left.

use super::attempt::{Attempt, Try, interrupted};
use super::program::{POLL, Record, tell};
use super::revealed::Revealing;
use super::settings::CommandSettings;
use super::store::{Store, StoreError, outcome_of};
use crate::execution::ExecutionContext;
use btr_core::world::{Outcome, Reality, Trial};
use btr_physics::model::Model;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Runs a program for every test.
pub struct CommandReality {
    settings: CommandSettings,
    model: Arc<Model>,
    store: Store,
    context: Arc<ExecutionContext>,
}

impl CommandReality {
    /// Keeps tests in `store`; `model` computes the references of a controller, and `context` tells of interruptions.
    pub fn new(settings: CommandSettings, model: Arc<Model>, store: Store, context: Arc<ExecutionContext>) -> Self {
        CommandReality { settings, model, store, context }
    }

    fn perform(&self, trial: &Trial) -> Result<Outcome, StoreError> {
        let _robot = self.context.robot();
        let asked = self.store.known_or_asked(trial, &self.model)?;
        let folder = self.store.folder_of(trial);
        let (settings, store, context) = (&self.settings, &self.store, self.context.as_ref());
        let test_s = self.model.scenarios[trial.scenario].duration_s;
        let of = |name| Try { settings, store, context, folder: &folder, name, test_s };
        if let Some(record) = Record::read(&folder)?
            && let Some(outcome) =
                self.left_by_a_killed_run(trial, &record, &of(record.name.clone()), asked.is_break())?
        {
            return Ok(outcome);
        }
        if let ControlFlow::Break(known) = asked {
            return Ok(known);
        }
        let mut why = String::new();
        for _ in 0..=settings.retries {
            if context.is_interrupted() {
                return Ok(interrupted());
            }
            match of(Try::free_name(&folder)).run()? {
                Attempt::Decided(outcome) => return Ok(outcome),
                Attempt::Failed(reason) => why = reason,
            }
        }
        self.store.fail(trial, &why)
    }

    /// What a program has come to that a killed run left: it is waited for as long as it may take. None if the test
    /// `is_known` already, or is to be carried out again.
    fn left_by_a_killed_run(
        &self,
        trial: &Trial,
        record: &Record,
        before: &Try,
        is_known: bool,
    ) -> Result<Option<Outcome>, StoreError> {
        let begun = Instant::now();
        let time = Duration::from_secs_f64(self.settings.timeout_s).saturating_sub(Record::age(before.folder));
        let of = format!("the program of real test {}, which a killed run started, still runs", trial.number);
        let mut told = false;
        while let Some(living) = record.living(&before.outputs()) {
            let still = format!("{of}: {living}");
            let is_interrupted = self.context.is_interrupted();
            if is_interrupted && self.ends(record, before) {
                break;
            }
            if is_interrupted || begun.elapsed() >= time {
                return Ok(Some(Outcome::Unsafe { why: still.into() }));
            }
            if !std::mem::replace(&mut told, true) {
                tell(&format!("{still}: waiting {:.0} s at most", time.as_secs_f64()));
            }
            std::thread::sleep(POLL);
        }
        // How it ended is unknown: its log has to speak for itself.
        let finished = if is_known { None } else { before.whole_log()? };
        let is_safe = if is_known { Ok(()) } else { before.make_safe() };
        Record::remove(before.folder)?;
        Ok(is_safe.err().map(|why| Outcome::Unsafe { why: why.into() }).or(finished))
    }

    /// Ends the program of a killed run, where it is certain which one it is; false if something of it lives on.
    fn ends(&self, record: &Record, before: &Try) -> bool {
        if let Some(group) = record.group.as_ref().filter(|group| group.began.is_some()) {
            group.end(&self.settings.stopping(), &|| true, &mut || {});
        }
        record.living(&before.outputs()).is_none()
    }
}

impl Reality for CommandReality {
    fn test(&mut self, trial: &Trial) -> Outcome {
        outcome_of(self.perform(trial))
    }

    fn recall(&mut self, trial: &Trial) -> Outcome {
        self.store.recalled(trial)
    }
}

impl Revealing for CommandReality {}
