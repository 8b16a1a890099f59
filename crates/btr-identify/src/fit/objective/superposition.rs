//! Residuals as sums. Where the motion is prescribed, friction, a rotor or a ripple at a joint adds a torque that is
//! proportional to its amplitude ([`AdditiveParameter`]): its response is simulated once, and from then on scaled and
//! added. What is left, the residual with all of these off, is simulated once for each point of the other parameters.
//!
//! A sum equals the simulation but for rounding, and has the same bits whatever was kept before.

use super::inertia::InertiaResponse;
use crate::fit::rollouts::{rows_near, shared};
use crate::residual_model::{AdditiveParameter, ModelDescription, RecordedLog, ResidualModel};
use btr_core::world::WorldError;
use rayon::prelude::*;
use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, PoisonError};

/// How many numbers are kept, in all residuals and responses (256 MiB).
const MOST_KEPT: usize = 1 << 25;

/// A simulated residual or response, or why there is none.
type Simulated = Result<Arc<Vec<f64>>, WorldError>;
/// Simulates points in logs.
pub(super) type Simulate<'a> = dyn Fn(&[(Vec<f64>, usize)]) -> Vec<Result<Vec<f64>, WorldError>> + 'a;

/// The residual model with its description.
#[derive(Clone, Copy)]
pub(super) struct Problem<'a> {
    pub(super) model: &'a dyn ResidualModel,
    pub(super) description: &'a ModelDescription,
}

/// What has to be simulated: the bits of coordinates make it exact.
#[derive(Clone, PartialEq, Eq, Hash)]
enum Key {
    /// The residual in a log at a point.
    Rest { log: usize, u: Vec<u64> },
    /// The response in a log to an additive parameter, at some shapes.
    Response { log: usize, index: usize, shapes: Vec<u64> },
}

/// A residual in parts: the rest, and responses with their coordinates.
struct Parts {
    log: usize,
    rest: Vec<f64>,
    /// Indices of additive parameters.
    added: Vec<usize>,
    /// The point with the links' parameters alone, if any of them differs from 0, and how they change the residual.
    links: Option<Vec<f64>>,
    of_links: Option<Arc<Vec<f64>>>,
}

/// What was simulated so far.
#[derive(Default)]
struct Known {
    kept: HashMap<Key, Simulated>,
    /// For each log, the response to the robot's inertias.
    inertias: HashMap<usize, InertiaResponse>,
}

/// Additive parameters, and what was simulated of them.
#[derive(Default)]
pub(super) struct Superposition {
    additive: Vec<AdditiveParameter>,
    inertial: Vec<usize>,
    inertial_unless: Vec<usize>,
    known: Mutex<Known>,
}

