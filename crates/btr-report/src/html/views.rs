//! A joint in one log: its measured position and simulations of it.

use crate::plot::{Ink, Series, ShownState};
use btr_identify::compare::{ChannelResidual, Comparison, JointTrack};

/// Maximum number of points of a line or a scatter plot.
pub(super) const FINE: usize = 1200;

/// A joint in one log.
pub(super) struct JointView<'a> {
    pub(super) log: usize,
    pub(super) name: &'a str,
    pub(super) measured: &'a [f64],
    pub(super) before: Option<SimulatedJoint<'a>>,
    /// On the way from the one before to the one after, with their names.
    pub(super) between: Vec<(&'a str, SimulatedJoint<'a>)>,
    pub(super) after: SimulatedJoint<'a>,
}

/// A simulation of a joint in one log.
pub(super) struct SimulatedJoint<'a> {
    pub(super) track: &'a JointTrack,
    pub(super) residual: &'a ChannelResidual,
}

impl<'a> SimulatedJoint<'a> {
    pub(super) fn of(comparison: &'a Comparison, log: usize, joint: &str) -> Option<Self> {
        let channel = format!("q_{joint}");
        let track = comparison.tracks.iter().find(|track| track.log == log && track.joint == joint)?;
        let residual = comparison.residuals.iter().find(|r| r.log == log && r.channel == channel)?;
        Some(SimulatedJoint { track, residual })
    }

    pub(super) fn chi(&self) -> f64 {
        let finite = self.track.error.iter().filter(|e| e.is_finite());
        let (n, sum) = finite.fold((0.0, 0.0), |(n, sum), e| (n + 1.0, sum + e * e));
        sum / (n * self.track.floor.powi(2))
    }
}

impl<'a> JointView<'a> {
    /// The simulations with their names and inks, the latest last. A single one is named `alone`.
    pub(super) fn versions(&self, alone: &'a str) -> Vec<(&'a str, Ink, &SimulatedJoint<'a>)> {
        match &self.before {
            None => vec![(alone, Ink::Main, &self.after)],
            Some(before) => vec![("before", Ink::Third, before), ("after", Ink::Main, &self.after)],
        }
    }

    /// A series for each simulation, in the order of the player's states. Those between are hidden until one is chosen.
    pub(super) fn series(&self, alone: &str, draw: impl Fn(&SimulatedJoint, &str, Ink) -> Series) -> Vec<Series> {
        let Some(before) = &self.before else { return vec![draw(&self.after, alone, Ink::Main)] };
        let between = self.between.iter().map(|(name, joint)| (joint, *name, Ink::Fourth));
        let all = std::iter::once((before, "before", Ink::Third)).chain(between);
        let all = all.chain([(&self.after, "after", Ink::Main)]).enumerate();
        all.map(|(number, (joint, name, ink))| {
            let state = ShownState { number, hidden: ink == Ink::Fourth };
            Series { state: Some(state), ..draw(joint, name, ink) }
        })
        .collect()
    }

    pub(super) fn unit(&self) -> &str {
        &self.after.residual.unit
    }
}
