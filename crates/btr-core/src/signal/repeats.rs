//! How far runs of the same command differ: the error that no deterministic model can go below.
//!
//! A run departs from the mean of its runs by what the robot does not do twice. With m runs, the squares of these
//! departures sum to m - 1 times the variance, sample by sample: the pure error of the lack-of-fit test of regression
//! with replicates.

use super::stats::quantile;

/// The departures without the mean of each run, and the standard deviation of these means: offsets that last a whole
/// run, in the channel's unit.
pub fn without_offsets(departures: &[Vec<f64>]) -> (Vec<Vec<f64>>, f64) {
    let offset = |run: &Vec<f64>| {
        let present = run.iter().filter(|d| d.is_finite());
        let (n, sum) = present.fold((0.0f64, 0.0), |(n, sum), d| (n + 1.0, sum + d));
        sum / n.max(1.0)
    };
    let offsets: Vec<f64> = departures.iter().map(offset).collect();
    let squares: f64 = offsets.iter().map(|offset| offset * offset).sum();
    let rest = departures.iter().zip(&offsets).map(|(run, offset)| run.iter().map(|d| d - offset).collect());
    (rest.collect(), (squares / departures.len().saturating_sub(1).max(1) as f64).sqrt())
}

/// The variance of runs about their mean, pooled over samples and commands.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunSpread {
    /// Sum of the squared departures, in the square of the channel's unit.
    squares: f64,
    /// Number of departures beyond the means: the sum of m - 1 over samples.
    differences: f64,
    /// The same as independent ones, by the memory within a run.
    independent: f64,
    /// For each command, the mean square of the departures of each run from what the robot does on average, in the
    /// square of the channel's unit.
    commands: Vec<Vec<f64>>,
}

/// The departures of runs from their mean, sample by sample: all runs on one clock. NaN where fewer than two have a
/// reading, or this one has none.
pub fn departures(runs: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let samples = runs.iter().map(Vec::len).min().unwrap_or(0);
    let mean = |i: usize| {
        let present = runs.iter().map(|run| run[i]).filter(|x| x.is_finite());
        let (n, sum) = present.fold((0.0, 0.0), |(n, sum), x| (n + 1.0, sum + x));
        if n >= 2.0 { sum / n } else { f64::NAN }
    };
    let means: Vec<f64> = (0..samples).map(mean).collect();
    runs.iter().map(|run| run.iter().zip(&means).map(|(x, mean)| x - mean).collect()).collect()
}

impl RunSpread {
    /// From the [`departures`] of the runs of a command.
    pub fn of(departures: &[Vec<f64>]) -> Self {
        let samples = departures.iter().map(Vec::len).min().unwrap_or(0);
        let present = |i: usize| departures.iter().filter(|run| run[i].is_finite()).count();
        let differences: f64 = (0..samples).map(|i| present(i).saturating_sub(1) as f64).sum();
        // The mean of a few runs follows each of them a little.
        let whole = departures.len() as f64 / departures.len().saturating_sub(1).max(1) as f64;
        let runs: Vec<f64> = departures.iter().map(|run| whole * mean_square(run)).collect();
        RunSpread {
            squares: departures.iter().flatten().filter(|d| d.is_finite()).map(|d| d * d).sum(),
            differences,
            independent: differences / memory_of_squares(departures),
            commands: if differences > 0.0 { vec![runs] } else { Vec::new() },
        }
    }

    /// This and another command's.
    #[must_use]
    pub fn and(mut self, other: RunSpread) -> RunSpread {
        self.commands.extend(other.commands);
        RunSpread {
            squares: self.squares + other.squares,
            differences: self.differences + other.differences,
            independent: self.independent + other.independent,
            commands: self.commands,
        }
    }

    /// Standard deviation of one run, in the channel's unit; `None` without runs of one command.
    pub fn std(&self) -> Option<f64> {
        (self.differences > 0.0).then(|| (self.squares / self.differences).sqrt())
    }

    /// Number of independent differences that it was estimated from: by the memory within a run, or by how unequal the
    /// runs are where that says less. What differs may be one number per run, a friction or a gain, that shows in all
    /// of its samples, and more in one command than in another.
    pub fn freedom(&self) -> f64 {
        let runs = self.runs();
        let by_runs = 2.0 * runs / self.inequality().max(f64::MIN_POSITIVE);
        // Each run is independent of the others, whatever the memory within it.
        self.independent.min(by_runs).max(runs.min(self.differences))
    }

