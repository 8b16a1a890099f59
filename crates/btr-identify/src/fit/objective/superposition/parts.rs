//! A point in parts: what must be simulated, and what is added to it.

use crate::residual_model::{ModelDescription, ProportionalParameter};

/// Coordinates that differ from 0: parameters and bits, which make a point exact.
pub(super) type Coordinates = Vec<(usize, u64)>;

/// What is simulated, or follows from what is.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(super) enum Key {
    /// The residual in a log at a point.
    Rest { log: usize, at: Coordinates },
    /// What acts in the joints contributes to it.
    Joints { log: usize, at: Coordinates },
    /// The change of that by the laws of a joint, in the rows where these show, from a point where they are off.
    Laws { log: usize, joint: usize, on: Coordinates, beside: Coordinates },
}

impl Key {
    /// The residual in a log where everything is off.
    pub(super) fn off(log: usize) -> Key {
        Key::Rest { log, at: Coordinates::new() }
    }

    pub(super) fn log(&self) -> usize {
        match self {
            Key::Rest { log, .. } | Key::Joints { log, .. } | Key::Laws { log, .. } => *log,
        }
    }

    /// The joint whose laws it is about.
    pub(super) fn joint(&self) -> Option<usize> {
        match self {
            Key::Laws { joint, .. } => Some(*joint),
            Key::Rest { .. } | Key::Joints { .. } => None,
        }
    }

    /// Where the laws are off, what acts in the joints.
    pub(super) fn base(&self) -> Option<Key> {
        match self {
            Key::Laws { log, beside, .. } => Some(Key::Joints { log: *log, at: beside.clone() }),
            Key::Rest { .. } | Key::Joints { .. } => None,
        }
    }

    /// All coordinates of its point.
    pub(super) fn coordinates(&self) -> impl Iterator<Item = &(usize, u64)> {
        let (at, beside) = match self {
            Key::Rest { at, .. } | Key::Joints { at, .. } => (at, None),
            Key::Laws { on, beside, .. } => (on, Some(beside)),
        };
        at.iter().chain(beside.into_iter().flatten())
    }
}

/// A residual in parts: the rest, and changes times factors.
pub(super) struct Parts {
    pub(super) log: usize,
    /// The point without what is added.
    pub(super) rest: Vec<f64>,
    pub(super) added: Vec<Added>,
    /// The point with the links' parameters alone, if any of them differs from 0 and what they change is added.
    pub(super) links: Option<Vec<f64>>,
}

/// The laws of a joint that are on, and the factor of their change.
pub(super) struct Added {
    pub(super) joint: usize,
    pub(super) on: Coordinates,
    /// Whether they are all that acts in the joint: their change may depend on the rest.
    together: bool,
    pub(super) factor: f64,
}

impl Parts {
    pub(super) fn of(description: &ModelDescription, u: &[f64], log: usize) -> Parts {
        let (mut rest, mut added) = (u.to_vec(), Vec::new());
        for (joint, laws) in description.joint_laws.iter().enumerate() {
            if laws.unless.iter().any(|&k| u[k] != 0.0) {
                continue;
            }
            if laws.together.iter().any(|&k| u[k] != 0.0) {
                let on = coordinates(u, laws.parameters.iter().copied());
                added.push(Added { joint, on, together: true, factor: 1.0 });
            } else {
                let seen = laws.proportional.iter().filter(|law| u[law.parameter] != 0.0);
                added.extend(seen.map(|law| Added::proportional(description, u, joint, law)));
            }
            laws.parameters.iter().for_each(|&k| rest[k] = 0.0);
        }
        let mut links = None;
        let seen = description.inertial.iter().any(|&k| rest[k] != 0.0);
        if seen && description.inertial_unless.iter().all(|&k| u[k] == 0.0) {
            let mut alone = vec![0.0; u.len()];
            description.inertial.iter().for_each(|&k| (alone[k], rest[k]) = (rest[k], 0.0));
            links = Some(alone);
        }
        Parts { log, rest, added, links }
    }

    /// The residual without what is added.
    pub(super) fn rest(&self) -> Key {
        Key::Rest { log: self.log, at: coordinates(&self.rest, 0..self.rest.len()) }
    }

    /// The change by laws.
    pub(super) fn laws(&self, added: &Added) -> Key {
        let beside = if added.together { coordinates(&self.rest, 0..self.rest.len()) } else { Vec::new() };
        Key::Laws { log: self.log, joint: added.joint, on: added.on.clone(), beside }
    }
}

impl Added {
    fn proportional(description: &ModelDescription, u: &[f64], joint: usize, law: &ProportionalParameter) -> Added {
        let unit = unit(description, law.parameter);
        let shapes = coordinates(u, law.shapes.iter().copied());
        let on = [vec![(law.parameter, unit.to_bits())], shapes].concat();
        Added { joint, on, together: false, factor: u[law.parameter] / unit }
    }
}

/// The coordinate at which the response to a parameter is simulated.
fn unit(description: &ModelDescription, parameter: usize) -> f64 {
    let parameter = &description.parameters[parameter];
    let unit = parameter.clamp(1.0);
    if unit == 0.0 { parameter.clamp(-1.0) } else { unit }
}

/// Those of some coordinates that differ from 0.
fn coordinates(u: &[f64], of: impl Iterator<Item = usize>) -> Coordinates {
    of.filter(|&k| u[k] != 0.0).map(|k| (k, u[k].to_bits())).collect()
}
