//! The sign of a command's effect on its joint: the partial correlation of command and acceleration.
//!
//! A joint that lags, is driven above its resonance or carries a load may move against its command for seconds although
//! it follows it. Its acceleration still has the command's sign once its position and velocity are accounted for. With
//! a reversed encoder or command, the sign is the opposite one.

use btr_core::signal::smooth::{Motion, smooth};
use nalgebra::{Matrix3, Vector3};

/// Fewest samples for a result.
const FEWEST: usize = 20;
/// Smallest share of the command's square that position and velocity must leave unexplained.
const LEAST_LEFT: f64 = 1e-6;

/// A command's effect on its joint's acceleration, once position and velocity are accounted for.
#[derive(Clone, Copy, Debug)]
pub(super) struct CommandInfluence {
    /// Partial correlation of the two, from -1 to 1; positive where the command pulls the joint towards itself.
    pub correlation: f64,
    /// The correlation in standard deviations from zero.
    pub significance: f64,
}

/// The effect of a command on its joint. `None` where it cannot be determined: too few samples, or a command that is a
/// function of position and velocity.
pub(super) fn pull(clock_s: &[f64], command: &[f64], position: &[f64]) -> Option<CommandInfluence> {
    // Both are smoothed by the same filter, which preserves every linear relation between them.
    let (commands, positions) = (smooth(clock_s, command), smooth(clock_s, position));
    let rows: Vec<(Vector3<f64>, f64, f64)> = commands.iter().zip(&positions).filter_map(row).collect();
    if rows.len() < FEWEST {
        return None;
    }
    // Columns are scaled to unit size, so that the normal matrix is well conditioned.
    let n = rows.len() as f64;
    let size = rows.iter().fold(Vector3::zeros(), |sum, (x, ..)| sum + x.component_mul(x) / n).map(f64::sqrt);
    if size.iter().any(|x| *x <= 0.0) {
        return None;
    }
    let rows: Vec<(Vector3<f64>, f64, f64)> = rows.iter().map(|(x, c, a)| (x.component_div(&size), *c, *a)).collect();
    let normal = rows.iter().fold(Matrix3::zeros(), |sum, (x, ..)| sum + x * x.transpose());
    let inverse = normal.cholesky()?;
    let along = |of: fn(&(Vector3<f64>, f64, f64)) -> f64| {
        inverse.solve(&rows.iter().fold(Vector3::zeros(), |sum, row| sum + row.0 * of(row)))
    };
    let (of_command, of_acceleration) = (along(|row| row.1), along(|row| row.2));
    let (mut cc, mut aa, mut ca, mut all) = (0.0, 0.0, 0.0, 0.0);
    for (x, c, a) in &rows {
        let (command_left, acceleration_left) = (c - of_command.dot(x), a - of_acceleration.dot(x));
        cc += command_left * command_left;
        aa += acceleration_left * acceleration_left;
        ca += command_left * acceleration_left;
        all += c * c;
    }
    if cc <= LEAST_LEFT * all || aa <= 0.0 {
        return None;
    }
    let correlation = ca / (cc * aa).sqrt();
    // Samples that were smoothed together count as one observation.
    let observations = (n / smoothing_samples(clock_s)).max(4.0);
    Some(CommandInfluence {
        correlation,
        significance: correlation * (observations / (1.0 - correlation * correlation).max(1e-9)).sqrt(),
    })
}

/// The regressors (constant, position, velocity), the command, and the acceleration.
fn row((command, position): (&Motion, &Motion)) -> Option<(Vector3<f64>, f64, f64)> {
    let row = (Vector3::new(1.0, position.value, position.velocity), command.value, position.acceleration);
    (row.0.iter().all(|x| x.is_finite()) && (row.1 * row.2).is_finite()).then_some(row)
}

/// Approximate number of samples that are smoothed together.
fn smoothing_samples(clock_s: &[f64]) -> f64 {
    let usual_s = (clock_s.last().unwrap_or(&0.0) - clock_s.first().unwrap_or(&0.0)) / clock_s.len().max(2) as f64;
    (0.04 / usual_s.max(f64::MIN_POSITIVE)).max(9.0)
}