    /// Samples per independent one, for the variance of a run.
    pub fn memory(&self) -> f64 {
        if self.differences > 0.0 { self.differences / self.freedom() } else { 1.0 }
    }

    /// Number of runs beyond the first of each command.
    fn runs(&self) -> f64 {
        self.commands.iter().map(|runs| (runs.len() - 1) as f64).sum()
    }

    /// The relative variance of the mean squares of runs: 2 over the number of independent samples of a run.
    fn inequality(&self) -> f64 {
        let Some(usual) = self.std().map(|std| std * std) else { return 0.0 };
        let of_command = |runs: &Vec<f64>| {
            let count = runs.len() as f64;
            let apart: f64 = runs.iter().map(|square| (square / usual - 1.0).powi(2)).sum();
            apart * (count - 1.0) / count
        };
        self.commands.iter().map(of_command).sum::<f64>() / self.runs()
    }
}

/// The mean square of the present departures of a run.
fn mean_square(run: &[f64]) -> f64 {
    let present = run.iter().filter(|d| d.is_finite());
    let (n, sum) = present.fold((0.0f64, 0.0), |(n, sum), d| (n + 1.0, sum + d * d));
    sum / n.max(1.0)
}

/// Samples per independent estimate of the variance of some series with mean zero: 1 + 2·sum of rho_k² for a normal
/// process (M. S. Bartlett, "On the theoretical specification and sampling properties of autocorrelated time series",
/// Supplement to the Journal of the Royal Statistical Society 8, 1946). The mean is not taken off: an offset that lasts
/// a whole run is one number. NaN are missing.
fn memory_of_squares(runs: &[Vec<f64>]) -> f64 {
    /// The sum ends where the lag is this many times it, or at half of the series.
    const WINDOW: f64 = 5.0;
    /// From this lag on, lags are left out: as many in a row as a share of the lag, and those between count alike. A
    /// long run with a long memory would take the square of its samples.
    const EVERY: usize = 32;
    let product = |lag: usize| {
        let pairs = runs.iter().flat_map(|run| run.iter().zip(run.iter().skip(lag)).map(|(a, b)| a * b));
        let (n, sum) = pairs.filter(|p| p.is_finite()).fold((0.0f64, 0.0), |(n, sum), p| (n + 1.0, sum + p));
        sum / n.max(1.0)
    };
    let (variance, samples) = (product(0), runs.iter().map(Vec::len).min().unwrap_or(0));
    let mut time = 1.0;
    if variance <= 0.0 {
        return time;
    }
    let mut lag = 1;
    while lag < samples / 2 && (lag as f64) < WINDOW * time {
        let step = (lag / EVERY).max(1);
        time += 2.0 * step as f64 * (product(lag) / variance).powi(2);
        lag += step;
    }
    time
}

/// Standard deviation of the logarithm of the ratio of an error to the spread of runs, root mean square both, for a
/// model without error: of `error` independent samples and of `freedom` independent differences.
pub fn ratio_deviation(error: f64, freedom: f64) -> f64 {
    (0.5 / error.max(1.0) + 0.5 / freedom.max(1.0)).sqrt()
}

/// The ratio that is not exceeded in 99 of 100 cases, for a logarithm that is about normal with this deviation.
pub fn largest_ratio(deviation: f64) -> f64 {
    const QUANTILE_99: f64 = 2.326;
    (QUANTILE_99 * deviation).exp()
}

