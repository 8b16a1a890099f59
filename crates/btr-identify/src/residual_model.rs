//! What fits and diagnoses work on: a family of simulations beside measurements.
//!
//! A simulator is a family of worlds indexed by numbers. Some of them are in doubt from the beginning (masses, gains), others
//! belong to effects that may be missing and are *off* as long as nobody says otherwise. Both are [`FitParameter`]s of one vector in
//! normalised coordinates: 0 is the model as it stands, 1 is a typical deviation.

pub use btr_core::world::TimeStep;
use btr_core::world::WorldError;
use std::ops::Range;

/// The most by which a number is multiplied (as a logarithm) rather than added to.
const MULTIPLIED: f64 = 0.5;

/// How a knob's coordinate becomes its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parametrisation {
    /// value = origin + size·u.
    Linear,
    /// value = origin·exp(size·u).
    Exponential,
    /// value = size/u: infinite, which is off, at u = 0.
    Inverse,
}

/// A number that may be varied.
#[derive(Clone, Debug, PartialEq)]
pub struct FitParameter {
    /// Unique in its family: `mass@thigh`, `coulomb_friction.torque@knee`.
    pub name: String,
    /// SI unit as text.
    pub unit: String,
    /// The value at u = 0.
    pub origin: f64,
    /// A typical deviation; see [`Parametrisation`].
    pub size: f64,
    /// From the coordinate to the value.
    pub law: Parametrisation,
    /// Least and greatest coordinate.
    pub bounds: (f64, f64),
    /// How far from 0 the coordinate is expected to be (a standard deviation).
    pub spread: f64,
    /// Reach of a finite difference.
    pub reach: f64,
    /// Whether it switches something on that is off at 0.
    pub amplitude: bool,
}

impl FitParameter {
    /// The value at a coordinate.
    pub fn value(&self, u: f64) -> f64 {
        match self.law {
            Parametrisation::Linear => self.origin + self.size * u,
            Parametrisation::Exponential => self.origin * (self.size * u).exp(),
            Parametrisation::Inverse => self.size / u,
        }
    }

    /// The coordinate of a value.
    pub fn coordinate(&self, value: f64) -> f64 {
        match self.law {
            Parametrisation::Linear => (value - self.origin) / self.size,
            Parametrisation::Exponential => (value / self.origin).ln() / self.size,
            Parametrisation::Inverse => self.size / value,
        }
    }

    /// d value / d u.
    pub fn slope(&self, u: f64) -> f64 {
        match self.law {
            Parametrisation::Linear => self.size,
            Parametrisation::Exponential => self.size * self.value(u),
            Parametrisation::Inverse => -self.size / (u * u),
        }
    }

    /// Whether a factor of e more or less is to be expected of it.
    pub fn is_of_any_magnitude(&self) -> bool {
        self.law == Parametrisation::Exponential && self.size * self.spread > 1.0
    }

    /// d ln(value) / d u: infinite, or not a number, where the value is 0 or off.
    pub fn growth(&self, u: f64) -> f64 {
        self.slope(u) / self.value(u)
    }

    /// Whether it is measured in units of mass, as forces, stiffnesses and inertias are.
    pub fn scales_with_mass(&self) -> bool {
        self.unit.contains("kg") || self.unit.starts_with('N')
    }

    /// The coordinate so far along a direction, within the bounds. A limit that is on is multiplied, as what moves
    /// exponentially is.
    pub fn along(&self, u: f64, by: f64) -> f64 {
        let on = self.law == Parametrisation::Inverse && u > 0.0;
        self.clamp(if on { u * (by / u).exp() } else { u + by })
    }

    /// The same where what moves linearly is multiplied as well, if that is a small part of it: so a common factor of
    /// masses, gains, limits and friction is a straight line.
    pub fn in_proportion(&self, u: f64, by: f64) -> f64 {
        let growth = self.growth(u);
        let multiplied = self.law == Parametrisation::Linear && (by * growth).abs() <= MULTIPLIED;
        if multiplied && growth != 0.0 { self.clamp(u + (by * growth).exp_m1() / growth) } else { self.along(u, by) }
    }

    /// A coordinate within the bounds.
    pub fn clamp(&self, u: f64) -> f64 {
        u.clamp(self.bounds.0, self.bounds.1)
    }
}

