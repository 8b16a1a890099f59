//! Whether a command pulls its joint towards itself, whatever else moves it.
//!
//! A joint that lags, swings beyond its resonance or carries a load may move against its command for seconds and follow it all
//! the same: its acceleration has the command's sign, once its own position and velocity are accounted for. Of a joint whose
//! encoder or command is reversed it has the other one.

use btr_core::signal::smooth::{Motion, smooth};
use nalgebra::{Matrix3, Vector3};

/// Fewest samples that are believed.
const FEWEST: usize = 20;
/// Of the command, this share of its square has to be left when position and velocity are taken away.
const LEAST_LEFT: f64 = 1e-6;

/// A command's part in its joint's acceleration, once position and velocity are accounted for.
#[derive(Clone, Copy, Debug)]
pub(super) struct CommandInfluence {
    /// How alike the two are, from -1 to 1; positive where the command pulls the joint towards itself.
    pub correlation: f64,
    /// How many standard deviations that is from nothing.
    pub telling: f64,
}

/// How a command pulls its joint. `None` where that cannot be told: too few samples, or a command that position and velocity foretell.
pub(super) fn pull(clock_s: &[f64], command: &[f64], position: &[f64]) -> Option<CommandInfluence> {
    // All are smoothed alike, which leaves every linear relation as it was.
    let (told, moved) = (smooth(clock_s, command), smooth(clock_s, position));
    let rows: Vec<(Vector3<f64>, f64, f64)> = told.iter().zip(&moved).filter_map(row).collect();
    if rows.len() < FEWEST {
        return None;
    }
    // In units of their own size the columns make a matrix that can be inverted, if any can.
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
        let (left, pulled) = (c - of_command.dot(x), a - of_acceleration.dot(x));
        (cc, aa, ca, all) = (cc + left * left, aa + pulled * pulled, ca + left * pulled, all + c * c);
    }
    if cc <= LEAST_LEFT * all || aa <= 0.0 {
        return None;
    }
    let correlation = ca / (cc * aa).sqrt();
    // Samples that were smoothed together are one observation.
    let observations = (n / together(clock_s)).max(4.0);
    Some(CommandInfluence {
        correlation,
        telling: correlation * (observations / (1.0 - correlation * correlation).max(1e-9)).sqrt(),
    })
}

/// Position and velocity beside a constant, the command, and the acceleration.
fn row((told, moved): (&Motion, &Motion)) -> Option<(Vector3<f64>, f64, f64)> {
    let row = (Vector3::new(1.0, moved.value, moved.velocity), told.value, moved.acceleration);
    (row.0.iter().all(|x| x.is_finite()) && (row.1 * row.2).is_finite()).then_some(row)
}

/// How many samples are smoothed together, about.
fn together(clock_s: &[f64]) -> f64 {
    let usual_s = (clock_s.last().unwrap_or(&0.0) - clock_s.first().unwrap_or(&0.0)) / clock_s.len().max(2) as f64;
    (0.04 / usual_s.max(f64::MIN_POSITIVE)).max(9.0)
}
