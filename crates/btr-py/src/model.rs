//! Models: the text of a model file, and operations that need no logs.

use crate::error::{Raise, raised};
use crate::laws;
use crate::log::{ChannelNames, Log, LogArgument};
use crate::work::{ExecutorChoice, at_once, context, working};
use btr_core::space::Space;
use btr_core::world::{Job, Simulator};
use btr_identify::fit::Posterior;
use btr_io::{IoError, read_text, write_whole};
use btr_lab::execution::ExecutionContext;
use btr_lab::experiment;
use btr_lab::experiment::{LogSource, Source};
use btr_lab::export;
use btr_lab::model_text::{at, moved};
use btr_lab::new_model::{LogColumns, UrdfPlace, written};
use btr_lab::verbs;
use btr_lab::verbs::{Addition, OwnLaw, OwnNumber};
use btr_physics::effects::FORMULA;
use btr_physics::engine::{BaseState, RobotState};
use btr_physics::model;
use btr_physics::robot::urdf::to_urdf;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use pyo3::prelude::*;
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;

/// See `Exported`.
type ExportedParts = (String, [Vec<String>; 3], Option<String>);

/// A robot's model: the text of its file, and where relative paths in it begin.
#[pyclass(frozen, module = "btr", name = "Model")]
pub(crate) struct Model {
    pub(crate) source: Source,
    /// The functions that its laws name.
    pub(crate) functions: laws::LawGiven,
    built: Box<model::Model>,
}

#[pymethods]
impl Model {
    /// A model of a text; `path` is where it stands or would stand, `laws` are the functions that it names.
    #[new]
    #[pyo3(signature = (text, path, laws = vec![]))]
    fn new(py: Python<'_>, text: String, path: PathBuf, laws: laws::LawGiven) -> PyResult<Self> {
        let source = Source { laws: laws::laws(py, &laws), ..Source::new(path, text) };
        let built = py.detach(|| experiment::model(&source)).map_err(Raise::raise)?;
        Ok(Model { source, functions: laws, built: Box::new(built) })
    }

    /// The model of a file, with `key=value` settings as `--set` takes them.
    #[staticmethod]
    #[pyo3(signature = (path, settings = vec![], laws = vec![]))]
    fn read(py: Python<'_>, path: PathBuf, settings: Vec<String>, laws: laws::LawGiven) -> PyResult<Self> {
        let mut source = Source::read(&path).map_err(Raise::raise)?;
        source.set(&settings).map_err(Raise::raise)?;
        Model::new(py, source.text, source.path, laws)
    }

    /// The text of the model file.
    #[getter]
    fn text(&self) -> &str {
        &self.source.text
    }

    /// Its name.
    #[getter]
    fn name(&self) -> PyResult<String> {
        Ok(self.source.parse().map_err(Raise::raise)?.name)
    }

    /// The path of its file.
    #[getter]
    fn path(&self) -> &PathBuf {
        &self.source.path
    }

    /// Its laws: the text of each, and the names of its parameters.
    #[getter]
    fn laws(&self) -> Vec<(&'static str, Vec<&'static str>)> {
        let laws =
            self.built.effects.iter().map(|placed| placed.effect.spec()).filter(|spec| spec.name == FORMULA.name);
        laws.map(|spec| (spec.law, spec.params.iter().map(|param| param.name).collect())).collect()
    }

    /// The joints that can move, in order.
    #[getter]
    fn joints(&self) -> Vec<&str> {
        self.built.robot.movable().map(|(_, link)| link.joint.name.as_str()).collect()
    }

    /// The URDF of its robot: of the file that it names, inside it, or written here for a built-in robot.
    #[getter]
    fn urdf(&self) -> PyResult<String> {
        let robot = self.source.parse().map_err(Raise::raise)?.robot;
        match (robot.urdf, robot.urdf_text) {
            (Some(name), _) => {
                let path = self.source.folder().join(name);
                read_text(&path).map_err(|source| IoError::File { path, source }.raise())
            }
            (None, Some(text)) => Ok(text),
            (None, None) => Ok(to_urdf(&self.built.robot)),
        }
    }

