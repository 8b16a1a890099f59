//! Models, robots and formulas: what is read is simulated.

use super::{FEW_STEPS, refused, simulated};
use crate::files;
use crate::folder::Folder;
use btr_lab::experiment::{Experiment, FileError, Source, model as model_of, replays};
use btr_lab::meshes::check as check_mesh;
use btr_lab::verbs::check;
use btr_physics::drive::Hold;
use btr_physics::effects::{FormulaTarget, PlacedEffect, formula as formula_of};
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::urdf::{parse_urdf, to_urdf};
use btr_physics::robot::{Actuator, Base, Robot};
use btr_physics::rollout::{RolloutRequest, simulate};
use btr_physics::setup::Setup;

/// A model or experiment file, with the files that it may name: `robot.urdf`, `log.csv`, `index.csv`.
pub fn model(data: &[u8]) -> bool {
    let [toml, urdf, log, index] = files(data);
    let Ok(text) = std::str::from_utf8(toml) else { return false };
    let folder = Folder::new();
    folder.write("robot.urdf", urdf);
    folder.write("index.csv", index);
    let (log, path) = (folder.write("log.csv", log), folder.write("model.toml", toml));
    let used = used(Source::new(path, text), &log, &folder);
    used.inspect_err(|error| refused(error, &folder)).is_ok()
}

fn used(mut source: Source, log: &std::path::Path, folder: &Folder) -> Result<(), FileError> {
    source.parse()?;
    source.set(&[FEW_STEPS.to_owned()])?;
    simulated(&model_of(&source)?);
    if let Ok(experiment) = Experiment::new(source.clone(), None, &folder.path().join("run")) {
        drop(experiment.stamp());
    }
    match replays(&source, &[log.to_owned()], &[]) {
        Ok(replays) => drop(check(replays).document().to_string()),
        Err(error) => refused(&error, folder),
    }
    Ok(())
}

/// A robot as URDF, fixed and free. What is written of it is read back.
pub fn urdf(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
    [Base::Fixed, Base::Floating].into_iter().all(|base| match parse_urdf(text, base) {
        Ok((robot, warnings)) => {
            warnings.iter().for_each(|warning| drop(warning.to_string()));
            moves(&robot, &[]);
            let again = parse_urdf(&to_urdf(&robot), base).map(|_| ()).map_err(|error| error.to_string());
            assert_eq!(again, Ok(()), "what is written of a robot cannot be read");
            true
        }
        Err(error) => error.to_string().is_empty(),
    })
}

/// A mesh: its kind (the first byte), then its file.
pub fn mesh(data: &[u8]) -> bool {
    let Some((kind, bytes)) = data.split_first() else { return false };
    let kind = ["stl", "obj", "dae", "gltf"][usize::from(*kind) % 4];
    check_mesh(kind, bytes).inspect_err(|why| assert!(!why.is_empty())).is_ok()
}

/// A formula: what it acts on (the first byte), then its text.
pub fn formula(data: &[u8]) -> bool {
    let Some((on, Ok(law))) = data.split_first().map(|(on, law)| (on, std::str::from_utf8(law))) else { return false };
    let on = [FormulaTarget::Torque, FormulaTarget::Command, FormulaTarget::Reading][usize::from(*on) % 3];
    match formula_of(on, law, &["a"]) {
        Ok(effect) => {
            let placed = PlacedEffect { effect, site: "hinge".to_owned(), values: vec![0.1] };
            moves(&pendulum(1.0, 0.5, Actuator::Passive), &[placed]);
            true
        }
        Err(error) => error.to_string().is_empty(),
    }
}

/// Simulates a robot for a few steps.
fn moves(robot: &Robot, effects: &[PlacedEffect]) {
    let setup = Setup { duration_s: 0.02, ..Setup::default() };
    let drive = Hold::new(robot);
    match simulate(RolloutRequest::new(robot, &drive).effects(effects).setup(&setup)) {
        Ok(log) => drop(log),
        Err(error) => drop(error.to_string()),
    }
}
