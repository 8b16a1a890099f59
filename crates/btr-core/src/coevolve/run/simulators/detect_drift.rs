//! Detection of a changed robot. Where no simulation explains a fresh test together with those before it, although the
//! belief explained several or had predicted one, either the robot has changed, or the fresh test shows what S lacks.
//! The test before it is repeated: if that is as predicted once more, the robot has not changed.

use crate::coevolve::drift::Drift;
use crate::coevolve::estimation::Posterior;
use crate::coevolve::ledger::Entry;
use crate::coevolve::run::coevolution::{Coevolution, Environment};
use crate::coevolve::transfer::ScoredController;

impl Coevolution {
    /// The real tests of the robot as it is now: all, unless it has changed.
    pub fn lately(&self) -> &[Entry] {
        let entries = self.state.ledger.entries();
        &entries[self.state.since.min(entries.len())..]
    }

    /// The first real test that no simulation explains together with those before it, until the cause is known.
    pub fn suspicion(&self) -> Option<&Entry> {
        self.state.ledger.entries().get(self.state.suspicion?)
    }

    /// Marks the tests of this iteration as contradicting the belief.
    pub(in crate::coevolve::run) fn suspect(&mut self) {
        let first = self.state.ledger.of_iteration(self.state.iteration).first().map(|entry| entry.trial.number);
        self.state.suspicion = first.filter(|&first| first > self.state.since);
        if let Some(estimated) = &mut self.state.estimated {
            estimated.explains = false;
        }
    }

    /// The controller of the test before the suspicious one.
    pub(in crate::coevolve::run) fn to_repeat(&self, on: &Environment<'_>) -> Option<ScoredController> {
        let before = self.state.ledger.entries().get(self.state.suspicion?.checked_sub(1)?)?;
        let unit = on.simulator.controllers().to_unit(&before.trial.controller);
        Some(ScoredController { unit, fitness: before.promised.unwrap_or(f64::NAN), generation: 0 })
    }

    /// The repeated test is done. Unless it was `as_predicted`, the robot has changed: only the tests from the
    /// suspicious one on count.
    pub(in crate::coevolve::run) fn resolve(&mut self, as_predicted: bool) {
        let Some(first) = self.state.suspicion.take() else { return };
        self.state.confirmed = false;
        if as_predicted {
            return;
        }
        let former = self.belief();
        self.state.history.drifts.push(Drift::seen(&self.state.ledger.entries()[first], former.clone()));
        self.state.since = first;
        if let Some(estimated) = &mut self.state.estimated {
            estimated.belief = Posterior::of_bounds(former.mean().as_slice());
        }
    }

    /// Updates the record of the last change with the present estimate.
    pub(in crate::coevolve::run) fn compare_with_before(&mut self, on: &Environment<'_>) {
        let (Some(drift), Some(now)) = (self.state.history.drifts.last_mut(), &self.state.estimated) else { return };
        drift.compare(on.simulator.simulations(), &now.belief, now.explains);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::coevolve::fixture::{Toy, ToyRobot, estimating, whitened};
    use crate::coevolve::run::coevolution::StepOutcome;

    /// Eight iterations of one test each with `simulator`, on `robot`.
    fn run(simulator: &Toy, mut robot: ToyRobot) -> Coevolution {
        let distance = whitened();
        let mut run = Coevolution::new(estimating(8), robot.seed, simulator).unwrap();
        let mut on = Environment { simulator, distance: &distance, reality: &mut robot };
        while !matches!(run.step(&mut on).unwrap(), StepOutcome::Stopped(_)) {}
        run
    }

    #[test]
    fn a_robot_that_changes_is_detected() {
        let toy = Toy::driven(0.0, &[]);
        for seed in 0..4 {
            let robot = ToyRobot::new(&toy, &[1.7, 1.13], seed);
            assert_eq!(run(&toy, ToyRobot { later: None, ..robot }).history().drifts, []);
            // Before the first prediction, and after.
            for from in [2, 4] {
                let robot = ToyRobot::new(&toy, &[1.7, 1.13], seed);
                let changed = run(&toy, ToyRobot { later: Some((from, vec![1.7, 1.25])), ..robot });
                let drifts = &changed.history().drifts;
                assert_eq!(drifts.len(), 1, "{drifts:?}");
                let drift = &drifts[0];
                assert!(drift.before_test == from && drift.iteration == from + 1 && drift.explained, "{drift:?}");
                assert_eq!(drift.changed.iter().map(|change| change.parameter.as_str()).collect::<Vec<_>>(), ["gain"]);
                assert!((drift.changed[0].after - 1.25).abs() < 0.01, "{drift:?}");
                // Tests before the change are not recommended.
                assert!(changed.best_tested().unwrap().trial.number >= from);
            }
        }
    }

    #[test]
    fn an_effect_that_s_lacks_is_not_taken_for_a_change_of_the_robot() {
        // The search moves towards amplitudes at which the robot sticks.
        let (simulator, stuck) = (Toy::driven(0.0, &[]), Toy::driven(0.5008, &[]));
        let mut repeats = 0;
        for seed in 0..8 {
            let run = run(&simulator, ToyRobot::new(&stuck, &[1.7, 1.13], seed));
            assert_eq!(run.history().drifts, []);
            let tests = run.ledger().entries();
            let again =
                |k: usize| tests[k + 1..].iter().any(|later| later.trial.controller == tests[k].trial.controller);
            // It may never get there; where it does, no simulation explains the tests.
            let repeated = (0..tests.len()).any(again);
            let explained = run.history().iterations.last().unwrap().posterior.as_ref().unwrap().explained;
            assert!(!(repeated && explained));
            repeats += usize::from(repeated);
        }
        assert!(repeats > 0);
    }
}