/// An effect at a site that the model may lack.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectCandidate {
    /// The effect.
    pub effect: String,
    /// Where it would sit.
    pub site: String,
    /// Its amplitudes: off at 0.
    pub amplitudes: Vec<usize>,
    /// Knobs that only shape it.
    pub shapes: Vec<usize>,
    /// Coordinates of the shapes from which it is worth trying, for each start one per shape. At least one, perhaps empty.
    pub starts: Vec<Vec<f64>>,
    /// Candidates at the same place that look alike, as indices.
    pub similar: Vec<usize>,
    /// Those of them that it becomes for some values of its numbers.
    pub nested: Vec<usize>,
}

impl EffectCandidate {
    /// `effect@site`.
    pub fn name(&self) -> String {
        format!("{}@{}", self.effect, self.site)
    }

    /// All its knobs.
    pub fn parameters(&self) -> impl Iterator<Item = usize> + '_ {
        self.amplitudes.iter().chain(&self.shapes).copied()
    }
}

/// A term that laws are made of: tried where no effect explains the error.
#[derive(Clone, Debug, PartialEq)]
pub struct LawTerm {
    /// What it acts on at its site; the terms of a law act on the same.
    pub on: String,
    /// Its knobs and site, as those of an effect.
    pub term: EffectCandidate,
    /// For a term that swings with time: the index of the same term without it. Its only shape is the rate, and has no
    /// starts: the error tells.
    pub swings: Option<usize>,
}

/// A measured channel of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredChannel {
    /// The channel's name in the log.
    pub name: String,
    /// SI unit as text.
    pub unit: String,
    /// Standard deviation of the sensor's error, quantisation included: the noise floor, in the channel's unit.
    pub sigma: f64,
    /// Its samples in the log's residual.
    pub samples: Range<usize>,
}

/// A log to learn from or to judge on.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedLog {
    /// What it is called in reports.
    pub name: String,
    /// Whether nothing may be fitted to it.
    pub held_out: bool,
    /// What was measured.
    pub channels: Vec<MeasuredChannel>,
    /// How many samples of all channels are there and count.
    pub present: usize,
}

impl RecordedLog {
    /// Length of its residual.
    pub fn rows(&self) -> usize {
        self.channels.last().map_or(0, |channel| channel.samples.end)
    }
}

/// A simulation that is put beside a log.
#[derive(Clone, Copy, Debug)]
pub struct ResidualRequest<'a> {
    /// One coordinate per knob.
    pub u: &'a [f64],
    /// Which log.
    pub log: usize,
    /// By how much each number of the log's start is moved, in all windows at once, in units of what noise could hide. Empty
    /// where it begins as it seems to.
    pub moved: &'a [f64],
}

impl<'a> ResidualRequest<'a> {
    /// From where the log seems to begin.
    pub fn of(u: &'a [f64], log: usize) -> Self {
        ResidualRequest { u, log, moved: &[] }
    }
}

