//! Text for the user that every front end words in its own way.
//!
//! What to do about an error often names a command or an option, and those are not called the same on the command line
//! and in Python. A [`Text`] mentions them by what they are. Its `Display` is the wording of the command line; another
//! front end words each [`Mention`] itself, by [`Text::worded`].
//!
//! ```
//! use btr_core::text::{Mention, Text};
//!
//! let help = Text::from("go on with ") + Mention::Resume + ", or choose another " + Mention::Out;
//! assert_eq!(help.to_string(), "go on with --resume, or choose another --out");
//! ```

use std::fmt;
use std::ops::Add;

/// Text in which commands and options are mentions.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Text(Vec<Part>);

/// A fragment of a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Part {
    /// Words that are the same everywhere.
    Words(String),
    /// What every front end calls by a name of its own.
    Mention(Mention),
}

/// What a text can mention. Front ends match on all kinds, so that a new one is worded in each of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Mention {
    /// A verb, as a noun.
    Verb(Verb),
    /// The description of one effect, as a noun.
    Effect(String),
    /// The settings of values in the model file, as a noun.
    Settings,
    /// One such setting, as it was given.
    Setting(String),
    /// How to set a value in the model file: "use ...".
    Set {
        /// The dotted key.
        key: String,
        /// What stands for the value.
        value: &'static str,
    },
    /// How to add an effect for one fit: "add ...".
    AddEffect,
    /// The seed of a run, as a noun.
    Seed,
    /// The folder of a run, as a noun.
    Out,
    /// The option that resumes a run, as a noun.
    Resume,
    /// How to resume a run: "run again ...".
    RunAgain,
    /// What a model file is for: "run by ...".
    ModelUse,
    /// How to read a log that only Python's libraries can read: "read it ...".
    LoadLog,
    /// How not to overwrite a file: "give the output another name".
    OtherName,
    /// How to read from a pipe: "write ...".
    Pipe,
    /// How to get the document of a fit as a file: "write it ...".
    FitDocument,
    /// How to make a model file of a robot's description at this path: "... writes a model file".
    NewModel(String),
}

/// The verbs that texts mention.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verb {
    /// Adds effects to a model.
    Add,
    /// Judges logs.
    Check,
    /// Finds missing effects.
    Diagnose,
    /// Lists the effects.
    Effects,
    /// Estimates free parameters.
    Fit,
    /// Lists what can be named in an experiment file.
    Info,
}

/// The text without characters that would control a terminal: those are spelt out. Names in logs and models may hold
/// them. Line breaks and tabs stay.
pub fn printable(text: &str) -> String {
    let mut printable = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\n' | '\t' => printable.push(c),
            c if c.is_control() => printable.extend(c.escape_default()),
            c => printable.push(c),
        }
    }
    printable
}

impl Text {
    /// The text with each mention in the words of a front end.
    pub fn worded(&self, word: impl Fn(&Mention) -> String) -> String {
        let part = |part: &Part| match part {
            Part::Words(words) => words.clone(),
            Part::Mention(mention) => word(mention),
        };
        self.0.iter().map(part).collect()
    }
}

/// The wording of the command line.
impl fmt::Display for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.worded(Mention::to_string))
    }
}

/// The wording of the command line.
impl fmt::Display for Mention {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Mention::Verb(verb) => write!(f, "`btr {}`", verb.name()),
            Mention::Effect(effect) => write!(f, "`btr effects {effect}`"),
            Mention::Settings => f.write_str("--set"),
            Mention::Setting(setting) => write!(f, "--set {setting}"),
            Mention::Set { key, value } => write!(f, "use --set {key}={value}"),
            Mention::AddEffect => f.write_str("--add an effect"),
            Mention::Seed => f.write_str("--seed"),
            Mention::Out => f.write_str("--out"),
            Mention::Resume => f.write_str("--resume"),
            Mention::RunAgain => f.write_str("run again with --resume"),
            Mention::ModelUse => f.write_str("run by `btr coevolve` or `btr simulate`"),
            Mention::LoadLog => f.write_str("read it in Python: btr.load_log"),
            Mention::OtherName => f.write_str("give the output another name"),
            Mention::Pipe => f.write_str("write `-` to read the standard input"),
            Mention::FitDocument => f.write_str("write it: btr fit MODEL LOG... -o fitted.toml --json > fit.json"),
            Mention::NewModel(robot) => write!(f, "`btr new {robot} -o model.toml` writes a model file to start from"),
        }
    }
}

