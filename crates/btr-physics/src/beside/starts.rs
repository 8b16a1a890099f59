//! Where a fixed robot's logs begin, as a model sees it. What its first readings tell is rough, above all of velocities: where
//! they change within a few samples, no curve through them is any good. A model that knows how the robot moves tells more.

use super::Beside;
use super::parts::whole;
use crate::model::{Model, Scenario};
use crate::robot::Base;
use btr_core::family::{Family, Step};
use btr_core::fit::{NOISE, squares};
use btr_core::log::Log;
use btr_core::world::WorldError;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;

/// Positions at the start are moved by so many noise floors, velocities by what comes to as much after so many seconds.
const NUDGE: (f64, f64) = (3.0, 0.05);
/// What the first readings leave open, in nudges: the standard deviation of positions and of velocities.
const OPEN: (f64, f64) = (1.0, 30.0);
/// Slopes are taken anew so often at most, ...
const ROUNDS: usize = 4;
/// ... until no number moves by more than this, in nudges.
const SETTLED: f64 = 0.1;
/// A step that leads nowhere is halved so often.
const HALVINGS: u32 = 3;
/// Starts that moved by less, in nudges, are as good as where they were: slopes at the old ones tell the rest.
const MOVED: f64 = 3.0;
/// A log whose squares fall to this share, or to noise, began elsewhere than its readings seem to say.
const MOST: f64 = 0.5;

/// The situations of logs with starts as the model that stands there sees them, where these explain all or most of what it is
/// off: a model that lacks something sees starts that make up for a little of it. `None` where there are no such.
pub(crate) fn seen_starts(model: &Model, recorded: &[Log]) -> Option<Vec<Scenario>> {
    if model.robot.base != Base::Fixed {
        return None;
    }
    let own = Arc::new(model.in_situations(model.scenarios.clone()));
    let mut beside = Beside::without_effects(own, recorded.to_vec(), whole(recorded)).ok()?;
    beside.measure().ok()?;
    let origin = vec![0.0; beside.knobs.len()];
    let chi = |beside: &Beside, log: usize| -> Option<f64> {
        let there: Vec<f64> = beside.residual(&origin, log, Step::USUAL).ok()?;
        let there: Vec<f64> = there.into_iter().filter(|r| r.is_finite()).collect();
        Some((squares(&there) / there.len().max(1) as f64).sqrt())
    };
    let mut seen = beside.clone();
    seen.start_from(&origin, 0.0);
    let mut differs = false;
    for log in 0..recorded.len() {
        let (before, after) = (chi(&beside, log)?, chi(&seen, log)?);
        if before > NOISE && after < NOISE.max(MOST.sqrt() * before) {
            beside.situations[log] = seen.situations[log].clone();
            differs = true;
        }
    }
    differs.then_some(beside.situations)
}

impl Beside {
    /// The start of a log, in which some numbers are moved by so many nudges.
    pub(super) fn nudge(&self, log: usize, scenario: &mut Scenario, number: usize, by: f64) {
        // Where one rests nothing moves, so that positions are all there is.
        let numbers = if self.rests { 1 } else { 2 };
        let Some((joint, sigma)) = self.nudged(log).nth(number / numbers) else { return };
        let start = &mut scenario.start[joint];
        match number % numbers {
            0 => start.0 += by * NUDGE.0 * sigma,
            _ => start.1 += by * NUDGE.0 * sigma / NUDGE.1,
        }
    }

    /// Moves the starts of a fixed robot's logs to where the model at `u` leads nearest to what is learnt from, or else to
    /// what is judged on. Whether one of them moved by more than slopes tell.
    pub(super) fn start_otherwise(&mut self, u: &[f64]) -> bool {
        self.start_from(u, MOVED)
    }

    /// The same for those that moved by more than so many nudges.
    fn start_from(&mut self, u: &[f64], least: f64) -> bool {
        let scenarios: Vec<usize> = (0..self.situations.len()).collect();
        let moved: Vec<Option<Scenario>> =
            scenarios.into_par_iter().map(|scenario| self.nearest_start(u, scenario, least)).collect();
        let differs = moved.iter().any(Option::is_some);
        for (situation, moved) in self.situations.iter_mut().zip(moved) {
            *situation = moved.unwrap_or_else(|| situation.clone());
        }
        differs
    }

