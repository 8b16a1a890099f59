//! Derivatives of the residual with respect to the free parameters: finite differences, of first order for a search and
//! of second order with adapted steps for intervals.

use super::estimate::information;
use super::objective::{LogSet, Objective};
use super::residual_vector::ResidualVector;
use super::solve::FitPoint;
use crate::residual_model::FitParameter;
use btr_core::world::WorldError;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Step of fine differences, as a share of the usual step.
const FINE: f64 = 0.1;
/// A residual that deviates from a straight line by more than this share of its change has a jump within the step...
const BENT: f64 = 0.1;
/// ... and is differentiated again with steps shortened by these factors, as long as that lowers the deviation.
const SHORTER: [f64; 2] = [0.1, 0.01];
/// Steps of fine differences, in standard deviations of the prior: about the shortest ones among them.
const SHORT: f64 = 0.005;
/// Directions are differentiated again with a step of their posterior deviation, as long as that exceeds the previous
/// step by this factor...
const GROWTH: f64 = 1.5;
/// ... but at most this often: each repetition contains less of the errors of short steps.
const RESTARTS: usize = 4;
/// The step along the common factor of all parameters whose unit contains mass, in standard deviations of the prior,
/// ...
const COMMON: f64 = 0.3;
/// ... and the largest share of the change by finer differences for its result to replace theirs.
const LESS: f64 = 0.5;
/// Smallest share to which bounds may shorten a step.
const CRAMPED: f64 = 0.2;

/// Two steps and the weights of the changes at them.
type Stencil = [(f64, f64); 2];

/// The residuals after the two steps.
type MovedPair = (Result<ResidualVector, WorldError>, Result<ResidualVector, WorldError>);

/// A direction to differentiate along.
struct ProbeDirection {
    /// The row vector that maps a step of the parameters to its length along `scaled`.
    along: DVector<f64>,
    /// The direction in coordinates of the parameters.
    scaled: DVector<f64>,
    /// Two steps and the weights of the changes at them.
    stencil: Stencil,
}

/// The derivative along a direction.
struct ProbeResponse {
    /// As in [`ProbeDirection`].
    along: DVector<f64>,
    /// As in [`ProbeDirection`].
    scaled: DVector<f64>,
    /// Derivative of the residual along it.
    change: DVector<f64>,
}

/// Replaces a Jacobian's derivative along a direction.
fn replace(jacobian: &mut DMatrix<f64>, along: &DVector<f64>, scaled: &DVector<f64>, change: &DVector<f64>) {
    let difference = change - &*jacobian * scaled;
    jacobian.ger(1.0, &difference, along, 1.0);
}

/// Derivative of the residual with respect to a parameter, and its deviation from a straight line as a share of the
/// change.
struct Slope {
    column: ResidualVector,
    bend: f64,
}

impl Slope {
    fn new(stencil: Stencil, here: &[f64], near: &[f64], far: &[f64]) -> Slope {
        let [(to_near, near_weight), (to_far, far_weight)] = stencil;
        let (mut missed, mut changed) = (0.0, 0.0);
        let changes = here.iter().zip(near).zip(far).map(|((here, near), far)| (near - here, far - here));
        let slope = |(near, far): (f64, f64)| {
            missed += (near - far * to_near / to_far).powi(2);
            changed += (near - far).powi(2);
            near_weight * near + far_weight * far
        };
        let column = changes.map(slope).collect();
        Slope { column, bend: if changed > 0.0 { (missed / changed).sqrt() } else { 0.0 } }
    }
}

impl FitPoint {
    /// Takes the Jacobian by forward differences (backward at an upper bound). Columns that cannot be simulated are
    /// zero.
    pub fn differentiate(&mut self, objective: &Objective) {
        let columns = columns(objective, &self.u, &self.active, &self.residual, &self.step_error);
        (self.jacobian, self.fresh) = (Some(self.jacobian_of(&columns)), true);
    }

    /// Takes the Jacobian by finer differences of second order: central ones, or one-sided ones next to a bound. The
    /// residual jumps where a joint switches between sticking and slipping. Differences across a jump deviate from a
    /// straight line and are taken again with shorter steps.
    pub fn differentiate_finely(&mut self, objective: &Objective) {
        let mut slopes = self.slopes(objective, &self.active, FINE);
        for finer in SHORTER {
            let bent: Vec<usize> = (0..slopes.len()).filter(|&k| slopes[k].bend > BENT).collect();
            if bent.is_empty() {
                break;
            }
            let parameters: Vec<usize> = bent.iter().map(|&k| self.active[k]).collect();
            for (k, slope) in bent.into_iter().zip(self.slopes(objective, &parameters, FINE * finer)) {
                if slope.bend < slopes[k].bend {
                    slopes[k] = slope;
                }
            }
        }
        let columns: Vec<Vec<f64>> = slopes.into_iter().map(|slope| slope.column).collect();
        (self.jacobian, self.fresh) = (Some(self.jacobian_of(&columns)), true);
    }

