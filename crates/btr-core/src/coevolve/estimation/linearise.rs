//! What a real test tells about S, by statistical linearisation.
//!
//! Simulations drawn from a belief are run on a test, and their errors, in multiples of the noise, are regressed on where they
//! stand in S. The slopes say what the test tells. What the regression leaves over is the part of the motion that the
//! belief's width makes unpredictable: a foot that lands earlier, a walk that grows chaotic, curvature. It is taken for
//! further noise, sample by sample and with the correlation that the ensemble shows, so that a chaotic test teaches with its
//! beginning while the belief is wide, and with more and more of it as the belief narrows. Linearising a likelihood about the
//! posterior itself, again and again, is the approach of D. M. Steinberg and E. V. Bonilla, "Extended and Unscented Gaussian
//! Processes" (NeurIPS 2014); the unpredictable part is btr's.
//!
//! Whether a test is explained is a posterior predictive check: simulations that took no part in a regression are held beside
//! it in the robot's place (A. Gelman, X.-L. Meng, H. Stern, "Posterior predictive assessment of model fitness via realized
//! discrepancies", Statistica Sinica 6, 1996).
//!
//! Errors have tens of thousands of samples, ensembles some tens of members: all that is needed of a test is the Gram matrix
//! of its members' errors.

use crate::optimize::Residuals;
use crate::search::UnitPoint;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Members that stand no farther apart than this in some direction do not stand apart.
const FLAT: f64 = 1e-12;
/// In so many parts an ensemble is divided to ask how well all others foretell each.
const FOLDS: usize = 8;
/// A robot that is like all but this share of the simulations that took no part in a regression is explained by it.
const FORESEEN: f64 = 0.9;
/// Samples that are looked at together.
const CHUNK: usize = 1024;

/// An ensemble's errors on one test: their inner products, member by member.
pub(crate) struct EnsembleErrors {
    gram: DMatrix<f64>,
    /// Covariance of the gradient by the sensors' noise alone.
    heard: DMatrix<f64>,
    /// How many readings there are, those that are unpredictable for less.
    samples: f64,
    /// Root mean square of what is unpredictable, in multiples of the noise.
    unpredictable: f64,
    /// Sum of ln(1 + variance) over the readings: what it costs to call them unpredictable.
    log_variances: f64,
}

impl EnsembleErrors {
    /// Of each member's residuals, whose squares add up to chi-squared per sample; `None` without any.
    pub(crate) fn of(ensemble: &Ensemble, residuals: &[Residuals]) -> Option<Self> {
        let WhitenedErrors { rows, variances, gram, .. } = WhitenedErrors::of(ensemble, residuals)?;
        let heard = ensemble.heard(&rows, &variances, &gram);
        let samples = variances.iter().map(|variance| 1.0 / (1.0 + variance)).sum();
        let unpredictable = (variances.iter().sum::<f64>() / variances.len() as f64).sqrt();
        let log_variances = variances.iter().map(|variance| variance.ln_1p()).sum();
        Some(EnsembleErrors { gram, heard, samples, unpredictable, log_variances })
    }

    /// How many readings were compared; one that is unpredictable counts for less.
    pub(crate) fn samples(&self) -> f64 {
        self.samples
    }

    /// How much of the spread of this test's errors no place in S accounts for, in multiples of the noise.
    pub(crate) fn unpredictable(&self) -> f64 {
        self.unpredictable
    }
}

/// Eight sums side by side: one alone would wait for every addition.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let ((xs, x_rest), (ys, y_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    for (x, y) in xs.iter().zip(ys) {
        for lane in 0..8 {
            sums[lane] += x[lane] * y[lane];
        }
    }
    sums.iter().sum::<f64>() + x_rest.iter().zip(y_rest).map(|(x, y)| x * y).sum::<f64>()
}

