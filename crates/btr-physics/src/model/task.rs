//! Tasks: the fitness f(B) of a behaviour, as a weighted sum of terms computed from a log.

use btr_core::log::{Log, LogError};
use btr_core::world::Measure;
use indexmap::IndexMap;

/// A fitness term.
pub struct FitnessTerm {
    /// Its name in experiment files.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// One line of help.
    pub help: &'static str,
    /// Channels that a log must have for it.
    pub needs: &'static [&'static str],
    measure: Measure,
}

/// All fitness terms.
pub static TERMS: &[FitnessTerm] = &[
    FitnessTerm {
        name: "distance",
        unit: "m",
        help: "how far the base moved forward (world x) from start to end",
        needs: &["base_x"],
        measure: |log| displacement(log, "base_x"),
    },
    FitnessTerm {
        name: "speed",
        unit: "m/s",
        help: "distance over the duration of the log",
        needs: &["base_x"],
        measure: |log| Ok(displacement(log, "base_x")? / log.duration_s().max(f64::MIN_POSITIVE)),
    },
    FitnessTerm {
        name: "sideways",
        unit: "m",
        help: "how far the base drifted sideways (world y), without sign",
        needs: &["base_y"],
        measure: |log| Ok(displacement(log, "base_y")?.abs()),
    },
    FitnessTerm {
        name: "heading",
        unit: "rad",
        help: "how far the base has turned about the vertical at the end, without sign",
        needs: &["base_qw", "base_qx", "base_qy", "base_qz"],
        measure: heading,
    },
    FitnessTerm {
        name: "peak_speed",
        unit: "rad/s",
        help: "the fastest that any joint moved (m/s for slides)",
        needs: &[],
        measure: |log| peak(log, "dq_"),
    },
    FitnessTerm {
        name: "peak_torque",
        unit: "N·m",
        help: "the largest torque of any motor, without sign (N for slides)",
        needs: &[],
        measure: |log| peak(log, "tau_"),
    },
    FitnessTerm {
        name: "ball_distance",
        unit: "m",
        help: "how far the ball moved over the ground from start to end",
        needs: &["ball_x", "ball_y"],
        measure: |log| Ok(displacement(log, "ball_x")?.hypot(displacement(log, "ball_y")?)),
    },
    FitnessTerm {
        name: "energy",
        unit: "J",
        help: "mechanical work of all motors, each counted without sign; give it a negative weight",
        needs: &[],
        measure: energy,
    },
    FitnessTerm {
        name: "upright_time",
        unit: "s",
        help: "time until the base leans more than 60 degrees or sinks below half its starting height",
        needs: &["base_z", "base_qw", "base_qx", "base_qy", "base_qz"],
        measure: upright_time,
    },
];

/// The measure of the term with this name; `None` if there is no such term.
pub fn measure(name: &str) -> Option<Measure> {
    TERMS.iter().find(|term| term.name == name).map(|term| term.measure)
}

/// cos 60°: the z component of the base's up vector below which it counts as fallen.
const FALLEN_UP: f64 = 0.5;
/// Share of the starting height below which the base counts as fallen.
const FALLEN_HEIGHT: f64 = 0.5;

/// A weighted sum of terms; its unit is the sum's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fitness {
    weights: Vec<(usize, f64)>,
}

/// A term that does not exist.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no fitness term `{name}`")]
pub struct UnknownTerm {
    /// The given name.
    pub name: String,
}

impl Fitness {
    /// The sum of the named terms with their weights.
    ///
    /// # Errors
    /// A name that [`TERMS`] does not have.
    pub fn new(weights: &IndexMap<String, f64>) -> Result<Self, UnknownTerm> {
        let index = |name: &String| TERMS.iter().position(|t| t.name == name);
        let weights = weights
            .iter()
            .map(|(name, w)| index(name).map(|i| (i, *w)).ok_or_else(|| UnknownTerm { name: name.clone() }))
            .collect::<Result<_, _>>()?;
        Ok(Fitness { weights })
    }

    /// The terms by name, with their weights; empty without fitness.
    pub fn weights(&self) -> IndexMap<String, f64> {
        self.weights.iter().map(|&(i, w)| (TERMS[i].name.to_owned(), w)).collect()
    }

    /// f(B). Without any term it is 0.
    ///
    /// # Errors
    /// A channel that a term needs and the log lacks.
    pub fn of(&self, log: &Log) -> Result<f64, LogError> {
        self.weights.iter().map(|&(i, w)| Ok(w * (TERMS[i].measure)(log)?)).sum()
    }

    /// The terms with their values, for reports.
    ///
    /// # Errors
    /// As [`Fitness::of`].
    pub fn terms(&self, log: &Log) -> Result<Vec<(&'static FitnessTerm, f64)>, LogError> {
        self.weights.iter().map(|&(i, _)| Ok((&TERMS[i], (TERMS[i].measure)(log)?))).collect()
    }
}

fn displacement(log: &Log, channel: &str) -> Result<f64, LogError> {
    let values = log.values(channel)?;
    Ok(values.last().unwrap_or(&0.0) - values.first().unwrap_or(&0.0))
}

fn energy(log: &Log) -> Result<f64, LogError> {
    let joints: Vec<&str> = log.channels().filter_map(|(name, _)| name.strip_prefix("tau_")).collect();
    if joints.is_empty() {
        log.values("tau_<joint>")?;
    }
    let mut work_j = 0.0;
    for joint in joints {
        let (tau, dq) = (log.values(&format!("tau_{joint}"))?, log.values(&format!("dq_{joint}"))?);
        let power_w = |k: usize| (tau[k] * dq[k]).abs();
        work_j += (1..log.len()).map(|k| power_w(k) * (log.clock_s()[k] - log.clock_s()[k - 1])).sum::<f64>();
    }
    Ok(work_j)
}