    /// A Jacobian with these columns.
    pub(super) fn jacobian_of(&self, columns: &[Vec<f64>]) -> DMatrix<f64> {
        let rows = self.residual.len();
        let mut jacobian = DMatrix::zeros(rows, columns.len());
        let places = jacobian.as_mut_slice().par_chunks_mut(rows.max(1));
        places.zip(columns).for_each(|(to, column)| to.copy_from_slice(column));
        jacobian
    }

    /// Differences of second order for some parameters, with steps of a share of their reach. Zero where they cannot be
    /// simulated.
    fn slopes(&self, objective: &Objective, active: &[usize], share: f64) -> Vec<Slope> {
        let parameters = objective.parameters();
        let stencils: Vec<Stencil> =
            active.iter().map(|&k| stencil(&parameters[k], self.u[k], share * parameters[k].reach)).collect();
        let moved = |(&parameter, stencil): (&usize, &Stencil)| {
            stencil.map(|(offset, _)| {
                let mut point = self.u.clone();
                point[parameter] += offset;
                (parameter, point)
            })
        };
        let here = self.bare();
        // Near steps first, then far ones: the two of a parameter never share a rollout.
        let points: Vec<[(usize, Vec<f64>); 2]> = active.iter().zip(&stencils).map(moved).collect();
        let (near, far): (Vec<_>, Vec<_>) = points.into_iter().map(|[near, far]| (near, far)).unzip();
        let (near, far) = (objective.moved(&near, &self.u, &here), objective.moved(&far, &self.u, &here));
        let slope = |(stencil, pair): (&Stencil, MovedPair)| match pair {
            (Ok(near), Ok(far)) => Slope::new(*stencil, &here, &near, &far),
            _ => Slope { column: vec![0.0; here.len()], bend: 0.0 },
        };
        stencils.par_iter().zip(near.into_par_iter().zip(far)).map(slope).collect()
    }

    /// Takes the Jacobian with steps as wide as the uncertainty that the logs leave: fine differences first, then once
    /// more along each poorly determined direction, in steps of its remaining deviation. The errors of short steps (a
    /// servo that sticks a sample earlier, a solver's tolerance) would otherwise count as information of the logs, and
    /// the widest intervals would be too narrow.
    pub fn differentiate_widely(&mut self, objective: &Objective) {
        self.differentiate_finely(objective);
        self.differentiate_along_common_factor(objective);
        let mut steps = vec![SHORT; self.active.len()];
        for _ in 0..RESTARTS {
            let information = information(objective.parameters(), self);
            let Some(information) = information.filter(|information| !information.is_empty()) else { return };
            let eigen = information.symmetric_eigen();
            let deviation = |i: usize| (1.0 + eigen.eigenvalues[i].max(0.0)).powf(-0.5);
            // From the best determined direction to the worst, so that each keeps its step from one repetition to the
            // next.
            let mut order: Vec<usize> = (0..self.active.len()).collect();
            order.sort_by(|&a, &b| deviation(a).total_cmp(&deviation(b)));
            let mut wider = Vec::new();
            for (&i, step) in order.iter().zip(&mut steps).filter(|(i, step)| deviation(**i) > GROWTH * **step) {
                *step = deviation(i);
                wider.push((eigen.eigenvectors.column(i).into_owned(), *step));
            }
            if wider.is_empty() {
                return;
            }
            self.differentiate_along(objective, wider);
        }
    }

    /// Replaces the derivative along the common factor of all parameters whose unit contains mass. Where no measured or
    /// fixed quantity depends on the unit of mass, logs do not determine this factor, but the errors of the fine
    /// differences of many parameters add up to apparent information. So the derivative is also taken along the factor
    /// itself, and replaces theirs where it is smaller.
    fn differentiate_along_common_factor(&mut self, objective: &Objective) {
        let parameters = objective.parameters();
        let Some(along) = self.common_factor(parameters) else { return };
        let Some(ProbeResponse { along, scaled, change }) = self.responses(objective, vec![(along, COMMON)]).pop()
        else {
            return;
        };
        let Some(jacobian) = self.jacobian.as_mut() else { return };
        if change.norm() < LESS * (&*jacobian * &scaled).norm() {
            replace(jacobian, &along, &scaled, &change);
        }
    }

    /// The direction, in units of the priors, in which all parameters whose unit contains mass grow by the same factor.
    fn common_factor(&self, parameters: &[FitParameter]) -> Option<DVector<f64>> {
        let part = |&k: &usize| {
            let growth = parameters[k].growth(self.u[k]);
            let grows = parameters[k].scales_with_mass() && growth.is_finite() && growth != 0.0;
            if grows { 1.0 / (growth * parameters[k].prior_sd()) } else { 0.0 }
        };
        DVector::from_iterator(self.active.len(), self.active.iter().map(part)).try_normalize(0.0)
    }

    /// Replaces the Jacobian's derivatives along directions (in units of the priors) by differences with the given
    /// steps.
    fn differentiate_along(&mut self, objective: &Objective, directions: Vec<(DVector<f64>, f64)>) {
        let responses = self.responses(objective, directions);
        let Some(jacobian) = self.jacobian.as_mut() else { return };
        responses.iter().for_each(|ProbeResponse { along, scaled, change }| replace(jacobian, along, scaled, change));
    }

