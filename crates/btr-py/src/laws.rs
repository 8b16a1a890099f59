//! A user's laws as functions in Python: how they are called, and how what they raise ends the work.

use crate::error::raised;
use btr_physics::effect::{Function, Laws, Param, Scene};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// How often Ctrl-C is asked for while others work.
const PATIENCE: Duration = Duration::from_millis(50);

/// What stands for a function in a model's text, and the function.
pub(crate) type Given = Vec<(String, Py<PyAny>)>;

/// Functions so far, by their addresses: they stay, as laws do, so that no address is used twice.
static KNOWN: Mutex<BTreeMap<usize, Arc<Function>>> = Mutex::new(BTreeMap::new());

thread_local! {
    /// Whether the work on this thread is to end.
    static STOP: RefCell<Arc<AtomicBool>> = RefCell::default();
}

/// The functions of a model.
pub(crate) fn laws(given: Given) -> Laws {
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    Laws::new(given.into_iter().map(|(name, function)| {
        let make = |function: Py<PyAny>| -> Arc<Function> {
            Arc::new(move |scene: &Scene, params: &[Param], p: &[f64]| value(&function, scene, params, p))
        };
        (name, known.entry(function.as_ptr() as usize).or_insert_with(|| make(function)).clone())
    }))
}

/// What the function says; an exception unwinds to whoever works with it.
fn value(function: &Py<PyAny>, scene: &Scene, params: &[Param], p: &[f64]) -> f64 {
    if STOP.with_borrow(|stop| stop.load(Ordering::Relaxed)) {
        resume_unwind(Box::new("interrupted"));
    }
    let answer = Python::attach(|py| called(function.bind(py), scene, params, p));
    answer.unwrap_or_else(|error| resume_unwind(Box::new(error)))
}

fn called(function: &Bound<'_, PyAny>, scene: &Scene, params: &[Param], p: &[f64]) -> PyResult<f64> {
    let (py, own) = (function.py(), PyDict::new(function.py()));
    for (param, value) in params.iter().zip(p) {
        own.set_item(PyString::intern(py, param.name), value)?;
    }
    let [q, dq, ddq, cmd, tau, t] = *scene;
    let answer = function.call((q, dq, ddq, cmd, tau, t), Some(&own))?;
    match answer.extract::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(value) => {
            let message = format!(
                "the law {function} gave {value} at q={q}, dq={dq}, ddq={ddq}, cmd={cmd}, tau={tau}, t={t} with {own}"
            );
            Err(raised(&message, Some("a law gives a finite number wherever a search may look".to_owned())))
        }
        Err(_) => Err(PyTypeError::new_err(format!("the law {function} gave {}, not a number", answer.repr()?))),
    }
}

/// Works on one other thread, on which the functions are called one after the other: only one can hold the lock. This one
/// listens for Ctrl-C meanwhile.
pub(crate) fn on_one_thread<T: Send>(work: impl FnOnce() -> PyResult<T> + Send) -> thread::Result<PyResult<T>> {
    let pool = match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(pool) => pool,
        Err(error) => return Ok(Err(raised(&error.to_string(), None))),
    };
    let stop = Arc::new(AtomicBool::new(false));
    let (tell, told) = mpsc::channel();
    pool.in_place_scope(|scope| {
        let heard = stop.clone();
        scope.spawn(move |_| {
            STOP.set(heard);
            // Python knows this thread from the first call to the last: to be introduced anew costs more than a call.
            let ended = Python::attach(|py| py.detach(|| catch_unwind(AssertUnwindSafe(work))));
            // The other end waits for it.
            let _ = tell.send(ended);
        });
        let mut signal = None;
        loop {
            match told.recv_timeout(PATIENCE) {
                Ok(ended) => return signal.map_or(ended, |signal| Ok(Err(signal))),
                Err(RecvTimeoutError::Timeout) if signal.is_none() => {
                    signal = Python::attach(|py| py.check_signals()).err();
                    stop.store(signal.is_some(), Ordering::Relaxed);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    return Ok(Err(raised("the work ended without an answer", None)));
                }
            }
        }
    })
}