/// Where the members of an ensemble stand, and what a regression on that does with a Gram matrix.
pub(crate) struct Ensemble {
    /// Mean of the members.
    pub mean: DVector<f64>,
    /// Where each of them stands, row by row.
    places: DMatrix<f64>,
    /// Rows average into slopes: errors regressed on the members' places are these columns' combinations of their rows.
    pub slopes: DMatrix<f64>,
    /// An orthonormal basis of where the members stand about their mean.
    axes: DMatrix<f64>,
    /// What it leaves of each member's errors.
    pub leftover: DMatrix<f64>,
    /// Members less what the regression has used up.
    pub freedom: f64,
}

impl Ensemble {
    /// Of points of the unit cube; `None` for fewer than two more than there are dimensions.
    pub(crate) fn of(members: &[UnitPoint]) -> Option<Self> {
        let dims = members.first()?.len();
        Self::at(DMatrix::from_fn(members.len(), dims, |i, k| members[i][k]))
    }

    fn at(places: DMatrix<f64>) -> Option<Self> {
        let (count, dims) = places.shape();
        if count < dims + 3 {
            return None;
        }
        if dims == 0 {
            return Some(Self::nowhere(count));
        }
        let mean = places.row_mean().transpose();
        let mut apart = places.clone();
        apart.row_iter_mut().for_each(|mut place| place -= mean.transpose());
        let parts = apart.svd(true, true);
        let (axes, across) = (parts.u?, parts.v_t?);
        // A direction in which nobody stands apart has no slope.
        let inverse = parts.singular_values.map(|width| if width > FLAT { 1.0 / width } else { 0.0 });
        let slopes = &axes * DMatrix::from_diagonal(&inverse) * across;
        let centring = DMatrix::identity(count, count).add_scalar(-1.0 / count as f64);
        let leftover = centring - &axes * axes.transpose();
        Some(Ensemble { mean, places, slopes, axes, leftover, freedom: (count - dims - 1) as f64 })
    }

    /// Of members that are told apart by nothing.
    fn nowhere(count: usize) -> Self {
        let none = DMatrix::zeros(count, 0);
        let leftover = DMatrix::identity(count, count).add_scalar(-1.0 / count as f64);
        Ensemble {
            mean: DVector::zeros(0),
            places: none.clone(),
            slopes: none.clone(),
            axes: none,
            leftover,
            freedom: count as f64 - 1.0,
        }
    }

    /// The members' combination that the regression has for a place.
    pub(crate) fn regressed(&self, at: &DVector<f64>) -> DVector<f64> {
        let average = DVector::from_element(self.places.nrows(), 1.0 / self.places.nrows() as f64);
        average + &self.slopes * (at - &self.mean)
    }

    /// What a test says: an information matrix and a gradient at the ensemble's mean.
    pub(crate) fn told(&self, shown: &EnsembleErrors) -> TestInformation {
        let count = shown.gram.nrows();
        let noise = Unpredictable::of(&self.leftover, &shown.gram, self.freedom);
        let average = DVector::from_element(count, 1.0 / count as f64);
        let information = noise.product(&self.slopes, &self.slopes);
        let gradient = noise.product(&self.slopes, &DMatrix::from_columns(&[average])).column(0).into_owned();
        // The weights count what is unpredictable as noise already.
        let astray = self.astray(shown).map_or_else(
            || DMatrix::zeros(gradient.len(), gradient.len()),
            |astray| astray + &shown.heard - &information,
        );
        TestInformation { information, gradient, astray }
    }

