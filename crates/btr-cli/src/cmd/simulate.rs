//! `btr simulate`: one rollout of a model, written as a log.

use super::common;
use crate::args::{Global, SimulateArgs};
use crate::exit::DONE;
use btr_core::world::Simulator;
use btr_io::Meta;
use btr_lab::experiment;
use btr_lab::experiment::Source;
use btr_lab::failure::Failure;
use btr_lab::output::{OutputKind, Overwrite, guard, inputs};
use btr_report::table::number;

pub(crate) fn run(args: &SimulateArgs, global: &Global) -> Result<u8, Failure> {
    let source = common::source(&args.model, global)?;
    let overwrite = if args.overwrite { Overwrite::Measurements } else { Overwrite::Commands };
    let log = OutputKind::Log(overwrite).at(Some(&args.output));
    guard(log, inputs(&source, args.log.iter().chain(&args.drive).cloned()))?;
    if !global.quiet {
        experiment::mesh_warnings(&source)?.iter().for_each(|warning| eprintln!("warning: {warning}"));
    }
    let model = match (&args.log, &args.drive) {
        (Some(log), _) => experiment::model_replaying(&source, common::log_at(log))?,
        (None, Some(drive)) => experiment::model_driven_by(&source, &Source::read(drive)?)?,
        (None, None) => experiment::model(&source)?,
    };
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let log = model.simulate(model.request(&s, 0).controller(&c).noise_seed(global.seed));
    let log = log.map_err(|e| Failure::from(e).of_model(&source.path))?;
    let (robot, ..) = model.at(&s, 0);
    let meta = Meta {
        base_link: robot.links.first().map(|link| link.name.clone()),
        model_toml: Some(source.text),
        urdf: Some(btr_physics::robot::urdf::to_urdf(&robot)),
        ..Meta::default()
    };
    btr_io::write_log(&args.output, &log, &meta)?;
    let terms = model.fitness.terms(&log).map_err(btr_core::world::WorldError::from)?;
    if global.json {
        let terms: serde_json::Map<_, _> = terms.iter().map(|(t, x)| (t.name.to_owned(), (*x).into())).collect();
        println!(
            "{}",
            serde_json::json!({ "ok": true, "samples": log.len(), "duration_s": log.duration_s(), "fitness": terms })
        );
    } else if !global.quiet {
        println!("{}: {} samples, {} s", args.output.display(), log.len(), number(log.duration_s()));
        terms.iter().for_each(|(term, x)| println!("  {:<14} {} {}", term.name, number(*x), term.unit));
    }
    Ok(DONE)
}
