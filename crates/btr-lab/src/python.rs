//! Python, for what only its packages do: reading robots' files of other programs, and serving the studio's page.

use std::process::{Command, Output};

/// Names the interpreter that has btr's Python package; the command of the wheel sets it.
const INTERPRETER: &str = "BTR_PYTHON";

/// A Python interpreter.
pub struct Python {
    interpreter: String,
}

impl Python {
    /// The interpreter that was named, or `python3`; whether it is there shows when it runs.
    pub fn named() -> Self {
        Python { interpreter: std::env::var(INTERPRETER).unwrap_or_else(|_| "python3".to_owned()) }
    }

    /// A run of it, still without arguments.
    pub fn command(&self) -> Command {
        Command::new(&self.interpreter)
    }

    /// Why it cannot be used: the interpreter's name and the reason.
    pub fn unusable(&self, why: impl std::fmt::Display) -> String {
        format!("{}: {why}", self.interpreter)
    }

    /// Whether it can import these modules (`a, b.c`).
    ///
    /// # Errors
    /// Why not: it is not there, or what it says of the import.
    pub fn imports(&self, modules: &str) -> Result<(), String> {
        let run = self.command().args(["-c", &format!("import {modules}")]).output();
        let run = run.map_err(|e| self.unusable(e))?;
        if run.status.success() { Ok(()) } else { Err(self.unusable(last_line(&run))) }
    }

    /// What to do where a package is missing that comes with an extra of btr's Python package.
    pub fn remedy(extra: &str) -> String {
        let install = format!("pip install 'btr[{extra}]'");
        format!(
            "{install}, and run the btr of that environment, or name its interpreter: {INTERPRETER}=venv/bin/python"
        )
    }
}

/// What a program says of its failure, in a line; of a traceback its end alone.
pub(crate) fn in_a_line(run: &Output) -> String {
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    if said.contains("Traceback") { last_line(run) } else { said.split_whitespace().collect::<Vec<_>>().join(" ") }
}

/// The last line of what a program says of its failure.
pub(crate) fn last_line(run: &Output) -> String {
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    said.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("it says nothing").trim().to_owned()
}
