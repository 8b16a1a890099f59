//! The belief about S: a normal distribution on the unit cube, from the bounds alone to the posterior of the real
//! tests.

use crate::random::{Rng, normal};
use crate::search::UnitPoint;
use crate::space::{Dim, Space};
use indexmap::IndexMap;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Standard deviation of a uniform distribution over the bounds.
const OF_BOUNDS: f64 = 0.288_675_134_594_812_9;
/// 97.5 % of a normal distribution lie below so many standard deviations.
const TWO_SIDED_95: f64 = 1.959_963_984_540_054;
/// A direction of S counts as open while its standard deviation is above this share of that of its bounds.
const HARDLY_NARROWED: f64 = 0.5;
/// Step on the cube for numerical derivatives between spaces with different bounds.
const CARRIED: f64 = 1e-6;
/// Parts of a direction below this share of its largest are left out of its description.
const SEEN: f64 = 0.2;

/// A normal distribution over S, on the unit cube.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Posterior {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// Marginal posterior of one parameter of S.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Belief {
    /// The most probable value, in the units of S.
    pub value: f64,
    /// 95 % credible interval, within the bounds. `None` while simulations do not explain the tests to the noise: with
    /// structured errors the interval would not be valid.
    pub ci95: Option<[f64; 2]>,
    /// Whether the interval's half is at most the plan's `resolution` of the bounds' width.
    #[serde(rename = "told")]
    pub identified: bool,
}

/// A combination of parameters that the real tests do not identify.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OpenDirection {
    /// The combination: shares of each parameter's bounds, in unit length; small parts are left out.
    pub parameters: IndexMap<String, f64>,
    /// Its standard deviation as a share of that of the bounds alone: 1 means that nothing was learnt.
    pub left: f64,
}

/// A belief and how well it explains the tests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimated {
    /// The belief.
    pub belief: Posterior,
    /// Root of chi-squared per sample over the tests, with the unpredictable part counted as noise.
    pub chi: f64,
    /// The unpredictable part of each test under the belief, in multiples of the noise.
    pub unpredictable: Vec<f64>,
    /// Effective number of samples that were compared; unpredictable ones count for less.
    pub samples: f64,
    /// Minus twice the logarithm of the likelihood, less a constant.
    pub deviance: f64,
    /// Whether `chi` is at the noise, and no test far from it.
    pub explains: bool,
}

/// An estimate with the space that it is about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Explanation {
    /// The dimensions of the belief.
    pub space: Space,
    /// How it explains the tests.
    pub estimated: Estimated,
}

impl Posterior {
    /// The belief from bounds alone, with its mean at `start`.
    pub fn of_bounds(start: &[f64]) -> Self {
        let dims = start.len();
        Posterior {
            mean: DVector::from_column_slice(start),
            covariance: DMatrix::identity(dims, dims) * OF_BOUNDS.powi(2),
        }
    }

    pub(crate) fn new(mean: DVector<f64>, covariance: DMatrix<f64>) -> Self {
        Posterior { mean, covariance }
    }

    /// Whether it is a belief about a space of `dims` dimensions.
    pub fn is_of(&self, dims: usize) -> bool {
        let numbers = self.mean.iter().chain(&self.covariance);
        (self.mean.len(), self.covariance.shape()) == (dims, (dims, dims)) && numbers.into_iter().all(|x| x.is_finite())
    }

    /// The most probable point, on the unit cube.
    pub fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    /// The covariance, on the unit cube.
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// The same belief, at least this wide in every direction.
    #[must_use]
    pub(crate) fn at_least(&self, sd: f64) -> Self {
        let dims = self.mean.len();
        let covariance = &self.covariance + DMatrix::identity(dims, dims) * sd.powi(2);
        Posterior { mean: self.mean.clone(), covariance }
    }

    /// The same belief, `times` as wide.
    #[must_use]
    pub(crate) fn wider(&self, times: f64) -> Self {
        Posterior { mean: self.mean.clone(), covariance: &self.covariance * times.powi(2) }
    }

    /// The same belief in a larger S, of whose new dimensions only the bounds are known.
    #[must_use]
    pub(crate) fn enlarged(&self, start: &[f64]) -> Self {
        let mut larger = Posterior::of_bounds(start);
        let known = self.mean.len();
        larger.mean.rows_mut(0, known).copy_from(&self.mean);
        larger.covariance.view_mut((0, 0), (known, known)).copy_from(&self.covariance);
        larger
    }