    /// Covariance of the gradient that [`told`](Self::told) gives by the sensors' noise alone, whose variance is a share
    /// 1 / (1 + variance) of what each reading counts.
    fn heard(&self, rows: &[Vec<f64>], variances: &[f64], gram: &DMatrix<f64>) -> DMatrix<f64> {
        let noise = Unpredictable::of(&self.leftover, gram, self.freedom);
        let combined = &self.slopes - &self.leftover * &noise.weight * &noise.seen * &self.slopes;
        let dims = combined.ncols();
        let chunk = |(n, variances): (usize, &[f64])| {
            let columns = combined.column_iter().map(|shares| {
                let mut column = vec![0.0; variances.len()];
                let from = n * CHUNK;
                for (row, share) in rows.iter().zip(shares.iter()) {
                    add_scaled(&mut column, &row[from..from + variances.len()], *share);
                }
                column.iter_mut().zip(variances).for_each(|(x, variance)| *x /= (1.0 + variance).sqrt());
                column
            });
            let columns: Vec<Vec<f64>> = columns.collect();
            DMatrix::from_fn(dims, dims, |i, j| dot(&columns[i], &columns[j]))
        };
        let chunks: Vec<DMatrix<f64>> = variances.par_chunks(CHUNK).enumerate().map(chunk).collect();
        chunks.iter().sum()
    }

    /// How far simulations would lead the gradient astray if one of them were the robot, by what no slope foretells: its mean
    /// outer product, over members that did not take part in the regression. `None` for an ensemble with too few members to
    /// leave some out.
    fn astray(&self, shown: &EnsembleErrors) -> Option<DMatrix<f64>> {
        let pulls: Vec<DMatrix<f64>> = self.left_out(shown).iter().map(LeftOut::pulls).collect();
        let count: usize = pulls.iter().map(DMatrix::ncols).sum();
        (count > 0).then(|| pulls.iter().map(|pulls| pulls * pulls.transpose() / count as f64).sum())
    }

    /// Every member once beside a regression that it did not take part in. None for an ensemble with too few members.
    fn left_out(&self, shown: &EnsembleErrors) -> Vec<LeftOut> {
        // Draws come in pairs about the mean, which stay together.
        let of_fold = |fold: usize| (0..self.places.nrows()).partition(|i| i / 2 % FOLDS != fold);
        let folds: Vec<(Vec<usize>, Vec<usize>)> = (0..FOLDS).map(of_fold).collect();
        folds.par_iter().filter_map(|(taking_part, others)| self.without(shown, taking_part, others)).collect()
    }

    fn without(&self, shown: &EnsembleErrors, taking_part: &[usize], others: &[usize]) -> Option<LeftOut> {
        let regression = Ensemble::at(self.places.select_rows(taking_part))?;
        let beside = shown.gram.select_rows(taking_part);
        let among = beside.select_columns(taking_part);
        let mut squares = Vec::with_capacity(others.len());
        let unforeseen = |&k: &usize| {
            let shares = regression.regressed(&self.places.row(k).transpose());
            let products = beside.column(k) - &among * &shares;
            squares.push(shown.gram[(k, k)] - shares.dot(&beside.column(k)) - shares.dot(&products));
            products
        };
        let products = DMatrix::from_columns(&others.iter().map(unforeseen).collect::<Vec<_>>());
        Some(LeftOut { regression, among, products, squares })
    }

    /// What is foretold of a test of the point `at`.
    pub(crate) fn foretold(&self, shown: &EnsembleErrors, at: &DVector<f64>) -> Prediction {
        let noise = Unpredictable::of(&self.leftover, &shown.gram, self.freedom);
        let combined = DMatrix::from_columns(&[self.regressed(at)]);
        let chi2 = noise.product(&combined, &combined)[(0, 0)];
        let deviance = chi2 + shown.log_variances + noise.log_determinant;
        let mut excesses: Vec<f64> = self.left_out(shown).iter().flat_map(LeftOut::excesses).collect();
        excesses.sort_by(f64::total_cmp);
        let last = excesses.len().saturating_sub(1) as f64;
        let excess = excesses.get((FORESEEN * last) as usize).copied().unwrap_or(0.0);
        Prediction { chi2, samples: shown.samples, excess, deviance }
    }

