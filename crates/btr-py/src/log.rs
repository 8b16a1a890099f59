//! Logs: a clock and channels as NumPy arrays.

use crate::error::{Raise, raised};
use crate::model::Model;
use btr_core::log;
use btr_physics::experiment::LogSource;
use btr_physics::io::{self, Mapping, Meta, Recording};
use numpy::{AllowTypeChange, PyArray1, PyArrayLike1};
use pyo3::exceptions::{PyKeyError, PyUserWarning};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};
use std::collections::BTreeMap;
use std::ffi::CString;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What a robot was told and what its sensors said, on one clock.
#[pyclass(frozen, module = "btr", name = "Log")]
pub(crate) struct Log {
    name: PathBuf,
    pub(crate) log: log::Log,
}

/// No two logs may be called the same.
pub(crate) fn numbered(name: &str) -> PathBuf {
    static MADE: AtomicUsize = AtomicUsize::new(1);
    PathBuf::from(format!("{name} {}", MADE.fetch_add(1, Ordering::Relaxed)))
}

pub(crate) type Floats<'py> = PyArrayLike1<'py, f64, AllowTypeChange>;

impl Log {
    pub(crate) fn new(name: PathBuf, log: log::Log) -> Self {
        Log { name, log }
    }
}

#[pymethods]
impl Log {
    /// A log of columns: `clock_s` in s, increasing, and one array of its length per channel. Names mean what a CSV's headers
    /// mean: `cmd_<joint>`, `q_<joint>`, `dq_<joint>`, `tau_<joint>`; `q_knee_deg` is in degrees. NaN where nothing is known.
    /// Raises `BtrError` for a clock that does not increase, and arrays of another length.
    #[new]
    #[pyo3(signature = (clock_s, channels, name = None))]
    fn made(clock_s: Floats<'_>, channels: &Bound<'_, PyDict>, name: Option<PathBuf>) -> PyResult<Self> {
        let name = name.unwrap_or_else(|| numbered("log"));
        let column = |(key, values): (Bound<'_, PyAny>, Bound<'_, PyAny>)| -> PyResult<(String, Vec<f64>)> {
            Ok((key.extract()?, values.extract::<Floats<'_>>()?.as_array().to_vec()))
        };
        let columns = channels.iter().map(column).collect::<PyResult<_>>()?;
        let log = io::log_of(&name, clock_s.as_array().to_vec(), columns).map_err(Raise::raise)?;
        Ok(Log { name, log })
    }

    /// Reads a `.csv`, `.csv.gz`, `.mcap`, bag or episode; a model's `[channels]` say what foreign names mean. Raises
    /// `BtrError` for what is no log.
    #[staticmethod]
    #[pyo3(signature = (path, model = None))]
    fn read(py: Python<'_>, path: PathBuf, model: Option<&Model>) -> PyResult<Self> {
        let mapping = mapping(model)?;
        let (log, warnings) = py.detach(|| io::read_log(&path, &mapping)).map_err(Raise::raise)?;
        warn(py, &warnings)?;
        Ok(Log { name: path, log })
    }

    /// Writes a `.csv`, `.csv.gz` or `.mcap`, whole or not at all. Raises `BtrError` where it cannot be written, and where a
    /// log with more than commands in it would be lost, unless that is to be: `overwrite`.
    #[pyo3(signature = (path, *, overwrite = false))]
    fn write(&self, py: Python<'_>, path: PathBuf, overwrite: bool) -> PyResult<()> {
        py.detach(|| btr_cli::may_write_log(&path, overwrite)).map_err(Raise::raise)?;
        py.detach(|| io::write_log(&path, &self.log, &Meta::default())).map_err(Raise::raise)
    }

    /// What it is called in reports: the file's path where it was read.
    #[getter]
    fn name(&self) -> &PathBuf {
        &self.name
    }

    /// The clock in s, an array of `len(log)`.
    #[getter]
    fn clock_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.log.clock_s())
    }

    /// The channels' names, in order.
    fn keys(&self) -> Vec<&str> {
        self.log.channels().map(|(name, _)| name).collect()
    }

    /// The unit of a channel (SI), as text. Raises `KeyError` for one that is not there.
    fn unit(&self, channel: &str) -> PyResult<&str> {
        let found = self.log.channel(channel).map(|channel| channel.unit.as_str());
        found.ok_or_else(|| self.missing(channel))
    }

