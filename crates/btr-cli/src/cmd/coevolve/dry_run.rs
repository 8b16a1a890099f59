//! `btr coevolve --dry-run`: prints the plan of a run.

use crate::args::Global;
use crate::exit::DONE;
use btr_core::world::Simulator;
use btr_lab::experiment::Experiment;
use btr_lab::failure::Failure;
use btr_report::table::number;
use std::path::Path;

pub(super) fn dry_run(experiment: &Experiment, folder: &Path, global: &Global) -> Result<u8, Failure> {
    let (s, c) = (experiment.model.simulations(), experiment.model.controllers());
    let plan = &experiment.plan;
    if global.json {
        let dims: Vec<_> = s.dims().iter().map(|d| &d.name).collect();
        println!("{}", serde_json::json!({ "ok": true, "dry_run": true, "parameters": dims, "controllers": c.len() }));
        return Ok(DONE);
    }
    println!("{}: {} iterations, output in {}", experiment.name, plan.iterations, folder.display());
    println!("real tests: {}", plan.real_tests.map_or_else(|| "no limit".to_owned(), |n| format!("at most {n}")));
    for (what, space) in [("S, simulations", s), ("C, controllers", c)] {
        println!("\n{what}: {} parameters", space.len());
        for d in space.dims() {
            println!("  {:<32} {} .. {} {}", d.name, number(d.min), number(d.max), d.unit);
        }
    }
    Ok(DONE)
}
