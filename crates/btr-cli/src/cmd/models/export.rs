//! `btr export`: writes what a model says into files of other simulators.

use crate::args::{ExportArgs, Global};
use crate::cmd::common;
use crate::exit::DONE;
use btr_lab::export::{FORMATS, export};
use btr_lab::failure::Failure;
use btr_lab::output::{OutputKind, guard, inputs};

pub(crate) fn run(args: &ExportArgs, global: &Global) -> Result<u8, Failure> {
    let source = common::source(&args.model, global)?;
    let format = FORMATS.iter().find(|format| format.name == args.to);
    let format = format.ok_or_else(|| Failure::usage(format!("no format `{}`", args.to)))?;
    let beside = args.output.with_extension("effects.json");
    let files = [(&args.output, format.endings), (&beside, &["json"])];
    let outputs = files.into_iter().filter_map(|(path, endings)| OutputKind::Foreign(endings).at(Some(path)));
    guard(outputs, inputs(&source, args.robot.clone()))?;
    let exported = export(&source, format, args.robot.clone(), args.step.as_secs_f64())?;
    common::write_text(&args.output, &exported.text)?;
    if let Some(effects) = &exported.effects {
        common::write_text(&beside, effects)?;
    }
    let effects = exported.effects.is_some().then_some(&beside);
    if global.json {
        let (carried, left) = (&exported.carried, &exported.left);
        let document = serde_json::json!({ "ok": true, "output": args.output, "carried": carried, "left": left, "effects": effects });
        println!("{document}");
    } else if !global.quiet {
        println!("{}: {}", args.output.display(), format.what);
        tell("carried over", &exported.carried);
        tell("not said by this format", &exported.left);
        if let Some(beside) = effects {
            println!("\n{}: the effects that are left, as JSON", beside.display());
        }
    }
    Ok(DONE)
}

/// Prints lines under a heading, if there are any.
fn tell(heading: &str, lines: &[String]) {
    if !lines.is_empty() {
        println!("\n{heading}:");
        lines.iter().for_each(|line| println!("  {line}"));
    }
}