    /// A situation with the start from which the model at `u` leads nearest to its log: by Gauss and Newton, from where it is
    /// now. `None` where it is no further away than so many nudges, or the model blows up.
    fn nearest_start(&self, u: &[f64], scenario: usize, least: f64) -> Option<Scenario> {
        let own = || (0..self.parts.len()).filter(|&log| self.parts[log].scenario == scenario);
        let log = own().find(|&log| !self.parts[log].held_out).or_else(|| own().next())?;
        let read = Start { beside: self, u, log, from: &self.situations[scenario] };
        let numbers = self.starts(log);
        let mut at = DVector::zeros(numbers);
        let mut residual = read.residual(&at).ok()?;
        for _ in 0..ROUNDS {
            let step = read.step(&at, &residual).ok()?;
            let Some((next, there)) = read.lower(&at, &residual, &step) else { break };
            let far = (&next - &at).amax();
            (at, residual) = (next, there);
            if far < SETTLED {
                break;
            }
        }
        (numbers > 0 && at.amax() > least).then(|| read.moved(&at))
    }
}

/// The start of a log as it is now, to be moved.
struct Start<'a> {
    beside: &'a Beside,
    u: &'a [f64],
    log: usize,
    from: &'a Scenario,
}

impl Start<'_> {
    fn moved(&self, by: &DVector<f64>) -> Scenario {
        let mut scenario = self.from.clone();
        by.iter().enumerate().for_each(|(k, by)| self.beside.nudge(self.log, &mut scenario, k, *by));
        scenario
    }

    fn residual(&self, by: &DVector<f64>) -> Result<DVector<f64>, WorldError> {
        let simulated = self.beside.simulate_in(self.u, &self.moved(by), Step::USUAL)?;
        let residual = self.beside.against(self.log, &simulated)?;
        Ok(DVector::from_iterator(residual.len(), residual.iter().map(|r| if r.is_finite() { *r } else { 0.0 })))
    }

    /// What is known of a number beforehand: the inverse of its variance.
    fn known(number: usize) -> f64 {
        let open = if number.is_multiple_of(2) { OPEN.0 } else { OPEN.1 };
        open.powi(-2)
    }

    fn cost(by: &DVector<f64>, residual: &DVector<f64>) -> f64 {
        let away: f64 = by.iter().enumerate().map(|(k, by)| Self::known(k) * by * by).sum();
        squares(residual.as_slice()) + away
    }

    /// Where slopes say that the cost is lowest.
    fn step(&self, at: &DVector<f64>, residual: &DVector<f64>) -> Result<DVector<f64>, WorldError> {
        let slope = |k: usize| {
            let mut there = at.clone();
            there[k] += 1.0;
            Ok(self.residual(&there)? - residual)
        };
        let slopes: Vec<DVector<f64>> = (0..at.len()).map(slope).collect::<Result<_, WorldError>>()?;
        if slopes.is_empty() {
            return Ok(DVector::zeros(0));
        }
        let known = DVector::from_fn(at.len(), |k, _| Self::known(k));
        let slopes = DMatrix::from_columns(&slopes);
        let normal = slopes.tr_mul(&slopes) + DMatrix::from_diagonal(&known);
        let downhill = -(slopes.tr_mul(residual) + known.component_mul(at));
        Ok(normal.cholesky().map_or_else(|| DVector::zeros(at.len()), |normal| normal.solve(&downhill)))
    }

    /// The first point along a step, or half of it, and so on, that is lower.
    fn lower(
        &self,
        at: &DVector<f64>,
        residual: &DVector<f64>,
        step: &DVector<f64>,
    ) -> Option<(DVector<f64>, DVector<f64>)> {
        let cost = Self::cost(at, residual);
        let halved = (0..=HALVINGS).map(|k| at + step * 0.5f64.powi(k as i32));
        let tried = halved.filter_map(|next| self.residual(&next).ok().map(|there| (next, there)));
        tried.into_iter().find(|(next, there)| Self::cost(next, there) < cost)
    }
}