    /// The variance of each sample's errors that no place in S accounts for.
    fn unexplained(&self, rows: &[Vec<f64>]) -> Vec<f64> {
        let chunk = |from: usize, variances: &mut [f64]| {
            let (mut sum, mut squares) = (vec![0.0; variances.len()], vec![0.0; variances.len()]);
            let mut along = vec![vec![0.0; variances.len()]; self.axes.ncols()];
            for (i, row) in rows.iter().enumerate() {
                let errors = &row[from..from + variances.len()];
                add_scaled(&mut sum, errors, 1.0);
                squares.iter_mut().zip(errors).for_each(|(sum, error)| *sum += error * error);
                for (k, along) in along.iter_mut().enumerate() {
                    add_scaled(along, errors, self.axes[(i, k)]);
                }
            }
            for (k, variance) in variances.iter_mut().enumerate() {
                let explained: f64 = along.iter().map(|along| along[k].powi(2)).sum();
                let about_mean = squares[k] - sum[k].powi(2) / rows.len() as f64;
                *variance = (about_mean - explained).max(0.0) / self.freedom;
            }
        };
        let mut variances = vec![0.0; rows[0].len()];
        variances.par_chunks_mut(CHUNK).enumerate().for_each(|(n, variances)| chunk(n * CHUNK, variances));
        variances
    }
}

/// Members that took no part in a regression, as the robot does not.
struct LeftOut {
    regression: Ensemble,
    /// Inner products of those that did.
    among: DMatrix<f64>,
    /// Inner products of what the regression does not foresee of a member, column by column, with those that took part.
    products: DMatrix<f64>,
    /// Of what it does not foresee of a member with itself.
    squares: Vec<f64>,
}

impl LeftOut {
    fn noise(&self) -> Unpredictable<'_> {
        Unpredictable::of(&self.regression.leftover, &self.among, self.regression.freedom)
    }

    /// Where the members, one per column, would pull the gradient if they were the robot and stood where the regression expects
    /// them.
    fn pulls(&self) -> DMatrix<f64> {
        let (noise, regression) = (self.noise(), &self.regression);
        let seen = &noise.weight * (&regression.leftover * &self.products);
        regression.slopes.transpose() * &self.products - (&noise.seen * &regression.slopes).transpose() * seen
    }

    /// What chi-squared would be of each of them without any noise, if it were the robot and stood where the regression expects
    /// it.
    fn excesses(&self) -> Vec<f64> {
        let seen = &self.regression.leftover * &self.products;
        let foreseen = &self.noise().weight * &seen;
        let excess = |(k, square): (usize, &f64)| square - seen.column(k).dot(&foreseen.column(k));
        self.squares.iter().enumerate().map(excess).collect()
    }
}

/// A test as a regression foretells it for some point.
pub(crate) struct Prediction {
    /// chi-squared beside what is unpredictable.
    pub chi2: f64,
    /// How many readings that is over.
    pub samples: f64,
    /// By how much chi-squared of a member that took no part exceeds what noise leaves, in [`FORESEEN`] of all cases: what is
    /// unpredictable is not as normal as it is taken for, and has more directions than members show.
    pub excess: f64,
    /// Minus twice the logarithm of the likelihood, less a constant: who calls more of it unpredictable has the smaller
    /// chi-squared and is no likelier for that.
    pub deviance: f64,
}

/// Adds a multiple of some numbers to sums.
pub(crate) fn add_scaled(sums: &mut [f64], numbers: &[f64], multiple: f64) {
    sums.iter_mut().zip(numbers).for_each(|(sum, number)| *sum += multiple * number);
}

/// The ensemble's mean on a test, where all that its members differ in counts as not known.
pub(crate) fn surprise(shown: &EnsembleErrors) -> Prediction {
    Ensemble::nowhere(shown.gram.nrows()).foretold(shown, &DVector::zeros(0))
}

/// An inner product of combinations of members' errors, weighted by the inverse of 1 + the covariance of what is left over
/// (Woodbury's identity; the noise is white and of size 1).
pub(crate) struct Unpredictable<'a> {
    gram: &'a DMatrix<f64>,
    /// leftover · gram.
    pub seen: DMatrix<f64>,
    pub weight: DMatrix<f64>,
    /// Logarithm of the covariance's determinant.
    log_determinant: f64,
}

