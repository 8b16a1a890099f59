//! From what is written to what can be run.

use super::file::{
    ActuatorSection, DriveSection, EffectSection, File, NoiseSection, ParameterSection, RealitySection,
    SearchedSection, TwinParameters, TwinSection,
};
use super::parse::{FileError, Source, nearest};
use super::scenarios::{self, Situations};
use crate::drive::{DRIVES, DriveError, DriveKind, DrivePlan, Replay};
use crate::effect::{self, Placed, SiteKind};
use crate::model::Model;
use crate::parameter::Target;
use crate::reality::{Command, Logs, Manual, Revealing, Store, Twin};
use crate::robot::{Actuator, Base, DutyLoop, Robot};
use crate::sensor::Noise;
use crate::sim::{Ball, Ground, Sensors, Setup};
use crate::task::{Fitness, TERMS};
use crate::{ant, nao, pendulum, site, urdf};
use btr_core::coevolve::{Coevolution, Plan, PlanError};
use btr_core::distance::DistanceSpec;
use btr_core::log::{Log, Role};
use btr_core::random;
use btr_core::space::{Dim, Space, SpaceError};
use indexmap::IndexMap;
use nalgebra::{Point3, Vector3};
use rand::RngExt;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

/// Everything a run needs.
pub struct Experiment {
    /// What it is called.
    pub name: String,
    /// The seed of every random number.
    pub seed: u64,
    /// S, C and how they behave.
    pub model: Arc<Model>,
    /// The loop's plan.
    pub plan: Plan,
    /// Where the truth comes from.
    pub reality: Box<dyn Revealing>,
    /// Recorded logs in the order of the model's scenarios, held-out ones last; empty for other realities.
    pub recorded: Vec<Log>,
    /// Distances to identify with once more.
    pub distances: Vec<DistanceSpec>,
    /// What the readers of the recorded logs noticed and could live with.
    pub warnings: Vec<String>,
    source: Source,
}

/// Label of the random stream that draws a hidden twin.
const TWIN_STREAM: u64 = 100;

impl Experiment {
    /// Builds the experiment; real tests are kept under `folder`.
    ///
    /// # Errors
    /// Whatever does not make sense, at its line.
    pub fn new(source: Source, seed: Option<u64>, folder: &Path) -> Result<Self, FileError> {
        let file = source.parse()?;
        let seed = seed.unwrap_or(file.seed);
        let missing = |section: &str| source.error(&[], &format!("there is no [{section}]"), Some(needs(section)));
        let plan = file.coevolve.clone().ok_or_else(|| missing("coevolve"))?;
        let reality = file.reality.clone().ok_or_else(|| missing("reality"))?;
        let builder = Builder { file: &file, source: &source };
        let situations = match &reality {
            RealitySection::Logs(logs) => scenarios::from_logs(logs, &file, &source, &builder.robot()?)?,
            _ => Situations::single(file.simulation.duration_s),
        };
        let (recorded, warnings) = (situations.logs.clone(), situations.warnings.clone());
        let model = Arc::new(builder.model(situations)?);
        builder.check_plan(&plan, &reality, &model, &recorded)?;
        let reality = builder.reality(&reality, &model, &recorded, seed, folder)?;
        let (name, distances) = (file.name.clone(), file.distances.clone());
        Ok(Experiment { name, seed, model, plan, reality, recorded, distances, warnings, source })
    }

    /// What identifies the experiment: its text with all settings, and its seed.
    pub fn stamp(&self) -> String {
        format!("# --seed {}\n{}", self.seed, self.source.text)
    }

    /// The file it came from.
    pub fn source(&self) -> &Source {
        &self.source
    }
}

fn bounds_help(error: &SpaceError) -> Option<String> {
    match error {
        SpaceError::Outside { .. } => Some("widen the bounds, or give value = a number between them".to_owned()),
        SpaceError::LogBounds { .. } => Some("start above zero, or leave out scale = \"log\"".to_owned()),
        _ => None,
    }
}

