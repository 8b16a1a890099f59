//! `btr info`: describes a log, or lists what btr provides.

use crate::args::Global;
use crate::cmd::common;
use crate::exit::DONE;
use crate::terminal::{self, Tone};
use btr_core::distance::DISTANCES;
use btr_core::log::{Channel, Log};
use btr_core::search::SEARCHES;
use btr_io::Mapping;
use btr_lab::failure::Failure;
use btr_physics::drive::DRIVES;
use btr_physics::model::task::TERMS;
use btr_report::table::{Table, number};
use serde_json::{Value, json};
use std::path::Path;

/// Said of units where no model states them.
const UNITS: &str = "units: as the names of the columns say, or btr's own; --model MODEL reads them by its [channels]";

pub(crate) fn run(path: Option<&Path>, model: Option<&Path>, global: &Global) -> Result<u8, Failure> {
    match path {
        Some(path) => about_log(path, model, global),
        None => about_btr(global),
    }
}

fn about_log(path: &Path, model: Option<&Path>, global: &Global) -> Result<u8, Failure> {
    let mapping = match model {
        Some(model) => common::source(model, global)?.parse()?.channels,
        None => Mapping::default(),
    };
    let (log, warnings) = common::read_log(path, &mapping)?;
    let warnings: Vec<String> = warnings.iter().map(ToString::to_string).collect();
    let rate_hz = (log.len().saturating_sub(1)) as f64 / log.duration_s();
    if global.json {
        let channels: Vec<Value> = log.channels().map(|(name, c)| describe(name, c)).collect();
        println!(
            "{}",
            json!({ "ok": true, "samples": log.len(), "duration_s": log.duration_s(), "rate_hz": rate_hz,
                    "warnings": warnings, "channels": channels })
        );
        return Ok(DONE);
    }
    println!("{}: {} samples, {} s, {} Hz", path.display(), log.len(), number(log.duration_s()), number(rate_hz));
    warnings.iter().for_each(|w| eprintln!("warning: {w}"));
    terminal::table(&channels(&log));
    if model.is_none() && !global.quiet {
        terminal::say(Tone::Plain, UNITS);
    }
    Ok(DONE)
}

fn channels(log: &Log) -> Table {
    let mut table = Table::new(&["channel", "role", "unit", "min", "max", "missing"]);
    for (name, channel) in log.channels() {
        let (min, max, missing) = range(channel);
        let role = format!("{:?}", channel.role).to_lowercase();
        table.row(vec![name.into(), role, channel.unit.clone(), number(min), number(max), missing.to_string()]);
    }
    table
}

fn range(channel: &Channel) -> (f64, f64, usize) {
    let finite = || channel.values.iter().copied().filter(|x| x.is_finite());
    let missing = channel.values.len() - finite().count();
    (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max), missing)
}

fn describe(name: &str, channel: &Channel) -> Value {
    let (min, max, missing) = range(channel);
    let finite = |x: f64| x.is_finite().then_some(x);
    json!({ "name": name, "role": channel.role, "unit": channel.unit, "min": finite(min), "max": finite(max),
            "missing": missing })
}

fn about_btr(global: &Global) -> Result<u8, Failure> {
    let terms: Vec<(String, &str)> = TERMS.iter().map(|t| (format!("{} ({})", t.name, t.unit), t.help)).collect();
    if global.json {
        let named =
            |list: &[(&str, &str)]| list.iter().map(|(n, h)| json!({ "name": n, "help": h })).collect::<Vec<_>>();
        let terms: Vec<Value> =
            TERMS.iter().map(|t| json!({ "name": t.name, "unit": t.unit, "help": t.help })).collect();
        println!(
            "{}",
            json!({ "ok": true, "drives": named(DRIVES), "distances": named(DISTANCES), "searches": named(SEARCHES),
                    "fitness": terms })
        );
        return Ok(DONE);
    }
    section("drives", DRIVES.iter().map(|(n, h)| ((*n).to_owned(), *h)));
    section("fitness terms", terms.into_iter());
    section("distances", DISTANCES.iter().map(|(n, h)| ((*n).to_owned(), *h)));
    section("searches", SEARCHES.iter().map(|(n, h)| ((*n).to_owned(), *h)));
    println!("effects: see `btr effects`");
    Ok(DONE)
}

fn section<'a>(title: &str, rows: impl Iterator<Item = (String, &'a str)>) {
    println!("{title}");
    rows.for_each(|(name, help)| terminal::say(Tone::Plain, &format!("  {name:<22} {help}")));
    println!();
}
