//! What is said of a finding of a diagnosis.

use crate::text::findings;
use btr_identify::diagnose::thresholds::{CONSIDERABLE, NEGLIGIBLE, STABLE};
use btr_identify::diagnose::{CapReason, RivalProbability};
use btr_lab::verbs::{DiagnoseReport, Support};

/// What speaks for a finding besides its fit. `fell` says by how much the error fell with it, which is told where that
/// is a small share of a much larger one.
pub fn evidence(support: &Support, fell: Option<&str>) -> String {
    let Support { share, learnt_share, logs_better: [better, of], leave_one_out_change, in_own_channel, .. } = support;
    let in_channel = if *in_own_channel { " of its joint's torque" } else { "" };
    let of_error = format!("of the squared error{in_channel} above the noise");
    let held_out = percent(*share);
    let explains = match learnt_share.map(percent) {
        Some(learnt) if learnt == held_out => format!("{learnt} {of_error} on training and held-out logs alike"),
        Some(learnt) => format!("{learnt} {of_error} on the training logs, and {held_out} on the held-out logs"),
        None => format!("{held_out} {of_error}"),
    };
    let little = !in_own_channel && share.max(learnt_share.unwrap_or(0.0)) < NEGLIGIBLE;
    let fell = fell.filter(|_| little).map_or_else(String::new, |fell| format!("; with it, the error fell {fell}"));
    let hardly = if learnt_share.is_some_and(|learnt| *share < CONSIDERABLE && learnt > CONSIDERABLE) {
        ", which hardly show it"
    } else {
        ""
    };
    let mut by = format!("it explains {explains}{hardly}{fell}; the error falls in {better} of {of} logs");
    if let (Some(change), Some(log)) = (leave_one_out_change, &support.leave_one_out_log) {
        let percent = (100.0 * change).ceil();
        by += &match change {
            change if *change <= STABLE => {
                format!("; leaving out any one training log changes its size by at most {percent:.0} %")
            }
            change if *change < 1.0 => format!("; without {log}, its size changes by {percent:.0} %"),
            _ => format!("; without {log}, its size would be unknown"),
        };
    }
    if support.established { by } else { format!("{by}: not established, it may stand in for something else") }
}

/// "helps but does not", of one finding or more.
pub fn helps(report: &DiagnoseReport) -> &'static str {
    let (effects, values) = findings(report);
    if effects.len() + values.len() == 1 { "helps but does not" } else { "help but do not" }
}

/// A share in percent.
fn percent(share: f64) -> String {
    match 100.0 * share {
        percent if percent > 0.0 && percent < 0.5 => "less than 1 %".to_owned(),
        percent => format!("{percent:.0} %"),
    }
}

/// The probability of a finding, as a bound where it is one.
pub fn likelihood(support: &Support) -> String {
    match &support.probability_cap {
        Some(cap) if support.probability >= REACHED * cap.at_most => format!("at most {:.2}", cap.at_most),
        _ => probability(support.probability),
    }
}

/// A probability of more than this share of its cap is as large as it can be.
const REACHED: f64 = 0.99;

/// Why a probability is not larger, whatever the rivals.
pub fn capped(support: &Support) -> Option<String> {
    let cap = support.probability_cap.as_ref()?;
    let log = support.leave_one_out_log.as_deref().unwrap_or("one of the logs");
    let reason = |reason: &CapReason| match reason {
        CapReason::UnstableSize => format!("its size changes by more than half without {log}"),
        CapReason::Series => {
            "together with what is found beside it, it can follow nearly any law of this joint".to_owned()
        }
        CapReason::SamePlace => "one cause that btr does not know may be behind all that is found here".to_owned(),
        CapReason::UncertainSize => "these logs do not tell its size from none beside the others".to_owned(),
        CapReason::LittleExplained => "two simulators of one robot differ by as much as it explains".to_owned(),
        CapReason::ParameterAtBound => "a free parameter ended at its bound (listed below)".to_owned(),
        CapReason::ErrorLeft => "an error is left, and another cause may be behind all of it".to_owned(),
        CapReason::LeftOver => "something is left for certain that it does not explain".to_owned(),
    };
    let reasons: Vec<String> = cap.reasons.iter().map(reason).collect();
    Some(format!("at most {:.2}: {}", cap.at_most, reasons.join("; and ")))
}

/// The most rivals that are told.
const RIVALS: usize = 5;