impl Verb {
    /// Its name on the command line and in Python.
    pub fn name(self) -> &'static str {
        match self {
            Verb::Add => "add",
            Verb::Check => "check",
            Verb::Diagnose => "diagnose",
            Verb::Effects => "effects",
            Verb::Fit => "fit",
            Verb::Info => "info",
        }
    }
}

impl Mention {
    /// One of each kind, for tests of front ends.
    pub fn one_of_each() -> Vec<Mention> {
        // A match, so that the compiler names the kind that is missing here.
        let next = |mention: &Mention| {
            Some(match mention {
                Mention::Verb(Verb::Add) => Verb::Check.into(),
                Mention::Verb(Verb::Check) => Verb::Diagnose.into(),
                Mention::Verb(Verb::Diagnose) => Verb::Effects.into(),
                Mention::Verb(Verb::Effects) => Verb::Fit.into(),
                Mention::Verb(Verb::Fit) => Verb::Info.into(),
                Mention::Verb(Verb::Info) => Mention::Effect("payload".to_owned()),
                Mention::Effect(_) => Mention::Settings,
                Mention::Settings => Mention::Setting("name".to_owned()),
                Mention::Setting(_) => Mention::Set { key: "reality.index".to_owned(), value: "PATH" },
                Mention::Set { .. } => Mention::AddEffect,
                Mention::AddEffect => Mention::Seed,
                Mention::Seed => Mention::Out,
                Mention::Out => Mention::Resume,
                Mention::Resume => Mention::RunAgain,
                Mention::RunAgain => Mention::ModelUse,
                Mention::ModelUse => Mention::LoadLog,
                Mention::LoadLog => Mention::OtherName,
                Mention::OtherName => Mention::Pipe,
                Mention::Pipe => Mention::FitDocument,
                Mention::FitDocument => Mention::NewModel("arm.urdf".to_owned()),
                Mention::NewModel(_) => return None,
            })
        };
        std::iter::successors(Some(Verb::Add.into()), next).collect()
    }
}

impl From<&str> for Part {
    fn from(words: &str) -> Self {
        Part::Words(words.to_owned())
    }
}

impl From<String> for Part {
    fn from(words: String) -> Self {
        Part::Words(words)
    }
}

impl From<&String> for Part {
    fn from(words: &String) -> Self {
        Part::Words(words.clone())
    }
}

impl From<Mention> for Part {
    fn from(mention: Mention) -> Self {
        Part::Mention(mention)
    }
}

impl From<Verb> for Part {
    fn from(verb: Verb) -> Self {
        Part::Mention(verb.into())
    }
}

impl From<Verb> for Mention {
    fn from(verb: Verb) -> Self {
        Mention::Verb(verb)
    }
}

impl<P: Into<Part>> From<P> for Text {
    fn from(part: P) -> Self {
        Text(vec![part.into()])
    }
}

impl<P: Into<Part>> Add<P> for Text {
    type Output = Text;

    fn add(mut self, part: P) -> Text {
        self.0.push(part.into());
        self
    }
}

impl Add<Text> for Text {
    type Output = Text;

    fn add(mut self, text: Text) -> Text {
        self.0.extend(text.0);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mention_has_its_name_on_the_command_line() {
        let worded: Vec<String> = Mention::one_of_each().iter().map(Mention::to_string).collect();
        let expected = [
            "`btr add`",
            "`btr check`",
            "`btr diagnose`",
            "`btr effects`",
            "`btr fit`",
            "`btr info`",
            "`btr effects payload`",
            "--set",
            "--set name",
            "use --set reality.index=PATH",
            "--add an effect",
            "--seed",
            "--out",
            "--resume",
            "run again with --resume",
            "run by `btr coevolve` or `btr simulate`",
            "read it in Python: btr.load_log",
            "give the output another name",
            "write `-` to read the standard input",
            "write it: btr fit MODEL LOG... -o fitted.toml --json > fit.json",
            "`btr new arm.urdf -o model.toml` writes a model file to start from",
        ];
        assert_eq!(worded, expected);
    }

    #[test]
    fn words_and_mentions_keep_their_order() {
        let text = Text::from("run: ") + (Text::from("see ") + Verb::Check + " or " + format!("{} logs", 2));
        assert_eq!(text.to_string(), "run: see `btr check` or 2 logs");
        assert_eq!(text.worded(|_| "it".to_owned()), "run: see it or 2 logs");
        assert_eq!(text, Text::from("run: ") + "see " + Verb::Check + " or " + "2 logs");
    }
}
