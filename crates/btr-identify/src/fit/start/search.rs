//! Search for the start states of logs. The first readings give only a rough estimate, above all of velocities: where
//! these change within a few samples, no curve fitted to the samples is accurate. A model that predicts the motion
//! gives a better estimate.

use crate::fit::residual_vector::squares;
use crate::fit::rollouts::{each, rows_near, shared};
use crate::residual_model::{
    ModelDescription, MovedStart, RecordedLog, ResidualModel, ResidualRequest, StartNumber, TimeStep,
};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::cell::Cell;

/// Most Gauss-Newton steps, ...
const ROUNDS: usize = 4;
/// ... which end when no number moves by more than this.
const SETTLED: f64 = 0.1;
/// Most halvings of a step that does not lower the cost.
const HALVINGS: u32 = 3;
/// Starts that move by less stay where they are: the linear response to the start covers the rest.
pub(in crate::fit) const MOVED: f64 = 3.0;

/// The starts from which the model at `u` is nearest to each log, by Gauss-Newton steps from the recorded starts: those
/// that move by more than `least`, and the number of simulated logs.
///
/// A model that lacks an effect prefers starts that compensate for a part of it: accept them only by how much error
/// they explain.
pub fn nearest_starts(
    model: &dyn ResidualModel,
    description: &ModelDescription,
    u: &[f64],
    least: f64,
) -> (Vec<MovedStart>, usize) {
    let starts = &description.starts;
    let logs: Vec<usize> = (0..starts.len()).filter(|&log| starts[log].begins_with == log).collect();
    let search_log = |log: usize| {
        let search = StartSearch {
            model,
            batch_size: description.batch_size,
            u,
            log,
            recorded: &description.logs[log],
            numbers: starts[log].numbers.iter().filter(|number| number.search_sd.is_some()).collect(),
            open: starts[log].search_sds(),
            rollouts: Cell::new(0),
        };
        let moved = search.nearest().filter(|by| by.amax() > least);
        (moved.map(|by| MovedStart { log, by: by.as_slice().to_vec() }), search.rollouts.get())
    };
    let searched: Vec<_> = logs.into_par_iter().with_max_len(1).map(search_log).collect();
    let rollouts = searched.iter().map(|(_, rollouts)| rollouts).sum();
    (searched.into_iter().filter_map(|(moved, _)| moved).collect(), rollouts)
}

/// The search for the start of one log.
struct StartSearch<'a> {
    model: &'a dyn ResidualModel,
    batch_size: usize,
    u: &'a [f64],
    log: usize,
    recorded: &'a RecordedLog,
    /// The numbers that are searched, ...
    numbers: Vec<&'a StartNumber>,
    /// ... and their standard deviations.
    open: Vec<f64>,
    rollouts: Cell<usize>,
}

