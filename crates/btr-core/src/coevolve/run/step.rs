//! The transitions of the state machine.

use super::coevolution::{Coevolution, Environment, StepOutcome};
use super::state::Phase;
use crate::coevolve::history::StopReason;
use crate::coevolve::ledger::Entry;
use crate::coevolve::plan::Method;
use crate::coevolve::transfer::ScoredController;
use crate::world::Cancelled;

impl Coevolution {
    /// Does the next unit of work.
    ///
    /// # Errors
    /// Cancelled work. Drop the run then, and resume it from the state before the step.
    pub fn step(&mut self, on: &mut Environment<'_>) -> Result<StepOutcome, Cancelled> {
        match std::mem::replace(&mut self.state.phase, Phase::Begin) {
            Phase::Begin => self.begin(on),
            Phase::Map { generation } => self.fill_map(on, generation),
            Phase::Controllers { search, archive, generation } => self.controllers(on, search, archive, generation),
            Phase::Transfer { queue, next, testing } => self.transfer(on, queue, next, testing),
            Phase::Simulators { search, tests, tried, generation } => {
                self.simulators(on, search, tests, tried, generation)
            }
            Phase::Refine { search, tests, tried, generation } => self.refine(on, search, tests, tried, generation),
            Phase::Estimate(estimation) => self.estimate(on, estimation),
            Phase::Enlarged(known) => self.enlarged(on, known),
            Phase::End => self.end(on),
            Phase::Stopped(reason) => self.stop(reason),
        }
    }

    fn begin(&mut self, on: &mut Environment<'_>) -> Result<StepOutcome, Cancelled> {
        if self.tests_left() == 0 {
            return self.stop(StopReason::RealTestsSpent);
        }
        if let Some(repeated) = self.to_repeat(on) {
            self.state.phase = Phase::Transfer { queue: vec![repeated], next: 0, testing: None };
            return self.step(on);
        }
        if self.plan.method == Method::QualityDiversity {
            return self.begin_map(on);
        }
        let fixed_drive = ScoredController { unit: Vec::new(), fitness: f64::NAN, generation: 0 };
        match &self.plan.controllers {
            Some(phase) if !on.simulator.controllers().is_empty() => {
                let search = phase.search.start(on.simulator.controllers().len(), self.state.ahead.as_deref());
                if self.plan.method == Method::RealityOnly {
                    return self.next_real_generation(on, search);
                }
                self.state.phase = Phase::Controllers { search, archive: Vec::new(), generation: 1 };
            }
            _ => {
                let queue = if self.state.iteration == 1 { vec![fixed_drive] } else { Vec::new() };
                self.state.phase = Phase::Transfer { queue, next: 0, testing: None };
            }
        }
        self.step(on)
    }

    fn end(&mut self, on: &mut Environment<'_>) -> Result<StepOutcome, Cancelled> {
        let record = self.record(on)?;
        self.state.history.iterations.push(record);
        let goal = self.plan.fitness_goal;
        let best = self.best_tested().and_then(Entry::fitness);
        self.state.phase = if goal.zip(best).is_some_and(|(goal, best)| best >= goal) {
            Phase::Stopped(StopReason::GoalReached)
        } else if self.nothing_better(on) {
            Phase::Stopped(StopReason::NothingBetter)
        } else if self.state.iteration >= self.plan.iterations {
            Phase::Stopped(StopReason::IterationsDone)
        } else if self.plan.disengagement.stop && self.disengaged() {
            Phase::Stopped(StopReason::Disengaged)
        } else {
            self.state.iteration += 1;
            Phase::Begin
        };
        Ok(StepOutcome::Iteration)
    }

    pub(super) fn stop(&mut self, reason: StopReason) -> Result<StepOutcome, Cancelled> {
        self.state.phase = Phase::Stopped(reason.clone());
        Ok(StepOutcome::Stopped(reason))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::coevolve::fixture::{Toy, ToyRobot, estimating, whitened};
    use crate::space::Space;
    use crate::text::Text;
    use crate::world::{Behaviour, Outcome, Reality, Simulator, Trial, WorldError};
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A toy whose simulations are cancelled after some.
    struct CancelledToy<'a> {
        toy: &'a Toy,
        left: AtomicUsize,
    }

