//! What logs and priors leave of all free parameters together, and draws from it.

use super::precision::{covariance, roots};
use super::wider;
use crate::fit::objective::Objective;
use crate::fit::solve::FitPoint;
use crate::residual_model::{FitParameter, Parametrisation};
use btr_core::random::{normal, stream};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Deserializer, Serialize};

/// The coordinate in which a parameter is uncertain by a standard deviation to both sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Coordinate {
    /// The value itself.
    Linear,
    /// Its natural logarithm.
    Log,
    /// Its inverse: 0 is off.
    Inverse,
}

/// A parameter's marginal distribution, in its coordinate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Marginal {
    /// Name of the parameter.
    pub name: String,
    /// The coordinate of the other numbers.
    pub coordinate: Coordinate,
    /// Mean: the fitted value.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
    /// Least coordinate; infinite for the logarithm of a bound at 0.
    #[serde(deserialize_with = "least")]
    pub min: f64,
    /// Greatest coordinate; infinite for the inverse of a bound at 0.
    #[serde(deserialize_with = "greatest")]
    pub max: f64,
}

/// A least coordinate: JSON has `null` in the place of an infinite number.
fn least<'de, D: Deserializer<'de>>(json: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(json)?.unwrap_or(f64::NEG_INFINITY))
}

/// The same for the greatest.
fn greatest<'de, D: Deserializer<'de>>(json: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(json)?.unwrap_or(f64::INFINITY))
}

/// A normal distribution of all free parameters in their coordinates, reflected at their bounds. Combinations that the
/// logs do not determine are as wide as their priors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Posterior {
    /// Each parameter by itself.
    pub parameters: Vec<Marginal>,
    /// Their correlations.
    pub correlation: Vec<Vec<f64>>,
    /// Whether the residual still has structure: the deviations are widened by it, but values that stand in for
    /// something that the model lacks may be further off.
    pub has_structure: bool,
}

impl Posterior {
    /// The posterior of a fit, with the deviations of its intervals; `inflation` is that of the covariance. With
    /// `structure`, the error that is no noise, in noise floors, deviations are wider by it, as far as the priors are:
    /// what stands in for something else is off by more than the residual's own spread. `None` without a derivative.
    pub fn of(objective: &Objective, fit: &FitPoint, inflation: f64, structure: Option<f64>) -> Option<Self> {
        let inflation = inflation * structure.map_or(1.0, |error| error.max(1.0).powi(2));
        let covariance = covariance(objective.parameters(), fit, inflation, 1.0)?;
        let within = roots(&covariance);
        let deviations = wider(objective, fit, &within);
        let correlation = |i: usize, j: usize| match (i == j, within[i] * within[j]) {
            (true, _) => 1.0,
            (_, product) if product > 0.0 => covariance[(i, j)] / product,
            _ => 0.0,
        };
        let all = 0..within.len();
        let marginal = |(&index, sd): (&usize, &f64)| Marginal::of(&objective.parameters()[index], fit.u[index], *sd);
        Some(Posterior {
            parameters: fit.active.iter().zip(&deviations).map(marginal).collect(),
            correlation: all.clone().map(|i| all.clone().map(|j| correlation(i, j)).collect()).collect(),
            has_structure: structure.is_some(),
        })
    }

    /// Values of the parameters, in their order, for each of `many` draws.
    ///
    /// # Errors
    /// A correlation that is no square matrix of the parameters, and numbers that are not finite: it was read from a
    /// file.
    pub fn draws(&self, many: usize, seed: u64) -> Result<Vec<Vec<f64>>, String> {
        let n = self.parameters.len();
        if self.correlation.len() != n || self.correlation.iter().any(|row| row.len() != n) {
            return Err(format!("the correlations of {n} parameters are no matrix of {n} by {n}"));
        }
        let known = |of: &Marginal| of.mean.is_finite() && of.sd.is_finite() && !of.min.is_nan() && !of.max.is_nan();
        if !self.parameters.iter().all(known) || self.correlation.iter().flatten().any(|x| !x.is_finite()) {
            return Err("a mean, deviation or correlation is not a finite number, or a bound is none".into());
        }
        // Rounding may have left a matrix that is not quite positive definite.
        let eigen = DMatrix::from_fn(n, n, |i, j| self.correlation[i][j]).symmetric_eigen();
        let lengths = eigen.eigenvalues.map(|length| length.max(0.0).sqrt());
        let draw = |k: usize| {
            let mut rng = stream(seed, &[k as u64]);
            let along = DVector::from_fn(n, |i, _| lengths[i] * normal(&mut rng));
            let together = &eigen.eigenvectors * along;
            self.parameters.iter().zip(together.iter()).map(|(of, z)| of.value(of.mean + of.sd * z)).collect()
        };
        Ok((0..many).map(draw).collect())
    }
}

impl Marginal {
    /// `u` and `sd` are in the parameter's coordinate of the fit.
    fn of(parameter: &FitParameter, u: f64, sd: f64) -> Self {
        let coordinate = match parameter.law {
            Parametrisation::Linear | Parametrisation::Stair | Parametrisation::Switch => Coordinate::Linear,
            Parametrisation::Exponential => Coordinate::Log,
            Parametrisation::Inverse | Parametrisation::Compliance => Coordinate::Inverse,
        };
        let at = |u: f64| match coordinate {
            Coordinate::Linear => parameter.value(u),
            Coordinate::Log => parameter.origin.ln() + parameter.size * u,
            Coordinate::Inverse => u / parameter.size,
        };
        let [a, b] = [parameter.bounds.0, parameter.bounds.1].map(at);
        let scale = if coordinate == Coordinate::Inverse { parameter.size.recip() } else { parameter.size };
        let name = parameter.name.clone();
        Marginal { name, coordinate, mean: at(u), sd: sd * scale.abs(), min: a.min(b), max: a.max(b) }
    }