impl StartSearch<'_> {
    /// The best start; `None` where none is searched, or a rollout fails: the log then keeps its start.
    fn nearest(&self) -> Option<DVector<f64>> {
        let mut at = DVector::zeros(self.open.len());
        if at.is_empty() {
            return None;
        }
        let mut residual = self.residual(&at)?;
        for _ in 0..ROUNDS {
            let Some((next, lowered)) = self.lower(&at, &residual, &self.step(&at, &residual)?) else { break };
            let far = (&next - &at).amax();
            (at, residual) = (next, lowered);
            if far < SETTLED {
                break;
            }
        }
        Some(at)
    }

    fn residuals(&self, moved: &[DVector<f64>]) -> Vec<Option<DVector<f64>>> {
        self.rollouts.update(|rollouts| rollouts + moved.len());
        let (u, log) = (self.u, self.log);
        let requests: Vec<ResidualRequest> =
            moved.iter().map(|by| ResidualRequest { u, log, moved: by.as_slice() }).collect();
        let or_zero = |r: &f64| if r.is_finite() { *r } else { 0.0 };
        let known = |residual: Vec<f64>| DVector::from_iterator(residual.len(), residual.iter().map(or_zero));
        let simulate = |requests: &[ResidualRequest]| self.model.residuals(requests, TimeStep::USUAL);
        each(self.batch_size, &requests, &simulate, &|_, residual| residual.ok().map(known))
    }

    fn residual(&self, by: &DVector<f64>) -> Option<DVector<f64>> {
        self.residuals(std::slice::from_ref(by)).pop().flatten()
    }

    /// Prior precision of each number: the inverse of its variance.
    fn precision(&self) -> DVector<f64> {
        DVector::from_iterator(self.open.len(), self.open.iter().map(|open| open.powi(-2)))
    }

    fn cost(&self, by: &DVector<f64>, residual: &DVector<f64>) -> f64 {
        squares(residual.as_slice()) + self.precision().dot(&by.component_mul(by))
    }

    /// The Gauss-Newton step; zero where the normal matrix is singular.
    fn step(&self, at: &DVector<f64>, residual: &DVector<f64>) -> Option<DVector<f64>> {
        let groups = shared(self.numbers.iter().map(|number| number.channels.as_slice()));
        let nudged = |group: &Vec<usize>| {
            let mut moved = at.clone();
            group.iter().for_each(|&k| moved[k] += 1.0);
            moved
        };
        let nudged = self.residuals(&groups.iter().map(nudged).collect::<Vec<_>>());
        let mut slopes = DMatrix::zeros(residual.len(), at.len());
        for (group, nudged) in groups.iter().zip(nudged) {
            let nudged = nudged?;
            for &k in group {
                for row in rows_near(self.recorded, &self.numbers[k].channels).into_iter().flatten() {
                    slopes[(row, k)] = nudged[row] - residual[row];
                }
            }
        }
        let precision = self.precision();
        let normal = slopes.tr_mul(&slopes) + DMatrix::from_diagonal(&precision);
        let downhill = -(slopes.tr_mul(residual) + precision.component_mul(at));
        Some(normal.cholesky().map_or_else(|| DVector::zeros(at.len()), |normal| normal.solve(&downhill)))
    }

    /// The first point with a lower cost after the step, half of it, and so on; with its residual.
    fn lower(
        &self,
        at: &DVector<f64>,
        residual: &DVector<f64>,
        step: &DVector<f64>,
    ) -> Option<(DVector<f64>, DVector<f64>)> {
        let cost = self.cost(at, residual);
        let halved = (0..=HALVINGS).map(|k| at + step * 0.5f64.powi(k as i32));
        let mut tried = halved.filter_map(|next| self.residual(&next).map(|lowered| (next, lowered)));
        tried.find(|(next, lowered)| self.cost(next, lowered) < cost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual_model::MeasuredChannel;
    use btr_core::world::WorldError;
    use proptest::prelude::*;
    use std::ops::Range;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn channel(name: &str, samples: Range<usize>) -> MeasuredChannel {
        let (name, unit) = (name.to_owned(), "m".to_owned());
        let present = samples.len();
        MeasuredChannel {
            name,
            unit,
            sigma: 1.0,
            sensor: 1.0,
            beside: [].into(),
            offset_differs: false,
            samples,
            present,
        }
    }

    fn log(channels: Vec<MeasuredChannel>) -> RecordedLog {
        RecordedLog { name: String::new(), held_out: false, channels, present: 0 }
    }

    /// Throws of a ball, measured without noise, whose true start differs from the recorded one; the last one's start
    /// is not searched.
    struct Throws {
        logs: Vec<RecordedLog>,
        began: Vec<[f64; 2]>,
        simulated: AtomicUsize,
    }

    impl Throws {
        fn that_began(began: &[[f64; 2]]) -> Self {
            let log = log(vec![channel("q_ball", 0..100)]);
            let (logs, began) = (vec![log; began.len()], began.to_vec());
            Throws { logs, began, simulated: AtomicUsize::new(0) }
        }
    }

    impl ResidualModel for Throws {
        fn description(&self) -> ModelDescription {
            let mut description = ModelDescription::new(Vec::new(), self.logs.clone());
            let open = |sd: f64| StartNumber { search_sd: Some(sd), ..StartNumber::default() };
            for start in description.starts.iter_mut().take(self.logs.len() - 1) {
                start.numbers = vec![open(10.0), open(300.0)];
            }
            description
        }

        /// Drag makes the height nonlinear in the velocity.
        fn residuals(&self, requests: &[ResidualRequest], _: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
            let residual = |&ResidualRequest { log, moved, .. }: &ResidualRequest| {
                self.simulated.fetch_add(1, Ordering::Relaxed);
                let height = |[q, dq]: [f64; 2], t: f64| q + 20.0 * (1.0 + (dq + 3.0) * t / 20.0).ln();
                let at = |k: usize| 0.01 * k as f64;
                let lost = |k: usize| if k == 7 { f64::NAN } else { 0.0 };
                let error = |k| height(self.began[log], at(k)) - height([moved[0], moved[1]], at(k)) + lost(k);
                Ok((0..100).map(error).map(|r| 1e3 * r).collect())
            };
            requests.iter().map(residual).collect()
        }
    }

    /// Two balls in one log that are rolled uphill side by side, each with a start of its own.
    struct SideBySide(ModelDescription);

    const ROWS: usize = 50;

    impl SideBySide {
        fn new(names: [&[&str]; 2]) -> Self {
            let log = log(vec![channel("q_left", 0..ROWS), channel("q_right", ROWS..2 * ROWS)]);
            let mut description = ModelDescription::new(Vec::new(), vec![log]);
            let number = |k: usize| StartNumber {
                channels: names[k / 2].iter().map(|&name| name.to_owned()).collect(),
                search_sd: Some(100.0),
            };
            description.starts[0].numbers = (0..4).map(number).collect();
            SideBySide(description)
        }
    }

    impl ResidualModel for SideBySide {
        fn description(&self) -> ModelDescription {
            self.0.clone()
        }

        fn residuals(&self, requests: &[ResidualRequest], _: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
            let rolled = |q: f64, dq: f64, t: f64| q + 30.0 * (dq * t / 30.0).sin();
            let row = |moved: &[f64], row: usize| {
                let (ball, t) = (row / ROWS, 0.05 * (row % ROWS) as f64);
                rolled(5.0, -8.0, t) - rolled(moved[2 * ball], moved[2 * ball + 1], t)
            };
            requests.iter().map(|r| Ok((0..2 * ROWS).map(|k| row(r.moved, k)).collect())).collect()
        }
    }

    #[test]
    fn numbers_that_show_in_different_channels_share_rollouts() {
        let search = |names| {
            let model = SideBySide::new(names);
            nearest_starts(&model, &model.description(), &[], 0.2)
        };
        let ((apart, few), (alone, many)) = (search([&["q_left"], &["q_right"]]), search([&[], &[]]));
        assert!(apart[0].by.iter().zip([5.0, -8.0, 5.0, -8.0]).all(|(by, truth)| (by - truth).abs() < SETTLED));
        // Each step takes two rollouts fewer.
        assert!(apart == alone && few < many, "{apart:?} {alone:?} {few} {many}");
    }

    proptest! {
        #[test]
        fn the_true_starts_of_logs_are_found(q in -5.0f64..5.0, dq in -2.0f64..20.0) {
            let throws = Throws::that_began(&[[q, dq], [0.0, 0.0], [q, dq]]);
            let (moved, rollouts) = nearest_starts(&throws, &throws.description(), &[], 0.2);
            prop_assert_eq!(rollouts, throws.simulated.into_inner());
            prop_assert_eq!(moved.len(), usize::from(q.abs().max(dq.abs()) > 0.2), "{:?}", &moved);
            for MovedStart { log, by } in moved {
                prop_assert!(log == 0 && (by[0] - q).abs() < SETTLED && (by[1] - dq).abs() < SETTLED, "{by:?}");
            }
        }
    }
}