impl<'a> Unpredictable<'a> {
    pub(crate) fn of(leftover: &DMatrix<f64>, gram: &'a DMatrix<f64>, freedom: f64) -> Self {
        let seen = leftover * gram;
        let count = gram.nrows();
        let inner = DMatrix::identity(count, count) * freedom + &seen * leftover;
        // Positive definite by construction; where rounding denies it, nothing is discounted for.
        let Some(factor) = inner.cholesky() else {
            return Unpredictable { gram, seen, weight: DMatrix::zeros(count, count), log_determinant: 0.0 };
        };
        let log_determinant = factor.l_dirty().diagonal().iter().map(|x| 2.0 * x.ln() - freedom.ln()).sum();
        Unpredictable { gram, seen, weight: factor.inverse(), log_determinant }
    }

    pub(crate) fn product(&self, a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
        let (seen_a, seen_b) = (&self.seen * a, &self.seen * b);
        a.transpose() * self.gram * b - seen_a.transpose() * &self.weight * seen_b
    }
}

/// What a test says about S.
pub(crate) struct TestInformation {
    /// Expected curvature of half its chi-squared.
    pub information: DMatrix<f64>,
    /// Slope of half its chi-squared at the ensemble's mean.
    pub gradient: DVector<f64>,
    /// Covariance of what the gradient errs by, less what the information has of it.
    pub astray: DMatrix<f64>,
}

/// Members' errors on one test, each reading's divided by its noise and by what is unpredictable of it.
pub(crate) struct WhitenedErrors {
    pub rows: Vec<Vec<f64>>,
    /// Which samples of the residuals these are, and by how much they were scaled to count in multiples of the noise.
    pub there: Vec<usize>,
    pub scale: f64,
    /// What is unpredictable of each, in multiples of the noise.
    pub variances: Vec<f64>,
    /// Inner products of the rows.
    pub gram: DMatrix<f64>,
}

impl WhitenedErrors {
    /// Of each member's residuals, whose squares add up to chi-squared per sample; `None` without any.
    pub(crate) fn of(ensemble: &Ensemble, residuals: &[Residuals]) -> Option<Self> {
        let (mut rows, there, scale) = rows_of(residuals)?;
        let variances = ensemble.unexplained(&rows);
        for row in &mut rows {
            row.iter_mut().zip(&variances).for_each(|(error, variance)| *error /= (1.0 + variance).sqrt());
        }
        let gram = gram_of(&rows);
        Some(WhitenedErrors { rows, there, scale, variances, gram })
    }
}

/// Each member's errors in multiples of the noise where all have some, which samples these are, and by how much residuals
/// were scaled for that.
fn rows_of(residuals: &[Residuals]) -> Option<(Vec<Vec<f64>>, Vec<usize>, f64)> {
    let flat: Vec<Vec<f64>> = residuals.iter().map(|blocks| blocks.concat()).collect();
    let length = flat.first()?.len();
    let there: Vec<usize> = (0..length).filter(|&k| flat.iter().all(|errors| errors[k].is_finite())).collect();
    let scale = (flat[0].iter().filter(|error| !error.is_nan()).count() as f64).sqrt();
    let row = |errors: &Vec<f64>| there.iter().map(|&k| scale * errors[k]).collect();
    let rows = flat.iter().map(row).collect();
    (!there.is_empty()).then_some((rows, there, scale))
}

fn gram_of(rows: &[Vec<f64>]) -> DMatrix<f64> {
    let products = |i: usize| (0..=i).map(|j| dot(&rows[i], &rows[j])).collect();
    let half: Vec<Vec<f64>> = (0..rows.len()).into_par_iter().map(products).collect();
    DMatrix::from_fn(rows.len(), rows.len(), |i, j| half[i.max(j)][i.min(j)])
}
