//! Python's wording of texts: what commands and options are called here.

use btr_core::text::{Mention, Text, Verb};

/// A text in Python's words.
pub(crate) fn in_python(text: &Text) -> String {
    text.worded(named)
}

fn named(mention: &Mention) -> String {
    match mention {
        Mention::Verb(Verb::Effects) => "`btr.effects()`",
        Mention::Verb(Verb::Info) => "`python -m btr info`",
        Mention::Verb(verb) => return format!("`btr.{}`", verb.name()),
        Mention::Effect(effect) => return format!("`btr.effects(\"{effect}\")`"),
        Mention::Settings => "settings",
        Mention::Setting(setting) => return format!("setting {setting}"),
        Mention::Set { key, value } => return format!("give load_model(..., {{\"{key}\": {value}}})"),
        Mention::AddEffect => "add an effect",
        Mention::Seed => "seed=",
        Mention::Out => "out=",
        Mention::Resume => "resume=True",
        Mention::RunAgain => "go on with resume=True",
        Mention::ModelUse => "for load_model",
        Mention::LoadLog => "give what btr.load_log makes of it",
        Mention::NewModel(robot) => {
            return format!("`python -m btr new {robot} -o model.toml` writes a model file to start from");
        }
        Mention::FitDocument => "give the posterior of the fit that the model is from",
        Mention::Pipe => "save what a pipe gives to a file first",
        Mention::OtherName => "give it another name, or write with overwrite=True what may be lost",
    }
    .to_owned()
}
