//! The last part of a fit: to the middle of what its logs leave open.

use super::bench::{Bench, Logs, corrected};
use super::solve::{Fit, cost};
use crate::family::Knob;
use nalgebra::{DMatrix, DVector};

/// Steps to the middle of what is left open, as long as each lowers the cost by this much, and which shares of each are tried.
const SETTLING: usize = 12;
const WORTH_A_STEP: f64 = 0.1;
const SHARES: [f64; 3] = [1.0, 0.5, 0.2];
/// The shares of a step after which its bend is looked at, and the most that it may bend.
const AHEAD: [f64; 2] = [0.1, 0.2];
const BENT: f64 = 0.75;
/// Slopes are renewed where less than this share of the promised fall came, ...
const KEPT: f64 = 0.5;
/// ... but so often at most.
const RENEWALS: usize = 2;

impl Fit {
    /// To the middle of what the logs leave open, with slopes as wide as that: a search for a lower error stops
    /// anywhere along a direction that hardly matters to it, an estimate must not. The way there is curved (a common
    /// factor of masses, gains and friction), so steps go in proportion and follow what is left of the curve:
    /// M. K. Transtrum and J. P. Sethna, "Improvements to the Levenberg-Marquardt algorithm for nonlinear least-squares
    /// minimization", arXiv:1201.5885.
    pub fn settle(&mut self, bench: &Bench) {
        self.differentiate_widely(bench);
        let mut renewals = 0;
        for _ in 0..SETTLING {
            let (fall, promised) = match self.settling_step(bench) {
                Some((to, promised)) => {
                    let (fall, jacobian) = (self.cost - to.cost, self.jacobian.take());
                    *self = Fit { jacobian, ..to };
                    (fall, promised)
                }
                None if self.fresh => return,
                None => (0.0, f64::INFINITY),
            };
            // Slopes that promised more than came are not those of here.
            if fall < KEPT * promised && promised > WORTH_A_STEP && renewals < RENEWALS {
                self.differentiate_widely(bench);
                renewals += 1;
            } else if fall < WORTH_A_STEP {
                return;
            }
        }
    }

    /// The best point on the way to where the local model is least, if it is better than here, and by how much the cost
    /// should fall on the way.
    fn settling_step(&self, bench: &Bench) -> Option<(Fit, f64)> {
        let (knobs, jacobian) = (bench.family.knobs(), self.jacobian.as_ref()?);
        let (straight, pinned) = self.bounded_step(knobs, jacobian)?;
        let promised = self.promised(knobs, jacobian, &straight);
        let bend = self.bend(bench, jacobian, &straight, &pinned);
        let curved = bend.map(|bend| SHARES.map(|share| &straight * share + &bend * share.powi(2)));
        let steps = SHARES.map(|share| &straight * share).into_iter().chain(curved.into_iter().flatten());
        let points: Vec<Vec<f64>> = steps.map(|step| self.point_along(knobs, &step)).collect();
        let there = bench.residuals(&points, Logs::Learn);
        let fits = points.into_iter().zip(there).filter_map(|(u, residual)| {
            let residual = corrected(residual?, &self.step_error);
            let cost = cost(knobs, &self.active, &u, &residual);
            Some(Fit { u, residual, cost, jacobian: None, fresh: false, ..self.like() })
        });
        let best = fits.min_by(|a, b| a.cost.total_cmp(&b.cost)).filter(|best| best.cost < self.cost);
        best.map(|best| (best, promised))
    }

    /// By how much the local model's cost falls with a step.
    fn promised(&self, knobs: &[Knob], jacobian: &DMatrix<f64>, step: &DVector<f64>) -> f64 {
        let prior = |(&k, by): (&usize, &f64)| (2.0 * self.u[k] * by + by * by) / knobs[k].spread.powi(2);
        let change = jacobian * step;
        let priors: f64 = self.active.iter().zip(step.iter()).map(prior).sum();
        -(2.0 * change.dot(&DVector::from_column_slice(&self.residual)) + change.norm_squared() + priors)
    }

