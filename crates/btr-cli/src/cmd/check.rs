//! `btr check`: what the logs are worth before anything is fitted to them.

use crate::args::{Check, Global};
use crate::failure::Failure;
use crate::table::{Table, maybe, number};
use btr_core::check::{self, Quality, Severity};
use btr_physics::experiment::{self, Source};
use serde_json::{Value, json};
use std::process::ExitCode;

pub(crate) fn run(args: &Check, global: &Global) -> Result<ExitCode, Failure> {
    let mut source = Source::read(&args.model)?;
    source.set(&global.settings)?;
    let replays = experiment::replays(&source, &args.logs, &[])?;
    // Identifiability (null directions of the parameters, from the Jacobian of a fit) belongs here, beside the logs.
    let names = args.logs.iter().map(|path| path.display().to_string());
    let checked: Vec<(String, Quality)> = names.zip(replays.logs.iter().map(check::check)).collect();
    if global.json {
        println!("{}", document(&checked, &replays.warnings));
        return Ok(ExitCode::SUCCESS);
    }
    replays.warnings.iter().filter(|_| !global.quiet).for_each(|warning| eprintln!("warning: {warning}"));
    for (k, (name, quality)) in checked.iter().enumerate() {
        println!("{}{}", if k > 0 { "\n" } else { "" }, text(name, quality, global.verbose));
    }
    Ok(ExitCode::SUCCESS)
}

fn word(severity: Severity) -> &'static str {
    match severity {
        Severity::Fine => "fine",
        Severity::Doubtful => "doubtful",
        Severity::Bad => "bad",
    }
}

fn text(name: &str, quality: &Quality, verbose: bool) -> String {
    let mut lines = vec![format!("{name}: {}", word(quality.worst()))];
    lines.extend(quality.findings.iter().map(|f| format!("  {:<9} {}", word(f.severity), f.sentence)));
    if verbose {
        let mut table = Table::new(&["channel", "unit", "min", "max", "noise", "step", "missing %"]);
        for s in &quality.sensors {
            let numbers = [number(s.min), number(s.max), maybe(s.noise), maybe(s.quantum), number(100.0 * s.missing)];
            table.row([s.name.clone(), s.unit.clone()].into_iter().chain(numbers).collect());
        }
        lines.push(table.render());
    }
    lines.join("\n")
}

fn document(checked: &[(String, Quality)], warnings: &[String]) -> Value {
    let joint = |j: &check::Follows| {
        let lag = j.lag.map(|lag| json!({ "lag_s": lag.seconds, "sd_s": lag.sd_s, "likeness": lag.likeness }));
        json!({ "joint": j.joint, "command_lag": lag })
    };
    let log = |(name, quality): &(String, Quality)| {
        json!({
            "log": name,
            "verdict": quality.worst(),
            "clock": quality.clock,
            "channels": quality.sensors,
            "joints": quality.joints.iter().map(joint).collect::<Vec<_>>(),
            "findings": quality.findings,
        })
    };
    json!({ "ok": true, "logs": checked.iter().map(log).collect::<Vec<_>>(), "warnings": warnings })
}