/// A family of simulations beside measurements.
pub trait ResidualModel: Send + Sync {
    /// Everything that may be varied.
    fn parameters(&self) -> &[FitParameter];
    /// The knobs that are in doubt from the beginning.
    fn free(&self) -> &[usize];
    /// Effects that may be missing.
    fn candidates(&self) -> &[EffectCandidate];
    /// Terms of laws, those of one place (site, and what they act on) one after the other.
    fn features(&self) -> &[LawTerm] {
        &[]
    }
    /// The clock of a log's channels, in s from where laws count time.
    fn clock_s(&self, _log: usize) -> &[f64] {
        &[]
    }
    /// The logs; those to learn from first.
    fn logs(&self) -> &[RecordedLog];
    /// (measured − simulated)/sigma for one log, all its channels one after the other; NaN where nothing was measured. The same
    /// arguments give the same bits.
    ///
    /// # Errors
    /// A simulation that blew up.
    fn residual(&self, rollout: ResidualRequest, step: TimeStep) -> Result<Vec<f64>, WorldError>;
    /// How many are best asked for at once.
    fn side_by_side(&self) -> usize {
        1
    }
    /// What [`residual`](Self::residual) gives for each, bit by bit; they may be simulated side by side.
    fn residuals(&self, rollouts: &[ResidualRequest], step: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
        rollouts.iter().map(|rollout| self.residual(*rollout, step)).collect()
    }
    /// With which power of the step its error falls.
    fn order(&self) -> i32 {
        1
    }
    /// How many numbers tell in which state a log begins, beyond what is known of it for sure.
    fn starts(&self, _log: usize) -> usize {
        0
    }
    /// Samples of every channel that follow from one start and no other; none where all of a log does. Those that belong to no
    /// start have no part in this.
    fn windows(&self, _log: usize) -> Vec<Range<usize>> {
        Vec::new()
    }
    /// Whether it touches the world, so that effects may show on one side of zero and not on the other.
    fn has_contact(&self) -> bool {
        false
    }
    /// Whether small errors grow, as with contact. Then half the step does not tell what no step at all would do: the
    /// noise floors must have the integrator's own error in them.
    fn is_chaotic(&self) -> bool {
        false
    }
    /// The same family as it is seen from a point: what only a model can tell of the logs' starts, and its noise floors, as the
    /// model there has them. None where they do not depend on it, or starts are looked for number by number
    /// ([`start_open`](Self::start_open)).
    fn with_starts_at(&self, _u: &[f64]) -> Option<Box<dyn ResidualModel>> {
        None
    }
    /// The same family where some logs begin elsewhere, and others with them ([`begins_with`](Self::begins_with)): by how much
    /// each number of their starts is moved, as in [`ResidualRequest`]. None where logs cannot.
    fn with_initial_state(&self, _moved: &[(usize, Vec<f64>)]) -> Option<Box<dyn ResidualModel>> {
        None
    }
    /// The same family where only the beginnings of logs count: what tips onto other feet moves on in ways that no
    /// probe around the model foretells, but why it tips shows before it does. None where the whole of a log follows
    /// from its beginning smoothly.
    fn beginnings(&self) -> Option<Box<dyn ResidualModel>> {
        None
    }
    /// Names of the channels in which one of those numbers is felt; none where it is felt everywhere.
    fn start_near(&self, _log: usize, _number: usize) -> &[String] {
        &[]
    }
    /// Names of the channels in which a candidate is felt before all others; none where it is felt everywhere. At a
    /// first glance, candidates that are felt in different channels are tried together.
    fn near(&self, _candidate: usize) -> &[String] {
        &[]
    }
    /// The standard deviation of what is known of those numbers, in units of what a [`ResidualRequest`] moves them by; infinite where
    /// nothing is.
    fn start_spread(&self) -> f64 {
        f64::INFINITY
    }
    /// How far from where a log seems to begin each of those numbers is looked for: standard deviations in the same units. None
    /// where they are not looked for.
    fn start_open(&self, _log: usize) -> Vec<f64> {
        Vec::new()
    }
    /// The log that tells where this one begins: an earlier part of the same recording, or itself.
    fn begins_with(&self, log: usize) -> usize {
        log
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::parameter;

    #[test]
    fn a_limit_keeps_its_proportion_to_a_mass() {
        let (mass, limit) = (
            parameter(Parametrisation::Exponential, 2.0, 0.1),
            parameter(Parametrisation::Inverse, f64::INFINITY, 3.0),
        );
        // To first order, a tenth more of the mass is a tenth less of the limit's coordinate.
        let proportion = |by: f64| mass.value(mass.along(0.0, by)) / limit.value(limit.along(0.6, -0.06 * by));
        assert!((proportion(4.0) / proportion(0.0) - 1.0).abs() < 1e-12);
        assert!(limit.along(0.6, -5.0) > 0.0, "a limit does not go past infinity");
        assert!(limit.along(0.0, 0.5) > 0.4, "a limit that is off can come on");
    }

    #[test]
    fn a_friction_keeps_its_proportion_to_a_mass() {
        for friction in [
            parameter(Parametrisation::Linear, 0.0, 0.3),
            parameter(Parametrisation::Linear, -0.1, 0.3),
            parameter(Parametrisation::Linear, 0.0, -0.3),
        ] {
            let mass = parameter(Parametrisation::Exponential, 2.0, 0.1);
            let along = |by: f64| friction.in_proportion(1.4, by * mass.growth(0.0) / friction.growth(1.4));
            let proportion = |by: f64| mass.value(mass.in_proportion(0.0, by)) / friction.value(along(by));
            assert!((proportion(4.0) / proportion(0.0) - 1.0).abs() < 1e-12);
            // What is hardly there, or not at all, is not multiplied.
            assert!((friction.in_proportion(1.4, -1.6) - (1.4 - 1.6)).abs() < 1e-12);
        }
        assert!((parameter(Parametrisation::Linear, 0.0, 0.3).in_proportion(0.0, 0.5) - 0.5).abs() < 1e-12);
    }
}
