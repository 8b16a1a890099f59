//! Reads logs for a comparison with simulations.

use super::rate;
use super::source::{LogSource, ReadLog};
use crate::experiment::file::File;
use crate::experiment::source::FileError;
use crate::log_quality::{torque_noise, usable};
use btr_core::log::{Log, Role};
use btr_core::signal::missing;
use btr_core::text::Text;
use btr_identify::quality::{find_glitches, leave_out_glitches};
use btr_physics::robot::{Base, Robot};
use std::path::Path;

/// Reads a log of a robot, leaves out its glitches, and rejects one that cannot be used. Robots that walk have impacts,
/// which look like glitches on a slow clock: their readings are all kept. The first of several logs of a prescribed
/// motion decides how often all are followed.
pub(crate) fn read(
    source: &LogSource,
    file: &File,
    robot: &Robot,
    followed_s: &mut Option<f64>,
) -> Result<ReadLog, RefusedLog> {
    let (mut log, warnings) = match source {
        LogSource::Read(known) => return Ok(known.clone()),
        LogSource::File(path) => btr_io::read_recorded(path, &file.channels).map_err(|e| unreadable(&e))?,
        LogSource::Stdin => {
            let read = btr_io::read_stream(source.path(), std::io::stdin().lock(), &file.channels);
            read.map(|(log, warnings)| (log.from_zero(), warnings)).map_err(|e| unreadable(&e))?
        }
        LogSource::InMemory { name, log } => {
            let renamed = btr_io::renamed(name, log.clone(), &file.channels).map_err(|e| unreadable(&e))?;
            (renamed.0.from_zero(), renamed.1)
        }
    };
    let unusable = |e: usable::UnusableLog| about(source.path(), &e.message, e.help.map(Text::from));
    usable::check_clock(&log).map_err(|e| RefusedLog::by_content(unusable(e)))?;
    let warnings = warnings.iter().map(ToString::to_string).collect();
    let glitches = match (robot.base, file.channels.keep_glitches) {
        (Base::Floating, _) => Vec::new(),
        (Base::Fixed, true) => find_glitches(&log),
        (Base::Fixed, false) => leave_out_glitches(&mut log),
    };
    let mut warnings: Vec<String> = warnings;
    // Means show their noise no more: what swings between two of them looks like it.
    let mut torque_noise = torque_noise::of_sensors(&log, robot);
    let step_s = log.usual_step_s().filter(|_| robot.is_prescribed());
    let thinned = step_s.and_then(|step_s| {
        let decided = || rate::followed_s(&log, robot, step_s);
        let stated_s = file.simulation.control_s;
        let period_s = stated_s.or_else(|| rate::is_fast(step_s).then(|| *followed_s.get_or_insert_with(decided)))?;
        thin(&mut log, step_s, period_s)
    });
    let (means_of, mean_s) = thinned.as_ref().map_or((1, 0.0), |(count, mean_s, _)| (*count, *mean_s));
    torque_noise.values_mut().for_each(|sigma| *sigma /= (means_of as f64).sqrt());
    warnings.extend(thinned.map(|(_, _, told)| told));
    Ok(ReadLog { path: source.path().to_owned(), log, glitches, warnings, means_of, mean_s, torque_noise })
}

/// Takes means where a prescribed motion was recorded at more than twice the rate at which it is followed: simulated
/// and smoothed torques have nothing above that. Says of how many samples the means are, over
/// how long, in s, and both in words.
fn thin(log: &mut Log, step_s: f64, period_s: f64) -> Option<(usize, f64, String)> {
    let count = rate::within(period_s, step_s);
    if count < 2 || count > log.len() {
        return None;
    }
    let clock_s = log.clock_s().to_vec();
    let measured = log.channels().filter(|(_, channel)| channel.role == Role::Measured);
    let measured: Vec<String> = measured.map(|(name, _)| name.to_owned()).collect();
    for name in &measured {
        if let Some(values) = log.values_mut(name) {
            let bridged = missing::bridged(&clock_s, values, count);
            values.copy_from_slice(&bridged);
        }
    }
    *log = log.means(count).from_zero();
    let (before, after) = (1.0 / step_s, 1.0 / (step_s * count as f64));
    let told = format!(
        "means of {count} samples, {after:.0} instead of {before:.0} per second; [simulation] control_s = {} uses all",
        (step_s * 1e6).round() / 1e6
    );
    Some((count, step_s * count as f64, told))
}

/// An error about a log that is not the fault of the model file.
pub(super) fn about(path: &Path, message: &str, help: Option<Text>) -> FileError {
    FileError { path: path.to_owned(), line: 0, column: 0, message: message.into(), help }
}

/// A log that cannot be used.
pub(crate) struct RefusedLog {
    pub error: FileError,
    /// Whether its content is at fault; otherwise what was asked for, such as a path that does not exist.
    pub by_content: bool,
}

impl RefusedLog {
    pub(super) fn by_content(error: FileError) -> Self {
        RefusedLog { error, by_content: true }
    }

    pub(super) fn by_request(error: FileError) -> Self {
        RefusedLog { error, by_content: false }
    }
}

impl From<RefusedLog> for FileError {
    fn from(log: RefusedLog) -> Self {
        log.error
    }
}

/// An error of the reader, whose message names the log.
fn unreadable(error: &btr_io::IoError) -> RefusedLog {
    let by_content = error.is_about_content();
    RefusedLog { error: about(Path::new(""), &error.to_string(), Some(error.help())), by_content }
}
