//! `btr convert`.

use crate::args::Global;
use crate::cmd::common;
use crate::exit::DONE;
use btr_io::{Mapping, Meta};
use btr_lab::failure::Failure;
use btr_lab::output::{OutputKind, Overwrite, guard};
use std::path::Path;

pub(crate) fn run(from: &Path, to: &Path, global: &Global) -> Result<u8, Failure> {
    guard(OutputKind::Log(Overwrite::Commands).at(Some(to)), [from.to_owned()])?;
    let (log, warnings) = common::read_log(from, &Mapping::default())?;
    btr_io::write_log(to, &log, &Meta::default())?;
    if global.json {
        let warnings: Vec<String> = warnings.iter().map(ToString::to_string).collect();
        println!("{}", serde_json::json!({ "ok": true, "samples": log.len(), "warnings": warnings }));
    } else if !global.quiet {
        warnings.iter().for_each(|w| eprintln!("warning: {w}"));
        println!("{}: {} samples, {} channels", to.display(), log.len(), log.channels().len());
    }
    Ok(DONE)
}
