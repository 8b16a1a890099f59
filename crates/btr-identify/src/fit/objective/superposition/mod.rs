//! Residuals as sums. Where the motion is prescribed, what acts in a joint adds torques that depend on the motion alone
//! ([`JointLaws`]). They are computed without the links, which takes a fraction of a
//! simulation's time; those in proportion to a coordinate once, and from then on scaled. Links require torques that are
//! linear in their inertias. What is left is simulated once for each point of the other parameters.
//!
//! A sum equals the simulation but for rounding, and has the same bits whatever was kept before.

mod inertia;
mod parts;

use self::inertia::InertiaResponse;
use self::parts::{Key, Parts};
use crate::fit::rollouts::{rows_near, shared};
use crate::residual_model::{JointLaws, ModelDescription, ResidualModel};
use btr_core::world::WorldError;
use rayon::prelude::*;
use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

/// How many numbers are kept, in all residuals and changes (256 MiB).
const MOST_KEPT: usize = 1 << 25;

/// A simulated residual or a change, or why there is none.
type Simulated = Result<Arc<Vec<f64>>, WorldError>;
/// Simulates points in logs.
type Simulate<'a> = dyn Fn(&[(Vec<f64>, usize)]) -> Vec<Result<Vec<f64>, WorldError>> + Sync + 'a;

/// The residual model with its description, and how it is simulated.
#[derive(Clone, Copy)]
pub(super) struct Problem<'a> {
    pub(super) model: &'a dyn ResidualModel,
    pub(super) description: &'a ModelDescription,
    pub(super) simulate: &'a Simulate<'a>,
    /// What acts in the joints contributes this.
    pub(super) joint_parts: &'a Simulate<'a>,
}

/// What was simulated.
#[derive(Default)]
pub(super) struct Superposition {
    known: Mutex<Known>,
}

/// What is known by now.
#[derive(Default)]
struct Known {
    kept: HashMap<Key, Simulated>,
    /// For each log, the response to the robot's inertias.
    inertias: HashMap<usize, InertiaResponse>,
}

impl Superposition {
    /// The residuals at points in logs.
    pub(super) fn residuals(&self, problem: Problem, points: &[(&[f64], usize)]) -> Vec<Result<Vec<f64>, WorldError>> {
        let mut parts: Vec<Parts> = points.iter().map(|(u, log)| Parts::of(problem.description, u, *log)).collect();
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.forget();
        let of_links = known.add_links(problem, &mut parts);
        known.add_residuals(problem, problem.simulate, parts.iter().map(Parts::rest).collect());
        let laws = parts.iter().flat_map(|part| part.added.iter().map(|added| part.laws(added)));
        known.add_laws(problem, laws.collect());
        let known = &*known;
        let sum = |(part, of_links): (&Parts, &Option<Vec<f64>>)| known.sum(problem, part, of_links.as_deref());
        parts.par_iter().zip(&of_links).map(sum).collect()
    }
}

impl Known {
    /// Forgets what was simulated where it has become too much.
    fn forget(&mut self) {
        if self.kept.values().flatten().map(|numbers| numbers.len()).sum::<usize>() > MOST_KEPT {
            self.kept.clear();
        }
    }

    /// The change of the residual by the links' parameters of each point, from what is known of inertias or by a
    /// simulation; `None` without such parameters, or where they cannot be told apart: then they become part of the
    /// rest.
    fn add_links(&mut self, problem: Problem, parts: &mut [Parts]) -> Vec<Option<Vec<f64>>> {
        let with_links = parts.iter().filter(|part| part.links.is_some());
        let off = with_links.map(|part| Key::off(part.log)).collect();
        self.add_residuals(problem, problem.simulate, off);
        let change = |part: &mut Parts| {
            let links = part.links.take()?;
            let change = self.change_by_links(problem, &links, part.log);
            if change.is_none() {
                problem.description.inertial.iter().for_each(|&k| part.rest[k] = links[k]);
            }
            change
        };
        parts.iter_mut().map(change).collect()
    }