/// The runs whose departures are far larger than usual (this many medians, root mean square); none of fewer than four
/// runs, where one departs the mean itself.
pub fn outliers(departures: &[Vec<f64>], medians: f64) -> Vec<usize> {
    let sizes: Vec<f64> = departures.iter().map(|run| mean_square(run).sqrt()).collect();
    let Some(usual) = quantile(sizes.clone(), 0.5).filter(|_| sizes.len() >= 4) else { return Vec::new() };
    (0..sizes.len()).filter(|&run| sizes[run] > medians * usual).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::random::{Rng, stream};
    use crate::signal::stats::{mean, std};
    use rand::RngExt;

    fn normal(rng: &mut Rng) -> f64 {
        (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
    }

    /// Runs around a sine: each with an autoregressive disturbance (of this persistence), and an offset.
    fn runs(count: usize, samples: usize, persistence: f64, offset: f64, seed: u64) -> Vec<Vec<f64>> {
        let mut rng = stream(seed, &[]);
        let mut run = || {
            let shift = offset * normal(&mut rng);
            let mut state = normal(&mut rng);
            let mut at = |i: usize| {
                state = persistence * state + (1.0 - persistence * persistence).sqrt() * normal(&mut rng);
                5.0 * (0.1 * i as f64).sin() + state + shift
            };
            (0..samples).map(&mut at).collect()
        };
        (0..count).map(|_| run()).collect()
    }

    #[test]
    fn the_spread_is_that_of_one_run_however_few_there_are() {
        for count in [2, 3, 8] {
            let spread = RunSpread::of(&departures(&runs(count, 20_000, 0.0, 0.0, 1)));
            assert!((spread.std().unwrap() - 1.0).abs() < 0.02, "{count}: {spread:?}");
            assert!((spread.memory() - 1.0).abs() < 0.05);
        }
        assert_eq!(RunSpread::of(&departures(&runs(1, 50, 0.0, 0.0, 1))).std(), None);
    }

    #[test]
    fn its_freedom_predicts_how_it_scatters() {
        // The variance of ln(std) is 1/(2·freedom).
        for (persistence, offset) in [(0.0, 0.0), (0.9, 0.0), (0.98, 0.0), (0.5, 3.0)] {
            let spreads: Vec<RunSpread> =
                (0..60).map(|seed| RunSpread::of(&departures(&runs(4, 600, persistence, offset, seed)))).collect();
            let logs: Vec<f64> = spreads.iter().map(|spread| spread.std().unwrap().ln()).collect();
            let promised = mean(&spreads.iter().map(|spread| 0.5 / spread.freedom()).collect::<Vec<_>>()).sqrt();
            let ratio = std(&logs) / promised;
            assert!((0.6..1.5).contains(&ratio), "{persistence} {offset}: {ratio} {promised}");
        }
    }

    #[test]
    fn one_number_per_run_is_one_difference_per_run() {
        // A gain that differs from run to run shows in every sample of a fast motion, without any memory of its own.
        let mut rng = stream(17, &[]);
        let mut run = || {
            let gain = normal(&mut rng);
            (0..500).map(|i| gain * (0.7 * i as f64).sin() + 0.01 * normal(&mut rng)).collect::<Vec<f64>>()
        };
        let mut command = || RunSpread::of(&departures(&(0..4).map(|_| run()).collect::<Vec<_>>()));
        let spread = (0..6).map(|_| command()).fold(RunSpread::default(), RunSpread::and);
        assert!((9.0..60.0).contains(&spread.freedom()), "{}", spread.freedom());
    }

    #[test]
    fn a_model_without_error_stays_below_the_largest_ratio() {
        let (mut above, seeds) = (0, 200);
        for seed in 0..seeds {
            let all = runs(5, 400, 0.9, 0.0, 1000 + seed);
            let spread = RunSpread::of(&departures(&all[..4]));
            let error: Vec<f64> = all[4].iter().enumerate().map(|(i, x)| x - 5.0 * (0.1 * i as f64).sin()).collect();
            let rms = (error.iter().map(|e| e * e).sum::<f64>() / 400.0).sqrt();
            let bound = largest_ratio(ratio_deviation(400.0 / spread.memory(), spread.freedom()));
            above += usize::from(rms / spread.std().unwrap() > bound);
        }
        assert!(above <= 8, "{above} of {seeds}");
    }

    #[test]
    fn offsets_are_told_from_the_rest() {
        let all = departures(&runs(12, 2000, 0.0, 3.0, 5));
        let (rest, offset) = without_offsets(&all);
        let spread = RunSpread::of(&rest);
        assert!((1.5..5.0).contains(&offset), "{offset}");
        assert!((spread.std().unwrap() - 1.0).abs() < 0.02 && spread.memory() < 2.0, "{spread:?}");
    }

    #[test]
    fn missing_readings_and_single_runs_are_left_out() {
        let mut all = runs(3, 100, 0.0, 0.0, 7);
        all[0][10..20].fill(f64::NAN);
        all[1][10..20].fill(f64::NAN);
        let departures = departures(&all);
        assert!(departures.iter().all(|run| run[10..20].iter().all(|d| d.is_nan())));
        assert!((RunSpread::of(&departures).differences - 180.0).abs() < 1e-9);
    }

    #[test]
    fn one_run_out_of_line_is_named() {
        let mut all = runs(5, 300, 0.5, 0.0, 3);
        all[2].iter_mut().for_each(|x| *x += 20.0);
        assert_eq!(outliers(&departures(&all), 2.5), [2]);
        assert!(outliers(&departures(&runs(5, 300, 0.5, 0.0, 3)), 2.5).is_empty());
    }
}
