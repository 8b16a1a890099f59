//! Long work: without Python's GIL, interruptible by Ctrl-C, and optionally on remote workers.

use crate::error::{Raise, raised};
use crate::laws;
use crate::laws::LawGiven;
use btr_lab::distributed;
use btr_lab::execution;
use btr_lab::execution::{CHECKED_ONE_IN, Cause, ExecutionContext, Executor};
use btr_lab::experiment::Source;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::num::NonZeroUsize;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// Polling period of Ctrl-C.
const POLL: Duration = Duration::from_millis(50);

/// Who does the work: threads of this process (all, or so many), or an object of `btr.executors` with `workers` and
/// `work`.
#[derive(FromPyObject)]
pub(crate) enum ExecutorChoice {
    Threads(usize),
    Object(Py<PyAny>),
}

/// How the work on a model is done. Functions of Python are called on one thread of a process: only one can hold
/// Python's lock.
pub(crate) fn context(
    py: Python<'_>,
    executor: Option<ExecutorChoice>,
    source: &Source,
    functions: &LawGiven,
) -> PyResult<Arc<ExecutionContext>> {
    Ok(Arc::new(match executor {
        Some(ExecutorChoice::Object(object)) => {
            let workers = object.getattr(py, "workers")?.extract(py)?;
            let (functions, check_one_in) = (laws::packed(py, functions)?, check_one_in(object.bind(py))?);
            ExecutionContext::with_executor(Box::new(PythonExecutor { object, workers, functions, check_one_in }))
        }
        Some(ExecutorChoice::Threads(threads)) if functions.is_empty() => ExecutionContext::local(threads),
        Some(ExecutorChoice::Threads(_)) | None => here(source),
    }))
}

/// The local execution context of a model: all threads, or one if it has Python functions.
fn here(source: &Source) -> ExecutionContext {
    if source.laws.is_empty() { ExecutionContext::default() } else { ExecutionContext::local(1) }
}

/// Sends batches to a Python object: `work(payloads, batch) -> answer`.
struct PythonExecutor {
    object: Py<PyAny>,
    workers: usize,
    functions: Vec<u8>,
    check_one_in: Option<NonZeroUsize>,
}

/// Which share of an executor's results is computed again; that of btr where the executor does not say.
fn check_one_in(executor: &Bound<'_, PyAny>) -> PyResult<Option<NonZeroUsize>> {
    match executor.getattr_opt("check_one_in")? {
        Some(stated) => stated.extract(),
        None => Ok(Some(CHECKED_ONE_IN)),
    }
}

/// Data sent to each worker once; equal contents have equal keys.
#[pyclass(frozen, module = "btr", name = "Payload")]
pub(crate) struct Payload(Arc<execution::Payload>);

#[pymethods]
impl Payload {
    #[getter]
    fn key(&self) -> u64 {
        self.0.key
    }

    #[getter]
    fn content<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.0.bytes)
    }
}

impl Executor for PythonExecutor {
    fn workers(&self) -> usize {
        self.workers
    }

    fn functions(&self) -> &[u8] {
        &self.functions
    }

    fn check_one_in(&self) -> Option<NonZeroUsize> {
        self.check_one_in
    }

    fn work(&self, payloads: &[Arc<execution::Payload>], batch: &[u8]) -> Result<Vec<u8>, Cause> {
        let answer = Python::attach(|py| -> PyResult<Vec<u8>> {
            let payloads: Vec<Payload> = payloads.iter().cloned().map(Payload).collect();
            let answer = self.object.call_method1(py, "work", (payloads, PyBytes::new(py, batch)))?;
            Ok(answer.cast_bound::<PyBytes>(py)?.as_bytes().to_vec())
        });
        answer.map_err(|error| Box::new(error) as Cause)
    }
}

/// How many forks lie between this process and the one that imported btr. A fork has none of its parent's threads.
static FORKS: AtomicUsize = AtomicUsize::new(0);
/// Thread pools by fork depth: the pool that a fork inherits belongs to its parent, and its threads do not exist in the
/// fork.
static OWN: [OnceLock<ThreadPool>; 8] = [const { OnceLock::new() }; 8];

/// To be called in the child after a fork.
#[pyfunction]
pub(crate) fn forked() {
    FORKS.fetch_add(1, Ordering::Relaxed);
}

