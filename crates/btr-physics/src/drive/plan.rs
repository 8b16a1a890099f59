//! Drives by name, and which of their parameters are searched.

use super::policy::{Policy, PolicyPlan};
use super::{Drive, Hold, NaoKick, NaoWalk, Replay, Sine};
use crate::robot::Robot;
use btr_core::space::{Dim, Space, SpaceError};
use btr_core::world::WorldError;
use indexmap::IndexMap;
use std::f64::consts::PI;
use std::sync::Arc;

/// Every drive: its name in experiment files, and its description.
pub const DRIVES: &[(&str, &str)] = &[
    ("hold", "holds every joint at its start position"),
    ("sine", "r_i = theta_i + a_i sin(omega t + psi_i) on every joint, as the paper's ant; C is a_i and psi_i"),
    ("nao_walk", "a walk for the Nao: ZMP targets converted to targets of the centre of mass"),
    ("nao_kick", "a kick for the Nao with its right foot"),
    ("policy", "sensor feedback corrects another drive (`around`): linear, or with a layer of `hidden` units"),
    ("replay", "the commands of a recorded log, held between samples"),
];

/// Largest amplitude of the sine drive unless the experiment says otherwise, in the unit of the commands.
const SINE_AMPLITUDE: f64 = 0.6;

/// A kind of drive with its settings.
#[derive(Clone, Debug)]
pub enum DriveKind {
    /// Holds every joint at its start position.
    Hold,
    /// Sines of one angular frequency.
    Sine {
        /// rad/s.
        omega_rad_s: f64,
    },
    /// The Nao's walk.
    NaoWalk,
    /// The Nao's kick.
    NaoKick,
    /// Sensor feedback that corrects another drive.
    Policy {
        /// The other drive.
        around: Box<DriveKind>,
        /// Its inputs and outputs.
        policy: PolicyPlan,
    },
    /// Recorded commands.
    Replay(Arc<Replay>),
}

impl DriveKind {
    /// Every parameter of this drive on this robot, with its own bounds.
    ///
    /// # Errors
    /// None for the built-in drives.
    pub fn dims(&self, robot: &Robot) -> Result<Vec<Dim>, SpaceError> {
        Ok(match self {
            DriveKind::Hold | DriveKind::Replay(_) => Vec::new(),
            DriveKind::Sine { .. } => sine_dims(robot),
            DriveKind::NaoWalk => NaoWalk::space()?.dims().to_vec(),
            DriveKind::NaoKick => NaoKick::space()?.dims().to_vec(),
            DriveKind::Policy { around, policy } => [around.dims(robot)?, policy.dims(robot)].concat(),
        })
    }

    /// Whether values outside the drive's bounds are valid. The bounds of a sine and of a policy's weights are only
    /// defaults of a search; the other drives are defined within their bounds only.
    fn takes_any_value(&self) -> bool {
        match self {
            DriveKind::Policy { around, .. } => around.takes_any_value(),
            DriveKind::Hold | DriveKind::Sine { .. } => true,
            DriveKind::NaoWalk | DriveKind::NaoKick | DriveKind::Replay(_) => false,
        }
    }

    fn at(&self, robot: &Robot, values: &[f64], duration_s: f64) -> Result<Box<dyn Drive>, WorldError> {
        let refused = |what: String| WorldError::Setup { what };
        Ok(match self {
            DriveKind::Hold => Box::new(Hold::new(robot)),
            DriveKind::Sine { omega_rad_s } => Box::new(Sine {
                centres: robot.movable().map(|(_, link)| link.joint.start).collect(),
                controller: values.to_vec(),
                omega_rad_s: *omega_rad_s,
            }),
            DriveKind::NaoWalk => {
                Box::new(NaoWalk::new(robot, values, duration_s).map_err(|e| refused(e.to_string()))?)
            }
            DriveKind::NaoKick => Box::new(NaoKick::new(robot, values).map_err(|e| refused(e.to_string()))?),
            DriveKind::Policy { around, policy } => {
                let (base_values, weights) = values.split_at(values.len() - policy.dims(robot).len());
                Box::new(Policy::new(policy, around.at(robot, base_values, duration_s)?, robot, weights))
            }
            DriveKind::Replay(replay) => Box::new(replay.clone()),
        })
    }
}

