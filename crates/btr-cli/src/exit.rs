//! Exit codes and the output of failures.

use crate::terminal::{Tone, complain};
use btr_lab::failure::{FOLDER_GONE, Failure, STORAGE};

/// Exit code of a run that was done.
pub(crate) const DONE: u8 = 0;
/// Exit code of a run that was done but missed the goal it was given.
pub(crate) const MISSED: u8 = 1;
/// Exit code of a run that was interrupted.
pub(crate) const INTERRUPTED: u8 = 130;
/// Exit code of an invocation that cannot be carried out.
pub(crate) const REFUSED: u8 = 2;

/// Prints a failure on stderr, or as a JSON document on stdout.
pub(crate) fn report(failure: &Failure, json: bool) -> u8 {
    if json {
        let help = failure.help.as_ref().map(ToString::to_string);
        let error = serde_json::json!({ "code": failure.code, "message": failure.message.to_string(), "help": help });
        println!("{}", serde_json::json!({ "ok": false, "error": error }));
    } else {
        complain(Tone::Bad, "error", &failure.message.to_string());
        if let Some(help) = &failure.help {
            complain(Tone::Fine, "help", &help.to_string());
        }
    }
    if [FOLDER_GONE, STORAGE].contains(&failure.code) { MISSED } else { REFUSED }
}