    /// Derivatives along directions (in units of the priors): differences of second order with the given steps, or as
    /// far as the bounds allow. Directions that diverge or have no room on either side are left out.
    fn responses(&self, objective: &Objective, directions: Vec<(DVector<f64>, f64)>) -> Vec<ProbeResponse> {
        let parameters = objective.parameters();
        let spreads = DVector::from_fn(self.active.len(), |k, _| parameters[self.active[k]].prior_sd());
        let placed = |(along, step): (DVector<f64>, f64)| {
            let scaled = along.component_mul(&spreads);
            let stencil = self.stencil_along(parameters, &scaled, step)?;
            Some(ProbeDirection { along: along.component_div(&spreads), scaled, stencil })
        };
        let directions: Vec<ProbeDirection> = directions.into_iter().filter_map(placed).collect();
        let moved = |direction: &ProbeDirection| {
            direction.stencil.map(|(step, _)| self.point_along(parameters, &(&direction.scaled * step)))
        };
        let points: Vec<Vec<f64>> = directions.iter().flat_map(moved).collect();
        let residuals = objective.residuals(&points, LogSet::Learn);
        let here = self.bare();
        let response = |(direction, pair): (ProbeDirection, &[Result<ResidualVector, WorldError>])| {
            let ([Ok(near), Ok(far)], [(_, near_weight), (_, far_weight)]) = (pair, direction.stencil) else {
                return None;
            };
            let at = |row: usize| near_weight * (near[row] - here[row]) + far_weight * (far[row] - here[row]);
            let change = DVector::from_fn(here.len(), |row, _| at(row));
            Some(ProbeResponse { along: direction.along, scaled: direction.scaled, change })
        };
        directions.into_iter().zip(residuals.chunks(2)).filter_map(response).collect()
    }

    /// The point after a step of the free parameters; see [`FitParameter::in_proportion`].
    pub(super) fn point_along(&self, parameters: &[FitParameter], step: &DVector<f64>) -> Vec<f64> {
        let mut point = self.u.clone();
        let moves = self.active.iter().zip(step.iter());
        moves.for_each(|(&k, by)| point[k] = parameters[k].in_proportion(point[k], *by));
        point
    }

    /// Two steps along a direction and the weights of the changes at them; `None` where the bounds leave no room.
    fn stencil_along(&self, parameters: &[FitParameter], scaled: &DVector<f64>, step: f64) -> Option<Stencil> {
        let room = |side: f64| {
            let rooms = self.active.iter().zip(scaled.iter()).filter(|(_, x)| x.abs() > 1e-9).map(|(&k, x)| {
                let bound = if side * x > 0.0 { parameters[k].bounds.1 } else { parameters[k].bounds.0 };
                (bound - self.u[k]).abs() / x.abs()
            });
            rooms.fold(step, f64::min)
        };
        let (ahead, behind) = (room(1.0), room(-1.0));
        let one_sided = |h: f64| [(0.5 * h, 4.0 / h), (h, -1.0 / h)];
        match (ahead.min(behind), ahead.max(behind)) {
            (least, _) if least > CRAMPED * step => Some([(least, 0.5 / least), (-least, -0.5 / least)]),
            (_, most) if most > CRAMPED * step => Some(one_sided(if ahead >= behind { most } else { -most })),
            _ => None,
        }
    }
}

/// Two offsets and the weights of the changes at them, for a derivative of second order with steps of `h`.
fn stencil(parameter: &FitParameter, u: f64, h: f64) -> Stencil {
    let (least, most) = parameter.bounds;
    let one_sided = |h: f64| [(h, 2.0 / h), (2.0 * h, -0.5 / h)];
    match () {
        () if u - h >= least && u + h <= most => [(h, 0.5 / h), (-h, -0.5 / h)],
        () if u + 2.0 * h <= most => one_sided(h),
        () => one_sided(-h),
    }
}

/// d residual / d coordinate of each parameter, by finite differences.
pub fn columns(
    objective: &Objective,
    u: &[f64],
    active: &[usize],
    residual: &[f64],
    step_error: &[f64],
) -> Vec<Vec<f64>> {
    let parameters = objective.parameters();
    let reach = |parameter: usize| {
        let reach = parameters[parameter].reach;
        if u[parameter] + reach <= parameters[parameter].bounds.1 { reach } else { -reach }
    };
    let moved = |&parameter: &usize| {
        let mut point = u.to_vec();
        point[parameter] += reach(parameter);
        (parameter, point)
    };
    let bare: Vec<f64> = residual.iter().zip(step_error).map(|(r, e)| r - e).collect();
    let residuals = objective.moved(&active.iter().map(moved).collect::<Vec<_>>(), u, &bare);
    let column = |(&parameter, moved): (&usize, Result<ResidualVector, WorldError>)| match moved {
        Ok(moved) => moved.iter().zip(&bare).map(|(a, b)| (a - b) / reach(parameter)).collect(),
        // A parameter whose step cannot be simulated is not searched.
        Err(_) => vec![0.0; residual.len()],
    };
    active.par_iter().zip(residuals).map(column).collect()
}