/// Absolute yaw angle from the start to the end, wrapped to [0, π].
fn heading(log: &Log) -> Result<f64, LogError> {
    let [w, x, y, z] = ["w", "x", "y", "z"].map(|part| log.values(&format!("base_q{part}")));
    let (w, x, y, z) = (w?, x?, y?, z?);
    let yaw = |k: usize| (2.0 * (x[k] * y[k] + w[k] * z[k])).atan2(1.0 - 2.0 * (y[k] * y[k] + z[k] * z[k]));
    let turned = yaw(log.len().saturating_sub(1)) - yaw(0);
    Ok(turned.sin().atan2(turned.cos()).abs())
}

/// The largest absolute value in the channels with this prefix.
fn peak(log: &Log, prefix: &str) -> Result<f64, LogError> {
    let mut names = log.channels().map(|(name, _)| name.to_owned()).filter(|name| name.starts_with(prefix)).peekable();
    if names.peek().is_none() {
        log.values(&format!("{prefix}<joint>"))?;
    }
    let mut sizes =
        names.map(|name| Ok(log.values(&name)?.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()))));
    sizes.try_fold(0.0, |largest: f64, size| Ok(largest.max(size?)))
}

fn upright_time(log: &Log) -> Result<f64, LogError> {
    let (z, qx, qy) = (log.values("base_z")?, log.values("base_qx")?, log.values("base_qy")?);
    let (Some(&start_z), Some(&start_s)) = (z.first(), log.clock_s().first()) else { return Ok(0.0) };
    let up = |k: usize| 1.0 - 2.0 * (qx[k] * qx[k] + qy[k] * qy[k]);
    let fallen = (0..log.len()).find(|&k| up(k) < FALLEN_UP || z[k] < FALLEN_HEIGHT * start_z);
    Ok(fallen.map_or(log.duration_s(), |k| log.clock_s()[k] - start_s))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::float_cmp)]
    use super::*;
    use btr_core::log::Role;

    fn log(channels: &[(&str, [f64; 3])]) -> Log {
        let mut log = Log::new(vec![1.0, 1.5, 2.0]).unwrap();
        for (name, values) in channels {
            log.insert(*name, "1", Role::Truth, values.to_vec()).unwrap();
        }
        log
    }

    fn weights(terms: &[(&str, f64)]) -> Fitness {
        Fitness::new(&terms.iter().map(|(n, w)| ((*n).to_owned(), *w)).collect()).unwrap()
    }

    #[test]
    fn a_weighted_sum_adds_its_terms() {
        let log = log(&[("base_x", [0.0, 0.3, 0.5]), ("tau_a", [0.0, -2.0, 2.0]), ("dq_a", [9.0, 1.0, 3.0])]);
        assert_eq!(weights(&[("distance", 2.0)]).of(&log).unwrap(), 1.0);
        assert_eq!(weights(&[("speed", 1.0)]).of(&log).unwrap(), 0.5);
        assert_eq!(weights(&[("energy", 1.0)]).of(&log).unwrap(), 4.0);
        assert_eq!(weights(&[("distance", 2.0), ("energy", -0.5)]).of(&log).unwrap(), -1.0);
    }

    #[test]
    fn heading_is_the_shorter_turn_from_the_start() {
        let yaw = |angles: [f64; 3]| {
            let of = |part: fn(f64) -> f64| angles.map(|angle| part(angle / 2.0));
            log(&[("base_qw", of(f64::cos)), ("base_qx", [0.0; 3]), ("base_qy", [0.0; 3]), ("base_qz", of(f64::sin))])
        };
        let heading = weights(&[("heading", 1.0)]);
        assert!((heading.of(&yaw([0.1, 2.0, -0.2])).unwrap() - 0.3).abs() < 1e-12);
        assert!((heading.of(&yaw([3.0, 0.0, -3.0])).unwrap() - (std::f64::consts::TAU - 6.0)).abs() < 1e-12);
    }

    #[test]
    fn peaks_are_the_largest_of_all_joints() {
        let log = log(&[("tau_a", [0.0, -2.0, 2.0]), ("tau_b", [0.0, -3.0, 1.0]), ("dq_a", [9.0, 1.0, 3.0])]);
        assert_eq!(weights(&[("peak_torque", 1.0)]).of(&log).unwrap(), 3.0);
        assert_eq!(weights(&[("peak_speed", 1.0)]).of(&log).unwrap(), 9.0);
        let error = weights(&[("peak_speed", 1.0)]).of(&self::log(&[])).unwrap_err();
        assert_eq!(error.to_string(), "the log has no channel `dq_<joint>`");
    }

    #[test]
    fn upright_time_ends_with_the_fall() {
        let tilt = |angle: f64| (angle / 2.0).sin();
        let mut channels = vec![("base_z", [0.3, 0.3, 0.3]), ("base_qx", [0.0, tilt(0.5), tilt(1.2)])];
        channels.push(("base_qy", [0.0; 3]));
        assert_eq!(weights(&[("upright_time", 1.0)]).of(&log(&channels)).unwrap(), 1.0);
        channels[0].1 = [0.3, 0.1, 0.1];
        assert_eq!(weights(&[("upright_time", 1.0)]).of(&log(&channels)).unwrap(), 0.5);
    }

    #[test]
    fn a_missing_channel_is_named() {
        let error = weights(&[("ball_distance", 1.0)]).of(&log(&[])).unwrap_err();
        assert_eq!(error.to_string(), "the log has no channel `ball_x`");
    }
}
