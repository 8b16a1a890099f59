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
use indexmap::IndexMap;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

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

/// What was simulated. Nothing is simulated while it is locked: a thread that waits for simulations may take over work
/// that asks for what is known.
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
    /// For each log, the last change by the links' parameters: what acts in joints is often varied beside them.
    links: HashMap<usize, (Vec<f64>, Arc<Vec<f64>>)>,
    /// Whether nothing may be forgotten.
    keeps_all: bool,
}

/// Some of what is known.
type Found = HashMap<Key, Simulated>;

impl Superposition {
    /// The residuals at points in logs.
    pub(super) fn residuals(&self, problem: Problem, points: &[(&[f64], usize)]) -> Vec<Result<Vec<f64>, WorldError>> {
        let mut parts: Vec<Parts> = points.iter().map(|(u, log)| Parts::of(problem.description, u, *log)).collect();
        self.lock().forget();
        let of_links: Vec<_> = parts.iter_mut().map(|part| self.change_by_links(problem, part)).collect();
        let mut found = self.simulated(problem, problem.simulate, parts.iter().map(Parts::rest));
        let laws = parts.iter().flat_map(|part| part.added.iter().map(|added| part.laws(added)));
        found.extend(self.changes_by_laws(problem, laws));
        let sum = |(part, of_links): (&Parts, &Option<Arc<Vec<f64>>>)| {
            sum(problem, &found, part, of_links.as_ref().map(|change| change.as_slice()))
        };
        parts.par_iter().zip(&of_links).map(sum).collect()
    }

    /// Lets all be kept, or no longer.
    pub(super) fn keep_all(&self, keeps_all: bool) {
        let mut known = self.lock();
        known.forget();
        known.keeps_all = keeps_all;
    }

    fn lock(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The change of the residual by the links' parameters of a point, from what is known of inertias or by a
    /// simulation; `None` without such parameters, or where they cannot be told apart: then they become part of the
    /// rest.
    fn change_by_links(&self, problem: Problem, part: &mut Parts) -> Option<Arc<Vec<f64>>> {
        let links = part.links.take()?;
        let change = self.of_links(problem, &links, part.log);
        if change.is_none() {
            problem.description.inertial.iter().for_each(|&k| part.rest[k] = links[k]);
        }
        change
    }

    fn of_links(&self, problem: Problem, links: &[f64], log: usize) -> Option<Arc<Vec<f64>>> {
        if let Some((_, change)) = self.lock().links.get(&log).filter(|(last, _)| is_same(last, links)) {
            return Some(change.clone());
        }
        let off = self.simulated(problem, problem.simulate, std::iter::once(Key::off(log)));
        let off = off.get(&Key::off(log))?.as_ref().ok()?;
        let inertias = |u: &[f64]| problem.model.inertias(u, log);
        let (origin, here) = (inertias(&vec![0.0; links.len()])?, inertias(links)?);
        let response =
            |known: &mut Known| known.inertias.entry(log).or_insert_with(|| InertiaResponse::new(origin)).change(&here);
        let follows = response(&mut self.lock());
        let change = match follows {
            Some(change) => change.added_up(),
            None => {
                let residual = (problem.simulate)(&[(links.to_vec(), log)]).pop()?.ok()?;
                let change: Vec<f64> = residual.iter().zip(off.iter()).map(|(with, off)| finite(with - off)).collect();
                // Added up from now on: the same bits as later.
                let learnt = |known: &mut Known| {
                    let response = known.inertias.get_mut(&log)?;
                    response.learn(&here, &change);
                    response.change(&here)
                };
                let follows = learnt(&mut self.lock());
                follows.map_or(change, |change| change.added_up())
            }
        };
        let change = Arc::new(change);
        self.lock().links.insert(log, (links.to_vec(), change.clone()));
        Some(change)
    }

    /// Residuals of keys; those that are not known are simulated.
    fn simulated(&self, problem: Problem, simulate: &Simulate, keys: impl Iterator<Item = Key>) -> Found {
        let (mut found, missing) = self.lock().find(keys);
        let points: Vec<(Vec<f64>, usize)> = missing.iter().map(|key| problem.point(key)).collect();
        let residuals = simulate(&points).into_iter().map(|residual| residual.map(Arc::new));
        let new: Vec<(Key, Simulated)> = missing.into_iter().zip(residuals).collect();
        self.lock().kept.extend(new.iter().cloned());
        found.extend(new);
        found
    }

    /// Changes by laws; those that are not known are simulated, those of different channels together.
    fn changes_by_laws(&self, problem: Problem, keys: impl Iterator<Item = Key>) -> Found {
        let (mut found, missing) = self.lock().find(keys);
        let bases: Vec<Key> = missing.iter().filter_map(Key::base).collect();
        let at_bases = self.simulated(problem, problem.joint_parts, bases.iter().cloned());
        let mut of_bases: IndexMap<&Key, Vec<&Key>> = IndexMap::new();
        missing.iter().zip(&bases).for_each(|(key, base)| of_bases.entry(base).or_default().push(key));
        let channels = |key: &&Key| problem.laws(key).map_or(&[][..], |laws| laws.channels.as_slice());
        let together = |keys: &Vec<&Key>| {
            let groups = shared(keys.iter().map(channels));
            groups.into_iter().map(|group| group.into_iter().map(|k| keys[k].clone()).collect()).collect::<Vec<_>>()
        };
        let probes: Vec<Vec<Key>> = of_bases.values().flat_map(together).collect();
        let points: Vec<(Vec<f64>, usize)> = probes.iter().map(|keys| problem.together(keys)).collect();
        let mut new: Vec<(Key, Simulated)> = Vec::new();
        for (keys, with) in probes.into_iter().zip((problem.joint_parts)(&points)) {
            for key in keys {
                let change = match (&with, key.base().and_then(|base| at_bases.get(&base))) {
                    (Ok(with), Some(Ok(base))) => Ok(Arc::new(problem.change(&key, with, base))),
                    (Err(error), _) | (_, Some(Err(error))) => Err(error.clone()),
                    (Ok(_), None) => continue,
                };
                new.push((key, change));
            }
        }
        self.lock().kept.extend(new.iter().cloned());
        found.extend(new);
        found
    }
}

impl Known {
    /// Forgets what was simulated where it has become too much.
    fn forget(&mut self) {
        if !self.keeps_all && self.kept.values().flatten().map(|numbers| numbers.len()).sum::<usize>() > MOST_KEPT {
            self.kept.clear();
        }
    }

