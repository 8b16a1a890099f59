//! What is simulated beside what was measured, at any point of the family and from any start.

use super::IdentificationProblem;
use super::noise_floor;
use super::start::moved::OPEN;
use super::start::windows;
use btr_core::log::{Log, interpolate};
use btr_core::world::{Simulator, WorldError};
use btr_identify::residual_model::{
    EffectCandidate, FitParameter, LawTerm, RecordedLog, ResidualModel, ResidualRequest, TimeStep,
};
use btr_physics::effects::PlacedEffect;
use btr_physics::model::{ModelPoint, Scenario};
use btr_physics::robot::Base;
use std::borrow::Cow;
use std::ops::Range;

/// What counts as the beginning of a log, as a share of it.
const BEGINNING: f64 = 0.3;

impl ResidualModel for IdentificationProblem {
    fn parameters(&self) -> &[FitParameter] {
        &self.parameters
    }

    fn free(&self) -> &[usize] {
        &self.free
    }

    fn candidates(&self) -> &[EffectCandidate] {
        &self.candidates
    }

    fn features(&self) -> &[LawTerm] {
        &self.features
    }

    fn clock_s(&self, log: usize) -> &[f64] {
        &self.clocks_s[self.parts[log].scenario]
    }

    fn logs(&self) -> &[RecordedLog] {
        &self.logs
    }

    fn residual(&self, rollout: ResidualRequest, step: TimeStep) -> Result<Vec<f64>, WorldError> {
        self.residuals(&[rollout], step).remove(0)
    }

    fn side_by_side(&self) -> usize {
        self.model.side_by_side()
    }

    fn residuals(&self, rollouts: &[ResidualRequest], step: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
        let point = |of: &ResidualRequest| (self.inner(of.u), self.placed(of.u), self.begun_from(of.log, of.moved));
        let points: Vec<(Vec<f64>, Vec<PlacedEffect>, Cow<Scenario>)> = rollouts.iter().map(point).collect();
        let points: Vec<ModelPoint> =
            points.iter().map(|(s, further, situation)| ModelPoint { s, further, situation }).collect();
        let simulated = self.model.rollouts_in(&points, step);
        rollouts.iter().zip(simulated).map(|(of, simulated)| self.against(of.log, &simulated?)).collect()
    }

    fn order(&self) -> i32 {
        self.model.order()
    }

    fn starts(&self, log: usize) -> usize {
        match (self.model.robot.base, self.parts[log].windows.len()) {
            (Base::Fixed, _) => 2 * self.nudged(log).count(),
            (Base::Floating, 0) if self.rests => self.nudged(log).count(),
            // A log too short for a window begins in a state that no joint tells.
            (Base::Floating, 0) => 0,
            (Base::Floating, _) => windows::nudges(self.model.robot.movable().count()),
        }
    }

    fn windows(&self, log: usize) -> Vec<Range<usize>> {
        self.parts[log].windows.clone()
    }

    fn start_spread(&self) -> f64 {
        // Nudges of a free robot are as large as what is not known of it.
        if self.model.robot.base == Base::Fixed { f64::INFINITY } else { 1.0 }
    }

    fn has_contact(&self) -> bool {
        self.model.has_contact()
    }

    fn is_chaotic(&self) -> bool {
        self.parts.iter().any(|part| !part.windows.is_empty())
    }

    fn with_starts_at(&self, u: &[f64]) -> Option<Box<dyn ResidualModel>> {
        if self.model.robot.base == Base::Fixed {
            return None;
        }
        let mut other = self.clone();
        let differs = if self.is_chaotic() {
            let cut = other.cut(u).and_then(|()| other.measure()).and_then(|()| noise_floor::raise(&mut other, u));
            cut.is_ok()
        } else {
            other.rest_otherwise(u).unwrap_or(false)
        };
        differs.then(|| Box::new(other) as Box<dyn ResidualModel>)
    }

    fn with_initial_state(&self, moved: &[(usize, Vec<f64>)]) -> Option<Box<dyn ResidualModel>> {
        Some(Box::new(self.begun_elsewhere(moved)))
    }

    fn beginnings(&self) -> Option<Box<dyn ResidualModel>> {
        if !self.has_contact() || self.is_chaotic() {
            return None;
        }
        let mut other = self.clone();
        other.shorten(BEGINNING).ok()?;
        Some(Box::new(other))
    }

    fn start_near(&self, log: usize, number: usize) -> &[String] {
        match windows::nudged_joint(number, self.model.robot.movable().count()) {
            Some(joint) if !self.parts[log].windows.is_empty() => &self.limbs[joint],
            _ => &[],
        }
    }

    fn near(&self, candidate: usize) -> &[String] {
        &self.near[candidate]
    }

    fn start_open(&self, log: usize) -> Vec<f64> {
        // A free robot's start is seen otherwise.
        let numbers = if self.model.robot.base == Base::Fixed { self.starts(log) } else { 0 };
        (0..numbers).map(|number| OPEN[number % 2]).collect()
    }

    fn begins_with(&self, log: usize) -> usize {
        let same = |other: &usize| self.parts[*other].scenario == self.parts[log].scenario;
        (0..self.parts.len()).find(same).unwrap_or(log)
    }
}

impl IdentificationProblem {
    /// Joints whose start is measured with noise, as indices in the scenario's start, with the noise.
    pub(super) fn nudged(&self, log: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let joints = 0..self.model.scenarios[self.parts[log].scenario].start.len();
        joints.zip(self.model.robot.movable()).filter_map(move |(i, (_, link))| {
            let name = format!("q_{}", link.joint.name);
            Some((i, self.logs[log].channels.iter().find(|channel| channel.name == name)?.sigma))
        })
    }

    /// What was measured in a log less what was simulated, in noise floors.
    pub(super) fn against(&self, log: usize, simulated: &Log) -> Result<Vec<f64>, WorldError> {
        let part = &self.parts[log];
        let recorded = &self.recorded[part.scenario];
        let mut residual = Vec::with_capacity(self.logs[log].channels.len() * recorded.len());
        for channel in &self.logs[log].channels {
            let said = interpolate(simulated.clock_s(), simulated.values(&channel.name)?, recorded.clock_s());
            let pairs = recorded.values(&channel.name)?.iter().zip(said).enumerate();
            let error = |(i, (measured, said)): (usize, (&f64, f64))| {
                if part.has(i) { (measured - said) / channel.sigma } else { f64::NAN }
            };
            residual.extend(pairs.map(error));
        }
        Ok(residual)
    }
}
