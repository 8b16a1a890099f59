//! What a run comes to, in sentences: for the terminal, for the run's page and for its document.

use super::augment::Cause;
use super::report::{ByDistance, LogScore, RunReport};
use crate::digits::{maybe, number, span};
use btr_core::coevolve::{Change, Drift, Iteration};

/// All of them, in the order in which the terminal has them.
pub fn conclusions(report: &RunReport) -> Vec<String> {
    let topics = [
        doubts(report),
        growth(report),
        drift(report),
        disengagement(report),
        report.diagnosis.iter().filter(|_| report.disengaged).flat_map(cause).collect(),
        at_bound(report),
        best(report),
        gap(report),
        determined(report),
        hidden(report),
        recorded(report),
        misled(report),
    ];
    topics.into_iter().flatten().collect()
}

/// What is bad about the logs of real tests.
pub fn doubts(report: &RunReport) -> Vec<String> {
    report.doubts.iter().map(|doubt| format!("bad: {}", doubt.sentence())).collect()
}

/// How S has grown.
pub fn growth(report: &RunReport) -> Vec<String> {
    let grown = report.augmentations.iter();
    grown.map(|g| format!("S has grown after iteration {}: {}", g.after_iteration, g.parameters.join(", "))).collect()
}

/// Detected changes of the robot.
pub fn drift(report: &RunReport) -> Vec<String> {
    let suspected = report.suspicion.map(|test| {
        format!(
            "nothing explains test {test} together with those before it: the robot has changed, or S lacks something; one \
             more iteration repeats test {} to decide",
            test.saturating_sub(1)
        )
    });
    report.drifts.iter().map(drifted).chain(suspected).collect()
}

fn drifted(drift: &Drift) -> String {
    let change = |c: &Change| {
        format!("{} {} -> {} ({} sd)", c.parameter, number(c.before), number(c.after), number(c.deviations))
    };
    let changed: Vec<String> = drift.changed.iter().map(change).collect();
    let what = match (drift.explained, changed.is_empty()) {
        (true, false) => changed.join(", "),
        (true, true) => "what has changed is not determined yet".to_owned(),
        (false, _) => "S does not contain what has changed".to_owned(),
    };
    format!("the robot changed before test {}: {what}", drift.before_test)
}

/// Why the populations disengaged, if they did: first that they did, then the evidence for it.
pub fn disengagement(report: &RunReport) -> Vec<String> {
    let Some(last) = report.iterations.last().filter(|_| report.disengaged) else { return Vec::new() };
    let e = &last.evidence;
    let that = "disengaged: the space of simulations does not reproduce what the robot does".to_owned();
    if last.posterior.is_some() {
        let chi = maybe(last.phi);
        return vec![that, format!("no simulation in it explains the real tests: {chi} x noise, from every start")];
    }
    vec![
        that,
        format!("phi is {} of its initial value and no longer decreases", maybe(e.phi_share)),
        format!("on fresh transfers, phi is {} of its initial value", maybe(e.predicted_share)),
        format!("rank agreement of controllers, promised against real: {}", maybe(e.rank_agreement)),
        format!("pressure of controllers on simulations: {}", maybe(e.pressure_on_simulations)),
        format!("pressure of simulations on controllers: {}", maybe(e.pressure_on_controllers)),
    ]
}

/// The cause of a disengagement: first the missing effects, then their parameters, and effects that the tests cannot
/// tell apart.
pub fn cause(cause: &Cause) -> Vec<String> {
    let mut said = vec![cause.sentence()];
    for found in &cause.effects {
        said.extend(found.parameters.iter().map(|parameter| {
            let interval = parameter.ci95.map_or_else(String::new, |_| format!(" (95 %: {})", span(parameter.ci95)));
            format!("{} = {} {}{interval}", parameter.name, number(parameter.value), parameter.unit)
        }));
        if !found.alike.is_empty() {
            said.push(format!("these tests cannot tell it from {}", found.alike.join(", ")));
        }
    }
    said
}

/// Parameters that ended at a bound of S. A disengagement that a posterior shows has no word of them.
pub fn at_bound(report: &RunReport) -> Vec<String> {
    let Some(last) = report.iterations.last() else { return Vec::new() };
    let names = &last.evidence.at_bound;
    if names.is_empty() || (report.disengaged && last.posterior.is_some()) {
        return Vec::new();
    }
    vec![format!("at a bound of S (the true value may lie beyond it): {}", names.join(", "))]
}

