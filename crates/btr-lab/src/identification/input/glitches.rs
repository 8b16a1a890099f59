//! What is told of glitches that only show beside a fitted model.

use super::{Doubt, VerbInput};
use btr_identify::fit::{NOISE, RemainingError};
use btr_identify::quality::{GlitchReport, glitch_findings};
use serde::Serialize;

/// A glitch that a fitted model shows, in the samples and the time of its log's file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FittedGlitch {
    /// The log's path.
    pub log: String,
    /// The glitch.
    #[serde(flatten)]
    pub glitch: GlitchReport,
}

impl VerbInput {
    /// The glitches that showed beside fitted models, each with its log in the residual model.
    pub(crate) fn in_files(&self, found: &[(usize, GlitchReport)]) -> Vec<FittedGlitch> {
        let in_file = |(log, glitch): &(usize, GlitchReport)| {
            let place = self.places.get(self.problem.scenario(*log))?;
            Some(FittedGlitch { log: place.file.clone(), glitch: glitch.clone().later(place.first, place.begins_s) })
        };
        let mut all: Vec<FittedGlitch> = found.iter().filter_map(in_file).collect();
        all.sort_by(|a, b| {
            let key = |of: &FittedGlitch| (of.log.clone(), of.glitch.channel.clone(), of.glitch.sample);
            key(a).cmp(&key(b))
        });
        all
    }

    /// The doubts about the logs, and those that these glitches add; without those that a model dispels which leaves
    /// this in each channel.
    pub(crate) fn doubts_with(&self, glitches: &[FittedGlitch], left: &[RemainingError]) -> Vec<Doubt> {
        let of_log = |of: &[FittedGlitch]| {
            let log = of[0].log.clone();
            let samples = self.places.iter().find(|place| place.file == log).map_or(0, |place| place.samples);
            let found: Vec<GlitchReport> = of.iter().map(|of| of.glitch.clone()).collect();
            let findings = glitch_findings(&found, samples, " beside the fitted model").into_iter();
            findings.map(move |finding| Doubt { log: log.clone(), finding }).collect::<Vec<_>>()
        };
        let further = glitches.chunk_by(|a, b| a.log == b.log).flat_map(of_log);
        let explained = |joint: &str| {
            let channel = format!("q_{joint}");
            left.iter()
                .any(|left| left.channel == channel && left.x_repeatability.unwrap_or(left.x_noise_floor) <= NOISE)
        };
        self.doubts.iter().filter(|doubt| !doubt.is_dispelled(explained)).cloned().chain(further).collect()
    }
}
