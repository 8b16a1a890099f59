//! Why a run disengaged, and the commands that continue it.

use crate::args::{CoevolveArgs, Global};
use btr_lab::run::augment::Cause;
use btr_lab::run::conclusions::{at_bound, cause, disengagement};
use btr_lab::run::report::RunReport;
use std::path::Path;

/// Prints why a run disengaged.
pub(super) fn show_disengagement(report: &RunReport) {
    let evidence = disengagement(report);
    let Some((that, evidence)) = evidence.split_first() else { return };
    println!("\n{that}");
    evidence.iter().for_each(|line| println!("  {line}"));
    let said = report.diagnosis.as_ref().map(cause).unwrap_or_default();
    for (k, line) in said.iter().enumerate() {
        let indent = if k == 0 { "  " } else { "    " };
        println!("{indent}{line}");
    }
    at_bound(report).iter().for_each(|line| println!("  {line}"));
}

/// Prints the commands that add the missing effects and resume the run.
pub(super) fn next_step(cause: &Cause, folder: &Path, args: &CoevolveArgs, global: &Global) {
    let missing = cause.missing();
    if missing.is_empty() {
        return;
    }
    let (model, larger) = (args.experiment.display(), args.experiment.with_extension("larger.toml"));
    // `--set` values are part of the experiment; `btr add` writes them into the file.
    let settings: String = global.settings.iter().map(|setting| format!(" --set '{setting}'")).collect();
    let seed = global.seed.map_or_else(String::new, |seed| format!(" --seed {seed}"));
    let (larger, folder) = (larger.display(), folder.display());
    println!(
        "  next: btr add {model} {}{settings} -o {larger} && btr coevolve {larger}{seed} --out {folder} --resume",
        missing.join(" ")
    );
}
