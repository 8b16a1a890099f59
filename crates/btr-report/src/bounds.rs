//! What to do about free parameters that a diagnosis leaves at their bounds, or that share their size with a finding.

use btr_lab::verbs::{AddsTo, DiagnoseReport};

/// What to do about parameters at bounds that may keep them from a better value: not those of effects that ended at
/// nothing. And about free parameters that a finding adds to.
pub fn about_bounds(report: &DiagnoseReport) -> Vec<String> {
    let is_of = |name: &str, idle: &str| {
        let (effect, site) = idle.split_once('@').unwrap_or((idle, "*"));
        name.starts_with(&format!("{effect}.")) && name.ends_with(&format!("@{site}"))
    };
    let names = report.at_bound.iter().map(String::as_str);
    let names = names.filter(|name| !report.without_effect.iter().any(|idle| is_of(name, idle)));
    let (limits, bounds): (Vec<&str>, Vec<&str>) =
        names.partition(|name| report.at_limit.iter().any(|limit| limit == name));
    let told = |what: &str, names: &[&str], advice: &str| {
        (!names.is_empty()).then(|| format!("{what}: {}; {advice}", names.join(", ")))
    };
    let widen = "what is named may not be all; freeze them if you know them, or widen the bounds";
    let no_further = "they cannot go further, so they may make up for something else: freeze them at what you know";
    let told = [told("at their bounds", &bounds, widen), told("at their limits", &limits, no_further)];
    told.into_iter().flatten().chain(report.adds_to.iter().map(shared)).collect()
}

/// What to do about a finding that adds to a free parameter.
fn shared(AddsTo { found, free }: &AddsTo) -> String {
    format!(
        "{found} adds to {free}, which is free: logs hardly tell the two apart, so the size of either may depend on the bounds; \
         freeze {free} if you know it, or widen its bounds and diagnose again"
    )
}