    impl Simulator for CancelledToy<'_> {
        fn simulations(&self) -> &Space {
            self.toy.simulations()
        }

        fn controllers(&self) -> &Space {
            self.toy.controllers()
        }

        fn scenarios(&self) -> usize {
            self.toy.scenarios()
        }

        fn run(&self, s: &[f64], c: &[f64], scenario: usize) -> Result<Behaviour, WorldError> {
            let left = self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1));
            if left.is_ok() { self.toy.run(s, c, scenario) } else { Err(Cancelled.into()) }
        }
    }

    /// A robot that has to be asked twice for each test, or whose files cannot be written.
    struct Hesitant<'a> {
        robot: ToyRobot<'a>,
        asked: usize,
        no: Outcome,
    }

    impl Reality for Hesitant<'_> {
        fn test(&mut self, trial: &Trial) -> Outcome {
            self.asked += 1;
            if self.asked % 2 == 1 { self.no.clone() } else { self.robot.test(trial) }
        }
    }

    #[test]
    fn a_test_that_is_asked_for_again_leaves_no_trace() {
        let (toy, distance) = (Toy::driven(0.0, &[]), whitened());
        let run = |reality: &mut dyn Reality, no: Option<&StepOutcome>| {
            let mut run = Coevolution::new(estimating(3), 3, &toy).unwrap();
            let mut refused = 0;
            loop {
                let mut on = Environment { simulator: &toy, distance: &distance, reality: &mut *reality };
                match run.step(&mut on).unwrap() {
                    StepOutcome::Stopped(_) => return (run, refused),
                    outcome => refused += usize::from(Some(&outcome) == no),
                }
            }
        };
        let robot = || ToyRobot::new(&toy, &[1.7, 1.13], 3);
        let (undisturbed, _) = run(&mut robot(), None);
        let why = || Text::from("not now");
        for (no, told) in [
            (Outcome::Pending { what: why() }, StepOutcome::Waiting(why())),
            (Outcome::Storage { why: why() }, StepOutcome::Storage(why())),
        ] {
            let mut hesitant = Hesitant { robot: robot(), asked: 0, no };
            let (run, refused) = run(&mut hesitant, Some(&told));
            assert!(refused == run.ledger().spent() && refused > 0, "{refused}");
            assert_eq!(run, undisturbed);
        }
    }

    #[test]
    fn cancelled_simulations_end_a_step_and_no_robot_is_moved_by_them() {
        let (toy, distance) = (Toy::driven(0.0, &[]), whitened());
        for simulations in [0, 40, 400, 1000] {
            let simulator = CancelledToy { toy: &toy, left: simulations.into() };
            let mut robot = ToyRobot::new(&toy, &[1.7, 1.13], 3);
            let mut on = Environment { simulator: &simulator, distance: &distance, reality: &mut robot };
            let mut run = Coevolution::new(estimating(4), 3, &simulator).unwrap();
            let before = loop {
                let before = run.clone();
                match run.step(&mut on) {
                    Ok(outcome) => assert!(!matches!(outcome, StepOutcome::Stopped(_)), "it ended after {simulations}"),
                    Err(Cancelled) => break before,
                }
            };
            assert_eq!(run.ledger(), before.ledger());
            // From the state before, the run goes on as one that was never cancelled.
            let mut undisturbed = Coevolution::new(estimating(4), 3, &toy).unwrap();
            let mut resumed = before;
            for run in [&mut undisturbed, &mut resumed] {
                let mut robot = ToyRobot::new(&toy, &[1.7, 1.13], 3);
                let mut on = Environment { simulator: &toy, distance: &distance, reality: &mut robot };
                while !matches!(run.step(&mut on).unwrap(), StepOutcome::Stopped(_)) {}
            }
            assert_eq!(resumed, undisturbed);
        }
    }
}
