//! Errors as Python exceptions, with the message and the help of the command line.

use btr_core::log::LogError;
use btr_core::space::SpaceError;
use btr_core::world::WorldError;
use btr_io::IoError;
use btr_lab::experiment::FileError;
use btr_lab::verbs::{AddError, ProblemError};
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

/// What the command line calls things, and what they are called here.
const IN_PYTHON: &[(&str, &str)] = &[
    ("or use --set logs.index=PATH", "or give load_model(..., {\"logs.index\": PATH})"),
    ("or use --set reality.index=PATH", "or give load_model(..., {\"reality.index\": PATH})"),
    ("--set and --seed", "settings and seed="),
    (" --set ", " setting "),
    ("run again with --resume", "go on with resume=True"),
    (" --resume", " resume=True"),
    (" --out", " out="),
    (" --seed", " seed="),
    ("`btr effects`", "`btr.effects()`"),
    ("`btr add`", "`btr.add`"),
    ("`btr check`", "`btr.check`"),
    ("`btr diagnose`", "`btr.diagnose`"),
    ("`btr fit`", "`btr.fit`"),
    ("a .toml is run by `btr coevolve` or `btr simulate`", "a .toml is for load_model"),
    ("; or read it in Python: btr.load_log", "; or give what btr.load_log makes of it"),
    ("give the output another name", "give it another name, or write with overwrite=True what may be lost"),
];

/// Rewrites a message of the command line for callers from Python.
pub(crate) fn in_python(text: &str) -> String {
    let text = IN_PYTHON.iter().fold(text.to_owned(), |text, (theirs, ours)| text.replace(theirs, ours));
    let of_an_effect = text.split_once("`btr effects ").and_then(|(before, rest)| {
        let (effect, after) = rest.split_once('`')?;
        Some(format!("{before}`btr.effects(\"{effect}\")`{after}"))
    });
    of_an_effect.unwrap_or(text)
}

/// An exception with a message and a remedy.
pub(crate) fn raised(message: &str, help: Option<String>) -> PyErr {
    BtrError::new_err(match help {
        Some(help) => format!("{}\nhelp: {}", in_python(message), in_python(&help)),
        None => in_python(message),
    })
}

/// Errors that are raised as Python exceptions.
pub(crate) trait Raise {
    fn raise(self) -> PyErr;
}

impl Raise for FileError {
    fn raise(self) -> PyErr {
        raised(&self.to_string(), self.help)
    }
}

impl Raise for IoError {
    fn raise(self) -> PyErr {
        raised(&self.to_string(), Some(self.help()))
    }
}

impl Raise for AddError {
    fn raise(self) -> PyErr {
        raised(&self.to_string(), self.help())
    }
}

impl Raise for WorldError {
    fn raise(self) -> PyErr {
        btr_lab::failure::Failure::from(self).raise()
    }
}

impl Raise for LogError {
    fn raise(self) -> PyErr {
        raised(&self.to_string(), None)
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
        };
        raised(&self.to_string(), Some(help.to_owned()))
    }
}

impl Raise for ProblemError {
    fn raise(self) -> PyErr {
        match self {
            ProblemError::File(error) => error.raise(),
            ProblemError::Add(error) => error.raise(),
            ProblemError::World(error) => error.raise(),
            ProblemError::Still | ProblemError::Short(_) | ProblemError::Blind | ProblemError::Nothing => {
                raised(&self.to_string(), self.help())
            }
        }
    }
}