/// Who has the rest of a finding's probability, where that is known.
pub fn rivals(support: &Support) -> Option<String> {
    let name = |rival: &RivalProbability| rival.name.clone().unwrap_or_else(|| "the model without it".to_owned());
    let told = |rival: &RivalProbability| format!("{} {}", name(rival), probability(rival.probability));
    let mut told: Vec<String> = support.rivals.iter().map(told).collect();
    let more = told.len().saturating_sub(RIVALS);
    told.truncate(RIVALS);
    if more > 0 {
        told.push(format!("{more} more"));
    }
    (!told.is_empty()).then(|| format!("the rest of the probability: {}", told.join(", ")))
}

/// What a probability means.
pub const PROBABILITY: &str = "probability: how likely this name is the right one of all that were fitted; in the benchmark, \
                               99 % of the names with 0.99 or more were right (docs/reliability.md)";

/// A probability with two digits, never certain.
pub fn probability(p: f64) -> String {
    match p {
        p if p > 0.99 => ">0.99".to_owned(),
        p if p < 0.01 => "<0.01".to_owned(),
        p => format!("{p:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use btr_identify::diagnose::ProbabilityCap;

    fn support(share: f64, learnt_share: Option<f64>) -> Support {
        Support {
            alike: Vec::new(),
            probability: 0.9,
            probability_cap: None,
            rivals: Vec::new(),
            delta_bic: 34_122.0,
            share,
            learnt_share,
            in_own_channel: false,
            logs_better: [3, 3],
            leave_one_out_change: Some(0.012),
            leave_one_out_log: Some("learn_1.csv".to_owned()),
            established: true,
        }
    }

    #[test]
    fn each_share_says_of_which_logs_it_is() {
        let stable = "the error falls in 3 of 3 logs; leaving out any one training log changes its size by at most 2 %";
        let said = |share, learnt_share| evidence(&support(share, learnt_share), Some("from 1.34 to 1.01"));
        let of = "of the squared error above the noise";
        assert_eq!(said(0.97, None), format!("it explains 97 % {of}; {stable}"));
        assert_eq!(
            said(0.97, Some(0.971)),
            format!("it explains 97 % {of} on training and held-out logs alike; {stable}")
        );
        let hardly = "and less than 1 % on the held-out logs, which hardly show it";
        assert_eq!(said(0.002, Some(0.96)), format!("it explains 96 % {of} on the training logs, {hardly}; {stable}"));
        let fell = "; with it, the error fell from 1.34 to 1.01";
        assert_eq!(said(0.001, None), format!("it explains less than 1 % {of}{fell}; {stable}"));
    }

    #[test]
    fn a_capped_probability_is_told_as_a_bound_with_its_reason() {
        let unstable = Support {
            probability_cap: Some(ProbabilityCap { at_most: 0.9, reasons: vec![CapReason::UnstableSize] }),
            leave_one_out_change: Some(0.7),
            ..support(1.0, None)
        };
        assert_eq!(likelihood(&unstable), "at most 0.90");
        let why = "at most 0.90: its size changes by more than half without learn_1.csv";
        assert_eq!(capped(&unstable).as_deref(), Some(why));
        assert!(
            evidence(&unstable, None).ends_with("; without learn_1.csv, its size changes by 70 %"),
            "{}",
            evidence(&unstable, None)
        );
        // What rivals leave of it is no bound.
        assert_eq!(likelihood(&Support { probability: 0.5, ..unstable }), "0.50");
        let sure = Support { probability: 0.9998, ..support(1.0, None) };
        assert_eq!((likelihood(&sure), capped(&sure)), (">0.99".to_owned(), None));
    }

    #[test]
    fn the_rest_of_a_probability_is_told_with_who_has_it() {
        let rival = |name: Option<&str>, probability| RivalProbability { name: name.map(str::to_owned), probability };
        let rivals_of = |of: Vec<RivalProbability>| rivals(&Support { rivals: of, ..support(1.0, None) });
        assert_eq!(rivals_of(Vec::new()), None);
        let two = vec![rival(Some("backlash@elbow"), 0.31), rival(None, 0.02)];
        let told = "the rest of the probability: backlash@elbow 0.31, the model without it 0.02";
        assert_eq!(rivals_of(two).as_deref(), Some(told));
        let many = (0..7).map(|_| rival(Some("a@b"), 0.1)).collect();
        assert!(rivals_of(many).is_some_and(|told| told.ends_with("a@b 0.10, 2 more")));
    }
}