    /// Gauss and Newton's step where knobs that it would carry over a bound go as far as the bound, the one that would go
    /// farthest beyond first, and the others do what is best then; with those that do.
    fn bounded_step(&self, knobs: &[Knob], jacobian: &DMatrix<f64>) -> Option<(DVector<f64>, Vec<Option<f64>>)> {
        let mut pinned: Vec<Option<f64>> = vec![None; self.active.len()];
        loop {
            let step = self.solved(knobs, jacobian, 0.0, &pinned, self.gradient(knobs, jacobian))?;
            let beyond = |k: usize| {
                let (knob, u) = (&knobs[self.active[k]], self.u[self.active[k]]);
                let bound = if step[k] < 0.0 { knob.bounds.0 } else { knob.bounds.1 };
                (((step[k] - (bound - u)) * step[k].signum()) / knob.spread, bound - u)
            };
            let free = (0..pinned.len()).filter(|&k| pinned[k].is_none());
            let farthest = free.map(|k| (k, beyond(k))).max_by(|a, b| a.1.0.total_cmp(&b.1.0));
            match farthest {
                Some((k, (by, room))) if by > 0.0 => pinned[k] = Some(room),
                _ => return Some((step, pinned)),
            }
        }
    }

    /// By how much a step leaves the way on which the residual changes in proportion to it, the pinned knobs aside; none
    /// where it bends too much to be followed.
    fn bend(
        &self,
        bench: &Bench,
        jacobian: &DMatrix<f64>,
        step: &DVector<f64>,
        pinned: &[Option<f64>],
    ) -> Option<DVector<f64>> {
        let knobs = bench.family.knobs();
        let there = bench.residuals(&AHEAD.map(|share| self.point_along(knobs, &(step * share))), Logs::Learn);
        let [Some(near), Some(far)] = &there[..] else { return None };
        let (near_weight, far_weight, here_weight) = second_difference(AHEAD);
        let here = self.bare();
        let second = |row: usize| 0.5 * (near_weight * near[row] + far_weight * far[row] + here_weight * here[row]);
        let second = DVector::from_fn(here.len(), |row, _| second(row));
        let held: Vec<Option<f64>> = pinned.iter().map(|pinned| pinned.map(|_| 0.0)).collect();
        let bend = self.solved(knobs, jacobian, 0.0, &held, jacobian.tr_mul(&second))?;
        (bend.norm() < BENT * step.norm()).then_some(bend)
    }

    /// The same knobs and step error, with nothing known.
    fn like(&self) -> Fit {
        let (active, step_error) = (self.active.clone(), self.step_error.clone());
        let (u, residual) = (Vec::new(), Vec::new());
        Fit { active, u, residual, cost: f64::INFINITY, step_error, jacobian: None, fresh: false }
    }
}