fn remedy(error: &PlanError) -> String {
    match error {
        PlanError::NoControllerSearch(_) => {
            "controllers = { generations = 10, search = { algorithm = \"ga\", population = 20 } }; or set them in [drive]"
        }
        PlanError::NoSimulatorSearch(_) => {
            "simulators = { generations = 20, search = { algorithm = \"cma_es\", population = 12 } }; or empty [parameters]"
        }
        PlanError::NothingToControl => "give [drive] a search, or take method = \"back_to_reality\"",
        PlanError::NoIterations => "iterations = 10",
    }
    .to_owned()
}

fn needs(section: &str) -> String {
    match section {
        "coevolve" => "add [coevolve] with iterations and distance; robots/pendulum.toml is a short example",
        _ => "add [reality] with kind = \"twin\", \"logs\", \"command\" or \"manual\"",
    }
    .to_owned()
}

/// A file on its way to a model.
pub(super) struct Builder<'a> {
    pub(super) file: &'a File,
    pub(super) source: &'a Source,
}

impl Builder<'_> {
    pub(super) fn model(&self, situations: Situations) -> Result<Model, FileError> {
        let robot = self.robot()?;
        let setup = self.setup(&robot)?;
        let effects = self.effects(&self.file.effects, "effects", &robot)?;
        let (targets, simulations) = self.parameters(&robot, &effects, &setup)?;
        let drive = self.drive(&robot)?;
        Ok(Model {
            fitness: self.fitness(&robot)?,
            robot,
            effects,
            setup,
            targets,
            simulations,
            drive,
            scenarios: situations.scenarios,
            learn: situations.learn,
            rollouts: AtomicU64::new(0),
        })
    }

    /// Whether plan, model and reality fit together: better said now than after hours.
    fn check_plan(
        &self,
        plan: &Plan,
        reality: &RealitySection,
        model: &Model,
        recorded: &[Log],
    ) -> Result<(), FileError> {
        if matches!(reality, RealitySection::Logs(_)) && !model.drive.space().is_empty() {
            let help = "take search out of [drive]; whatever it says, the logs' own commands are replayed".to_owned();
            return Err(self.error(&["drive", "search"], "recorded logs leave no controllers to search", Some(help)));
        }
        Coevolution::new(plan.clone(), 0, model).map_err(|e| self.error(&["coevolve"], &e, Some(remedy(&e))))?;
        let distances = [(&["coevolve", "distance"][..], &plan.distance)];
        for (keys, distance) in distances.into_iter().chain(self.file.distances.iter().map(|d| (&["distances"][..], d)))
        {
            self.check_channels(keys, distance, model, recorded)?;
        }
        Ok(())
    }

    /// A distance restricted to channels that nobody has would call everything infinitely far apart.
    fn check_channels(
        &self,
        keys: &[&str],
        distance: &DistanceSpec,
        model: &Model,
        recorded: &[Log],
    ) -> Result<(), FileError> {
        let Some(channels) = distance.channels() else { return Ok(()) };
        let nominal = (model.simulations.nominal(), model.drive.space().nominal());
        // A model that blows up here says so in the run, where failures are counted.
        let Ok(log) = model.simulate(&nominal.0, &nominal.1, 0, None) else { return Ok(()) };
        let known: Vec<&str> = log.channels().filter(|(_, c)| c.role != Role::Truth).map(|(name, _)| name).collect();
        for log in std::iter::once(&log).chain(recorded) {
            if let Some(wrong) = channels.unmatched(log).first() {
                return Err(self.unknown(keys, "channel", wrong, known));
            }
        }
        Ok(())
    }

    fn error(&self, keys: &[&str], message: impl std::fmt::Display, help: Option<String>) -> FileError {
        self.source.error(keys, &message.to_string(), help)
    }

    fn unknown<'b>(
        &self,
        keys: &[&str],
        what: &str,
        wrong: &str,
        known: impl IntoIterator<Item = &'b str>,
    ) -> FileError {
        let known: Vec<&str> = known.into_iter().collect();
        let help = match nearest(wrong, known.iter().copied()) {
            Some(name) => format!("did you mean `{name}`?"),
            None => format!("known: {}", known.join(", ")),
        };
        self.error(keys, format!("there is no {what} `{wrong}`"), Some(help))
    }

    pub(super) fn robot(&self) -> Result<Robot, FileError> {
        let section = &self.file.robot;
        let mut robot = match (&section.builtin, &section.urdf) {
            (Some(name), None) => self.builtin(name)?,
            (None, Some(path)) => {
                let base = section.base.unwrap_or(Base::Fixed);
                let path = self.source.folder().join(path);
                let (robot, _) = urdf::load_urdf(&path, base).map_err(|e| self.error(&["robot", "urdf"], e, None))?;
                robot
            }
            _ => {
                let help = "builtin = \"ant\", \"nao\" or \"pendulum\"; or urdf = \"robot.urdf\"";
                return Err(self.error(&["robot"], "give either builtin or urdf", Some(help.to_owned())));
            }
        };
        if let Some(height) = section.height_m {
            robot.start.translation.z = height;
        }
        self.actuators(&mut robot)?;
        Ok(robot)
    }

    fn builtin(&self, name: &str) -> Result<Robot, FileError> {
        let section = &self.file.robot;
        match name {
            "ant" => Ok(ant::ant()),
            "nao" => Ok(nao::nao()),
            "pendulum" => {
                let (mass_kg, length_m) = (section.mass_kg.unwrap_or(1.0), section.length_m.unwrap_or(1.0));
                Ok(pendulum::pendulum(mass_kg, length_m, Actuator::Passive))
            }
            _ => Err(self.unknown(&["robot", "builtin"], "built-in robot", name, ["ant", "nao", "pendulum"])),
        }
    }

    fn actuators(&self, robot: &mut Robot) -> Result<(), FileError> {
        let names: Vec<String> = robot.movable().map(|(_, link)| link.joint.name.clone()).collect();
        for (pattern, section) in &self.file.actuators {
            if !names.iter().any(|name| site::matches(pattern, name)) {
                return Err(self.unknown(&["actuators", pattern], "joint", pattern, names.iter().map(String::as_str)));
            }
            for link in robot.links.iter_mut().skip(1).filter(|link| site::matches(pattern, &link.joint.name)) {
                link.joint.actuator = actuator(section);
            }
        }
        Ok(())
    }

    fn setup(&self, robot: &Robot) -> Result<Setup, FileError> {
        let s = &self.file.simulation;
        let positive = [("control_s", s.control_s), ("duration_s", s.duration_s)];
        if let Some((key, value)) = positive.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
            return Err(self.error(&["simulation", key], format!("{key} = {value} must be positive"), None));
        }
        let counts = [("steps_per_control", s.steps_per_control), ("sample_every", s.sample_every)];
        if let Some((key, _)) = counts.iter().find(|(_, count)| *count == 0) {
            return Err(self.error(&["simulation", key], format!("{key} must be at least 1"), None));
        }
        let dt_s = s.control_s / f64::from(s.steps_per_control);
        let floating = robot.base == Base::Floating;
        Ok(Setup {
            dt_s,
            substeps: 1,
            duration_s: s.duration_s,
            control_s: s.control_s,
            interpolate: s.interpolate,
            sample_s: Some(dt_s * f64::from(s.sample_every)),
            sensors: Sensors { velocities: true, torques: true, imu: floating, feet: floating },
            ground: floating.then_some(Ground { friction: s.ground_friction }),
            ball: s.ball.as_ref().map(|b| Ball {
                radius_m: b.radius_m,
                mass_kg: b.mass_kg,
                start_m: Point3::new(b.position_m[0], b.position_m[1], b.radius_m),
                friction: b.friction,
                restitution: b.restitution,
                rolling_damping_per_s: b.rolling_damping_per_s,
            }),
            noise: noise(&self.file.noise),
            gravity_m_s2: Vector3::new(0.0, 0.0, s.gravity),
            start_velocities: Vec::new(),
        })
    }

    fn effects(&self, sections: &[EffectSection], table: &str, robot: &Robot) -> Result<Vec<Placed>, FileError> {
        sections.iter().enumerate().map(|(k, section)| self.effect(section, (table, k), robot)).collect()
    }

    fn effect(&self, section: &EffectSection, at: (&str, usize), robot: &Robot) -> Result<Placed, FileError> {
        let index = at.1.to_string();
        let keys: Vec<&str> = at.0.split('.').chain([index.as_str()]).collect();
        let Some(effect) = effect::find(&section.effect) else {
            let known = effect::EFFECTS.iter().map(|e| e.card().name);
            return Err(self.unknown(&[&keys[..], &["effect"]].concat(), "effect", &section.effect, known));
        };
        let params = effect.card().params;
        if let Some(wrong) = section.values.keys().find(|name| params.iter().all(|p| p.name != name.as_str())) {
            let what = format!("parameter of {}", section.effect);
            return Err(self.unknown(
                &[&keys[..], &[wrong.as_str()]].concat(),
                &what,
                wrong,
                params.iter().map(|p| p.name),
            ));
        }
        let values = params.iter().map(|p| section.values.get(p.name).copied().unwrap_or(p.off)).collect();
        let placed = Placed { effect, site: section.site.clone(), values };
        if placed.check_site(robot).is_err() {
            let (what, known) = sites(effect.card().site, robot);
            return Err(self.unknown(&[&keys[..], &["site"]].concat(), what, &placed.site, known));
        }
        placed.check().map_err(|e| self.error(&keys, e, None))?;
        Ok(placed)
    }

    fn parameters(&self, robot: &Robot, effects: &[Placed], setup: &Setup) -> Result<(Vec<Target>, Space), FileError> {
        let (mut targets, mut dims) = (Vec::new(), Vec::new());
        for (name, section) in &self.file.parameters {
            let keys = ["parameters", name.as_str()];
            let target = Target::parse(name, robot).map_err(|e| self.error(&keys, e, None))?;
            let own = target.nominal(robot, effects, setup);
            let dim = dim(section, &target, own).map_err(|message| self.error(&keys, message, None))?;
            Space::new(vec![dim.clone()]).map_err(|e| self.error(&keys, &e, bounds_help(&e)))?;
            dims.push(dim);
            targets.push(target);
        }
        let space = Space::new(dims).map_err(|e| self.error(&["parameters"], e, None))?;
        Ok((targets, space))
    }

    fn drive(&self, robot: &Robot) -> Result<DrivePlan, FileError> {
        let Some(section) = &self.file.drive else {
            let none = IndexMap::new();
            return DrivePlan::new(DriveKind::Hold, robot, &none, &IndexMap::new(), false)
                .map_err(|e| self.error(&["drive"], e, None));
        };
        let kind = self.drive_kind(section, robot)?;
        let dims = kind.dims(robot).map_err(|e| self.error(&["drive"], e, None))?;
        let searched = match &section.search {
            SearchedSection::Word(word) if word == "all" => dims.iter().map(|d| (d.name.clone(), None)).collect(),
            SearchedSection::Word(word) if word == "none" => IndexMap::new(),
            SearchedSection::Word(word) => {
                return Err(self.unknown(&["drive", "search"], "choice", word, ["all", "none"]));
            }
            SearchedSection::Names(names) => names.iter().map(|name| (name.clone(), None)).collect(),
            SearchedSection::Bounds(bounds) => bounds.iter().map(|(name, b)| (name.clone(), Some(*b))).collect(),
        };
        DrivePlan::new(kind, robot, &section.set, &searched, section.start_from_nominal).map_err(|e| match &e {
            DriveError::Unknown { name, known } => {
                let table = if section.set.contains_key(name) { "set" } else { "search" };
                self.unknown(&["drive", table, name], "drive parameter", name, known.iter().map(String::as_str))
            }
            DriveError::Space(e) => self.error(&["drive", "search"], e, None),
            DriveError::World(e) => self.error(&["drive", "kind"], e, None),
        })
    }

    fn drive_kind(&self, section: &DriveSection, robot: &Robot) -> Result<DriveKind, FileError> {
        match section.kind.as_str() {
            "hold" => Ok(DriveKind::Hold),
            "nao_walk" => Ok(DriveKind::NaoWalk),
            "nao_kick" => Ok(DriveKind::NaoKick),
            "sine" => match section.omega_rad_s {
                Some(omega_rad_s) => Ok(DriveKind::Sine { omega_rad_s }),
                None => Err(self.error(&["drive", "kind"], "a sine drive needs omega_rad_s", None)),
            },
            "replay" => {
                let path =
                    section.log.as_ref().ok_or_else(|| self.error(&["drive"], "replay needs log = PATH", None))?;
                let path = self.source.folder().join(path);
                let (log, _) = crate::io::read_log(&path, &self.file.channels)
                    .map_err(|e| self.error(&["drive", "log"], &e, Some(e.help())))?;
                Ok(DriveKind::Replay(Arc::new(Replay::new(&log, robot))))
            }
            other => Err(self.unknown(&["drive", "kind"], "drive", other, DRIVES.iter().map(|d| d.0))),
        }
    }

    fn fitness(&self, robot: &Robot) -> Result<Fitness, FileError> {
        let fitness = Fitness::new(&self.file.fitness)
            .map_err(|e| self.unknown(&["fitness", &e.name], "fitness term", &e.name, TERMS.iter().map(|t| t.name)))?;
        for term in TERMS.iter().filter(|t| self.file.fitness.contains_key(t.name)) {
            let lacks = |channel: &&&str| match channel.split_once('_') {
                Some(("base", _)) => robot.base == Base::Fixed,
                Some(("ball", _)) => self.file.simulation.ball.is_none(),
                _ => false,
            };
            if let Some(channel) = term.needs.iter().find(lacks) {
                let message = format!("`{}` needs the channel {channel}, which this model does not have", term.name);
                let help = "a free base gives base_*, a [simulation.ball] gives ball_*".to_owned();
                return Err(self.error(&["fitness", term.name], message, Some(help)));
            }
        }
        Ok(fitness)
    }

    fn reality(
        &self,
        section: &RealitySection,
        model: &Arc<Model>,
        recorded: &[Log],
        seed: u64,
        folder: &Path,
    ) -> Result<Box<dyn Revealing>, FileError> {
        let controllers = model.drive.space().clone();
        let fitness = model.fitness.clone();
        let store = Store::new(folder.join("transfers"), controllers, fitness.clone(), self.file.channels.clone());
        Ok(match section {
            RealitySection::Twin(twin) => Box::new(self.twin(twin, model, seed, store)?),
            RealitySection::Logs(_) => Box::new(Logs::new(recorded[..model.learn].to_vec(), fitness)),
            RealitySection::Command(command) => {
                if command.run.is_empty() || command.timeout_s.is_nan() || command.timeout_s <= 0.0 {
                    let message = "a command needs run = [program, ...] and a positive timeout_s";
                    return Err(self.error(&["reality"], message, None));
                }
                Box::new(Command::new(command.clone(), model.clone(), store))
            }
            RealitySection::Manual {} => Box::new(Manual::new(model.clone(), store)),
        })
    }

    fn twin(&self, twin: &TwinSection, model: &Model, seed: u64, store: Store) -> Result<Twin, FileError> {
        let point = self.twin_point(twin, &model.simulations, seed)?;
        let mut hidden = self.model(Situations::single(self.file.simulation.duration_s))?;
        hidden.effects.extend(self.effects(&twin.effects, "reality.effects", &hidden.robot)?);
        hidden.setup.noise = noise(&twin.noise);
        if let Some(steps) = twin.steps_per_control {
            if steps == 0 {
                return Err(self.error(
                    &["reality", "steps_per_control"],
                    "steps_per_control must be at least 1",
                    None,
                ));
            }
            hidden.setup.dt_s = hidden.setup.control_s / f64::from(steps);
        }
        let names = twin.effects.iter().map(|e| format!("{}@{}", e.effect, e.site)).collect();
        Ok(Twin::new(hidden, point, names, random::derive(seed, &[TWIN_STREAM, 1]), store))
    }

    fn twin_point(&self, twin: &TwinSection, space: &Space, seed: u64) -> Result<Vec<f64>, FileError> {
        let keys = ["reality", "parameters"];
        let mut point = space.nominal();
        match &twin.parameters {
            TwinParameters::Word(word) if word == "nominal" => {}
            TwinParameters::Word(word) if word == "random" => {
                let spread = twin.spread.unwrap_or(1.0);
                let mut rng = random::stream(seed, &[TWIN_STREAM, 0]);
                let unit: Vec<f64> = (0..space.len()).map(|_| 0.5 + spread * (rng.random::<f64>() - 0.5)).collect();
                point = space.from_unit(&unit);
            }
            TwinParameters::Word(word) => return Err(self.unknown(&keys, "choice", word, ["nominal", "random"])),
            TwinParameters::Values(values) => {
                for (name, value) in values {
                    let Some(k) = space.index_of(name) else {
                        let known = space.dims().iter().map(|d| d.name.as_str());
                        return Err(self.unknown(&["reality", "parameters", name], "parameter of S", name, known));
                    };
                    point[k] = *value;
                }
            }
        }
        space.check(&point).map_err(|e| {
            let help = "a twin lives in S: widen the bounds in [parameters] or move the twin".to_owned();
            let keys = match &e {
                SpaceError::Outside { name, .. } => vec!["reality", "parameters", name.as_str()],
                _ => keys.to_vec(),
            };
            self.error(&keys, format!("the hidden twin lies outside S: {e}"), Some(help))
        })?;
        Ok(point)
    }
}

