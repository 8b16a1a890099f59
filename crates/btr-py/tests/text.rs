//! Python's wording of texts. The extension module itself cannot be linked into a test.

#[path = "../src/error/text.rs"]
mod text;

use btr_core::text::{Mention, Text, Verb};
use text::in_python;

#[test]
fn every_mention_has_its_name_in_python() {
    let worded: Vec<String> = Mention::one_of_each().into_iter().map(|mention| in_python(&mention.into())).collect();
    let expected = [
        "`btr.add`",
        "`btr.check`",
        "`btr.diagnose`",
        "`btr.effects()`",
        "`btr.fit`",
        "`python -m btr info`",
        "`btr.effects(\"payload\")`",
        "settings",
        "setting name",
        "give load_model(..., {\"reality.index\": PATH})",
        "add an effect",
        "seed=",
        "out=",
        "resume=True",
        "go on with resume=True",
        "for load_model",
        "give what btr.load_log makes of it",
        "give it another name, or write with overwrite=True what may be lost",
        "save what a pipe gives to a file first",
        "give the posterior of the fit that the model is from",
        "`python -m btr new arm.urdf -o model.toml` writes a model file to start from",
    ];
    assert_eq!(worded, expected);
}

/// `tests/structure.py` finds commands and options in the words between mentions.
#[test]
fn no_mention_speaks_of_the_command_line() {
    for mention in Mention::one_of_each() {
        let worded = in_python(&(Text::from("do ") + mention));
        assert!(!worded.contains(" --") && !worded.contains("`btr "), "{worded}");
    }
}

#[test]
fn words_stay_as_they_are() {
    let help = Text::from("see ") + Verb::Check + ", or convert it with another --option";
    assert_eq!(in_python(&help), "see `btr.check`, or convert it with another --option");
}
