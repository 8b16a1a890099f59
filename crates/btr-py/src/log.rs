//! Logs: a clock and channels as NumPy arrays.

use crate::error::{Raise, raised};
use btr_core::log;
use btr_io::{Mapping, Meta, Recording, Warning};
use btr_lab::experiment::LogSource;
use btr_lab::output::{Overwrite, may_write_log};
use numpy::{AllowTypeChange, PyArray1, PyArrayLike1};
use pyo3::exceptions::{PyKeyError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyIterator, PyList, PyTuple};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The commands and sensor readings of a robot, on one clock. A mapping from channel names to arrays, except that its
/// length is the number of samples.
#[pyclass(frozen, mapping, module = "btr", name = "Log")]
pub(crate) struct Log {
    name: PathBuf,
    /// Whether the user gave the name. Otherwise it is only a kind of log, and verbs number such logs.
    is_named: bool,
    pub(crate) log: log::Log,
}

/// The meanings that a model gives to foreign channel names (`[channels]`). Extracted from a `Model`.
pub(crate) struct ChannelNames(pub(crate) Mapping);

/// The mapping of a model, or the default one.
fn mapping(model: Option<ChannelNames>) -> Mapping {
    model.map(|model| model.0).unwrap_or_default()
}

pub(crate) type Floats<'py> = PyArrayLike1<'py, f64, AllowTypeChange>;

impl Log {
    pub(crate) fn new(name: PathBuf, log: log::Log) -> Self {
        Log { name, is_named: true, log }
    }

    /// A log without a name of its own.
    pub(crate) fn made_here(kind: &str, log: log::Log) -> Self {
        Log { name: PathBuf::from(kind), is_named: false, log }
    }

    fn of(name: Option<PathBuf>, log: log::Log) -> Self {
        match name {
            Some(name) => Log::new(name, log),
            None => Log::made_here(UNNAMED, log),
        }
    }
}

/// Name of a log that was not given one.
const UNNAMED: &str = "log";

/// The numbers of an array. Times are refused, as NumPy would convert them to numbers of an arbitrary unit.
fn numbers(values: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<f64>> {
    if let Ok(dtype) = values.getattr("dtype") {
        let kind = dtype.getattr("kind").and_then(|kind| kind.extract::<String>()).unwrap_or_default();
        if kind == "M" || kind == "m" {
            let help = "btr.load_log takes columns whose `t` holds times; else give seconds: \
                        (times - times[0]) / numpy.timedelta64(1, 's')";
            return Err(PyTypeError::new_err(format!("{what} holds times, not numbers\nhelp: {help}")));
        }
    }
    let found = values.extract::<Floats<'_>>().map_err(|why| {
        PyTypeError::new_err(format!("{what} is an array of numbers of shape (samples,): {}", why.value(values.py())))
    })?;
    Ok(found.as_array().to_vec())
}

#[pymethods]
impl Log {
    /// A log of columns: `clock_s` in s, increasing, and one array of the same length per channel. Names are those of a
    /// CSV's headers: `cmd_<joint>`, `q_<joint>`, `dq_<joint>`, `tau_<joint>`; `q_knee_deg` is in degrees. NaN is a
    /// missing sample. Raises `BtrError` for a clock that does not increase and for arrays of another length.
    #[new]
    #[pyo3(signature = (clock_s, channels, name = None))]
    fn made(clock_s: &Bound<'_, PyAny>, channels: &Bound<'_, PyDict>, name: Option<PathBuf>) -> PyResult<Self> {
        Ok(of_columns(clock_s, channels, name, &Mapping::default())?.0)
    }

    /// Reads a `.csv`, `.csv.gz`, `.mcap`, bag or episode; a model's `[channels]` map foreign names. Raises `BtrError`
    /// for a file that is not a log.
    #[staticmethod]
    #[pyo3(signature = (path, model = None))]
    fn read(py: Python<'_>, path: PathBuf, model: Option<ChannelNames>) -> PyResult<Self> {
        let mapping = mapping(model);
        let (log, warnings) = py.detach(|| btr_io::read_log(&path, &mapping)).map_err(Raise::raise)?;
        warn(py, &warnings)?;
        Ok(Log::new(path, log))
    }