impl Superposition {
    pub(super) fn new(description: &ModelDescription) -> Self {
        Superposition {
            additive: description.additive.clone(),
            inertial: description.inertial.clone(),
            inertial_unless: description.inertial_unless.clone(),
            known: Mutex::default(),
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.additive.is_empty()
    }

    /// The residuals at points in logs.
    pub(super) fn residuals(
        &self,
        problem: Problem,
        points: &[(&[f64], usize)],
        simulate: &Simulate,
    ) -> Vec<Result<Vec<f64>, WorldError>> {
        let mut parts: Vec<Parts> = points.iter().map(|(u, log)| self.parts(u, *log)).collect();
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let Known { kept, inertias } = &mut *known;
        if kept.values().flatten().map(|numbers| numbers.len()).sum::<usize>() > MOST_KEPT {
            kept.clear();
        }
        let off = |part: &Parts| Parts::off(part.log, part.rest.len()).key();
        simulate_rests(kept, parts.iter().map(off).collect(), simulate);
        for part in &mut parts {
            part.of_links = self.of_links(problem, kept, inertias, part, simulate);
        }
        simulate_rests(kept, parts.iter().map(Parts::key).collect(), simulate);
        let responses = parts
            .iter()
            .zip(points)
            .flat_map(|(part, (u, _))| part.added.iter().map(|&index| self.response(part.log, index, u)));
        self.simulate_responses(problem, kept, responses.collect(), simulate);
        let kept = &*kept;
        let sum = |(part, (u, _)): (&Parts, &(&[f64], usize))| self.sum(problem, kept, part, u);
        parts.par_iter().zip(points).map(sum).collect()
    }

    /// The change of the residual by the links' parameters of a point, from what is known of inertias or by a
    /// simulation. `None` without such parameters, or where they cannot be told apart: then they are part of the rest.
    fn of_links(
        &self,
        problem: Problem,
        kept: &HashMap<Key, Simulated>,
        inertias: &mut HashMap<usize, InertiaResponse>,
        part: &mut Parts,
        simulate: &Simulate,
    ) -> Option<Arc<Vec<f64>>> {
        let links = part.links.take()?;
        let log = part.log;
        let change = (|| {
            let off = kept.get(&Parts::off(log, links.len()).key())?.as_ref().ok()?;
            let at = |u: &[f64]| problem.model.inertias(u, log);
            let known = match inertias.entry(log) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(none) => none.insert(InertiaResponse::new(at(&vec![0.0; links.len()])?)),
            };
            known.change(&at(&links)?, || {
                let residual = simulate(&[(links.clone(), log)]).pop()?.ok()?;
                Some(residual.iter().zip(off.iter()).map(|(with, off)| finite(with - off)).collect())
            })
        })();
        if change.is_none() {
            self.inertial.iter().for_each(|&k| part.rest[k] = links[k]);
        }
        change.map(Arc::new)
    }

    /// Takes out of a point what is additive there.
    fn parts(&self, u: &[f64], log: usize) -> Parts {
        let (mut rest, mut added) = (u.to_vec(), Vec::new());
        for (index, additive) in self.additive.iter().enumerate() {
            if additive.unless.iter().all(|&other| u[other] == 0.0) {
                if u[additive.parameter] != 0.0 {
                    added.push(index);
                }
                rest[additive.parameter] = 0.0;
                additive.shapes.iter().for_each(|&shape| rest[shape] = 0.0);
            }
        }
        let mut links = None;
        if self.inertial.iter().any(|&k| rest[k] != 0.0) && self.inertial_unless.iter().all(|&k| u[k] == 0.0) {
            let mut alone = vec![0.0; u.len()];
            self.inertial.iter().for_each(|&k| (alone[k], rest[k]) = (rest[k], 0.0));
            links = Some(alone);
        }
        Parts { log, rest, added, links, of_links: None }
    }

    fn response(&self, log: usize, index: usize, u: &[f64]) -> Key {
        Key::Response {
            log,
            index,
            shapes: self.additive[index].shapes.iter().map(|&shape| u[shape].to_bits()).collect(),
        }
    }

    /// Simulates responses that are not known, those of different channels together.
    fn simulate_responses(
        &self,
        problem: Problem,
        kept: &mut HashMap<Key, Simulated>,
        keys: Vec<Key>,
        simulate: &Simulate,
    ) {
        let missing = missing(kept, keys);
        let mut probes: Vec<(Vec<f64>, usize, Vec<&Key>)> = Vec::new();
        for log in 0..problem.description.logs.len() {
            let of_log: Vec<(&Key, &AdditiveParameter, &Vec<u64>)> = missing
                .iter()
                .filter_map(|key| match key {
                    Key::Response { log: of, index, shapes } if *of == log => {
                        Some((key, &self.additive[*index], shapes))
                    }
                    _ => None,
                })
                .collect();
            for group in shared(of_log.iter().map(|(_, additive, _)| additive.channels.as_slice())) {
                let mut u = vec![0.0; problem.description.parameters.len()];
                for &member in &group {
                    let (_, additive, shapes) = of_log[member];
                    u[additive.parameter] = unit(problem, additive.parameter);
                    additive.shapes.iter().zip(shapes).for_each(|(&shape, bits)| u[shape] = f64::from_bits(*bits));
                }
                probes.push((u, log, group.into_iter().map(|member| of_log[member].0).collect()));
            }
        }
        let residuals = simulate(&probes.iter().map(|(u, log, _)| (u.clone(), *log)).collect::<Vec<_>>());
        for ((_, log, keys), residual) in probes.iter().zip(residuals) {
            let off = kept.get(&Parts::off(*log, problem.description.parameters.len()).key()).cloned();
            for &key in keys {
                let response = match (&residual, &off) {
                    (Ok(with), Some(Ok(off))) => Ok(Arc::new(self.change(problem, key, with, off))),
                    (Err(error), _) | (_, Some(Err(error))) => Err(error.clone()),
                    (Ok(_), None) => continue,
                };
                kept.insert(key.clone(), response);
            }
        }
    }

