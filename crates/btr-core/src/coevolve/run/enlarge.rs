//! The paper's self-organising re-parametrisation (principle P3): where S cannot reproduce what the robot does, S itself grows.
//! The run goes on with everything it has learnt; what was estimated before stands in the larger S with the new dimensions at
//! their nominal values, which is where an effect is off.

use super::{Coevolution, On, Phase, Step};
use crate::coevolve::history::{Augmentation, Side};
use crate::space::{Dim, Space};

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
        // The bounds of what is new are all that is known of it.
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
        let phase = std::mem::replace(&mut self.state.phase, Phase::Enlarged);
        match phase {
            Phase::Stopped(_) => self.state.iteration += 1,
            Phase::Simulators { .. } | Phase::Refine { .. } | Phase::Estimate(_) | Phase::Enlarged => {}
            before => self.state.phase = before,
        }
    }

    /// Step 3 on the tests there are.
    pub(super) fn enlarged(&mut self, on: &mut On<'_>) -> Step {
        let tested = self.state.ledger.entries().iter().rev().find(|entry| entry.behaviour().is_some());
        let latest = tested.map_or(self.state.iteration, |entry| entry.trial.iteration);
        self.state.phase = self.begin_simulators(on, latest);
        self.step(on)
    }
}