    /// The belief about the parameters of another space, marginalised over those that it lacks; bounds may differ.
    /// `None` where it has further ones.
    pub fn carried(&self, from: &Space, to: &Space) -> Option<Self> {
        let place = |dim: &Dim| from.dims().iter().position(|known| known.name == dim.name);
        let places: Vec<usize> = to.dims().iter().map(place).collect::<Option<_>>()?;
        let carry = |k: usize, u: f64| to.dims()[k].to_unit(from.dims()[places[k]].from_unit(u));
        let at = |k: usize| self.mean[places[k]].clamp(CARRIED, 1.0 - CARRIED);
        let slope = |k: usize| (carry(k, at(k) + CARRIED) - carry(k, at(k) - CARRIED)) / (2.0 * CARRIED);
        let slopes: Vec<f64> = (0..places.len()).map(slope).collect();
        let mean = DVector::from_fn(places.len(), |k, _| carry(k, self.mean[places[k]]));
        let of = |i: usize, j: usize| slopes[i] * slopes[j] * self.covariance[(places[i], places[j])];
        Some(Posterior { mean, covariance: DMatrix::from_fn(places.len(), places.len(), of) })
    }

    /// Points of the cube drawn from it; each has a partner on the other side of the mean, so that the sample is
    /// centred.
    pub(crate) fn draws(&self, count: usize, rng: &mut Rng) -> Vec<UnitPoint> {
        let root = root(&self.covariance);
        let mut draws = Vec::with_capacity(count + 1);
        while draws.len() < count {
            let step = &root * DVector::from_fn(self.mean.len(), |_, _| normal(rng));
            for point in [&self.mean + &step, &self.mean - &step] {
                draws.push(point.iter().map(|x| x.clamp(0.0, 1.0)).collect());
            }
        }
        draws.truncate(count);
        draws
    }

    /// Standard deviation of a dimension, as a share of its bounds' width.
    pub fn sd(&self, k: usize) -> f64 {
        self.covariance[(k, k)].max(0.0).sqrt()
    }

    /// Logarithm of its volume on the cube, less a constant.
    pub(crate) fn volume(&self) -> f64 {
        root(&self.covariance).diagonal().iter().map(|width| width.ln()).sum()
    }

    /// Whether the interval of a dimension is narrow enough.
    pub(crate) fn identifies(&self, k: usize, resolution: f64) -> bool {
        TWO_SIDED_95 * self.sd(k) <= resolution
    }

    /// The marginal of each parameter, by name; `explained`: whether simulations explain the tests.
    pub(crate) fn beliefs(&self, space: &Space, resolution: f64, explained: bool) -> IndexMap<String, Belief> {
        let belief = |(k, dim): (usize, &Dim)| {
            let (u, half) = (self.mean[k], TWO_SIDED_95 * self.sd(k));
            let ci95 = explained.then(|| [dim.from_unit(u - half), dim.from_unit(u + half)]);
            let identified = explained && self.identifies(k, resolution);
            (dim.name.clone(), Belief { value: dim.from_unit(u), ci95, identified })
        };
        space.dims().iter().enumerate().map(belief).collect()
    }

    /// The combinations of parameters that are hardly narrower than the bounds leave them, widest first.
    pub(crate) fn open_directions(&self, space: &Space) -> Vec<OpenDirection> {
        let eigen = self.covariance.clone().symmetric_eigen();
        let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let left = |k: usize| eigen.eigenvalues[k].max(0.0).sqrt() / OF_BOUNDS;
        let open = order.into_iter().filter(|&k| left(k) > HARDLY_NARROWED);
        open.map(|k| {
            let direction = eigen.eigenvectors.column(k);
            let largest = direction[direction.iamax()];
            let parts = space.dims().iter().zip(direction.iter().map(|part| part / largest.signum()));
            let seen = parts.filter(|(_, part)| part.abs() >= SEEN * largest.abs());
            OpenDirection { parameters: seen.map(|(dim, part)| (dim.name.clone(), part)).collect(), left: left(k) }
        })
        .collect()
    }
}

/// A square root of a covariance: its Cholesky factor, or its deviations where rounding leaves none.
pub(crate) fn root(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let deviations = || DMatrix::from_diagonal(&covariance.diagonal().map(|variance| variance.max(0.0).sqrt()));
    covariance.clone().cholesky().map_or_else(deviations, |factor| factor.l())
}