    fn change_by_links(&mut self, problem: Problem, links: &[f64], log: usize) -> Option<Vec<f64>> {
        let off = self.kept.get(&Key::off(log))?.as_ref().ok()?;
        let at = |u: &[f64]| problem.model.inertias(u, log);
        let known = match self.inertias.entry(log) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(none) => none.insert(InertiaResponse::new(at(&vec![0.0; links.len()])?)),
        };
        known.change(&at(links)?, || {
            let residual = (problem.simulate)(&[(links.to_vec(), log)]).pop()?.ok()?;
            Some(residual.iter().zip(off.iter()).map(|(with, off)| finite(with - off)).collect())
        })
    }

    /// Simulates residuals that are not known.
    fn add_residuals(&mut self, problem: Problem, simulate: &Simulate, keys: Vec<Key>) {
        let missing = self.missing(keys);
        let points: Vec<(Vec<f64>, usize)> = missing.iter().map(|key| problem.point(key)).collect();
        let residuals = simulate(&points);
        self.kept.extend(missing.into_iter().zip(residuals.into_iter().map(|residual| residual.map(Arc::new))));
    }

    /// Simulates changes by laws that are not known, those of different channels together.
    fn add_laws(&mut self, problem: Problem, keys: Vec<Key>) {
        let missing = self.missing(keys);
        let bases: Vec<Key> = missing.iter().filter_map(Key::base).collect();
        self.add_residuals(problem, problem.joint_parts, bases.clone());
        let mut of_bases: HashMap<&Key, Vec<&Key>> = HashMap::new();
        missing.iter().zip(&bases).for_each(|(key, base)| of_bases.entry(base).or_default().push(key));
        let channels = |key: &&Key| problem.laws(key).map_or(&[][..], |laws| laws.channels.as_slice());
        let together = |keys: &Vec<&Key>| {
            let groups = shared(keys.iter().map(channels));
            groups.into_iter().map(|group| group.into_iter().map(|k| keys[k].clone()).collect()).collect::<Vec<_>>()
        };
        let probes: Vec<Vec<Key>> = of_bases.values().flat_map(together).collect();
        let points: Vec<(Vec<f64>, usize)> = probes.iter().map(|keys| problem.together(keys)).collect();
        for (keys, with) in probes.into_iter().zip((problem.joint_parts)(&points)) {
            for key in keys {
                let base = key.base().and_then(|base| self.kept.get(&base).cloned());
                let change = match (&with, base) {
                    (Ok(with), Some(Ok(base))) => Ok(Arc::new(problem.change(&key, with, &base))),
                    (Err(error), _) => Err(error.clone()),
                    (_, Some(Err(error))) => Err(error),
                    (Ok(_), None) => continue,
                };
                self.kept.insert(key, change);
            }
        }
    }

    /// Those of some keys that are not known, each once.
    fn missing(&self, keys: Vec<Key>) -> Vec<Key> {
        let mut seen = HashSet::new();
        keys.into_iter().filter(|key| !self.kept.contains_key(key) && seen.insert(key.clone())).collect()
    }

    fn get(&self, key: &Key) -> Simulated {
        let unanswered = || WorldError::Setup { what: "the residual model did not answer".to_owned() };
        self.kept.get(key).cloned().unwrap_or_else(|| Err(unanswered()))
    }

    fn sum(&self, problem: Problem, part: &Parts, of_links: Option<&[f64]>) -> Result<Vec<f64>, WorldError> {
        let mut residual = self.get(&part.rest())?.to_vec();
        residual.iter_mut().zip(of_links.into_iter().flatten()).for_each(|(r, change)| *r += change);
        for added in &part.added {
            let key = part.laws(added);
            let change = self.get(&key)?;
            let rows = problem.rows(&key).into_iter().flatten();
            rows.zip(change.iter()).for_each(|(row, change)| residual[row] += added.factor * change);
        }
        Ok(residual)
    }
}

impl Problem<'_> {
    fn laws(&self, key: &Key) -> Option<&JointLaws> {
        key.joint().and_then(|joint| self.description.joint_laws.get(joint))
    }

    /// The rows of a log's residual in which laws show.
    fn rows(&self, key: &Key) -> Vec<Range<usize>> {
        let rows = |laws: &JointLaws| rows_near(&self.description.logs[key.log()], &laws.channels);
        self.laws(key).map(rows).unwrap_or_default()
    }

    /// What differs in these rows.
    fn change(&self, key: &Key, with: &[f64], base: &[f64]) -> Vec<f64> {
        self.rows(key).into_iter().flatten().map(|row| finite(with[row] - base[row])).collect()
    }

    /// The point of a key, and its log.
    fn point(&self, key: &Key) -> (Vec<f64>, usize) {
        self.together(std::slice::from_ref(key))
    }

    /// The point with all that some keys are about, and their log.
    fn together(&self, keys: &[Key]) -> (Vec<f64>, usize) {
        let mut u = vec![0.0; self.description.parameters.len()];
        keys.iter().flat_map(Key::coordinates).for_each(|&(k, bits)| u[k] = f64::from_bits(bits));
        (u, keys.first().map_or(0, Key::log))
    }
}

/// What was not measured does not change.
fn finite(change: f64) -> f64 {
    if change.is_finite() { change } else { 0.0 }
}