    /// Writes a `.csv`, `.csv.gz` or `.mcap`, completely or not at all. Raises `BtrError` if it cannot be written, and
    /// if it would replace a log that contains more than commands, unless `overwrite` is set.
    #[pyo3(signature = (path, *, overwrite = false))]
    fn write(&self, py: Python<'_>, path: PathBuf, overwrite: bool) -> PyResult<()> {
        let overwrite = if overwrite { Overwrite::Measurements } else { Overwrite::Commands };
        py.detach(|| may_write_log(&path, overwrite)).map_err(Raise::raise)?;
        py.detach(|| btr_io::write_log(&path, &self.log, &Meta::default())).map_err(Raise::raise)
    }

    /// The name in reports; for a log that was read, the file's path. A log without its own name is called `log` (or
    /// `simulated`), and verbs number such logs: `log 1`.
    #[getter]
    fn name(&self) -> &PathBuf {
        &self.name
    }

    /// Whether it has its own name.
    #[getter]
    fn is_named(&self) -> bool {
        self.is_named
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

    /// The channels' values, arrays of `len(log)`, in the order of `keys`.
    fn values<'py>(&self, py: Python<'py>) -> Vec<Bound<'py, PyArray1<f64>>> {
        self.log.channels().map(|(_, channel)| PyArray1::from_slice(py, &channel.values)).collect()
    }

    /// The channels, pairs of name and array of `len(log)`, in the order of `keys`.
    fn items<'py>(&self, py: Python<'py>) -> Vec<(&str, Bound<'py, PyArray1<f64>>)> {
        self.log.channels().map(|(name, channel)| (name, PyArray1::from_slice(py, &channel.values))).collect()
    }

    /// The channel of that name, an array of `len(log)`; `default` if there is no such channel.
    #[pyo3(signature = (channel, default = None, /))]
    fn get<'py>(
        &self,
        py: Python<'py>,
        channel: &str,
        default: Option<Bound<'py, PyAny>>,
    ) -> Option<Bound<'py, PyAny>> {
        let found = self.log.channel(channel).map(|found| PyArray1::from_slice(py, &found.values).into_any());
        found.or(default)
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        PyList::new(py, self.keys())?.try_iter()
    }

    /// The unit of a channel (SI), as text. Raises `KeyError` for an unknown channel.
    fn unit(&self, channel: &str) -> PyResult<&str> {
        let found = self.log.channel(channel).map(|channel| channel.unit.as_str());
        found.ok_or_else(|| self.missing(channel))
    }

    fn __getitem__<'py>(&self, py: Python<'py>, channel: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let found = self.log.channel(channel).ok_or_else(|| self.missing(channel))?;
        Ok(PyArray1::from_slice(py, &found.values))
    }

    /// The channels by name, each an array of `len(log)` in its unit. If a joint's name ends like a unit (`arm_m`),
    /// `Log` would interpret the ending as a unit.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let channels = PyDict::new(py);
        for (name, channel) in self.log.channels() {
            channels.set_item(name, PyArray1::from_slice(py, &channel.values))?;
        }
        Ok(channels)
    }

    /// A pandas frame: the clock in s as column `t`, then every channel in its unit, so that `load_log` reads it back.
    /// Raises `ImportError` without pandas.
    fn to_dataframe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("btr.logs")?.call_method1("frame", (self.clock_s(py), self.columns(py)?))
    }

    /// Draws channels in their units over time in s; by default the commands and positions of the joints. Channels of
    /// one joint and one unit share axes; a given Matplotlib `ax` receives all channels. Returns the figure.
    /// Raises `KeyError` for an unknown channel, `ImportError` without Matplotlib.
    #[pyo3(signature = (*channels, ax = None))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        channels: Vec<String>,
        ax: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("btr.plots")?.call_method1("log", (slf, channels, ax))
    }

    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("btr.logs")?.call_method1("table", (slf,))
    }

    /// For pickles.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let parts = (self.clock_s(py), self.columns(py)?, self.is_named.then(|| self.name.clone()));
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
            let column =
                btr_io::column_of(name).ok_or_else(|| raised(format!("no column can be called {name}"), None))?;
            columns.set_item(column, PyArray1::from_slice(py, &channel.values))?;
        }
        Ok(columns)
    }

    fn missing(&self, channel: &str) -> PyErr {
        PyKeyError::new_err(format!("no channel {channel}; there are {}", self.keys().join(", ")))
    }
}