    /// The change of the residual for a unit of an additive parameter, in the rows where it shows.
    fn change(&self, problem: Problem, key: &Key, with: &[f64], off: &[f64]) -> Vec<f64> {
        let Key::Response { log, index, .. } = key else { return Vec::new() };
        let additive = &self.additive[*index];
        let unit = unit(problem, additive.parameter);
        let change = |row: usize| (with[row] - off[row]) / unit;
        rows(problem, *log, additive).map(|row| finite(change(row))).collect()
    }

    fn sum(
        &self,
        problem: Problem,
        kept: &HashMap<Key, Simulated>,
        part: &Parts,
        u: &[f64],
    ) -> Result<Vec<f64>, WorldError> {
        let known = |key: &Key| {
            let unanswered = || WorldError::Setup { what: "the residual model did not answer".to_owned() };
            kept.get(key).cloned().unwrap_or_else(|| Err(unanswered()))
        };
        let mut residual = known(&part.key())?.to_vec();
        if let Some(links) = &part.of_links {
            residual.iter_mut().zip(links.iter()).for_each(|(r, change)| *r += change);
        }
        for &index in &part.added {
            let (additive, response) = (&self.additive[index], known(&self.response(part.log, index, u))?);
            let coordinate = u[additive.parameter];
            rows(problem, part.log, additive).zip(response.iter()).for_each(|(row, r)| residual[row] += coordinate * r);
        }
        Ok(residual)
    }
}

impl Parts {
    /// The point where everything is off.
    fn off(log: usize, parameters: usize) -> Parts {
        Parts { log, rest: vec![0.0; parameters], added: Vec::new(), links: None, of_links: None }
    }

    fn key(&self) -> Key {
        Key::Rest { log: self.log, u: self.rest.iter().map(|x| x.to_bits()).collect() }
    }
}

/// Simulates rests that are not known.
fn simulate_rests(kept: &mut HashMap<Key, Simulated>, keys: Vec<Key>, simulate: &Simulate) {
    let missing = missing(kept, keys);
    let point = |key: &Key| match key {
        Key::Rest { log, u } => (u.iter().copied().map(f64::from_bits).collect(), *log),
        Key::Response { log, .. } => (Vec::new(), *log),
    };
    let residuals = simulate(&missing.iter().map(point).collect::<Vec<_>>());
    kept.extend(missing.into_iter().zip(residuals.into_iter().map(|residual| residual.map(Arc::new))));
}

/// What was not measured has no response.
fn finite(change: f64) -> f64 {
    if change.is_finite() { change } else { 0.0 }
}

/// Those of some keys that are not known, each once.
fn missing(kept: &HashMap<Key, Simulated>, keys: Vec<Key>) -> Vec<Key> {
    let mut seen = HashSet::new();
    keys.into_iter().filter(|key| !kept.contains_key(key) && seen.insert(key.clone())).collect()
}

/// The coordinate at which the response to a parameter is simulated.
fn unit(problem: Problem, parameter: usize) -> f64 {
    let parameter = &problem.description.parameters[parameter];
    let unit = parameter.clamp(1.0);
    if unit == 0.0 { parameter.clamp(-1.0) } else { unit }
}

/// The rows of a log's residual in which a parameter shows.
fn rows(problem: Problem, log: usize, additive: &AdditiveParameter) -> impl Iterator<Item = usize> {
    let log: &RecordedLog = &problem.description.logs[log];
    rows_near(log, &additive.channels).into_iter().flatten()
}