    /// S and C, as JSON: the dimensions of each.
    #[getter]
    fn spaces(&self) -> (String, String) {
        let dims = |space: &Space| json!(space.dims()).to_string();
        (dims(self.built.simulations()), dims(self.built.controllers()))
    }

    /// The nominal points of S and C: the middle of the bounds where nothing is known.
    #[getter]
    fn nominal(&self) -> (Vec<f64>, Vec<f64>) {
        (self.built.simulations().nominal(), self.built.controllers().nominal())
    }

    /// The text of the model with other nominal values of these dimensions of S.
    fn at(&self, values: Vec<(usize, f64)>) -> PyResult<String> {
        let (space, mut s) = (self.built.simulations(), self.built.simulations().nominal());
        values.iter().for_each(|&(k, value)| s[k] = value);
        space.check(&s).map_err(|e| raised(e.to_string(), None))?;
        let values = values.iter().map(|&(k, value)| (space.dims()[k].name.as_str(), value));
        at(&self.source.text, &self.built, values).map_err(|e| raised(e.to_string(), None))
    }

    /// Where the names are among the dimensions of S, or of C, which are called `what`.
    fn places(&self, of_controllers: bool, names: Vec<String>, what: &str) -> PyResult<Vec<usize>> {
        let space = if of_controllers { self.built.controllers() } else { self.built.simulations() };
        let place = |name: &String| space.index_of(name).ok_or_else(|| unknown(name, space, what));
        names.iter().map(place).collect()
    }

    /// Values of a posterior's parameters for each of `many` draws; the posterior is JSON.
    fn draws(&self, posterior: &str, many: usize, seed: u64) -> PyResult<Vec<Vec<f64>>> {
        export::drawn_values(&self.source, &posterior_in(posterior)?, many, seed).map_err(Raise::raise)
    }

    /// What the model says, in a format of another simulator: the text; what it says, what it does not, and advice;
    /// the effects that are left, as JSON. `posterior`, JSON as well, is what a fit leaves, for formats with ranges.
    #[pyo3(signature = (to, robot, step_s, posterior))]
    fn export(
        &self,
        py: Python<'_>,
        to: &str,
        robot: Option<PathBuf>,
        step_s: f64,
        posterior: Option<&str>,
    ) -> PyResult<ExportedParts> {
        let posterior = posterior.map(posterior_in).transpose()?;
        let format = export::FORMATS.iter().find(|format| format.name == to).ok_or_else(|| {
            let known: Vec<&str> = export::FORMATS.iter().map(|format| format.name).collect();
            raised(format!("no format `{to}`"), Some(format!("formats: {}", known.join(", ")).into()))
        })?;
        if !(step_s > 0.0 && step_s.is_finite()) {
            return Err(raised(format!("a step of {step_s} s"), Some("give a number of seconds above 0".into())));
        }
        let exported = py
            .detach(|| export::export(&self.source, format, robot, step_s, posterior.as_ref()))
            .map_err(Raise::raise)?;
        Ok((exported.text, [exported.carried, exported.left, exported.advice], exported.effects))
    }

