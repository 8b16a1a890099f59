//! `btr export`: writes what a model says into files of other simulators.

use crate::args::{ExportArgs, Global};
use crate::cmd::common;
use crate::exit::DONE;
use crate::terminal::{Tone, say};
use btr_lab::experiment::Source;
use btr_lab::export::{Exported, FORMATS, Format, Randomised, draws, export, posterior_of};
use btr_lab::failure::Failure;
use btr_lab::output::{OutputKind, guard, inputs};
use std::path::{Path, PathBuf};

/// Seed of draws, unless one is given.
const SEED: u64 = 0;

pub(crate) fn run(args: &ExportArgs, global: &Global) -> Result<u8, Failure> {
    let source = common::source(&args.model, global)?;
    let format = FORMATS.iter().find(|format| format.name == args.to);
    let format = format.ok_or_else(|| Failure::usage(format!("no format `{}`", args.to)))?;
    let posterior = args.randomize.as_deref().map(posterior_of).transpose()?;
    let (in_files, in_ranges) = match format.randomised {
        Randomised::InFiles => (posterior.as_ref(), None),
        Randomised::InRanges | Randomised::Never => (None, posterior.as_ref()),
    };
    let seed = global.seed.unwrap_or(SEED);
    let many = args.draws as usize;
    let drawn = in_files.map_or_else(|| Ok(Vec::new()), |posterior| draws(&source, posterior, many, seed))?;
    let paths: Vec<PathBuf> = (0..drawn.len()).map(|k| numbered(&args.output, k)).collect();
    let read = args.robot.iter().chain(&args.randomize).cloned();
    let effects: Vec<PathBuf> = std::iter::once(&args.output).chain(&paths).map(|path| beside(path)).collect();
    let files = std::iter::once(&args.output).chain(&paths).map(|path| (path, format.endings));
    let files = files.chain(effects.iter().map(|path| (path, ["json"].as_slice())));
    let outputs = files.filter_map(|(path, endings)| OutputKind::Foreign(endings).at(Some(path)));
    guard(outputs, inputs(&source, read))?;
    let write = |source: &Source, path: &Path| {
        let exported = export(source, format, args.robot.clone(), args.step.as_secs_f64(), in_ranges)?;
        common::write_text(path, &exported.text)?;
        exported.effects.iter().try_for_each(|effects| common::write_text(&beside(path), effects))?;
        Ok::<Exported, Failure>(exported)
    };
    let exported = write(&source, &args.output)?;
    drawn.iter().zip(&paths).try_for_each(|(source, path)| write(source, path).map(drop))?;
    let has_structure = posterior.is_some_and(|posterior| posterior.has_structure);
    report(args, global, format, &exported, (&paths, has_structure));
    Ok(DONE)
}

/// Replays a log in MuJoCo, with the effects that the file does not say, and prints the error of each joint.
const REPLAY: &str = r#"  import btr, mujoco

  model = mujoco.MjModel.from_xml_path(ROBOT)
  log = btr.load_log("LOG", model=btr.load_model(MODEL))  # in the model's names and units
  print(btr.mujoco.replay(model, log, EFFECTS))
"#;

/// A path as a string of Python.
fn quoted(path: &Path) -> String {
    format!("{:?}", path.display().to_string())
}

/// Where the effects that a file does not say are written.
fn beside(path: &Path) -> PathBuf {
    path.with_extension("effects.json")
}

/// `robot.xml` with the number of a draw: `robot.007.xml`.
fn numbered(path: &Path, k: usize) -> PathBuf {
    let ending = path.extension().map(|ending| ending.to_string_lossy().into_owned()).unwrap_or_default();
    path.with_extension(format!("{k:03}.{ending}"))
}

fn report(
    args: &ExportArgs,
    global: &Global,
    format: &Format,
    exported: &Exported,
    (draws, has_structure): (&[PathBuf], bool),
) {
    let effects = exported.effects.is_some().then(|| beside(&args.output));
    if global.json {
        let document = serde_json::json!({
            "ok": true,
            "output": args.output,
            "carried": exported.carried,
            "left": exported.left,
            "advice": exported.advice,
            "effects": effects,
            "draws": draws,
        });
        println!("{document}");
    } else if !global.quiet {
        println!("{}: {}", args.output.display(), format.what);
        tell("carried over", &exported.carried);
        tell("not said by this format", &exported.left);
        tell("advice", &exported.advice);
        if let Some(beside) = effects {
            println!("\n{}: the effects that are left, as JSON", beside.display());
            if format.name == "mujoco" {
                let files = REPLAY.replace("ROBOT", &quoted(&args.output)).replace("EFFECTS", &quoted(&beside));
                let files = files.replace("MODEL", &quoted(&args.model));
                println!(
                    "btr.mujoco.EffectStepper applies them. A log, replayed in Python (pip install btr[mujoco]):\n"
                );
                print!("{files}");
            }
        }
        if let [first, .., last] = draws {
            println!("\n{} to {}: draws from what the fit leaves", first.display(), last.display());
        }
    }
    if has_structure && !global.quiet {
        eprintln!(
            "warning: the fit left an error that is not noise: its values may stand in for what the model lacks, and \
             the draws may not contain the robot"
        );
    }
}

/// Prints lines under a heading, if there are any.
fn tell(heading: &str, lines: &[String]) {
    if !lines.is_empty() {
        println!("\n{heading}:");
        lines.iter().for_each(|line| say(Tone::Plain, &format!("  {line}")));
    }
}