    /// A coordinate within the bounds. One beyond a bound is reflected there, so that draws do not gather at the bound.
    fn reflected(&self, coordinate: f64) -> f64 {
        let width = self.max - self.min;
        match (self.min.is_finite(), self.max.is_finite()) {
            (true, true) if width > 0.0 => {
                let beyond = (coordinate - self.min).rem_euclid(2.0 * width);
                self.min + beyond.min(2.0 * width - beyond)
            }
            (true, true) => self.min,
            (true, false) => self.min + (coordinate - self.min).abs(),
            (false, true) => self.max - (coordinate - self.max).abs(),
            (false, false) => coordinate,
        }
    }

    /// The value at a coordinate.
    fn value(&self, coordinate: f64) -> f64 {
        let within = self.reflected(coordinate);
        match self.coordinate {
            Coordinate::Linear => within,
            Coordinate::Log => within.exp(),
            Coordinate::Inverse => within.recip(),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use btr_core::signal::stats::{mean, std};

    fn marginal(coordinate: Coordinate, mean: f64, sd: f64, (min, max): (f64, f64)) -> Marginal {
        Marginal { name: "mass@bob".into(), coordinate, mean, sd, min, max }
    }

    fn posterior(parameters: Vec<Marginal>, correlation: f64) -> Posterior {
        let n = parameters.len();
        let row = |i: usize| (0..n).map(|j| if i == j { 1.0 } else { correlation }).collect();
        Posterior { parameters, correlation: (0..n).map(row).collect(), has_structure: false }
    }

    #[test]
    fn draws_have_the_deviations_and_the_correlation() {
        let wide = (-1e9, 1e9);
        let linear = marginal(Coordinate::Linear, 3.0, 0.5, wide);
        let log = marginal(Coordinate::Log, 2.0_f64.ln(), 0.1, (-20.0, 20.0));
        let inverse = marginal(Coordinate::Inverse, 0.5, 0.02, (0.0, 10.0));
        let drawn = posterior(vec![linear, log, inverse], 0.9).draws(4000, 7).unwrap();
        let column = |k: usize, of: fn(f64) -> f64| drawn.iter().map(|row| of(row[k])).collect::<Vec<f64>>();
        let coordinates = [column(0, |x| x), column(1, f64::ln), column(2, f64::recip)];
        for (values, (center, sd)) in coordinates.iter().zip([(3.0, 0.5), (2.0_f64.ln(), 0.1), (0.5, 0.02)]) {
            assert!((mean(values) - center).abs() < 0.1 * sd, "{}", mean(values));
            assert!((std(values) / sd - 1.0).abs() < 0.05, "{}", std(values));
        }
        let both = coordinates[0].iter().zip(&coordinates[1]);
        let product: Vec<f64> = both.map(|(a, b)| (a - 3.0) / 0.5 * ((b - 2.0_f64.ln()) / 0.1)).collect();
        assert!((mean(&product) - 0.9).abs() < 0.05, "{}", mean(&product));
    }

    #[test]
    fn draws_stay_within_the_bounds_and_do_not_gather_there() {
        let known = marginal(Coordinate::Linear, 0.0, 1.0, (0.0, 0.5));
        let drawn = posterior(vec![known], 0.0).draws(1000, 1).unwrap();
        assert!(drawn.iter().all(|row| (0.0..=0.5).contains(&row[0])));
        assert!(drawn.iter().filter(|row| !(1e-6..=0.5 - 1e-6).contains(&row[0])).count() < 10);
    }

    #[test]
    fn a_bound_at_0_is_infinite_in_the_coordinate_and_null_in_json() {
        let log = marginal(Coordinate::Log, 0.0, 0.5, (f64::NEG_INFINITY, 0.0));
        let inverse = marginal(Coordinate::Inverse, 0.1, 1.0, (0.0, f64::INFINITY));
        let written = serde_json::to_string(&posterior(vec![log, inverse], 0.0)).unwrap();
        assert!(written.contains("\"min\":null") && written.contains("\"max\":null"), "{written}");
        let read: Posterior = serde_json::from_str(&written).unwrap();
        let drawn = read.draws(1000, 1).unwrap();
        assert!(drawn.iter().all(|row| row[0] > 0.0 && row[0] <= 1.0 && row[1] > 0.0));
        assert!((0..2).all(|k| std(&drawn.iter().map(|row| row[k]).collect::<Vec<_>>()) > 0.0));
    }

    #[test]
    fn damaged_numbers_are_refused() {
        let of = || marginal(Coordinate::Linear, 0.0, 1.0, (-1.0, 1.0));
        let narrow = Posterior { correlation: vec![vec![1.0]], ..posterior(vec![of(), of()], 0.0) };
        assert!(narrow.draws(1, 0).unwrap_err().contains("no matrix of 2 by 2"));
        let endless = posterior(vec![Marginal { sd: f64::INFINITY, ..of() }], 0.0);
        assert!(endless.draws(1, 0).unwrap_err().contains("not a finite number"));
        let boundless = posterior(vec![Marginal { min: f64::NAN, ..of() }], 0.0);
        assert!(boundless.draws(1, 0).unwrap_err().contains("a bound is none"));
    }
}