/// Weights of a second derivative from what is seen at two distances and here.
fn second_difference([near, far]: [f64; 2]) -> (f64, f64, f64) {
    let (near_weight, far_weight) = (2.0 / (near * (near - far)), 2.0 / (far * (far - near)));
    (near_weight, far_weight, -near_weight - far_weight)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::family::{Candidate, Family, Law, Measured, Recorded, Rollout, Step};
    use crate::fit::{Effort, estimates};
    use crate::world::WorldError;

    const ROWS: usize = 200;

    /// A servo with friction: what is measured follows from gain over mass and from friction over mass alone.
    struct Servo {
        knobs: Vec<Knob>,
        logs: Vec<Recorded>,
    }

    impl Servo {
        fn new() -> Self {
            let knob = |name: &str, unit: &str, law, origin, size, spread| Knob {
                name: name.to_owned(),
                unit: unit.to_owned(),
                origin,
                size,
                law,
                bounds: if law == Law::Linear { (0.0, 30.0) } else { (-2.0, 2.0) },
                spread,
                reach: 0.05,
                amplitude: law == Law::Linear,
            };
            let knobs = vec![
                knob("mass", "kg", Law::Exponential, 2.0, 0.3, 1.0),
                knob("kp", "N.m/rad", Law::Exponential, 30.0, 0.3, 1.0),
                knob("friction", "N.m", Law::Linear, 0.0, 0.1, 33.0),
            ];
            let channel = Measured { name: "q".to_owned(), unit: "rad".to_owned(), sigma: 1.0, samples: 0..ROWS };
            let log = Recorded { name: "log".to_owned(), held_out: false, channels: vec![channel], present: ROWS };
            Servo { knobs, logs: vec![log] }
        }

        fn simulated(&self, u: &[f64], row: usize) -> f64 {
            let [mass, kp, friction] = [0, 1, 2].map(|k| self.knobs[k].value(u[k]));
            let t = row as f64 * 0.02;
            100.0 * ((kp / mass).sqrt() * t).sin() - 300.0 * (friction / mass) * (1.3 * t).cos()
        }
    }

    impl Family for Servo {
        fn knobs(&self) -> &[Knob] {
            &self.knobs
        }

        fn doubtful(&self) -> &[usize] {
            &[0, 1, 2]
        }

        fn candidates(&self) -> &[Candidate] {
            &[]
        }

        fn logs(&self) -> &[Recorded] {
            &self.logs
        }

        fn residual(&self, Rollout { u, .. }: Rollout, _: Step) -> Result<Vec<f64>, WorldError> {
            let truth = [0.0, self.knobs[1].coordinate(36.0), self.knobs[2].coordinate(0.4)];
            let noise = |row: usize| ((row * row) as f64 * 0.7).sin() * std::f64::consts::SQRT_2;
            Ok((0..ROWS).map(|row| self.simulated(&truth, row) + noise(row) - self.simulated(u, row)).collect())
        }
    }

    /// A fit that has gone downhill from somewhere along the factor.
    fn downhill(bench: &Bench, factor: f64) -> Fit {
        let knobs = bench.family.knobs();
        let values = [2.0 * factor, 36.0 * factor, 0.4 * factor];
        let u = knobs.iter().zip(values).map(|(knob, value)| knob.coordinate(value)).collect();
        let mut fit = Fit::at(bench, vec![0, 1, 2], u, &[]).unwrap();
        fit.solve(bench, Effort::FULL);
        fit
    }

    #[test]
    fn a_common_factor_that_is_not_told_is_found_in_its_middle() {
        let servo = Servo::new();
        let bench = Bench::new(&servo);
        let mut ends = Vec::new();
        for factor in [0.8, 1.0, 1.3] {
            let mut fit = downhill(&bench, factor);
            fit.settle(&bench);
            let estimates = estimates(&bench, &fit, 1.0, true);
            for ((_, estimate), truth) in estimates.iter().zip([2.0, 36.0, 0.4]) {
                let [least, most] = estimate.ci95.unwrap();
                assert!(least < truth && truth < most, "{factor}: {estimate:?}");
                assert!(most > 1.2 * least, "a factor that nothing tells leaves more open: {estimate:?}");
            }
            ends.push(fit);
        }
        let least = ends.iter().map(|fit| fit.cost).fold(f64::INFINITY, f64::min);
        for fit in &ends {
            assert!(fit.cost - least < WORTH_A_STEP, "{} is not the middle, {least} is", fit.cost);
            assert!((fit.u[0] - ends[0].u[0]).abs() < 0.1, "{:?} and {:?}", fit.u, ends[0].u);
        }
    }

    #[test]
    fn knobs_go_to_their_bounds_one_by_one_and_the_others_make_the_best_of_it() {
        let mut servo = Servo::new();
        // The middle lies beyond this bound of the gain: mass and friction follow it there.
        servo.knobs[1].bounds.1 = servo.knobs[1].coordinate(31.0);
        let bench = Bench::new(&servo);
        let mut fit = downhill(&bench, 0.7);
        fit.settle(&bench);
        assert!((fit.u[1] - servo.knobs[1].bounds.1).abs() < 1e-9, "{:?}", fit.u);
        let ratio = servo.knobs[1].value(fit.u[1]) / servo.knobs[0].value(fit.u[0]);
        assert!((ratio / 18.0 - 1.0).abs() < 0.01, "{ratio}");
        assert!(fit.squares() < 1.1 * ROWS as f64, "{}", fit.squares());
    }

    #[test]
    fn a_second_difference_is_exact_for_parabolas() {
        let (near, far, here) = second_difference(AHEAD);
        let parabola = |x: f64| 3.0 * x * x - x + 2.0;
        let second = near * parabola(AHEAD[0]) + far * parabola(AHEAD[1]) + here * parabola(0.0);
        assert!((second - 6.0).abs() < 1e-9, "{second}");
    }
}
