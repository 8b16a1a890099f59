//! What `btr check` tells about runs of the same command.

use super::{ChannelSpread, Repeats};
use btr_core::log::Log;
use btr_core::signal::repeats::outliers as outliers_among;
use btr_core::signal::stats::{kendall_tau_b, std};
use btr_identify::compare::{LogPair, Regime, compare, spectrum};
use btr_physics::model::Model;
use nalgebra::DMatrix;
use serde::Serialize;

/// A run whose departures are this many times the usual ones is out of line.
const OUT_OF_LINE: f64 = 2.5;
/// Fewest runs that can show a drift by their order, and smallest share of the departures that follow it.
const DRIFT: (usize, f64) = (5, 0.5);
/// Fewest independent differences for a spread that is known to about a fifth.
const FEW: f64 = 12.0;
/// Runs that a command should have.
const ENOUGH_RUNS: usize = 4;

/// How far runs of the same command differ.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RepeatReport {
    /// For each command that was given more than once, the logs of its runs.
    pub runs: Vec<Vec<String>>,
    /// The repeatability of each compared channel.
    pub channels: Vec<RepeatedChannel>,
    /// Runs that differ far more than the others.
    pub outliers: Vec<RunOutlier>,
    /// Commands whose runs change in one direction, as while a robot warms up.
    pub drifts: Vec<Drift>,
    /// What to record.
    pub advice: Option<String>,
}

/// The repeatability of a channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RepeatedChannel {
    /// The channel.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// Standard deviation of a run from what the robot does on average, the sensor's noise included.
    pub repeatability: f64,
    /// The part of it that is an offset of the whole run: its standard deviation.
    pub offset: f64,
    /// The noise floor of its sensor.
    pub noise_floor: f64,
    /// Number of independent differences between runs that it rests on.
    pub independent: f64,
    /// The frequency below which half of its variance lies, in Hz; none for logs too short to tell.
    pub half_below_hz: Option<f64>,
    /// The same by regime, largest first.
    pub regimes: Vec<RepeatedRegime>,
}

/// The repeatability of a joint in a regime.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RepeatedRegime {
    /// What the joint does.
    pub regime: Regime,
    /// Standard deviation, in the channel's unit.
    pub repeatability: f64,
}

/// A run that differs from the others of its command.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunOutlier {
    /// The log.
    pub log: String,
    /// The channel.
    pub channel: String,
}

/// A command whose runs change in one direction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Drift {
    /// The logs, in their order.
    pub logs: Vec<String>,
    /// The share of the departures that follows the order of the runs.
    pub share: f64,
}

impl Repeats {
    /// The report on the logs of the model's scenarios.
    pub(crate) fn report(&self, model: &Model, logs: &[Log]) -> RepeatReport {
        let name = |scenario: usize| model.scenarios[scenario].name.clone();
        let names = |runs: &Vec<(usize, f64)>| runs.iter().map(|(scenario, _)| name(*scenario)).collect();
        let mut outliers = Vec::new();
        for (channel, spread) in self.channels.iter().filter(|(_, spread)| spread.beyond_the_sensor().is_some()) {
            for runs in &self.runs {
                let scenarios: Vec<usize> = runs.iter().map(|(scenario, _)| *scenario).collect();
                let departures: Vec<Vec<f64>> =
                    scenarios.iter().filter_map(|scenario| spread.departures.get(scenario).cloned()).collect();
                let found = outliers_among(&departures, OUT_OF_LINE)
                    .into_iter()
                    .map(|run| RunOutlier { log: name(scenarios[run]), channel: channel.clone() });
                outliers.extend(found);
            }
        }
        RepeatReport {
            runs: self.runs.iter().map(names).collect(),
            channels: self.channels.iter().map(|(name, spread)| repeated(name, spread, model, logs)).collect(),
            outliers,
            drifts: self.runs.iter().filter_map(|runs| self.drift(runs, &name)).collect(),
            advice: self.advice(model, logs),
        }
    }