    fn __getitem__<'py>(&self, py: Python<'py>, channel: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let found = self.log.channel(channel).ok_or_else(|| self.missing(channel))?;
        Ok(PyArray1::from_slice(py, &found.values))
    }

    /// The channels by name, each an array of `len(log)` in its unit. Where a joint's name ends like a unit (`arm_m`), `Log`
    /// would read that as one.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let channels = PyDict::new(py);
        for (name, channel) in self.log.channels() {
            channels.set_item(name, PyArray1::from_slice(py, &channel.values))?;
        }
        Ok(channels)
    }

    /// A pandas frame: the clock in s as column `t`, then every channel in its unit, so that `load_log` reads it back. Raises
    /// `ImportError` without pandas.
    fn to_dataframe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("btr._logs")?.call_method1("frame", (self.clock_s(py), self.columns(py)?))
    }

    /// Draws channels in their units against the clock in s; without any, what joints were told and what they read. What
    /// belongs to one joint and has one unit shares an axes; `ax`, one Matplotlib `Axes`, takes everything. Returns the list
    /// of axes. Raises `KeyError` for a channel that is not there, `ImportError` without Matplotlib.
    #[pyo3(signature = (*channels, ax = None))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        channels: Vec<String>,
        ax: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("btr.plots")?.call_method1("log", (slf, channels, ax))
    }

    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("btr._logs")?.call_method1("table", (slf,))
    }

    /// For pickles.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let parts = (self.clock_s(py), self.columns(py)?, self.name.clone());
        Ok((py.get_type::<Log>().into_any(), parts.into_pyobject(py)?))
    }

    fn __contains__(&self, channel: &str) -> bool {
        self.log.channel(channel).is_some()
    }

    fn __len__(&self) -> usize {
        self.log.len()
    }

    fn __eq__(&self, other: &Self) -> bool {
        // A sample that is missing on both sides is the same.
        let bits = |log: &log::Log| -> Vec<Vec<u64>> {
            let series = log.channels().map(|(_, channel)| channel.values.as_slice()).chain([log.clock_s()]);
            series
                .map(|values| values.iter().map(|x| if x.is_nan() { u64::MAX } else { (x + 0.0).to_bits() }).collect())
                .collect()
        };
        let heads = |log: &log::Log| -> Vec<_> {
            log.channels().map(|(name, c)| (name.to_owned(), c.unit.clone(), c.role)).collect()
        };
        heads(&self.log) == heads(&other.log) && bits(&self.log) == bits(&other.log)
    }

    fn __repr__(&self) -> String {
        let (samples, seconds, channels) = (self.log.len(), self.log.duration_s(), self.log.channels().len());
        format!("<Log {}: {samples} samples, {seconds:.3} s, {channels} channels>", self.name.display())
    }
}

impl Log {
    /// The channels under names that `Log` reads as what they are.
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(py);
        for (name, channel) in self.log.channels() {
            let column = io::column_of(name).ok_or_else(|| raised(&format!("no column can be called {name}"), None))?;
            columns.set_item(column, PyArray1::from_slice(py, &channel.values))?;
        }
        Ok(columns)
    }

    fn missing(&self, channel: &str) -> PyErr {
        PyKeyError::new_err(format!("no channel {channel}; there are {}", self.keys().join(", ")))
    }
}

/// What a model says of foreign names.
fn mapping(model: Option<&Model>) -> PyResult<Mapping> {
    let file = model.map(|model| model.source.parse().map_err(Raise::raise)).transpose()?;
    Ok(file.map_or_else(Mapping::default, |file| file.channels))
}

/// What a reader noticed, as Python's warnings.
pub(crate) fn warn(py: Python<'_>, warnings: &[impl ToString]) -> PyResult<()> {
    for warning in warnings {
        let text = CString::new(warning.to_string().replace('\0', ""))?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
    }
    Ok(())
}

/// A log of ROS 2 messages that somebody else reads: topics with their type and encoding, and messages with the number of
/// their topic, when they were recorded in ns, and their bytes.
#[pyfunction]
pub(crate) fn log_of_messages(
    py: Python<'_>,
    name: PathBuf,
    topics: Vec<(String, String, String)>,
    messages: &Bound<'_, PyAny>,
    model: Option<&Model>,
) -> PyResult<Log> {
    let mapping = mapping(model)?;
    let mut recording = Recording::new(&mapping);
    for (id, (topic, schema, encoding)) in (0..).zip(&topics) {
        recording.topic(id, topic, schema, encoding, &BTreeMap::new());
    }
    for message in messages.try_iter()? {
        let (id, log_ns, data): (u16, i64, Bound<'_, PyBytes>) = message?.extract()?;
        recording.take(id, u64::try_from(log_ns).unwrap_or(0), data.as_bytes());
    }
    let (log, warnings) = recording.into_log(&name).map_err(Raise::raise)?;
    warn(py, &warnings)?;
    Ok(Log { name, log })
}

/// A log that somebody asks about: a path, or a log that is there.
#[derive(FromPyObject)]
pub(crate) enum Given {
    Log(Py<Log>),
    Path(PathBuf),
}

impl Given {
    pub(crate) fn source(self) -> LogSource {
        match self {
            Given::Path(path) => LogSource::File(path),
            Given::Log(log) => {
                let log = log.get();
                LogSource::Made { name: log.name.clone(), log: log.log.clone() }
            }
        }
    }
}
