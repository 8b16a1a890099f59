//! `btr add`: adds an effect to a model, with free parameters.

use crate::args::{AddArgs, Global};
use crate::cmd::common;
use crate::exit::DONE;
use btr_lab::experiment;
use btr_lab::failure::Failure;
use btr_lab::model_text::{moved, named_files};
use btr_lab::output::{OutputKind, guard};
use btr_lab::verbs::{AddError, Addition, add};

pub(crate) fn run(args: &AddArgs, global: &Global) -> Result<u8, Failure> {
    let source = common::source(&args.model, global)?;
    // The output may be the model itself: nothing in it is lost.
    guard(OutputKind::Model.at(Some(&args.output)), named_files(&source))?;
    let model = experiment::model(&source)?;
    let additions =
        args.effects.iter().map(|text| Addition::parse(text, &model.robot)).collect::<Result<Vec<_>, _>>()?;
    let text = add(&source, &model.robot, &additions)?;
    let into = args.output.parent().unwrap_or(&args.output);
    let text = moved(&text, source.folder(), into).map_err(AddError::from)?;
    common::write_text(&args.output, &text)?;
    if global.json {
        println!("{}", serde_json::json!({ "ok": true, "model": args.output, "added": args.effects }));
    } else if !global.quiet {
        println!("{}: {} added, with free parameters", args.output.display(), args.effects.join(", "));
        println!("next: btr fit {} LOG... -o fitted.toml", args.output.display());
    }
    Ok(DONE)
}
