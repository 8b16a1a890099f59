//! Has the robot changed? Where nothing explains a fresh test beside those before it, although what was believed had foretold
//! tests, either the robot is another one, or the fresh test shows what S lacks. The test before it is repeated: if that comes as
//! it was foretold once more, the robot is the same.

use super::{Coevolution, On};
use crate::coevolve::drift::Drift;
use crate::coevolve::ledger::Entry;
use crate::coevolve::posterior::Posterior;
use crate::coevolve::transfer::Scored;

impl Coevolution {
    /// The real tests of the robot as it is now: all, unless it has changed.
    pub fn lately(&self) -> &[Entry] {
        let entries = self.state.ledger.entries();
        &entries[self.state.since.min(entries.len())..]
    }

    /// The first real test that nothing explains beside those before it, as long as nobody knows why.
    pub fn suspicion(&self) -> Option<&Entry> {
        self.state.ledger.entries().get(self.state.suspicion?)
    }

    /// What was believed does not go with the tests of this iteration.
    pub(super) fn suspect(&mut self) {
        let first = self.state.ledger.of_iteration(self.state.iteration).first().map(|entry| entry.trial.number);
        self.state.suspicion = first.filter(|&first| first > self.state.since);
        if let Some(estimated) = &mut self.state.estimated {
            estimated.explains = false;
        }
    }

    /// The controller of the test before the suspicious one.
    pub(super) fn to_repeat(&self, on: &On<'_>) -> Option<Scored> {
        let before = self.state.ledger.entries().get(self.state.suspicion?.checked_sub(1)?)?;
        let unit = on.simulator.controllers().to_unit(&before.trial.controller);
        Some(Scored { unit, fitness: before.promised.unwrap_or(f64::NAN), generation: 0 })
    }

    /// The repeated test has been made. Where it was not `as_foretold`, the robot has changed: from the suspicious test on, only
    /// what it does now counts.
    pub(super) fn resolve(&mut self, as_foretold: bool) {
        let Some(first) = self.state.suspicion.take() else { return };
        self.state.foretold = false;
        if as_foretold {
            return;
        }
        let former = self.belief();
        self.state.history.drifts.push(Drift::seen(&self.state.ledger.entries()[first], former.clone()));
        self.state.since = first;
        if let Some(estimated) = &mut self.state.estimated {
            estimated.belief = Posterior::of_bounds(former.mean().as_slice());
        }
    }

    /// Brings the record of the last change up to date with what is believed now.
    pub(super) fn compare_with_before(&mut self, on: &On<'_>) {
        let (Some(drift), Some(now)) = (self.state.history.drifts.last_mut(), &self.state.estimated) else { return };
        drift.compare(on.simulator.simulations(), &now.belief, now.explains);
    }
}