/// The best controller in reality.
pub fn best(report: &RunReport) -> Vec<String> {
    let best = report.recommended.iter().filter(|_| !report.fitness.is_empty());
    best.map(|best| format!("best in reality: fitness {}, in transfers/{:04}", number(best.fitness_real), best.test))
        .collect()
}

/// The reality gap: real fitness against promised fitness, and how many promises held.
pub fn gap(report: &RunReport) -> Vec<String> {
    let known = report.reality_gap.iter().filter(|gap| gap.within[1] > 0);
    let said = known.map(|gap| {
        let interval = gap.ci95.map_or_else(String::new, |_| format!(" (95 %: {})", span(gap.ci95)));
        let (mean, tests, [held, of]) = (number(gap.mean), tests(gap.tests), gap.within);
        format!(
            "reality gap: {mean}{interval} from promised to real fitness, over {tests}; {held} of {of} within their interval"
        )
    });
    said.collect()
}

/// Which parameters of S the tests determine.
pub fn determined(report: &RunReport) -> Vec<String> {
    let Some(estimate) = report.iterations.last().and_then(|last| last.posterior.as_ref()) else { return Vec::new() };
    let mut said = Vec::new();
    if estimate.parameters.values().all(|belief| belief.ci95.is_none()) {
        said.push("the estimates do not explain the tests: do not use them".to_owned());
    }
    said.push(match estimate.not_told.is_empty() {
        true => format!("determined: all {} parameters, by {}", estimate.parameters.len(), tests(told_by(report))),
        false => format!("not determined by these tests: {}", estimate.not_told.join(", ")),
    });
    said.extend(estimate.open_directions.iter().map(|open| {
        let parts = open.parameters.iter().map(|(name, share)| format!("{share:+.2} {name}"));
        format!("hardly determined: {}", parts.collect::<Vec<_>>().join(" "))
    }));
    said
}

/// Number of real tests after which all parameters have been identified.
fn told_by(report: &RunReport) -> usize {
    let told = |it: &&Iteration| it.posterior.as_ref().is_some_and(|estimate| estimate.not_told.is_empty());
    report.iterations.iter().rev().take_while(told).last().map_or(0, |it| it.real_tests)
}

/// The hidden twin beside the simulation found, without the table of its parameters.
pub fn hidden(report: &RunReport) -> Vec<String> {
    let searched = report.iterations.iter().any(|it| it.phi.is_some());
    let Some(revealed) = report.revealed.as_ref().filter(|_| searched) else { return Vec::new() };
    let effects = &revealed.truth.effects;
    let of_effects = (!effects.is_empty()).then(|| format!("hidden effects: {}", effects.join(", ")));
    let state: Vec<String> = revealed.state_match.iter().map(|(unit, x)| format!("{} {unit}", number(*x))).collect();
    let of_state = format!("state match (rms of simulated − real, best controller): {}", state.join(", "));
    of_effects.into_iter().chain([of_state]).collect()
}

/// How well the models before and after reproduce recorded logs.
pub fn recorded(report: &RunReport) -> Vec<String> {
    [(false, "learnt"), (true, "held out")]
        .into_iter()
        .flat_map(|(held_out, of)| errors(report, held_out, of))
        .collect()
}

fn errors(report: &RunReport, held_out: bool, of: &str) -> Vec<String> {
    let scores: Vec<&LogScore> =
        report.logs.iter().filter(|s| s.held_out == held_out && s.after.mean_abs.is_finite()).collect();
    let mean = |of: &dyn Fn(&&LogScore) -> f64| scores.iter().map(of).sum::<f64>() / scores.len() as f64;
    let (before, after) = (mean(&|s| s.before.mean_abs), mean(&|s| s.after.mean_abs));
    let mut said = vec![format!("{of}: mean |error| {} before, {} after", number(before), number(after))];
    if after > before {
        said.push("the adapted model is worse than the initial one: do not use it".to_owned());
    }
    if scores.is_empty() { Vec::new() } else { said }
}

/// Distances that prefer a wrong simulation.
pub fn misled(report: &RunReport) -> Vec<String> {
    let fooled = |by: &&ByDistance| by.phi_of_truth.is_some_and(|truth| truth > by.telling);
    let said = |by: &ByDistance| {
        let name = &by.distance;
        format!("{name} prefers its own estimate to the truth: do not rely on its estimate from this recording")
    };
    report.by_distance.iter().filter(fooled).map(said).collect()
}

/// A number of real tests in words.
pub fn tests(count: usize) -> String {
    if count == 1 { "1 real test".to_owned() } else { format!("{count} real tests") }
}
