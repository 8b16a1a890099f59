//! The paper's self-organising re-parametrisation (principle P3): where S cannot reproduce what the robot does, S
//! itself grows. The run goes on with everything it has learnt; the earlier estimate extends to the larger S with the
//! new dimensions at their nominal values, at which an effect is off.

use crate::coevolve::estimation::{Estimated, Explanation};
use crate::coevolve::history::{Augmentation, Side};
use crate::coevolve::run::coevolution::{Coevolution, Environment, StepOutcome};
use crate::coevolve::run::state::Phase;
use crate::space::{Dim, Space};
use crate::world::Cancelled;

impl Coevolution {
    /// Goes on in a larger S, whose first dimensions are the present ones. A run that had stopped makes one more
    /// iteration, which begins with step 3 on the real tests there are; one within step 3 begins it anew.
    pub fn enlarge(&mut self, simulations: &Space) {
        let known = self.state.simulation.len();
        let added: &[Dim] = &simulations.dims()[known..];
        let off: Vec<f64> = simulations.nominal()[known..].to_vec();
        self.state.history.augmentations.push(Augmentation {
            after_iteration: self.state.history.iterations.len(),
            real_tests: self.state.ledger.spent(),
            parameters: added.iter().map(|dim| dim.name.clone()).collect(),
        });
        self.state.simulation.extend(&off);
        self.state.start.extend(&off);
        // Only the bounds of the new dimensions are known.
        let new_units = added.iter().zip(&off).map(|(dim, x)| dim.to_unit(*x));
        self.state.prior.extend(new_units);
        if let Some(estimated) = &mut self.state.estimated {
            estimated.belief = estimated.belief.enlarged(&self.state.prior);
        }
        self.state.rivals.iter_mut().for_each(|rival| rival.extend(&off));
        for iteration in &mut self.state.history.iterations {
            iteration.parameters.extend(added.iter().map(|dim| dim.name.clone()).zip(off.iter().copied()));
        }
        for generation in self.state.history.generations.iter_mut().filter(|g| g.side == Side::Simulators) {
            generation.points.iter_mut().for_each(|point| point.extend(&off));
        }
        // A search knows only the dimensions it was begun with.
        self.state.carried = None;
        let phase = std::mem::replace(&mut self.state.phase, Phase::Enlarged(None));
        match phase {
            Phase::Stopped(_) => self.state.iteration += 1,
            Phase::Simulators { .. } | Phase::Refine { .. } | Phase::Estimate(_) | Phase::Enlarged(_) => {}
            before => self.state.phase = before,
        }
    }

    /// Continues from an estimate that explains the real tests in this S, before any new test; a run that had stopped
    /// makes one more iteration. False where the estimate is not of this S, or no step 3 is due.
    pub fn explain(&mut self, simulations: &Space, known: &Explanation) -> bool {
        let Some(belief) = known.estimated.belief.carried(&known.space, simulations) else { return false };
        if simulations.len() != known.space.len() {
            return false;
        }
        match self.state.phase {
            Phase::Stopped(_) => self.state.iteration += 1,
            Phase::Enlarged(_) => {}
            _ => return false,
        }
        self.state.phase = Phase::Enlarged(Some(Estimated { belief, ..known.estimated.clone() }));
        true
    }

    /// Step 3 on the existing tests.
    pub(in crate::coevolve::run) fn enlarged(
        &mut self,
        on: &mut Environment<'_>,
        known: Option<Estimated>,
    ) -> Result<StepOutcome, Cancelled> {
        if known.is_some() {
            return self.finish_estimation(on, known);
        }
        let tested = self.state.ledger.entries().iter().rev().find(|entry| entry.behaviour().is_some());
        let latest = tested.map_or(self.state.iteration, |entry| entry.trial.iteration);
        self.state.phase = self.begin_simulators(on, latest)?;
        self.step(on)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::coevolve::estimation::Posterior;
    use crate::coevolve::fixture::{Toy, ToyRobot, estimating, whitened};
    use crate::coevolve::history::StopReason;
    use crate::coevolve::run::fits;
    use nalgebra::{DMatrix, DVector};

    /// Steps until it stops. Each state on the way is one to resume from.
    fn stopped(run: &mut Coevolution, on: &mut Environment<'_>) -> StopReason {
        loop {
            assert_eq!(fits::check(&run.state, &run.plan, on.simulator), Ok(()));
            if let StepOutcome::Stopped(reason) = run.step(on).unwrap() {
                return reason;
            }
        }
    }

    /// Number of turns of step 3.
    fn turns(run: &Coevolution) -> usize {
        run.history().generations.iter().filter(|g| g.side == Side::Simulators).count()
    }

    #[test]
    fn a_run_continues_from_a_given_explanation_of_its_tests() {
        let truth = [1.7, 1.13, 0.05];
        let drift = Dim::new("drift.rate@toy", "1/s", -2.0, 2.0).nominal(0.0);
        let (small, larger) = (Toy::driven(0.0, &[]), Toy::driven(0.0, &[drift]));
        let mut robot = ToyRobot::new(&larger, &truth, 3);
        let distance = whitened();
        let mut run = Coevolution::new(estimating(4), 3, &small).unwrap();
        let reason =
            stopped(&mut run, &mut Environment { simulator: &small, distance: &distance, reality: &mut robot });
        assert_eq!(reason, StopReason::Disengaged);

        // The explanation has the parameters in another order and within other bounds.
        let of = |name, low, high| Dim::new(name, "1", low, high);
        let dims = vec![of("drift.rate@toy", -1.0, 1.0), of("gain", 0.0, 2.0), of("rate", 1.0, 3.0)];
        let space = Space::new(dims).unwrap();
        let mean = DVector::from_vec(space.to_unit(&[truth[2], truth[1], truth[0]]));
        let belief = Posterior::new(mean, DMatrix::from_diagonal_element(3, 3, 1e-8));
        let estimated = Estimated { belief, explains: true, ..run.state.estimated.clone().unwrap() };
        let known = Explanation { space, estimated };
        assert!(!run.explain(&small.space, &known), "it is of another S");

        let turns_before = turns(&run);
        run.enlarge(&larger.space);
        assert!(run.explain(&larger.space, &known));
        let reason =
            stopped(&mut run, &mut Environment { simulator: &larger, distance: &distance, reality: &mut robot });
        assert_ne!(reason, StopReason::Disengaged);
        assert_eq!(turns(&run), turns_before, "a known explanation needs no estimate");
        for (found, truth) in run.simulation().iter().zip(truth) {
            assert!((found - truth).abs() < 1e-9, "{found} {truth}");
        }
    }
}