/// Runs work on the global thread pool, or in a fork on a pool of its own.
fn threaded<T: Send>(work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let Some(fork) = FORKS.load(Ordering::Relaxed).checked_sub(1) else { return Ok(work()) };
    let pool = own_pool(fork).map_err(|why| raised(&why, Some("start processes afresh (spawn)".into())))?;
    // Python knows the pool's thread from the first call of a law to the last, as in `laws::with_cancellation`.
    let in_pool = || pool.install(|| Python::attach(|py| py.detach(work)));
    // A thread that rayon has never seen asks: where one of the parent's pool forked, this one passes for it, and would
    // wait by doing what that one had to do.
    let done = std::thread::scope(|scope| scope.spawn(in_pool).join());
    Ok(done.unwrap_or_else(|cause| resume_unwind(cause)))
}

fn own_pool(fork: usize) -> Result<&'static ThreadPool, String> {
    let own = OWN.get(fork).ok_or("forks are nested too deeply")?;
    if own.get().is_none() {
        // Where two threads race, the first pool is kept.
        _ = own.set(ThreadPoolBuilder::new().build().map_err(|e| e.to_string())?);
    }
    own.get().ok_or_else(|| "a fork found no threads".to_owned())
}

/// Answers a batch, wherever work is done: `payloads` are keys and contents. What a law's function raises is raised
/// here. The batch is worked on in a thread of its own, so that the calling one, which may belong to a pool, does not
/// begin other work while it waits.
#[pyfunction]
pub(crate) fn serve<'py>(
    py: Python<'py>,
    payloads: Vec<(u64, Bound<'py, PyBytes>)>,
    batch: &Bound<'py, PyBytes>,
) -> PyResult<Bound<'py, PyBytes>> {
    let payloads: Vec<(u64, &[u8])> = payloads.iter().map(|(key, content)| (*key, content.as_bytes())).collect();
    let batch = batch.as_bytes();
    let context = Arc::new(ExecutionContext::local(1));
    let serve = || distributed::serve(&payloads, batch, &laws::unpacked, &context);
    let on_one_thread = || context.install(|| laws::with_cancellation(&context, serve));
    let answer = py.detach(|| std::thread::scope(|scope| scope.spawn(on_one_thread).join()));
    if let Some(cause) = context.take_cause() {
        return Err(exception(cause));
    }
    let answer = answer.unwrap_or_else(|panic| resume_unwind(panic)).map_err(|why| raised(why.to_string(), None))?;
    Ok(PyBytes::new(py, &answer.map_err(Raise::raise)?))
}

/// Runs work in a thread of its own while this one waits for it and for Ctrl-C. Exceptions in it (of a listener, a
/// worker, a user's function) are raised here.
pub(crate) fn working<T: Send>(
    py: Python<'_>,
    context: &Arc<ExecutionContext>,
    work: impl FnOnce() -> PyResult<T> + Send,
) -> PyResult<T> {
    let mut interrupted = None;
    let ended = py.detach(|| {
        std::thread::scope(|scope| {
            let (done, finished) = channel::<()>();
            let worker = scope.spawn(move || {
                let _done = done;
                threaded(|| context.install(|| laws::with_cancellation(context, work)))
            });
            while finished.recv_timeout(POLL) == Err(RecvTimeoutError::Timeout) {
                if let Err(signal) = Python::attach(|py| py.check_signals()) {
                    interrupted = Some(signal);
                    context.cancel();
                }
            }
            worker.join().unwrap_or_else(|panic| resume_unwind(panic))
        })
    });
    // What the work gave after it was cancelled says less than why it was.
    match interrupted.or_else(|| context.take_cause().map(exception)) {
        Some(error) => Err(error),
        None => ended?.map_err(|why| raised(why.to_string(), None))?,
    }
}

/// Short work, on this thread where no function can make it long or raise.
pub(crate) fn at_once<T: Send>(
    py: Python<'_>,
    source: &Source,
    work: impl FnOnce() -> PyResult<T> + Send,
) -> PyResult<T> {
    if source.laws.is_empty() { py.detach(|| threaded(work))? } else { working(py, &Arc::new(here(source)), work) }
}

/// The cause of a cancellation as an exception.
fn exception(cause: Cause) -> PyErr {
    match cause.downcast::<PyErr>() {
        Ok(error) => *error,
        Err(other) => raised(other.to_string(), None),
    }
}