fn sine_dims(robot: &Robot) -> Vec<Dim> {
    let joints = robot.movable().map(|(_, link)| &link.joint);
    joints
        .flat_map(|joint| {
            let name = &joint.name;
            [
                Dim::new(format!("amplitude@{name}"), joint.command_unit(), 0.0, SINE_AMPLITUDE),
                Dim::new(format!("phase@{name}"), "rad", -PI, PI),
            ]
        })
        .collect()
}

/// Where the search for controllers starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchStart {
    /// From random points of C.
    Random,
    /// From the nominal values as c_0.
    Nominal,
}

/// A drive of which some parameters are searched and the others fixed.
#[derive(Clone, Debug)]
pub struct DrivePlan {
    kind: DriveKind,
    /// Value of every parameter; those of the searched ones are overwritten.
    values: Vec<f64>,
    /// Indices of the searched parameters among all.
    searched: Vec<usize>,
    space: Space,
}

/// Why a drive cannot be planned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DriveError {
    /// A parameter that the drive does not have.
    #[error("the drive has no parameter `{name}`")]
    Unknown {
        /// The name.
        name: String,
        /// Its parameters.
        known: Vec<String>,
    },
    /// Invalid bounds or an invalid value.
    #[error(transparent)]
    Space(#[from] SpaceError),
    /// The drive does not support the robot.
    #[error(transparent)]
    World(#[from] WorldError),
}

impl DrivePlan {
    /// `set` fixes parameters, `searched` lists those of C with optional bounds.
    ///
    /// # Errors
    /// Unknown names, values outside their bounds, a robot that the drive does not support.
    pub fn new(
        kind: DriveKind,
        robot: &Robot,
        set: &IndexMap<String, f64>,
        searched: &IndexMap<String, Option<[f64; 2]>>,
        start: SearchStart,
    ) -> Result<Self, DriveError> {
        let all = Space::new(kind.dims(robot)?)?;
        let known = || all.dims().iter().map(|d| d.name.clone()).collect::<Vec<_>>();
        let index = |name: &String| {
            all.index_of(name).ok_or_else(|| DriveError::Unknown { name: name.clone(), known: known() })
        };
        let mut values = all.nominal();
        for (name, value) in set {
            values[index(name)?] = *value;
        }
        if !(kind.takes_any_value() && values.iter().all(|x| x.is_finite())) {
            all.check(&values)?;
        }
        let mut dims = Vec::new();
        for (name, bounds) in searched {
            let k = index(name)?;
            let mut dim = all.dims()[k].clone();
            [dim.min, dim.max] = bounds.unwrap_or([dim.min, dim.max]);
            dim.nominal = (start == SearchStart::Nominal).then_some(values[k]);
            dims.push(dim);
        }
        let searched = searched.keys().map(index).collect::<Result<_, _>>()?;
        let plan = DrivePlan { kind, values, searched, space: Space::new(dims)? };
        plan.at(robot, &plan.space.nominal(), 1.0)?;
        Ok(plan)
    }

    /// Whether sensor readings change the references: then [`at`](Self::at) alone does not determine them.
    pub fn senses(&self) -> bool {
        matches!(self.kind, DriveKind::Policy { .. })
    }

    /// The controller space C.
    pub fn space(&self) -> &Space {
        &self.space
    }

    /// The drive of controller `c`, for `duration_s` seconds.
    ///
    /// # Errors
    /// A robot that the drive does not support.
    pub fn at(&self, robot: &Robot, c: &[f64], duration_s: f64) -> Result<Box<dyn Drive>, WorldError> {
        let mut values = self.values.clone();
        self.searched.iter().zip(c).for_each(|(&k, &x)| values[k] = x);
        self.kind.at(robot, &values, duration_s)
    }
}
