//! `btr new`: a model file to start from, made of a robot's file and logs.

use crate::args::{Global, NewArgs};
use crate::cmd::common;
use crate::exit::DONE;
use crate::terminal::{Tone, say};
use btr_core::text::Text;
use btr_lab::experiment;
use btr_lab::experiment::Source;
use btr_lab::failure::Failure;
use btr_lab::model_text::{moved, relative_path};
use btr_lab::new_model::{Draft, LogColumns, RobotFile, UrdfPlace, written};
use btr_lab::output::{OutputKind, guard};
use btr_lab::verbs::AddError;
use btr_physics::robot::Base;
use btr_physics::robot::urdf::parse_urdf;
use std::path::Path;

pub(crate) fn run(args: &NewArgs, global: &Global) -> Result<u8, Failure> {
    let urdf_file = args.output.with_extension("urdf");
    guard(OutputKind::Model.at(Some(&args.output)), std::iter::once(args.robot.clone()).chain(args.logs.clone()))?;
    keep(&args.output, args)?;
    if let Some(gone) = args.package_paths.iter().find(|folder| !folder.is_dir()) {
        return Err(Failure::usage(format!("{}: there is no such folder", gone.display())));
    }
    let file = RobotFile::read(&args.robot, args.root.as_deref(), &args.package_paths)?;
    if !file.is_urdf {
        keep(&urdf_file, args)?;
    }
    let named = if file.is_urdf { &args.robot } else { &urdf_file };
    let draft = drafted(args, &file, named)?;
    if !file.is_urdf {
        common::write_text(&urdf_file, &file.robot.urdf)?;
    }
    common::write_text(&args.output, &draft.text)?;
    tell(args, global, &file, &draft, named);
    Ok(DONE)
}

/// Refuses to overwrite, unless that was asked for.
fn keep(path: &Path, args: &NewArgs) -> Result<(), Failure> {
    if path.exists() && !args.overwrite {
        let message = format!("{} exists", path.display());
        return Err(Failure::new("output", message, Some("give another name, or --overwrite".into())));
    }
    Ok(())
}

/// The model file, whose URDF is in a file. btr can read it: nothing else is written.
fn drafted(args: &NewArgs, file: &RobotFile, urdf: &Path) -> Result<Draft, Failure> {
    let base = args.base.as_deref().map(|word| if word == "fixed" { Base::Fixed } else { Base::Floating });
    let (robot, _) = parse_urdf(&file.robot.urdf, Base::Fixed)
        .map_err(|e| Failure::new("robot", format!("{}: {e}", args.robot.display()), e.help().map(Into::into)))?;
    let columns = LogColumns::matched(&args.logs, &robot)?;
    let (from, into) = (folder(urdf), folder(&args.output));
    let package_paths = file.package_paths.as_ref().map(|folders| {
        folders.iter().map(|folder| relative_path(from, folder).to_string_lossy().into_owned()).collect()
    });
    let name = urdf.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let draft = written(&file.robot, &columns, base, &UrdfPlace::File { urdf: name, package_paths })?;
    let text = moved(&draft.text, from, into).map_err(AddError::from)?;
    let read = match file.is_urdf {
        true => text.clone(),
        // Its URDF is not written yet.
        false => written(&file.robot, &columns, base, &UrdfPlace::Inside)?.text,
    };
    experiment::model(&Source::new(&args.output, read)).map_err(|error| {
        let message = format!("{}: btr cannot read the model that it would become: ", args.robot.display());
        let help = "change what it names in the robot's file; in names, commas and * have a meaning of their own";
        Failure::new("robot", Text::from(message) + error.message, Some(help.into()))
    })?;
    Ok(Draft { text, ..draft })
}

fn folder(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}

fn tell(args: &NewArgs, global: &Global, file: &RobotFile, draft: &Draft, urdf: &Path) {
    let lacking = &file.robot.not_represented;
    let Draft { told, warnings, .. } = draft;
    if global.json {
        let document = serde_json::json!({
            "ok": true, "model": args.output, "urdf": urdf,
            "guesses": told, "not_represented": lacking, "warnings": warnings,
        });
        println!("{document}");
    } else if !global.quiet {
        println!("{}: a model of {} joints", args.output.display(), file.robot.joints.len());
        told.iter().for_each(|guess| say(Tone::Plain, &format!("guess: {guess}")));
        lacking.iter().for_each(|what| say(Tone::Plain, &format!("not represented: {what}")));
        warnings.iter().for_each(|what| say(Tone::Plain, &format!("warning: {what}")));
        if !file.robot.warnings.is_empty() {
            let help = "help: --package-path DIR names a folder with packages; the motion does not depend on meshes";
            say(Tone::Plain, help);
        }
        let logs = if args.logs.is_empty() { "LOG..." } else { "the same logs" };
        let asks = if told.is_empty() { "" } else { "see what says GUESS or FILL IN in it, then " };
        say(Tone::Plain, &format!("next: {asks}btr check {} with {logs}", args.output.display()));
    }
}
