//! Parameters of a restricted family that give the estimated combinations.

use super::BaseParameters;
use btr_core::optimize::QuadraticModel;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// What a coordinate of 1 costs, in squared standard deviations of a combination: less and less, so that in the end
/// combinations decide, and coordinates only where these leave them open.
const COSTS: [f64; 4] = [1.0, 1e-2, 1e-4, 1e-6];
/// Steps at each cost.
const STEPS: usize = 60;
/// The first damping, relative to the diagonal; its factors on success and failure, and its limit.
const DAMPING: (f64, f64, f64, f64) = (1e-3, 0.2, 8.0, 1e8);
/// A fall of the cost by a smaller share ends the steps.
const STALL: f64 = 1e-9;
/// Half the width of a difference.
const REACH: f64 = 1e-5;
/// Root mean square of deviations, in standard deviations, below which combinations count as reproduced.
const REPRODUCED: f64 = 0.05;

/// Parameters as a function of coordinates, which are 0 at the model and of the order of 1 at another one.
pub trait Family {
    /// Smallest and largest value of each coordinate.
    fn bounds(&self) -> Vec<(f64, f64)>;
    /// The parameters at some coordinates; `None` where there are none.
    fn at(&self, x: &[f64]) -> Option<Vec<f64>>;
}

/// Whether a family has members with the estimated combinations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Membership {
    /// A member has the estimates themselves.
    AsEstimated,
    /// A member has combinations that the logs do not tell from them, at the level of 5 %.
    WithinUncertainty,
    /// All members differ from them by more.
    Contradicted,
}

/// The member of a family that is nearest to the model among those that give the estimated combinations best.
#[derive(Clone, Debug, PartialEq)]
pub struct Nearest {
    /// All parameters.
    pub values: Vec<f64>,
    /// Its combinations.
    pub combinations: Vec<f64>,
    /// Root mean square of the deviations from the estimates, in their standard deviations.
    pub distance: f64,
    /// Whether that is little.
    pub membership: Membership,
}

/// Searches a family. The search descends from the model; where parameters are an injective smooth function of
/// coordinates, the sum of squares has no other local minimum, as it is convex in the parameters. `None` where the
/// family has no member at the model.
pub fn nearest(base: &BaseParameters, family: &dyn Family) -> Option<Nearest> {
    let search = Search { base, family, bounds: family.bounds(), estimates: base.estimates() };
    let mut x = search.within(&DVector::zeros(search.bounds.len()));
    for cost in COSTS {
        x = search.descended(x, cost)?;
    }
    let values = family.at(x.as_slice())?;
    let squares = search.deviations(&values).norm_squared();
    let count = base.combinations.len().max(1) as f64;
    let distance = (squares / count).sqrt();
    let membership = match () {
        () if distance <= REPRODUCED => Membership::AsEstimated,
        () if squares <= chi_squared_95(count) => Membership::WithinUncertainty,
        () => Membership::Contradicted,
    };
    let combinations = (&base.map * DVector::from_column_slice(&values)).as_slice().to_vec();
    Some(Nearest { values, combinations, distance, membership })
}

struct Search<'a> {
    base: &'a BaseParameters,
    family: &'a dyn Family,
    bounds: Vec<(f64, f64)>,
    estimates: DVector<f64>,
}

impl Search<'_> {
    /// Differences between combinations and estimates, as independent numbers in standard deviations.
    fn deviations(&self, values: &[f64]) -> DVector<f64> {
        &self.base.whitening * (&self.base.map * DVector::from_column_slice(values) - &self.estimates)
    }

    fn cost(&self, x: &DVector<f64>, cost: f64) -> Option<f64> {
        Some(self.deviations(&self.family.at(x.as_slice())?).norm_squared() + cost * x.norm_squared())
    }

    /// Levenberg and Marquardt's steps within the bounds.
    fn descended(&self, mut x: DVector<f64>, cost: f64) -> Option<DVector<f64>> {
        let (mut now, mut damping) = (self.cost(&x, cost)?, DAMPING.0);
        for _ in 0..STEPS {
            let quadratic = self.quadratic(&x, cost)?;
            let Some((next, fell)) = self.step(&x, now, cost, &quadratic, &mut damping) else { break };
            let stalls = now - fell <= STALL * now;
            (x, now) = (next, fell);
            if stalls {
                break;
            }
        }
        Some(x)
    }

    /// A step that lowers the cost, with its cost.
    fn step(
        &self,
        x: &DVector<f64>,
        now: f64,
        cost: f64,
        quadratic: &QuadraticModel,
        damping: &mut f64,
    ) -> Option<(DVector<f64>, f64)> {
        let (_, success, failure, most) = DAMPING;
        let held: Vec<Option<f64>> = self
            .bounds
            .iter()
            .enumerate()
            .map(|(k, (least, most))| {
                let outwards =
                    (x[k] <= *least && quadratic.gradient[k] > 0.0) || (x[k] >= *most && quadratic.gradient[k] < 0.0);
                outwards.then_some(0.0)
            })
            .collect();
        while *damping < most {
            let moved = quadratic.step(*damping, &held).map(|by| self.within(&(x + by)));
            let better = moved.and_then(|next| Some((self.cost(&next, cost)?, next))).filter(|(c, _)| *c < now);
            if let Some((fell, next)) = better {
                *damping *= success;
                return Some((next, fell));
            }
            *damping *= failure;
        }
        *damping = DAMPING.0;
        None
    }

    fn within(&self, x: &DVector<f64>) -> DVector<f64> {
        DVector::from_iterator(x.len(), x.iter().zip(&self.bounds).map(|(x, (least, most))| x.clamp(*least, *most)))
    }

    fn quadratic(&self, x: &DVector<f64>, cost: f64) -> Option<QuadraticModel> {
        let residual = self.deviations(&self.family.at(x.as_slice())?);
        let mut slopes = DMatrix::zeros(self.base.map.ncols(), x.len());
        for k in 0..x.len() {
            let side = |by: f64| {
                let mut moved = x.clone();
                moved[k] += by;
                self.family.at(moved.as_slice()).map(DVector::from_vec)
            };
            slopes.set_column(k, &((side(REACH)? - side(-REACH)?) / (2.0 * REACH)));
        }
        let jacobian = &self.base.whitening * (&self.base.map * slopes);
        let mut curvature = jacobian.tr_mul(&jacobian);
        (0..x.len()).for_each(|k| curvature[(k, k)] += cost);
        Some(QuadraticModel { curvature, gradient: jacobian.tr_mul(&residual) + x * cost })
    }
}

/// The value that a chi-squared number exceeds in 5 % of the cases: the cube-root approximation of E. B. Wilson and M.
/// M. Hilferty, "The distribution of chi-square", Proceedings of the National Academy of Sciences 17, 1931.
fn chi_squared_95(freedom: f64) -> f64 {
    const QUANTILE_95: f64 = 1.645;
    let spread = 2.0 / (9.0 * freedom);
    freedom * (1.0 - spread + QUANTILE_95 * spread.sqrt()).powi(3)
}