    /// What is known of keys, and those that are not known, each once.
    fn find(&self, keys: impl Iterator<Item = Key>) -> (Found, Vec<Key>) {
        let (mut found, mut missing, mut seen) = (Found::new(), Vec::new(), HashSet::new());
        for key in keys {
            match self.kept.get(&key) {
                Some(known) => drop(found.insert(key, known.clone())),
                None if seen.insert(key.clone()) => missing.push(key),
                None => {}
            }
        }
        (found, missing)
    }
}

/// The residual of a point from its parts.
fn sum(problem: Problem, found: &Found, part: &Parts, of_links: Option<&[f64]>) -> Result<Vec<f64>, WorldError> {
    let unanswered = || WorldError::Setup { what: "the residual model did not answer".to_owned() };
    let get = |key: &Key| found.get(key).cloned().unwrap_or_else(|| Err(unanswered()));
    let mut residual = get(&part.rest())?.to_vec();
    residual.iter_mut().zip(of_links.into_iter().flatten()).for_each(|(r, change)| *r += change);
    for added in &part.added {
        let key = part.laws(added);
        let change = get(&key)?;
        let mut changes = change.as_slice();
        for rows in problem.rows(&key) {
            let (here, later) = changes.split_at(rows.len().min(changes.len()));
            residual[rows].iter_mut().zip(here).for_each(|(r, change)| *r += added.factor * change);
            changes = later;
        }
    }
    Ok(residual)
}

/// Whether two points are the same, bit by bit.
fn is_same(a: &[f64], b: &[f64]) -> bool {
    a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits()))
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
        let of =
            |rows: Range<usize>| with[rows.clone()].iter().zip(&base[rows]).map(|(with, base)| finite(with - base));
        self.rows(key).into_iter().flat_map(of).collect()
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
