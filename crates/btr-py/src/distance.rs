//! Distances between any series of Python.

use crate::error::{Raise, raised};
use crate::log::{Floats, Log};
use crate::settings::{self, Settings};
use btr_core::distance::{Channels, DISTANCES, DistanceSpec};
use btr_core::log::{self, Role};
use btr_core::world::Behaviour;
use btr_io::Mapping;
use pyo3::prelude::*;
use std::path::PathBuf;

fn spec(name: &str, settings: &Settings<'_>) -> PyResult<DistanceSpec> {
    settings::read("name", name, settings, str::to_owned)
}

/// A distance by its name in experiment files, between logs.
#[pyfunction]
pub(crate) fn distance(
    py: Python<'_>,
    name: &str,
    settings: Settings<'_>,
    real: &Log,
    simulated: &Log,
) -> PyResult<f64> {
    let spec = spec(name, &settings)?;
    if let Some(channels) = spec.channels() {
        comparable(channels, &real.log, &simulated.log)?;
    }
    let behaviour = |log: &Log| Behaviour { log: log.log.clone(), fitness: f64::NAN };
    let (real, simulated) = (behaviour(real), behaviour(simulated));
    Ok(py.detach(|| spec.build().distance(&real, &simulated)))
}

/// The distance by fitness alone.
#[pyfunction]
pub(crate) fn fitness_distance(real: f64, simulated: f64) -> PyResult<f64> {
    let behaviour = |fitness: f64| Behaviour { log: log::Log::default(), fitness };
    Ok(spec("fitness", &vec![])?.build().distance(&behaviour(real), &behaviour(simulated)))
}

/// Every distance: its name, what it looks at, and its settings with their defaults as JSON.
#[pyfunction]
pub(crate) fn distances() -> PyResult<Vec<(&'static str, &'static str, String)>> {
    let row = |&(name, what): &(&'static str, &'static str)| {
        Ok((name, what, serde_json::json!(spec(name, &vec![])?).to_string()))
    };
    DISTANCES.iter().map(row).collect()
}

/// A log of series that are to be compared, whatever they are called: what is no command was measured.
#[pyfunction]
pub(crate) fn measured(name: PathBuf, clock_s: Floats<'_>, series: Vec<(String, Floats<'_>)>) -> PyResult<Log> {
    let columns = series.into_iter().map(|(key, values)| (key, values.as_array().to_vec())).collect();
    let made = btr_io::log_of(&name, clock_s.as_array().to_vec(), columns, &Mapping::default());
    let mut log = made.map_err(Raise::raise)?.0;
    let foreign = log.channels().filter(|(_, channel)| channel.role == Role::Truth);
    let foreign: Vec<(String, log::Channel)> =
        foreign.map(|(key, channel)| (key.to_owned(), channel.clone())).collect();
    for (key, channel) in foreign {
        log.insert(key, channel.unit, Role::Measured, channel.values).map_err(Raise::raise)?;
    }
    Ok(Log::new(name, log))
}

/// Nothing to compare is a mistake, and so is a pattern that no channel has.
fn comparable(channels: &Channels, real: &log::Log, simulated: &log::Log) -> PyResult<()> {
    let names = |log: &log::Log| log.channels().map(|(name, _)| name.to_owned()).collect::<Vec<_>>().join(", ");
    if let Some(pattern) = channels.unmatched(real).first() {
        let help = format!("known channels: {}; `*` stands for any characters, once per pattern", names(real));
        return Err(raised(format!("no channel is called `{pattern}`"), Some(help.into())));
    }
    let compared = |(name, channel): (&str, &log::Channel)| {
        channel.role != Role::Truth && channels.contains(name) && simulated.channel(name).is_some()
    };
    if real.channels().any(compared) {
        return Ok(());
    }
    let what =
        format!("no channel to compare: the real ones are {}; the simulated ones {}", names(real), names(simulated));
    let help =
        "of logs commands and sensors are compared (`cmd_`, `q_`, `dq_`, `tau_`, `imu_`, `foot_`), of dicts everything";
    Err(raised(&what, Some(help.into())))
}
