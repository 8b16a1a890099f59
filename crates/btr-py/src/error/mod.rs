//! Errors as Python exceptions, with the message and the help of the command line in Python's words.

mod text;

pub(crate) use text::in_python;

use btr_core::log::LogError;
use btr_core::space::SpaceError;
use btr_core::text::{Text, printable};
use btr_core::world::WorldError;
use btr_io::IoError;
use btr_lab::distributed::DistributedError;
use btr_lab::experiment::FileError;
use btr_lab::failure::Failure;
use btr_lab::verbs::{AddError, ProblemError, RemoveError};
use pyo3::PyErr;
use pyo3::create_exception;
use pyo3::exceptions::PyException;

create_exception!(
    btr,
    BtrError,
    PyException,
    "Something that cannot be done as it was asked; the message ends with what to do."
);

create_exception!(
    btr,
    TestFailed,
    PyException,
    "To be raised by a robot's function that could not do what it was asked (it fell off the table): the test counts as spent."
);

/// An exception with a message and a remedy.
pub(crate) fn raised(message: impl Into<Text>, help: Option<Text>) -> PyErr {
    let message = in_python(&message.into());
    let text = match help {
        Some(help) => format!("{message}\nhelp: {}", in_python(&help)),
        None => message,
    };
    BtrError::new_err(printable(&text))
}

/// Errors that are raised as Python exceptions.
pub(crate) trait Raise {
    fn raise(self) -> PyErr;
}

impl Raise for Failure {
    fn raise(self) -> PyErr {
        raised(self.message, self.help)
    }
}

impl Raise for FileError {
    fn raise(self) -> PyErr {
        raised(self.text(), self.help)
    }
}

impl Raise for IoError {
    fn raise(self) -> PyErr {
        raised(self.to_string(), Some(self.help()))
    }
}

impl Raise for AddError {
    fn raise(self) -> PyErr {
        raised(self.to_string(), self.help())
    }
}

impl Raise for RemoveError {
    fn raise(self) -> PyErr {
        raised(self.to_string(), self.help())
    }
}

impl Raise for DistributedError {
    fn raise(self) -> PyErr {
        raised(self.to_string(), self.help())
    }
}

impl Raise for WorldError {
    fn raise(self) -> PyErr {
        Failure::from(self).raise()
    }
}

impl Raise for LogError {
    fn raise(self) -> PyErr {
        raised(self.to_string(), None)
    }
}

impl Raise for SpaceError {
    fn raise(self) -> PyErr {
        let help = match &self {
            SpaceError::Bounds { .. } | SpaceError::LogBounds { .. } => {
                "bounds are pairs (low, high), one per dimension"
            }
            SpaceError::Outside { .. } => "move it between its bounds, or the bounds around it",
            SpaceError::Length { .. } => "give one value per dimension",
            SpaceError::Twice { .. } => "give every parameter a name of its own",
            _ => return raised(self.to_string(), None),
        };
        raised(self.to_string(), Some(help.into()))
    }
}

impl Raise for ProblemError {
    fn raise(self) -> PyErr {
        Failure::input(self, &[]).raise()
    }
}
