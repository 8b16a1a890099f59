//! Everything about a residual model that does not have to be simulated.

use super::candidate::{EffectCandidate, LawTerm};
use super::log::{LogStart, RecordedLog};
use super::parameter::FitParameter;
use crate::quality::GlitchReport;
use std::sync::Arc;

/// Largest error, in multiples of the noise floor, of a residual that counts as noise. Above it the residual has
/// structure, and intervals would be too narrow.
pub const NOISE: f64 = 1.15;

/// What acts in one joint of a prescribed motion, and depends on the motion alone: its torques are added to what the
/// links require. Parameters are indices.
#[derive(Clone, Debug, PartialEq)]
pub struct JointLaws {
    /// Names of the channels in which they show.
    pub channels: Vec<String>,
    /// Parameters to which the residual is proportional, while none of `together` differs from 0.
    pub proportional: Vec<ProportionalParameter>,
    /// Amplitudes of laws that are not proportional to them, or that depend on the joint's other laws.
    pub together: Vec<usize>,
    /// Parameters that, where they are not 0, make the joint's torque depend on more than the motion.
    pub unless: Arc<[usize]>,
    /// All parameters of these laws.
    pub parameters: Vec<usize>,
}

/// A parameter to which a residual is proportional.
#[derive(Clone, Debug, PartialEq)]
pub struct ProportionalParameter {
    /// The parameter, as an index.
    pub parameter: usize,
    /// Parameters that shape its response. They do nothing where it, and all others that they shape, are 0.
    pub shapes: Vec<usize>,
}

/// The parameters, candidates and logs of a residual model, and how to simulate it.
///
/// [`new`](Self::new) describes a smooth model without effect candidates whose logs begin in a known state; set the
/// other fields where that is not so.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelDescription {
    /// All parameters. A point of the model has one coordinate per parameter.
    pub parameters: Vec<FitParameter>,
    /// Indices of the parameters that are fitted from the beginning.
    pub free: Vec<usize>,
    /// Effects that may be missing.
    pub candidates: Vec<EffectCandidate>,
    /// For each candidate, names of the channels that it mainly affects; empty where it affects all. The first
    /// screening tries candidates that affect different channels in one rollout.
    pub candidate_channels: Vec<Vec<String>>,
    /// Parameters that show in the channels of one limb alone, and these channels, where limbs on a held base do not
    /// act on each other. Changes in different limbs share a rollout.
    pub limb_parameters: Vec<(usize, Vec<String>)>,
    /// Parameters that, where they are not 0, let limbs act on each other.
    pub joining: Vec<usize>,
    /// What acts in the joints of a prescribed motion, joint by joint; see [`ResidualModel::joint_parts`].
    ///
    /// [`ResidualModel::joint_parts`]: super::ResidualModel::joint_parts
    pub joint_laws: Vec<JointLaws>,
    /// Parameters that change the robot's inertias alone, as [`ResidualModel::inertias`] gives them.
    ///
    /// [`ResidualModel::inertias`]: super::ResidualModel::inertias
    pub inertial: Vec<usize>,
    /// Parameters that, where they are not 0, change how the residual depends on inertias.
    pub inertial_unless: Vec<usize>,
    /// Terms of laws. Those with the same site and the same quantity are adjacent.
    pub law_terms: Vec<LawTerm>,
    /// The logs; training logs first.
    pub logs: Vec<RecordedLog>,
    /// For each log, the clock of its channels, in s from where laws count time.
    pub clocks_s: Vec<Vec<f64>>,
    /// For each log, the measured values in the rows of its residual, in the channels' units; empty where unknown.
    pub measured: Vec<Vec<f64>>,
    /// Glitches that showed beside the model at another point and are left out, each with its log; see
    /// [`Derivation::WithoutGlitchesAt`](super::Derivation::WithoutGlitchesAt).
    pub glitches: Vec<(usize, GlitchReport)>,
    /// For each log, how it begins.
    pub starts: Vec<LogStart>,
    /// Standard deviation of the prior of the numbers of all starts, in units of
    /// [`ResidualRequest::moved`](super::ResidualRequest::moved); infinite without a prior.
    pub start_spread: f64,
    /// Best number of requests per call of [`residuals`](super::ResidualModel::residuals).
    pub batch_size: usize,
    /// Order of the integrator: its error falls with this power of the time step.
    pub order: i32,
    /// Whether the robot touches the world, so that effects may show on one side of zero and not on the other.
    pub has_contact: bool,
    /// Whether small errors grow, as with contact. Then results with half the time step cannot be extrapolated to a
    /// step of zero, and the noise floors must include the integrator's error.
    pub is_chaotic: bool,
    /// Whether the motion is prescribed, so that what acts in a joint shows in that joint's channel alone.
    pub is_decoupled: bool,
    /// Whether what differs from run to run counts as noise, so that a log is one draw of it: the uncertainty of
    /// estimates is then taken from the differences between logs as well.
    pub has_runs: bool,
    /// Largest error of a model without a fault, as a root mean square of residuals: [`NOISE`](crate::fit::NOISE), or
    /// more where the spread of runs is only roughly known.
    pub noise_bound: f64,
}

impl ModelDescription {
    /// A smooth model with these parameters, all of them free, and these logs, which begin in a known state.
    pub fn new(parameters: Vec<FitParameter>, logs: Vec<RecordedLog>) -> Self {
        let start = |log| LogStart { begins_with: log, ..LogStart::default() };
        ModelDescription {
            free: (0..parameters.len()).collect(),
            parameters,
            candidates: Vec::new(),
            candidate_channels: Vec::new(),
            limb_parameters: Vec::new(),
            joining: Vec::new(),
            joint_laws: Vec::new(),
            inertial: Vec::new(),
            inertial_unless: Vec::new(),
            law_terms: Vec::new(),
            clocks_s: vec![Vec::new(); logs.len()],
            measured: vec![Vec::new(); logs.len()],
            glitches: Vec::new(),
            starts: (0..logs.len()).map(start).collect(),
            logs,
            start_spread: f64::INFINITY,
            batch_size: 1,
            order: 1,
            has_contact: false,
            is_chaotic: false,
            is_decoupled: false,
            has_runs: false,
            noise_bound: NOISE,
        }
    }

    /// Names of the channels that a candidate mainly affects; empty where it affects all.
    pub fn channels_of(&self, candidate: usize) -> &[String] {
        self.candidate_channels.get(candidate).map_or(&[], Vec::as_slice)
    }
}
