//! Laws as Python functions: how they are called, and how their exceptions end the work.

use crate::error::raised;
use btr_lab::distributed::DistributedError;
use btr_lab::execution::ExecutionContext;
use btr_lab::failure::FINITE_LAW;
use btr_physics::effects::{LawFunction, LawInputs, Laws, Param};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Python functions with their names in the model's text.
pub(crate) type LawGiven = Vec<(String, Py<PyAny>)>;

/// Functions so far, by their addresses: they stay, as laws do, so that no address is used twice.
static KNOWN: Mutex<BTreeMap<usize, Arc<LawFunction>>> = Mutex::new(BTreeMap::new());

thread_local! {
    /// The execution context of this thread, which can be cancelled.
    static CONTEXT: RefCell<Option<Arc<ExecutionContext>>> = const { RefCell::new(None) };
}

/// The functions of a model.
pub(crate) fn laws(py: Python<'_>, given: &LawGiven) -> Laws {
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    Laws::new(given.iter().map(|(name, function)| {
        let make = |function: Py<PyAny>| -> Arc<LawFunction> {
            Arc::new(move |scene: &LawInputs, params: &[Param], p: &[f64]| value(&function, scene, params, p))
        };
        let function = function.clone_ref(py);
        (name.clone(), known.entry(function.as_ptr() as usize).or_insert_with(|| make(function)).clone())
    }))
}

/// Functions as other processes can read them; nothing where there are none.
pub(crate) fn packed(py: Python<'_>, given: &LawGiven) -> PyResult<Vec<u8>> {
    if given.is_empty() {
        return Ok(Vec::new());
    }
    let given: Vec<(&str, &Py<PyAny>)> = given.iter().map(|(name, function)| (name.as_str(), function)).collect();
    py.import("btr._laws")?.call_method1("packed", (given,))?.extract()
}

/// The functions that another process packed.
pub(crate) fn unpacked(bytes: &[u8]) -> Result<Laws, DistributedError> {
    Python::attach(|py| {
        let given = py.import("btr._laws").and_then(|laws| laws.call_method1("unpacked", (PyBytes::new(py, bytes),)));
        let given: PyResult<LawGiven> = given.and_then(|given| given.extract());
        let unreadable = |why| DistributedError::Functions(format!("the law's function cannot be read here: {why}"));
        given.map(|given| laws(py, &given)).map_err(unreadable)
    })
}

/// The value of the function. An exception cancels the work, and so does a value that is not a finite number; the
/// simulation ends with it, and no function is called any more.
fn value(function: &Py<PyAny>, scene: &LawInputs, params: &[Param], p: &[f64]) -> f64 {
    CONTEXT.with_borrow(|context| {
        if context.as_ref().is_some_and(|context| context.is_cancelled()) {
            return f64::NAN;
        }
        Python::attach(|py| called(function.bind(py), scene, params, p)).unwrap_or_else(|error| {
            if let Some(context) = context {
                context.fail(Box::new(error));
            }
            f64::NAN
        })
    })
}

fn called(function: &Bound<'_, PyAny>, scene: &LawInputs, params: &[Param], p: &[f64]) -> PyResult<f64> {
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
            Err(raised(&message, Some(FINITE_LAW.into())))
        }
        Err(_) => Err(PyTypeError::new_err(format!("the law {function} gave {}, not a number", answer.repr()?))),
    }
}

/// Runs work on this thread; its Python functions stop when the context is cancelled. All simulations with functions
/// run on one thread: see [`context`](crate::work::context).
pub(crate) fn with_cancellation<T: Send>(context: &Arc<ExecutionContext>, work: impl FnOnce() -> T + Send) -> T {
    CONTEXT.set(Some(context.clone()));
    // Python knows this thread from the first call to the last: to be introduced anew takes longer than a call.
    Python::attach(|py| py.detach(work))
}