    /// Whether the runs of a command change in the order in which they were made: their departures, in spreads, lie
    /// mostly along one line, and the runs in order on it.
    fn drift(&self, runs: &[(usize, f64)], name: &dyn Fn(usize) -> String) -> Option<Drift> {
        let beyond = self.channels.values().filter_map(|channel| Some((channel, channel.beyond_the_sensor()?.sigma)));
        let series: Vec<Vec<f64>> = runs
            .iter()
            .map(|(scenario, _)| {
                let of = |(channel, sigma): (&ChannelSpread, f64)| {
                    let departures = channel.departures.get(scenario).cloned().unwrap_or_default();
                    departures.into_iter().map(move |d| if d.is_finite() { d / sigma } else { 0.0 })
                };
                beyond.clone().flat_map(of).collect()
            })
            .collect();
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let eigen = DMatrix::from_fn(runs.len(), runs.len(), |i, j| product(&series[i], &series[j])).symmetric_eigen();
        let (first, whole) = (eigen.eigenvalues.imax(), eigen.eigenvalues.sum());
        let along: Vec<f64> = eigen.eigenvectors.column(first).iter().copied().collect();
        let order: Vec<f64> = (0..runs.len()).map(|k| k as f64).collect();
        let in_order = kendall_tau_b(&along, &order).is_some_and(|tau| tau.abs() > 1.0 - 1e-9);
        let share = eigen.eigenvalues[first] / whole;
        let logs = || runs.iter().map(|(scenario, _)| name(*scenario)).collect();
        (runs.len() >= DRIFT.0 && in_order && share >= DRIFT.1).then(|| Drift { logs: logs(), share })
    }

    /// What to record for the repeatability to be known.
    fn advice(&self, model: &Model, logs: &[Log]) -> Option<String> {
        let Some(runs) = self.runs.iter().max_by_key(|runs| runs.len()) else {
            let motion = |log: &Log| {
                let joints =
                    model.robot.movable().filter_map(|(_, link)| log.channel(&format!("q_{}", link.joint.name)));
                joints.map(|channel| std(&channel.values)).filter(|x| x.is_finite()).sum::<f64>()
            };
            let most = (0..logs.len()).max_by(|a, b| motion(&logs[*a]).total_cmp(&motion(&logs[*b])))?;
            return Some(format!(
                "how well the robot repeats itself is not known: no two logs have the same command; record {} runs of {}",
                ENOUGH_RUNS, model.scenarios[most].name
            ));
        };
        let rough = self.channels.values().any(|c| c.beyond_the_sensor().is_some() && c.rest.freedom() < FEW);
        let first = &model.scenarios[runs.first()?.0].name;
        rough.then(|| format!("the repeatability rests on few independent differences; record more runs of {first}"))
    }
}

/// A channel's repeatability by regime and frequency: what the runs differ by is mapped as the error of a model is.
fn repeated(name: &str, spread: &ChannelSpread, model: &Model, logs: &[Log]) -> RepeatedChannel {
    let mean = |(scenario, departures): (&usize, &Vec<f64>)| {
        let mut log = logs[*scenario].clone();
        log.retain(|channel, _| channel == name);
        let readings = log.values_mut(name)?;
        readings.iter_mut().zip(departures).for_each(|(reading, departure)| *reading -= departure);
        Some((*scenario, log))
    };
    let means: Vec<(usize, Log)> = spread.departures.iter().filter_map(mean).collect();
    let pairs = means.iter().map(|one| (one, &model.scenarios[one.0].name));
    let pairs: Vec<LogPair> =
        pairs.map(|((scenario, mean), name)| LogPair { name, real: &logs[*scenario], simulated: mean }).collect();
    let cells = compare(&pairs, |_, _, _| Some(spread.sensor.max(f64::MIN_POSITIVE))).cells;
    let cells = cells.iter().filter(|cell| cell.regime != Regime::Throughout);
    let mut regimes: Vec<RepeatedRegime> =
        cells.map(|cell| RepeatedRegime { regime: cell.regime, repeatability: cell.rmse }).collect();
    regimes.sort_by(|a, b| b.repeatability.total_cmp(&a.repeatability));
    RepeatedChannel {
        channel: name.to_owned(),
        unit: spread.unit.clone(),
        repeatability: spread.spread.std().unwrap_or(f64::NAN),
        offset: spread.offset(),
        noise_floor: spread.sensor,
        independent: spread.beyond_the_sensor().map_or(spread.spread.freedom(), |noise| noise.freedom),
        half_below_hz: half_below_hz(spread, logs),
        regimes,
    }
}

/// The frequency below which half of the variance of the departures lies.
fn half_below_hz(spread: &ChannelSpread, logs: &[Log]) -> Option<f64> {
    let (scenario, departures) = spread.departures.iter().max_by_key(|(_, departures)| departures.len())?;
    let lines = spectrum(logs[*scenario].clock_s(), departures);
    let whole: f64 = lines.iter().map(|(_, density)| density * density).sum();
    let mut below = 0.0;
    lines.into_iter().find_map(|(hz, density)| {
        below += density * density;
        (below >= 0.5 * whole).then_some(hz)
    })
}