/// A log of columns under a model's `[channels]`, with what was noticed.
fn of_columns(
    clock_s: &Bound<'_, PyAny>,
    channels: &Bound<'_, PyDict>,
    name: Option<PathBuf>,
    mapping: &Mapping,
) -> PyResult<(Log, Vec<Warning>)> {
    let called = name.clone().unwrap_or_else(|| PathBuf::from(UNNAMED));
    let column = |(key, values): (Bound<'_, PyAny>, Bound<'_, PyAny>)| -> PyResult<(String, Vec<f64>)> {
        let key: String = key.extract()?;
        let values = numbers(&values, &format!("channel {key}"))?;
        Ok((key, values))
    };
    let columns = channels.iter().map(column).collect::<PyResult<_>>()?;
    let (log, warnings) =
        btr_io::log_of(&called, numbers(clock_s, "clock_s")?, columns, mapping).map_err(Raise::raise)?;
    Ok((Log::of(name, log), warnings))
}

/// A log of columns in memory, whose foreign names mean what a model says.
#[pyfunction]
pub(crate) fn log_of_columns(
    py: Python<'_>,
    clock_s: &Bound<'_, PyAny>,
    channels: &Bound<'_, PyDict>,
    name: Option<PathBuf>,
    model: Option<ChannelNames>,
) -> PyResult<Log> {
    let (log, warnings) = of_columns(clock_s, channels, name, &mapping(model))?;
    warn(py, &warnings)?;
    Ok(log)
}

/// A log under the names that a model's `[channels]` say; itself where it has these already.
#[pyfunction]
pub(crate) fn renamed(py: Python<'_>, log: Py<Log>, model: ChannelNames) -> PyResult<Py<Log>> {
    let Log { name, is_named, log: given } = log.get();
    let (other, warnings) = btr_io::renamed(name, given.clone(), &model.0).map_err(Raise::raise)?;
    warn(py, &warnings)?;
    if other.is_same(given) {
        return Ok(log);
    }
    Py::new(py, Log { name: name.clone(), is_named: *is_named, log: other })
}

/// Which of these columns is the time, as in a CSV, and how many seconds its unit has.
#[pyfunction]
pub(crate) fn time_of(columns: Vec<String>, model: Option<ChannelNames>) -> PyResult<Option<(String, f64)>> {
    let mapping = mapping(model);
    Ok(btr_io::time_of(&columns, &mapping).map(|(column, unit_s)| (column.to_owned(), unit_s)))
}

/// Issues a reader's warnings as Python warnings at the line that called btr.
pub(crate) fn warn(py: Python<'_>, warnings: &[impl ToString]) -> PyResult<()> {
    for warning in warnings {
        py.import("btr._warnings")?.call_method1("warn", (warning.to_string(),))?;
    }
    Ok(())
}

/// A log of ROS 2 messages that somebody else reads: topics with their type and encoding, and messages with the number
/// of their topic, when they were recorded in ns, and their bytes.
#[pyfunction]
pub(crate) fn log_of_messages(
    py: Python<'_>,
    name: PathBuf,
    topics: Vec<(String, String, String)>,
    messages: &Bound<'_, PyAny>,
    model: Option<ChannelNames>,
) -> PyResult<Log> {
    let mapping = mapping(model);
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
    Ok(Log::new(name, log))
}

/// A log argument: a path, or a log in memory, optionally under another name.
#[derive(FromPyObject)]
pub(crate) enum LogArgument {
    Log(Py<Log>),
    Called((String, Py<Log>)),
    Path(PathBuf),
}

impl LogArgument {
    pub(crate) fn source(self) -> LogSource {
        match self {
            LogArgument::Path(path) => LogSource::File(path),
            LogArgument::Log(log) => LogSource::InMemory { name: log.get().name.clone(), log: log.get().log.clone() },
            LogArgument::Called((name, log)) => {
                LogSource::InMemory { name: PathBuf::from(name), log: log.get().log.clone() }
            }
        }
    }
}
