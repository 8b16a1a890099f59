//! The constants of CMA-ES, which follow from dimension and population alone.
//!
//! N. Hansen, "The CMA evolution strategy: a tutorial", arXiv:1604.00772, table 1, with negative weights (active
//! update). Names are the tutorial's.

/// Constants of one run.
pub(super) struct Weights {
    /// w_i by rank, best first: positive ones sum to 1, negative ones follow.
    pub(super) w: Vec<f64>,
    /// How many weights are positive.
    pub(super) mu: usize,
    /// Variance-effective selection mass of the positive weights.
    pub(super) mu_eff: f64,
    /// Learning rate of the path of the step size.
    pub(super) c_sigma: f64,
    /// Damping of the step size.
    pub(super) d_sigma: f64,
    /// Learning rate of the path of the covariance.
    pub(super) c_c: f64,
    /// Learning rate of the rank-one update.
    pub(super) c_1: f64,
    /// Learning rate of the rank-mu update.
    pub(super) c_mu: f64,
    /// Expected length of a standard normal vector.
    pub(super) chi_n: f64,
}

impl Weights {
    /// Constants for `dims` >= 1 dimensions and a population of `lambda` >= 2.
    pub(super) fn new(dims: usize, lambda: usize) -> Self {
        let n = dims as f64;
        let raw: Vec<f64> = (1..=lambda).map(|i| ((lambda as f64 + 1.0) / 2.0).ln() - (i as f64).ln()).collect();
        let mu = lambda / 2;
        let (mu_eff, mu_eff_neg) = (effective(&raw[..mu]), effective(&raw[mu..]));

        let c_c = (4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n);
        let c_sigma = (mu_eff + 2.0) / (n + mu_eff + 5.0);
        let c_1 = 2.0 / ((n + 1.3).powi(2) + mu_eff);
        let c_mu = (1.0 - c_1).min(2.0 * (0.25 + mu_eff + 1.0 / mu_eff - 2.0) / ((n + 2.0).powi(2) + mu_eff));
        let d_sigma = 1.0 + 2.0 * (((mu_eff - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + c_sigma;

        let positive: f64 = raw.iter().filter(|w| **w > 0.0).sum();
        let negative: f64 = -raw.iter().filter(|w| **w < 0.0).sum::<f64>();
        // The last bound keeps the covariance positive definite.
        let reach = (1.0 + c_1 / c_mu)
            .min(1.0 + 2.0 * mu_eff_neg / (mu_eff_neg.max(0.0) + 2.0))
            .min((1.0 - c_1 - c_mu) / (n * c_mu))
            .max(0.0);
        let w = raw.iter().map(|w| if *w >= 0.0 { w / positive } else { w * reach / negative }).collect();
        let chi_n = n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n));
        Weights { w, mu, mu_eff, c_sigma, d_sigma, c_c, c_1, c_mu, chi_n }
    }
}

fn effective(weights: &[f64]) -> f64 {
    let squares: f64 = weights.iter().map(|w| w * w).sum();
    weights.iter().sum::<f64>().powi(2) / squares
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tutorials_properties_hold() {
        for dims in 1..40 {
            for lambda in [2, 4, 5, 10, 33, 200] {
                let k = Weights::new(dims, lambda);
                let positive: f64 = k.w[..k.mu].iter().sum();
                assert!((positive - 1.0).abs() < 1e-12 && k.w[..k.mu].iter().all(|w| *w > 0.0));
                assert!(k.w[k.mu..].iter().all(|w| *w <= 0.0));
                assert!(k.w.windows(2).all(|pair| pair[0] >= pair[1]));
                assert!(k.c_1 > 0.0 && k.c_mu >= 0.0 && k.c_1 + k.c_mu <= 1.0, "{dims} {lambda}");
                assert!(k.mu_eff >= 1.0 && k.mu_eff <= k.mu as f64);
            }
        }
    }
}