fn actuator(section: &ActuatorSection) -> Actuator {
    match *section {
        ActuatorSection::Passive => Actuator::Passive,
        ActuatorSection::Position { kp, ki, kd, max_torque } => Actuator::Position { kp, ki, kd, max_torque },
        ActuatorSection::Torque { max_torque } => Actuator::Torque { max_torque },
        ActuatorSection::Voltage { kt, resistance, gain, max_duty, supply } => {
            Actuator::Voltage { kt, resistance, servo: gain.map(|gain| DutyLoop { gain, max_duty, supply }) }
        }
        ActuatorSection::Prescribed => Actuator::Prescribed,
    }
}

/// Where an effect of this kind can sit on a robot, and what such a place is called.
fn sites(kind: SiteKind, robot: &Robot) -> (&'static str, Vec<&str>) {
    match kind {
        SiteKind::Joint => ("joint", robot.movable().map(|(_, link)| link.joint.name.as_str()).collect()),
        SiteKind::Link | SiteKind::Ground => ("link", robot.links.iter().map(|link| link.name.as_str()).collect()),
    }
}

/// A dimension of S; `own` is the robot's own value, if its sites share one.
fn dim(section: &ParameterSection, target: &Target, own: Option<f64>) -> Result<Dim, String> {
    let name = target.name();
    let known = own.filter(|x| x.is_finite());
    let [min, max] = match (section.bounds, section.relative, known) {
        (Some(bounds), None, _) => bounds,
        (None, Some([a, b]), Some(own)) => [a * own, b * own],
        (None, Some(_), None) => {
            return Err(format!("parameter `{name}`: the robot has no single value to be relative to; give bounds"));
        }
        _ => return Err(format!("parameter `{name}`: give either bounds = [min, max] or relative = [factor, factor]")),
    };
    let dim = Dim::new(name, target.unit(), min, max).scale(section.scale.into());
    Ok(match section.value.or(known) {
        Some(value) => dim.nominal(value),
        None => dim,
    })
}

fn noise(section: &NoiseSection) -> Noise {
    Noise {
        position: section.position_rad,
        velocity: section.velocity_rad_s,
        torque: section.torque_n_m,
        gyro_rad_s: section.gyro_rad_s,
        accelerometer_m_s2: section.acceleration_m_s2,
        foot_n: section.force_n,
        position_quantum: section.position_quantum_rad,
    }
}