    /// Writes the model file, whole or not at all; the files that it names are found from there.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let into = path.parent().unwrap_or(&path);
        let text = moved(&self.source.text, self.source.folder(), into).map_err(|e| raised(e.to_string(), None))?;
        let written = write_whole(&path, |out| out.write_all(text.as_bytes()));
        written.map_err(|source| IoError::File { path, source }.raise())
    }

    /// One rollout: of the model's own drive, or told what a log says the robot was told, from where it or `begins`
    /// says.
    #[pyo3(signature = (log = None, seed = None, begins = None))]
    fn simulate(
        &self,
        py: Python<'_>,
        log: Option<LogArgument>,
        seed: Option<u64>,
        begins: Option<Begins>,
    ) -> PyResult<Log> {
        let log = log.map(LogArgument::source);
        let simulated = at_once(py, &self.source, || {
            let model = match log {
                Some(log) => self.replaying(log, begins)?,
                None => experiment::model(&self.source).map_err(Raise::raise)?,
            };
            let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
            model.simulate(model.request(&s, 0).controller(&c).noise_seed(seed)).map_err(Raise::raise)
        })?;
        Ok(Log::made_here("simulated", simulated))
    }

    /// The accelerations in a state: of a floating base (angular, linear), then of the joints.
    #[pyo3(signature = (q, dq, torques, base = None))]
    fn accelerations(
        &self,
        q: Vec<f64>,
        dq: Vec<f64>,
        torques: Vec<f64>,
        base: Option<([f64; 7], [f64; 6])>,
    ) -> PyResult<Vec<f64>> {
        if dq.len() != q.len() {
            return Err(raised("positions and velocities must be as many", None));
        }
        let state = RobotState { joints: q.into_iter().zip(dq).collect(), base: base_state(base) };
        let s = self.built.simulations().nominal();
        self.built.accelerations(&s, &state, &torques).map_err(Raise::raise)
    }

    /// Many rollouts, side by side: a point of S and one of C for each (the nominal one where there is none); nothing
    /// where a simulation diverged.
    #[pyo3(signature = (parameters, controllers, log = None, begins = None))]
    fn simulate_all(
        &self,
        py: Python<'_>,
        parameters: Option<Vec<Vec<f64>>>,
        controllers: Option<Vec<Vec<f64>>>,
        log: Option<LogArgument>,
        begins: Option<Begins>,
    ) -> PyResult<Vec<Option<Log>>> {
        let log = log.map(LogArgument::source);
        let context = self.context(py, None)?;
        let simulated = working(py, &context, || {
            let replaying = log.map(|log| self.replaying(log, begins)).transpose()?;
            let model = replaying.as_ref().unwrap_or(&self.built);
            let rollouts = parameters.as_ref().or(controllers.as_ref()).map_or(0, Vec::len);
            let rows =
                |given: Option<Vec<Vec<f64>>>, space: &Space| given.unwrap_or_else(|| vec![space.nominal(); rollouts]);
            let (s, c) = (rows(parameters, model.simulations()), rows(controllers, model.controllers()));
            s.iter().zip(&c).try_for_each(|(s, c)| within(model, s, c))?;
            let jobs: Vec<Job> = s.iter().zip(&c).map(|(s, c)| Job { s, c, scenario: 0 }).collect();
            model.simulate_jobs(&jobs, &|| context.check_cancelled()).map_err(|why| raised(why.to_string(), None))
        })?;
        let logs = simulated.into_iter().map(|log| Some(Log::made_here("simulated", log.ok()?)));
        Ok(logs.collect())
    }

    /// The text of the model with effects (`coulomb_friction@knee`) in it, free to fit.
    fn add(&self, effects: Vec<String>) -> PyResult<String> {
        let robot = &self.built.robot;
        let addition = |text: &String| Addition::parse(text, robot).map_err(Raise::raise);
        let additions = effects.iter().map(addition).collect::<PyResult<Vec<_>>>()?;
        if additions.is_empty() {
            return Err(raised("no effect to add", Some("for instance \"coulomb_friction@knee\"".into())));
        }
        verbs::add(&self.source, robot, &additions).map_err(Raise::raise)
    }

    /// The text of the model without effects (`coulomb_friction@knee`, or `coulomb_friction` at all sites).
    fn remove(&self, effects: Vec<String>) -> PyResult<String> {
        if effects.is_empty() {
            return Err(raised("no effect to remove", Some("for instance \"coulomb_friction@knee\"".into())));
        }
        verbs::remove(&self.source.text, &effects).map_err(Raise::raise)
    }

    /// The text of the model with a user's own law in it; whether that makes sense is said when it is read.
    fn with_law(&self, law: String, site: String, on: String, numbers: Vec<(String, Number)>) -> PyResult<String> {
        let numbers = numbers.into_iter().map(|(name, number)| (name, number.into())).collect();
        verbs::add_law(&self.source, &OwnLaw { law, site, on, numbers }).map_err(Raise::raise)
    }
}

