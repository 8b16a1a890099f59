//! Parses the command line. The help shows verbs by what people come for, and only the options that a verb acts on.

use crate::args::Args;
use clap::builder::Styles;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::parser::ValueSource;
use clap::{ArgMatches, Command, CommandFactory, Error, FromArgMatches};
use std::ffi::OsString;
use std::fmt::Write;

/// The verbs in groups.
const GROUPS: [(&str, &[&str]); 3] = [
    ("Understand a model", &["new", "check", "compare", "diagnose", "fit", "add", "studio", "export"]),
    ("The loop", &["coevolve", "simulate"]),
    ("Reference", &["effects", "info", "schema", "convert", "completions"]),
];

/// Options of every verb, and the verbs that act on them.
const ACTS: [(&str, &str, &[&str]); 6] = [
    ("seed", "--seed", &["coevolve", "simulate", "export"]),
    ("settings", "--set", &["coevolve", "simulate", "check", "compare", "diagnose", "fit", "add", "export"]),
    ("threads", "--threads", &["coevolve", "simulate", "check", "compare", "diagnose", "fit", "studio"]),
    ("verbose", "--verbose", &["coevolve", "check", "compare"]),
    (
        "quiet",
        "--quiet",
        &["coevolve", "simulate", "new", "check", "compare", "diagnose", "fit", "add", "export", "convert"],
    ),
    (
        "json",
        "--json",
        &[
            "coevolve", "simulate", "new", "check", "compare", "diagnose", "fit", "add", "export", "effects", "info",
            "convert",
        ],
    ),
];

/// Options that are refused where they do nothing: people who give one expect another result.
const REFUSED: [&str; 2] = ["seed", "settings"];

/// Parses the arguments. Errors are clap's, with a tip where clap cannot give one.
pub(crate) fn parsed(typed: Vec<OsString>) -> Result<Args, Error> {
    let with_held_out = typed.iter().any(|argument| argument == "--held-out");
    if typed.iter().filter(|argument| *argument == "-").count() > 1 {
        let once = "the standard input is read once: only one argument can be `-`";
        return Err(Args::command().error(ErrorKind::ArgumentConflict, once));
    }
    let mut command = command();
    let matches = command.try_get_matches_from_mut(typed).map_err(|mut error| {
        let tip = match error.kind() {
            ErrorKind::MissingRequiredArgument if with_held_out => {
                Some("put the logs before --held-out, which takes all arguments that follow".to_owned())
            }
            ErrorKind::UnknownArgument => unknown(&error).map(str::to_owned),
            ErrorKind::InvalidSubcommand => Some(format!("verbs: {}", verbs().join(", "))),
            _ => None,
        };
        if let Some(tip) = tip {
            error.remove(ContextKind::SuggestedArg);
            error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
        }
        error
    })?;
    refuse_idle(&command, &matches)?;
    Args::from_arg_matches(&matches)
}

/// What to do without an option that other verbs have.
fn unknown(error: &Error) -> Option<&'static str> {
    match error.get(ContextKind::InvalidArg)? {
        ContextValue::String(name) if name == "--overwrite" => {
            Some("not needed here: an output replaces an earlier one of its kind, and nothing that is read")
        }
        ContextValue::String(name) if name == "--held-out" => {
            Some("leave it out: this verb takes all logs alike, also those that are held out from fits")
        }
        _ => None,
    }
}

/// The verbs that are not hidden.
fn verbs() -> Vec<String> {
    let command = Args::command();
    command.get_subcommands().filter(|verb| !verb.is_hide_set()).map(|verb| verb.get_name().to_owned()).collect()
}

/// The command line with its help.
fn command() -> Command {
    let mut command = Args::command();
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{}{}\n{{options}}{{after-help}}",
        groups(&command),
        heading("Options")
    );
    command = command.help_template(template);
    for (option, _, verbs) in ACTS {
        let Some(hidden) = command.get_arguments().find(|of| of.get_id() == option).map(|of| of.clone().hide(true))
        else {
            continue;
        };
        // A verb that has an option of its own is not given the one of all verbs.
        let idle = |verb: Command| if verbs.contains(&verb.get_name()) { verb } else { verb.arg(hidden.clone()) };
        command = command.mut_subcommands(idle);
    }
    command
}

fn heading(text: &str) -> String {
    let style = Styles::styled().get_header().to_owned();
    format!("{style}{text}:{style:#}")
}

fn groups(command: &Command) -> String {
    let mut text = String::new();
    let literal = Styles::styled().get_literal().to_owned();
    for (title, verbs) in GROUPS {
        let _ = writeln!(text, "{}", heading(title));
        for verb in verbs.iter().filter_map(|name| command.find_subcommand(name)) {
            let about = verb.get_about().map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(text, "  {literal}{:<11}{literal:#}  {about}", verb.get_name());
        }
        text.push('\n');
    }
    text
}

/// An error if an option is given to a verb that does nothing with it.
fn refuse_idle(command: &Command, matches: &ArgMatches) -> Result<(), Error> {
    let Some((verb, of_verb)) = matches.subcommand() else { return Ok(()) };
    for (option, name, verbs) in ACTS.iter().filter(|(option, ..)| REFUSED.contains(option)) {
        let is_given = of_verb.try_contains_id(option).unwrap_or(false)
            && of_verb.value_source(option) == Some(ValueSource::CommandLine);
        if is_given && !verbs.contains(&verb) {
            let why = format!("`btr {verb}` does nothing with {name}");
            return Err(command.clone().error(ErrorKind::ArgumentConflict, why));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_verb_is_in_a_group_and_every_name_is_a_verb() {
        let command = Args::command();
        let grouped: Vec<&str> = GROUPS.iter().flat_map(|(_, verbs)| verbs.iter().copied()).collect();
        let shown = command.get_subcommands().filter(|verb| !verb.is_hide_set());
        let verbs: Vec<&str> = shown.map(Command::get_name).collect();
        assert_eq!(grouped.len(), verbs.len());
        assert!(verbs.iter().all(|verb| grouped.contains(verb)));
        assert!(ACTS.iter().flat_map(|(.., verbs)| verbs.iter()).all(|verb| grouped.contains(verb)));
        let global = |option: &str| command.get_arguments().any(|of| of.get_id() == option && of.is_global_set());
        assert!(ACTS.iter().all(|(option, ..)| global(option)));
    }
}
