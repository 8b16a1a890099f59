//! What is told of a log's glitches: one sentence for those that share a fate.

use super::glitches::MOST;
use super::report::{Finding, GlitchReport, Severity, Topic};
use btr_core::signal::glitch::GlitchKind;

/// The kinds in words.
const KINDS: [(GlitchKind, &str); 4] = [
    (GlitchKind::WrapAround, "off by full turns"),
    (GlitchKind::Zero, "exactly zero"),
    (GlitchKind::Stuck, "stuck at the reading before"),
    (GlitchKind::Spike, "at another value"),
];
const LOST: &str = "from lost messages, which repeat all joints' positions";

/// The findings about the glitches of a log of so many samples, one for each fate. `beside` says what they show beside,
/// if not in the readings alone.
pub fn glitch_findings(found: &[GlitchReport], of: usize, beside: &str) -> Vec<Finding> {
    let by_channel = |these: Vec<&'_ GlitchReport>| -> Vec<Vec<GlitchReport>> {
        these.chunk_by(|a, b| a.channel == b.channel).map(|chunk| chunk.iter().copied().cloned().collect()).collect()
    };
    // Those that show beside a model come after those that the readings show.
    let first = |glitch: &GlitchReport| found.iter().position(|other| other.channel == glitch.channel);
    let mut sorted: Vec<&GlitchReport> = found.iter().collect();
    sorted.sort_by_key(|glitch| (first(glitch), glitch.sample));
    let (left_out, kept): (Vec<_>, Vec<_>) = sorted.into_iter().partition(|glitch| glitch.left_out);
    let is_too_much = |channel: &Vec<GlitchReport>| samples(channel) as f64 > MOST * of as f64;
    let (too_many, kept): (Vec<_>, Vec<_>) = by_channel(kept).into_iter().partition(is_too_much);
    let slow = "too many to leave out, and kept: does the sensor read more slowly than it is logged?";
    let fates = [(by_channel(left_out), "left out"), (too_many, slow), (kept, "kept")];
    let told = fates.into_iter().filter(|(channels, _)| !channels.is_empty());
    told.map(|(channels, fate)| finding(&channels, fate, beside)).collect()
}

fn finding(channels: &[Vec<GlitchReport>], fate: &str, beside: &str) -> Finding {
    let wrong: usize = channels.iter().map(|channel| samples(channel)).sum();
    let (readings, they) = if wrong == 1 { ("reading", "it is") } else { ("readings", "they are") };
    let each: Vec<String> = channels.iter().map(|channel| of_channel(channel)).collect();
    let sentence = format!("{wrong} {readings} that no motion explains{beside}: {}; {they} {fate}", each.join("; "));
    let channel = if channels.len() == 1 { channels[0][0].channel.as_str() } else { "" };
    Finding::new(Topic::Glitches, Severity::Doubtful, channel, sentence)
}

/// How many readings of a channel are of which kind, and the first of them.
fn of_channel(found: &[GlitchReport]) -> String {
    let counted = |is: &dyn Fn(&GlitchReport) -> bool, what: &str| {
        let count: usize = found.iter().filter(|glitch| is(glitch)).map(|glitch| glitch.samples).sum();
        (count > 0).then(|| format!("{count} {what}"))
    };
    let alone = |(kind, what): (GlitchKind, &str)| counted(&|it| !it.lost_message && it.kind == kind, what);
    let kinds: Vec<String> =
        KINDS.into_iter().filter_map(alone).chain(counted(&|glitch| glitch.lost_message, LOST)).collect();
    let GlitchReport { channel, sample, time_s, value, expected, .. } = &found[0];
    let first = if samples(found) == 1 { "" } else { "the first is " };
    let at = format!("{first}sample {sample} at {time_s:.3} s: {value:.5} instead of {expected:.5}");
    format!("{channel} {} ({at})", kinds.join(", "))
}

fn samples(found: &[GlitchReport]) -> usize {
    found.iter().map(|glitch| glitch.samples).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn glitch(channel: &str, kind: GlitchKind, sample: usize, left_out: bool) -> GlitchReport {
        GlitchReport {
            channel: channel.to_owned(),
            kind,
            sample,
            samples: 2,
            time_s: 0.01 * sample as f64,
            value: 0.0,
            expected: 0.5,
            lost_message: false,
            left_out,
        }
    }

    #[test]
    fn one_sentence_tells_all_that_is_left_out_with_kinds_and_samples() {
        let all = [
            glitch("q_hip", GlitchKind::Spike, 90, true),
            glitch("q_knee", GlitchKind::Stuck, 7, true),
            glitch("q_hip", GlitchKind::Zero, 41, true),
        ];
        let found = glitch_findings(&all, 1000, "");
        assert_eq!((found.len(), found[0].channel.as_str()), (1, ""));
        assert_eq!(
            found[0].sentence,
            "6 readings that no motion explains: q_hip 2 exactly zero, 2 at another value (the first is sample 41 at \
             0.410 s: 0.00000 instead of 0.50000); q_knee 2 stuck at the reading before (the first is sample 7 at \
             0.070 s: 0.00000 instead of 0.50000); they are left out"
        );
        let kept = glitch_findings(&[all[2].clone(), glitch("q_knee", GlitchKind::Spike, 3, false)], 1000, "");
        assert_eq!(kept.iter().map(|finding| finding.channel.as_str()).collect::<Vec<_>>(), ["q_hip", "q_knee"]);
    }
}