/// The text of a new model: the robot of a description (JSON), with its URDF inside.
#[pyfunction]
pub(crate) fn new_model(description: &str) -> PyResult<String> {
    let robot = serde_json::from_str(description).map_err(|e| raised(e.to_string(), None))?;
    let draft = written(&robot, &LogColumns::default(), None, &UrdfPlace::Inside).map_err(Raise::raise)?;
    Ok(draft.text)
}

/// The base at x, y, z in m and the quaternion w, x, y, z, with its linear and angular velocity in m/s and rad/s; at
/// rest at the origin where nothing is given.
fn base_state(base: Option<([f64; 7], [f64; 6])>) -> BaseState {
    let ([x, y, z, w, i, j, k], [vx, vy, vz, wx, wy, wz]) = base.unwrap_or(([0., 0., 0., 1., 0., 0., 0.], [0.0; 6]));
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    BaseState {
        pose: Isometry3::from_parts(Translation3::new(x, y, z), turn),
        velocity_m_s: Vector3::new(vx, vy, vz),
        angular_rad_s: Vector3::new(wx, wy, wz),
    }
}

/// How a controller of the loop begins: joints by name, the base of a floating robot, and how long it lasts in s.
type Begins = (Vec<(String, f64)>, Option<[f64; 7]>, f64);

impl Model {
    /// How work on the model is done.
    pub(crate) fn context(&self, py: Python<'_>, executor: Option<ExecutorChoice>) -> PyResult<Arc<ExecutionContext>> {
        context(py, executor, &self.source, &self.functions)
    }

    /// The model, told what a log says, from where the log begins or as `begins` has it.
    fn replaying(&self, log: LogSource, begins: Option<Begins>) -> PyResult<model::Model> {
        let replaying = experiment::model_replaying(&self.source, log).map_err(Raise::raise)?;
        Ok(match begins {
            Some((joints, base, duration_s)) => replaying.begun(&joints, base, duration_s),
            None => replaying,
        })
    }
}

/// Where a model is given for a log, its `[channels]` are meant.
impl<'py> FromPyObject<'_, 'py> for ChannelNames {
    type Error = PyErr;

    fn extract(model: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let file = model.cast::<Model>()?.get().source.parse().map_err(Raise::raise)?;
        Ok(ChannelNames(file.channels))
    }
}

/// A posterior in the JSON of a fit.
fn posterior_in(text: &str) -> PyResult<Posterior> {
    serde_json::from_str(text).map_err(|e| raised(e.to_string(), None))
}

fn unknown(name: &str, space: &Space, what: &str) -> PyErr {
    let known = || space.dims().iter().map(|dim| dim.name.as_str());
    let all = || match space.is_empty() {
        true => format!("there are no {what}"),
        false => format!("there are {}", known().collect::<Vec<_>>().join(", ")),
    };
    let help = btr_lab::suggest::suggestion(name, known()).unwrap_or_else(all);
    raised(format!("none of the model's {what} is called `{name}`"), Some(help.into()))
}

/// Whether points are in their spaces: what is outside is a mistake, not a simulation that failed.
fn within(model: &model::Model, s: &[f64], c: &[f64]) -> PyResult<()> {
    let checked = model.simulations().check(s).and_then(|()| model.controllers().check(c));
    checked.map_err(|e| raised(e.to_string(), None))
}

/// A number of a law: known, or free to fit between two bounds.
#[derive(FromPyObject)]
enum Number {
    Fixed(f64),
    Between((f64, f64)),
}

impl From<Number> for OwnNumber {
    fn from(number: Number) -> Self {
        match number {
            Number::Fixed(value) => OwnNumber::Fixed(value),
            Number::Between((least, most)) => OwnNumber::Between(least, most),
        }
    }
}
