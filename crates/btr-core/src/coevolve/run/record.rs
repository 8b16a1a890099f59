//! The end of an iteration: its record, with the evidence for or against disengagement.

use super::coevolution::{Coevolution, Environment};
use crate::coevolve::evaluate;
use crate::coevolve::history::{EstimateRecord, Evidence, Generation, Iteration, Side};
use crate::coevolve::ledger::Entry;
use crate::search::UnitPoint;
use crate::signal::stats;
use crate::world::Cancelled;

/// A parameter this close to a bound, as a share of its range, lies on it: no search gets there exactly.
const AT_BOUND: f64 = 1e-3;

impl Coevolution {
    pub(super) fn record(&mut self, on: &Environment<'_>) -> Result<Iteration, Cancelled> {
        let evidence = self.evidence(on)?;
        self.compare_with_before(on);
        let mine = self.state.ledger.of_iteration(self.state.iteration);
        let first = mine.iter().min_by_key(|e| e.trial.number);
        let space = on.simulator.simulations();
        let controller = self.state.controller.as_ref().map(|u| on.simulator.controllers().from_unit(u));
        Ok(Iteration {
            i: self.state.iteration,
            fitness_sim: first.and_then(|e| e.promised),
            fitness_ci95: first.and_then(|e| e.promised_ci95),
            fitness_real: first.and_then(|e| e.fitness()),
            best_real: self.best_tested().and_then(Entry::fitness),
            phi_predicted: self.state.phi_predicted.take(),
            phi: self.state.phi,
            parameters: space
                .dims()
                .iter()
                .map(|d| d.name.clone())
                .zip(self.state.simulation.iter().copied())
                .collect(),
            posterior: self.estimate_record(on),
            controller: controller.unwrap_or_default(),
            real_tests: self.state.ledger.spent(),
            simulated_evaluations: self.state.cost.evaluations,
            evidence,
        })
    }

    /// The estimate of S so far.
    fn estimate_record(&self, on: &Environment<'_>) -> Option<EstimateRecord> {
        let (phase, estimated) = (self.plan.posterior.as_ref()?, self.state.estimated.as_ref()?);
        let space = on.simulator.simulations();
        let parameters = estimated.belief.beliefs(space, phase.resolution, estimated.explains);
        let known = || estimated.unpredictable.iter().filter(|x| x.is_finite());
        Some(EstimateRecord {
            explained: estimated.explains,
            unpredictable: known().sum::<f64>() / known().count().max(1) as f64,
            not_told: parameters
                .iter()
                .filter(|(_, belief)| !belief.identified)
                .map(|(name, _)| name.clone())
                .collect(),
            parameters,
            open_directions: estimated.belief.open_directions(space),
        })
    }

    pub(super) fn evidence(&mut self, on: &Environment<'_>) -> Result<Evidence, Cancelled> {
        let share =
            |phi: Option<f64>| phi.zip(self.state.phi_start).map(|(phi, start)| phi / start.max(f64::MIN_POSITIVE));
        let (phi_share, predicted_share) = (share(self.state.phi), share(self.state.phi_predicted));
        let pairs: Vec<(UnitPoint, f64, f64)> = self
            .state
            .ledger
            .of_iteration(self.state.iteration)
            .iter()
            .filter_map(|e| Some((on.simulator.controllers().to_unit(&e.trial.controller), e.promised?, e.fitness()?)))
            .collect();
        let promised: Vec<f64> = pairs.iter().map(|p| p.1).collect();
        let real: Vec<f64> = pairs.iter().map(|p| p.2).collect();
        let units: Vec<UnitPoint> = pairs.into_iter().map(|p| p.0).collect();
        let renewed = evaluate::fitness(on.simulator, &self.state.simulation, &units, &mut self.state.cost)?;
        Ok(Evidence {
            phi_share,
            predicted_share,
            rank_agreement: stats::kendall_tau_b(&promised, &real),
            pressure_on_simulations: self.pressure_on_simulations(),
            pressure_on_controllers: stats::kendall_tau_b(&promised, &renewed).map(|tau| (1.0 - tau) / 2.0),
            at_bound: self.at_bound(on),
        })
    }

    pub(super) fn pressure_on_simulations(&self) -> Option<f64> {
        let mine = |g: &&Generation| g.iteration == self.state.iteration && g.side == Side::Simulators;
        let first = self.state.history.generations.iter().find(mine)?;
        Some((first.mean - first.best) / first.mean.max(f64::MIN_POSITIVE)).filter(|p| p.is_finite())
    }

    pub(super) fn at_bound(&self, on: &Environment<'_>) -> Vec<String> {
        let dims = on.simulator.simulations().dims().iter().zip(&self.state.simulation);
        dims.filter(|(d, x)| !(AT_BOUND..=1.0 - AT_BOUND).contains(&d.to_unit(**x)))
            .map(|(d, _)| d.name.clone())
            .collect()
    }
}
